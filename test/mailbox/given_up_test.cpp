// Messages that must arrive although no request waits for an answer: messages without a reply after a message that the
// slave has not read yet, and messages that end operations early.
#include "mailbox/mailbox_bus.hpp"
#include "sim/library/library.hpp"

#include <margay/run.hpp>
#include <margay/soe.hpp>
#include <margay/voe.hpp>

namespace margay {
namespace {

// The slave has `before` messages to answer, and its mailbox is full. The frame with the next message is lost.
TEST(LostMessages, BehindAMessageThatIsNotReadYetAreRepeated) {
    for (unsigned before = 0; before < 12; ++before) {
        SCOPED_TRACE(before);
        MailboxBus bus;
        bus.add_device(sim::make_device("voe_device").value());
        bus.start();
        bus.idle(100ms);
        std::vector<std::byte> memory(8192);
        VoeInbox inbox(memory);
        inbox.only_slave = 1;
        inbox.look_every = 1ms;
        const VoeHeader protocol{sim::kVendorId, 1};
        for (unsigned n = 0; n < before; ++n)
            ASSERT_TRUE(VOEsend(*bus.ctx, 1, protocol, std::array{static_cast<std::byte>(n)}).ok());
        bus.segment.lose_next({0, 0});
        VoeSend last;
        const std::array message{std::byte{0xEE}};
        last.slave = 1;
        last.header = protocol;
        last.data = message;
        ASSERT_TRUE(submit(*bus.ctx, last).ok());
        bus.idle(5ms);
        ASSERT_TRUE(listen(*bus.ctx, inbox).ok());
        bus.idle(1s);
        EXPECT_EQ(last.state(), RequestState::success) << bus.words(last.error());
        std::vector<std::byte> echoes;
        std::array<std::byte, 8> echo{};
        while (inbox.take(echo)) echoes.push_back(echo[0]);
        ASSERT_FALSE(echoes.empty());  // the first messages arrived before the listener was added
        EXPECT_EQ(echoes.back(), std::byte{0xEE});
    }
}

// Two axes of one drive are homing when both commands are cancelled at the same time, with and without lost frames.
TEST(GivenUpCommands, AreClearedForEachAxis) {
    for (const bool loses : {false, true}) {
        SCOPED_TRACE(loses);
        MailboxBus bus;
        bus.add_device(sim::make_device("soe_drive").value());
        bus.start();
        Context& ctx = *bus.ctx;
        std::vector<std::byte> image(512);
        ASSERT_TRUE(config_map(ctx, image).ok());
        ASSERT_TRUE(reach(ctx, AlState::op, 10s).ok());
        const SlaveImage& data = ctx.slave(1).image;
        const auto cycles = [&](Duration how_long) {
            const Time end = bus.osal.now() + how_long;
            (void)run_cycle(ctx, {}, [&](const CycleInfo&) {
                for (std::size_t axis = 0; axis < 2; ++axis) {  // switched on, with the present position as target
                    data.outputs.bytes[axis * 6 + 1] = std::byte{0xE0};
                    std::copy_n(data.inputs.bytes.begin() + static_cast<std::ptrdiff_t>(axis * 10 + 2), 4,
                                data.outputs.bytes.begin() + static_cast<std::ptrdiff_t>(axis * 6 + 2));
                }
                return bus.osal.now() < end;
            });
        };
        cycles(20ms);
        std::array<SoeCommand, 2> homing;
        for (std::uint8_t axis = 0; axis < 2; ++axis) {
            homing[axis].slave = 1;
            homing[axis].drive = axis;
            homing[axis].idn = Idn::standard(148);
            ASSERT_TRUE(submit(ctx, homing[axis]).ok());
        }
        cycles(50ms);
        ASSERT_TRUE(homing[0].busy() && homing[1].busy());
        if (loses) bus.segment.set_noise({.lost = 1.0});
        for (SoeCommand& one : homing) one.cancel();
        if (loses) cycles(2ms);
        bus.segment.set_noise({});
        cycles(200ms);
        for (std::uint8_t axis = 0; axis < 2; ++axis) {
            std::array<std::byte, 2> state{};
            ASSERT_TRUE(SoEread(ctx, 1, axis, Idn::standard(148), soe_element::kDataState, state).ok());
            EXPECT_EQ(state[0] & std::byte{0x07}, std::byte{0}) << "axis " << int{axis};
        }
    }
}

}  // namespace
}  // namespace margay
