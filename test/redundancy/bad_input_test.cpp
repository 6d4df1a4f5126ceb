// Cables and NICs that are connected wrongly or do not work. Each case gives an error or an event with a text.
#include "redundancy/ring_bus.hpp"
#include "wire/datagram.hpp"

namespace margay {
namespace {

using Events = std::vector<std::string>;

TEST(RingBadInput, TheSameNicTwice) {
    RingBus bus;
    bus.build_line(3);
    bus.plug();
    bus.ctx = std::make_unique<HostContext>(RingBus::limits());
    const auto done = init_redundant(*bus.ctx, *bus.nics[0], *bus.nics[0], bus.osal);
    ASSERT_FALSE(done.ok());
    EXPECT_EQ(done.error().code, Errc::invalid_argument);
    EXPECT_NE(bus.words(done.error()).find("the second NIC is the first one"), std::string::npos);
    // The context is as before.
    EXPECT_TRUE(init_redundant(*bus.ctx, *bus.nics[0], *bus.nics[1], bus.osal).ok());
    EXPECT_EQ(init_redundant(*bus.ctx, *bus.nics[0], *bus.nics[1], bus.osal).error().code, Errc::wrong_state);
}

TEST(RingBadInput, WithoutMemoryForTwoNics) {
    RingBus bus;
    bus.build_line(3);
    const auto done = bus.begin({.slaves = 32});
    ASSERT_FALSE(done.ok());
    EXPECT_EQ(done.error().code, Errc::capacity);
    EXPECT_NE(bus.words(done.error()).find("Limits::redundancy is false"), std::string::npos)
        << bus.words(done.error());
    EXPECT_FALSE(bus.status().redundant);
    EXPECT_EQ(bus.begin({.slaves = 0, .redundancy = true}).error().code, Errc::invalid_argument);
}

TEST(RingBadInput, TheSecondNicIsDownAtTheStart) {
    RingBus bus;
    bus.build_line(5);
    bus.plug();
    bus.cable(bus.ring_cables.back(), false);
    bus.start();
    EXPECT_FALSE(bus.ctx->errors().take().has_value());
    ASSERT_TRUE(config_map(*bus.ctx, bus.image).ok());
    ASSERT_TRUE(submit(*bus.ctx, bus.supervision).ok());
    ASSERT_TRUE(bus.until_all_in_op());
    const auto told = bus.events();
    EXPECT_NE(bus.joined(told).find("no redundancy: the second NIC reaches no slave"), std::string::npos)
        << bus.joined(told);
    EXPECT_EQ(bus.status().cables[1].link, LinkState::down);
    EXPECT_EQ(bus.stale_cycles(10), 0U);
    bus.cable(bus.ring_cables.back(), true);
    EXPECT_EQ(bus.stale_cycles(20), 0U);
    EXPECT_EQ(bus.events(), Events{"redundancy restored: the ring is whole again"});
    bus.cable(bus.ring_cables[2], false);
    EXPECT_EQ(bus.stale_cycles(20), 0U);
    EXPECT_EQ(bus.status().cables[1].slaves, 3U);
}

// Each cable in turn is broken from the start. The slaves are found, numbered and brought to OP from both ends.
TEST(RingBadInput, BrokenAtTheStart) {
    for (std::size_t n = 0; n < 15; ++n) {
        SCOPED_TRACE("ring cable " + std::to_string(n));
        RingBus bus;
        bus.build_tree();
        bus.plug();
        bus.cable(bus.ring_cables[n], false);
        bus.start();
        EXPECT_FALSE(bus.ctx->errors().take().has_value());
        for (std::size_t s = 1; s <= 20; ++s) {
            EXPECT_EQ(bus.ctx->slave(s).ring_position, s);
            // The first slave behind the break is connected to the second NIC, all other slaves to their neighbour.
            const bool at_master = s == 1 || (n < 14 && s == bus.ring_cables[n].slave + 1);
            EXPECT_EQ(bus.ctx->slave(s).parent == 0, at_master) << s;
        }
        bus.run();
        EXPECT_EQ(bus.stale_cycles(20), 0U);
        bus.cable(bus.ring_cables[n], true);
        EXPECT_EQ(bus.stale_cycles(20), 0U);
        EXPECT_EQ(bus.status().ring, RingState::whole);
    }
}

// An earlier master has used the same station addresses, the ring is broken, and the replies of one NIC never arrive.
// The slaves of this NIC do not execute commands for the slaves of the other NIC.
TEST(RingBadInput, ADeafNicAtTheStart) {
    for (const unsigned which : {0U, 1U})
        for (const std::uint32_t broken : {1U, 3U, 5U}) {
            SCOPED_TRACE("NIC " + std::to_string(which) + ", cable " + std::to_string(broken));
            RingBus bus;
            bus.build_line(6);
            bus.start();
            bus.cable(bus.ring_cables[broken], false);
            bus.nics[which]->deaf = true;
            ASSERT_TRUE(bus.begin().ok());
            const auto found = config_init(*bus.ctx);
            ASSERT_TRUE(found.ok()) << bus.words(found.error());
            EXPECT_EQ(*found, which == 0 ? 6 - broken : broken);
            ASSERT_NO_FATAL_FAILURE(bus.run());
            (void)bus.stale_cycles(100);
            const auto expect_untouched = [&] {
                for (std::uint32_t n = 0; n < 6; ++n) {
                    if ((n < broken) != (which == 0)) continue;
                    EXPECT_EQ(bus.segment.slave(n).registers().get<std::uint16_t>(0x0130), 1U) << n;
                    for (const std::byte octet : bus.io(n + 1)->outputs()) EXPECT_EQ(octet, std::byte{0}) << n;
                }
            };
            expect_untouched();
            bus.nics[which]->deaf = false;
            (void)bus.stale_cycles(1000);
            expect_untouched();
            EXPECT_TRUE(bus.all_in_op()) << bus.joined(bus.events());
        }
}

TEST(RingBadInput, ABreakFromTheStartIsNamed) {
    for (const std::size_t n : {0U, 1U, 2U, 4U}) {
        RingBus bus;
        bus.build_line(5);
        bus.plug();
        bus.cable(bus.ring_cables[n], false);
        bus.start();
        ASSERT_TRUE(config_map(*bus.ctx, bus.image).ok());
        ASSERT_TRUE(submit(*bus.ctx, bus.supervision).ok());
        ASSERT_TRUE(bus.until_all_in_op());
        const std::string before = n == 0 ? "the first NIC" : "slave " + std::to_string(n) + " port 1";
        const auto told = bus.joined(bus.events());
        EXPECT_NE(told.find("redundancy broken between " + before + " and slave " + std::to_string(n + 1) + "\n"),
                  std::string::npos)
            << told;
    }
}

TEST(RingBadInput, NothingIsConnected) {
    RingBus bus;
    bus.build_line(3);
    bus.plug();
    bus.cable(bus.ring_cables.front(), false);
    bus.cable(bus.ring_cables.back(), false);
    ASSERT_TRUE(bus.begin().ok());
    const auto found = config_init(*bus.ctx);
    ASSERT_FALSE(found.ok());
    EXPECT_EQ(found.error().code, Errc::link_down);
}

// The second NIC is connected to the first slave of another segment.
TEST(RingBadInput, AnotherSegmentBehindTheSecondNic) {
    RingBus bus;
    (void)bus.add_to_ring();
    (void)bus.add_to_ring();
    const auto other = bus.add(RingBus::io_device());
    ASSERT_TRUE(bus.segment.connect_master({other, 0}, 1));
    ASSERT_TRUE(bus.begin().ok());
    const auto found = config_init(*bus.ctx);
    ASSERT_FALSE(found.ok());
    EXPECT_EQ(found.error().code, Errc::cabling);
    EXPECT_EQ(found.error().detail, static_cast<std::uint32_t>(CablingFault::second_segment));
    EXPECT_NE(bus.words(found.error()).find("another segment"), std::string::npos) << bus.words(found.error());
    EXPECT_EQ(bus.status().fault, CablingFault::second_segment);
}

// Records the commands of the frames that it sends.
class CommandSpy final : public ForwardingNic {
  public:
    explicit CommandSpy(Nic& nic) : ForwardingNic(nic) {}
    unsigned frames = 0;
    unsigned commands = 0;  // other than NOP

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        ++frames;
        wire::DatagramReader reader(frame);
        while (const auto d = reader.next()) commands += d->header.command == wire::Command::NOP ? 0 : 1;
        return nic_.send(frame);
    }
};

// The cable of the second NIC is plugged into another segment during operation. The slaves of that segment do not get
// any further commands, and the own slaves continue. When the cable is right again, the redundancy is back.
TEST(RingBadInput, TheSecondNicKeepsSilentAtAnotherSegment) {
    RingBus bus;
    bus.build_line(4);
    const auto foreign = bus.add(RingBus::io_device());
    bus.plug();
    CommandSpy spy(*bus.nics[1]);
    bus.ctx = std::make_unique<HostContext>(RingBus::limits());
    ASSERT_TRUE(init_redundant(*bus.ctx, *bus.nics[0], spy, bus.osal).ok());
    const auto found = config_init(*bus.ctx);
    ASSERT_TRUE(found.ok()) << bus.words(found.error());
    ASSERT_EQ(*found, 4U);
    bus.run();
    bus.segment.disconnect({3, 1});
    ASSERT_TRUE(bus.segment.connect_master({foreign, 0}, 1));
    EXPECT_LE(bus.stale_cycles(50), 1U);
    EXPECT_EQ(bus.status().fault, CablingFault::second_segment);
    EXPECT_NE(bus.joined(bus.events()).find("another segment"), std::string::npos);
    spy.frames = spy.commands = 0;
    EXPECT_EQ(bus.stale_cycles(640), 0U);
    EXPECT_TRUE(bus.all_in_op());
    EXPECT_EQ(spy.commands, 0U) << "nothing that a slave would execute";
    EXPECT_GE(spy.frames, 5U) << "it is still looked whether the cable is right again";
    EXPECT_LE(spy.frames, 640U / 10U);
    // The cable is back at the end of the ring, which has been broken meanwhile.
    bus.segment.disconnect({foreign, 0});
    bus.cable(bus.ring_cables[2], false);
    ASSERT_TRUE(bus.segment.connect_master({3, 1}, 1));
    (void)bus.stale_cycles(200);
    EXPECT_EQ(bus.status().fault, CablingFault::none);
    ASSERT_TRUE(bus.until_all_in_op()) << bus.joined(bus.events());
    EXPECT_EQ(bus.stale_cycles(50), 0U);
    bus.cable(bus.ring_cables[2], true);
    EXPECT_LE(bus.stale_cycles(50), 1U);
    EXPECT_EQ(bus.status().ring, RingState::whole);
    EXPECT_NE(bus.joined(bus.events()).find("redundancy restored"), std::string::npos);
    // The cable is moved directly from the other segment to the whole ring.
    bus.segment.disconnect({3, 1});
    ASSERT_TRUE(bus.segment.connect_master({foreign, 0}, 1));
    (void)bus.stale_cycles(50);
    EXPECT_EQ(bus.status().fault, CablingFault::second_segment);
    (void)bus.events();
    bus.segment.disconnect({foreign, 0});
    ASSERT_TRUE(bus.segment.connect_master({3, 1}, 1));
    EXPECT_LE(bus.stale_cycles(50), 1U);
    EXPECT_EQ(bus.status().fault, CablingFault::none);
    EXPECT_EQ(bus.status().ring, RingState::whole);
    EXPECT_NE(bus.joined(bus.events()).find("redundancy restored"), std::string::npos);
}

// Two NICs that receive the same frames, like two sockets of one interface.
class SharedWire final : public Nic {
  public:
    explicit SharedWire(Nic& wire) : wire_(wire) {}
    SharedWire* other = nullptr;
    SendStatus send(std::span<const std::byte> frame) noexcept override { return wire_.send(frame); }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        if (!frames_.empty()) {
            const auto frame = frames_.front();
            frames_.erase(frames_.begin());
            std::ranges::copy(frame, into.begin());
            return frame.size();
        }
        const std::size_t length = wire_.receive(into);
        if (length != 0) other->frames_.emplace_back(into.begin(), into.begin() + static_cast<std::ptrdiff_t>(length));
        return length;
    }
    MacAddress source_mac() const noexcept override { return wire_.source_mac(); }
    Time next_arrival() const noexcept override { return frames_.empty() ? wire_.next_arrival() : Time::min(); }

  private:
    Nic& wire_;
    std::vector<std::vector<std::byte>> frames_;
};

TEST(RingBadInput, BothNicsOnTheSamePort) {
    RingBus bus;
    (void)bus.add_to_ring();
    (void)bus.add_to_ring();
    bus.plug();
    SharedWire one(*bus.wires[0]);
    SharedWire two(*bus.wires[0]);
    one.other = &two;
    two.other = &one;
    bus.ctx = std::make_unique<HostContext>(RingBus::limits());
    ASSERT_TRUE(init_redundant(*bus.ctx, one, two, bus.osal).ok());
    const auto found = config_init(*bus.ctx);
    ASSERT_FALSE(found.ok());
    EXPECT_EQ(found.error().code, Errc::cabling);
    EXPECT_EQ(found.error().detail, static_cast<std::uint32_t>(CablingFault::same_port));
    EXPECT_NE(bus.words(found.error()).find("same frames"), std::string::npos) << bus.words(found.error());
}

// The first NIC is connected to the end of the ring. Everything works, and the numbers begin at the first slave.
TEST(RingBadInput, SwappedCables) {
    RingBus bus;
    bus.build_line(6);
    bus.plug();
    std::swap(bus.nics[0], bus.nics[1]);
    bus.start();
    EXPECT_TRUE(bus.status().swapped);
    bus.run();
    EXPECT_EQ(bus.ctx->slave(6).parent, 5U);
    EXPECT_EQ(bus.ctx->slave(1).ring, RingEnd::second_nic);
    EXPECT_EQ(bus.stale_cycles(10), 0U);
    // The events name the NIC whose cable is broken.
    const std::size_t last = bus.ring_cables.size() - 1;
    (void)bus.events();
    for (std::size_t n = 0; n <= last; ++n) {
        bus.cable(bus.ring_cables[n], false);
        EXPECT_EQ(bus.stale_cycles(40), 0U) << n;
        const auto texts = bus.joined(bus.events());
        const auto* const place = n == 0      ? "between the second NIC and slave 1"
                                  : n == last ? "between slave 6 port 1 and the first NIC"
                                              : "between slave ";
        EXPECT_NE(texts.find(place), std::string::npos) << texts;
        bus.cable(bus.ring_cables[n], true);
        EXPECT_EQ(bus.stale_cycles(20), 0U) << n;
    }
    // Broken from the start as well.
    RingBus broken;
    broken.build_line(6);
    broken.plug();
    std::swap(broken.nics[0], broken.nics[1]);
    broken.cable(broken.ring_cables[2], false);
    broken.start();
    EXPECT_TRUE(broken.status().swapped);
    for (std::size_t s = 1; s <= 6; ++s) EXPECT_EQ(broken.ctx->slave(s).ring_position, s);
    ASSERT_TRUE(config_map(*broken.ctx, broken.image).ok());
    ASSERT_TRUE(submit(*broken.ctx, broken.supervision).ok());
    ASSERT_TRUE(broken.until_all_in_op());
    EXPECT_NE(broken.joined(broken.events()).find("the cables of the NICs are swapped"), std::string::npos);
}

}  // namespace
}  // namespace margay
