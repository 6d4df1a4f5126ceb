// A master with a cycle on a simulated segment, and a mailbox gateway. The thread of the owner never waits for a
// client. The outputs come back as inputs, and each cycle is checked.
#pragma once

#include "gateway/gateway_client.hpp"
#include "segment/clients_bench.hpp"
#include "util/bytes.hpp"

#include <margay/gateway/mailbox_gateway.hpp>

#include <memory>

namespace margay {

using namespace std::chrono_literals;
using namespace testing_gateway;

class GatewayTest : public ClientsTest {
  protected:
    static constexpr std::uint16_t kOdd = 0x1001;    // 64 KiB of objects; outputs come back as inputs
    static constexpr std::uint16_t kPlain = 0x1002;  // no mailbox
    static constexpr std::uint16_t kDrive = 0x1003;  // CiA 402
    static constexpr std::uint16_t kVoice = 0x1004;  // VoE
    static constexpr std::uint16_t kAxes = 0x1005;   // SoE
    static constexpr std::uint16_t kPort = 0x1006;   // EoE
    static constexpr std::size_t kRoom = 128 - 6;    // mailbox data of a message to kOdd

    std::array<std::byte, 4096> image{};
    std::unique_ptr<MailboxGateway> gateway;

    void SetUp() override {
        plug_line({"odd_device", "digital_in_8", "drive", "voe_device", "soe_drive", "eoe_gateway"});
        switch_on();
        ASSERT_TRUE(bring_up());
        ASSERT_TRUE(config_map(ctx, image));
        const auto up = reach(ctx, AlState::op, 5s);
        ASSERT_TRUE(up) << words(up.error());
        serve({});
    }
    void TearDown() override { gateway.reset(); }
    void serve(MailboxGatewaySettings settings) {
        gateway.reset();
        settings.port = 0;
        // The gateway uses real time. A long timeout, because the machine may be loaded.
        if (settings.reply_timeout == MailboxGatewaySettings{}.reply_timeout) settings.reply_timeout = 1min;
        gateway = std::make_unique<MailboxGateway>(ctx, std::move(settings));
        ASSERT_EQ(gateway->error(), "");
    }

    // The first word of the outputs is a counter. The inputs must be the outputs of one of the last cycles.
    bool cycle() override {
        const Slave& odd = ctx.slave(1);
        ++counter_;
        store_le(odd.image.outputs.bytes.span(), 0, counter_);
        const bool right = ClientsTest::cycle();
        const auto age = static_cast<std::uint16_t>(counter_ - load_le<std::uint16_t>(odd.image.inputs.bytes.span()));
        return right && (age <= 4 || counter_ < 10);
    }

  private:
    std::uint16_t counter_ = 0;
};

}  // namespace margay
