// A master on a segment of stack slaves and scripted slaves, in virtual time. The test chooses the frames that the
// line loses.
#pragma once

#include "mailbox/scripted_slave.hpp"
#include "mailbox/stack_slave.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <string>
#include <vector>

namespace margay {

using namespace std::chrono_literals;

// Counts frames from 0. Loses chosen frames on the way out or on the way back, or sends them twice.
class LossyNic final : public Nic {
  public:
    explicit LossyNic(Nic& nic) : nic_(nic) {}
    std::set<std::uint64_t> lose_out;
    std::set<std::uint64_t> lose_in;
    std::set<std::uint64_t> twice;
    std::uint16_t lose_mail_from = 0;  // lose all frames that return mail of this slave, the first slave is 1; 0: none
    std::uint64_t sent = 0;
    std::uint64_t came = 0;
    bool keeps_mail = false;
    std::vector<Mail> mail;  // if keeps_mail: the messages in both directions, truncated to their lengths

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (lose_out.count(sent++) != 0) {
            ++came;  // the reply will not come
            return SendStatus::sent;
        }
        if (twice.count(sent - 1) != 0) (void)nic_.send(frame);
        return nic_.send(frame);
    }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        for (;;) {
            const std::size_t length = nic_.receive(into);
            if (length == 0) return length;
            const bool lost = lose_in.count(came++) != 0;
            if (keeps_mail) keep_mail(into.first(length));
            if (!lost && !brings_mail(into.first(length))) return length;
        }
    }
    LinkState link_state() noexcept override { return nic_.link_state(); }
    MacAddress source_mac() const noexcept override { return nic_.source_mac(); }
    Time next_arrival() const noexcept override { return nic_.next_arrival(); }

  private:
    void keep_mail(Bytes frame) {
        wire::DatagramReader reader(frame);
        while (const auto datagram = reader.next()) {
            const auto command = datagram->header.command;
            const bool of_mailbox = datagram->header.address.ado() >= 0x1000 && datagram->data.size() > 16;
            if (datagram->wkc != 1 || !of_mailbox) continue;
            if (command != wire::Command::FPRD && command != wire::Command::FPWR) continue;
            if (const auto message = wire::load_mailbox_message(datagram->data))
                mail.emplace_back(datagram->data.begin(),
                                  datagram->data.begin() +
                                      static_cast<std::ptrdiff_t>(wire::kMailboxHeaderBytes + message->data.size()));
        }
    }
    // Returns whether the frame has an FPRD of a whole mailbox that the slave has filled.
    [[nodiscard]] bool brings_mail(Bytes frame) const {
        if (lose_mail_from == 0) return false;
        wire::DatagramReader reader(frame);
        while (const auto datagram = reader.next())
            if (datagram->header.command == wire::Command::FPRD && datagram->wkc == 1 && datagram->data.size() > 16 &&
                datagram->header.address.adp() == 0x1000 + lose_mail_from)
                return true;
        return false;
    }

    Nic& nic_;
};

class MailboxBus {
  public:
    VirtualOsal osal;
    sim::Segment segment;
    std::unique_ptr<SimulatedNic> cable;
    std::unique_ptr<LossyNic> nic;
    std::unique_ptr<HostContext> ctx;

    StackSlave& add_stack(std::uint16_t mailbox_bytes = 128, bool complete_access = true) {
        auto firmware = std::make_unique<StackSlave>(mailbox_bytes, complete_access);
        return add(std::move(firmware));
    }
    ScriptedSlave& add_scripted(std::uint16_t mailbox_bytes = 64, std::uint16_t protocols = 0x3F,
                                std::uint8_t coe_details = 0x3F) {
        return add(std::make_unique<ScriptedSlave>(mailbox_bytes, protocols, coe_details));
    }

    // Appends a device of the library.
    void add_device(sim::Device device) {
        const auto n = segment.add(std::move(device).assemble());
        EXPECT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}));
    }

    void start(Limits limits = {}) {
        segment.power_up(osal.now());
        cable = std::make_unique<SimulatedNic>(segment, osal);
        nic = std::make_unique<LossyNic>(*cable);
        limits.slaves =
            static_cast<std::uint16_t>(std::max<std::size_t>(segment.size(), limits.slaves == 64 ? 1 : limits.slaves));
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *nic, osal));
        const auto found = config_init(*ctx);
        ASSERT_TRUE(found.ok()) << words(found.error());
        ASSERT_EQ(*found, segment.size());
        for (const Slave& slave : ctx->slaves()) {
            ASSERT_EQ(slave.error.code, Errc::none) << words(slave.error);
            ASSERT_EQ(slave.al.state, AlState::preop) << slave.number;
        }
    }

    // Polls until the request ends or `most` has passed.
    void run(const Request& request, Duration most = 60s) {
        const Time end = osal.now() + most;
        while (request.busy() && osal.now() < end) step();
        EXPECT_FALSE(request.busy()) << "still busy";
    }
    void step() {
        const Time next = poll(*ctx, osal.now());
        osal.wait(std::min(next, osal.now() + 1ms), -1);
        segment.advance(osal.now());
    }
    void idle(Duration time) {
        const Time end = osal.now() + time;
        while (osal.now() < end) step();
    }

    static std::string words(const Error& error) {
        std::array<char, 400> text{};
        return std::string(describe(error, text));
    }

    template <class F>
    F& add(std::unique_ptr<F> firmware) {
        F& it = *firmware;
        auto esc = std::make_unique<sim::Esc>(F::chip(), it.sii());
        esc->set_firmware(std::move(firmware));
        const auto n = segment.add(std::move(esc));
        EXPECT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}));
        return it;
    }
};

[[nodiscard]] inline std::string text_of(Bytes bytes) {
    std::string text(bytes.size(), '\0');
    std::memcpy(text.data(), bytes.data(), bytes.size());
    return text;
}

// Octets whose values depend on their offsets.
[[nodiscard]] inline std::vector<std::byte> pattern(std::size_t bytes) {
    std::vector<std::byte> out(bytes);
    for (std::size_t i = 0; i < bytes; ++i) out[i] = static_cast<std::byte>((i * 7 + i / 251 + 1) & 0xFF);
    return out;
}

}  // namespace margay
