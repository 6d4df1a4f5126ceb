// The cycle in a ring with two NICs: whole, broken anywhere, and closed again.
#include "redundancy/ring_bus.hpp"

#include <margay/clocks.hpp>

namespace margay {
namespace {

using Events = std::vector<std::string>;

TEST(Ring, WholeIsAsWithoutRedundancy) {
    RingBus bus;
    bus.build_line(5);
    bus.start();
    bus.run();
    const LinkStatistics before = bus.ctx->statistics();
    EXPECT_EQ(bus.stale_cycles(50), 0U);
    EXPECT_EQ(*bus.wkc, bus.ctx->group(0).expected_wkc);
    EXPECT_EQ(*bus.wkc, 5U * 3U);  // LRW: 1 for reading and 2 for writing
    EXPECT_EQ(bus.ctx->statistics().echoes, before.echoes);
    EXPECT_EQ(bus.ctx->statistics().unexpected, before.unexpected);
    const RedundancyStatus status = bus.status();
    EXPECT_TRUE(status.redundant);
    EXPECT_EQ(status.ring, RingState::whole);
    EXPECT_EQ(status.breaks, 0U);
    EXPECT_EQ(status.merged, 0U);
    EXPECT_EQ(status.cables[0].slaves, 5U);
    EXPECT_EQ(status.cables[1].slaves, 0U);
    EXPECT_EQ(status.cables[0].lost + status.cables[1].lost + status.cables[0].late + status.cables[1].late, 0U);
    EXPECT_NEAR(status.cables[0].received, status.cables[1].received, 1.0);
    EXPECT_EQ(bus.events(), Events());
    for (const Slave& slave : bus.ctx->slaves()) {
        EXPECT_EQ(slave.ring, RingEnd::first_nic);
        EXPECT_EQ(slave.parent, slave.number - 1);
    }
}

// The call for the link state of a NIC may wait in the operating system, for example until another program has changed
// an interface. So poll() does not call it while there are cycles.
TEST(Ring, PollDoesNotAskForTheLinkState) {
    RingBus bus;
    bus.build_tree();
    bus.start();
    bus.run();
    const auto reads = [&] { return bus.nics[0]->link_reads + bus.nics[1]->link_reads; };
    const unsigned before = reads();
    (void)bus.stale_cycles(300);
    for (const std::size_t cable : {std::size_t{0}, std::size_t{5}, bus.ring_cables.size() - 1}) {
        bus.cable(bus.ring_cables[cable], false);
        (void)bus.stale_cycles(300);
        bus.cable(bus.ring_cables[cable], true);
        (void)bus.stale_cycles(300);
    }
    bus.segment.set_power(7, false, bus.osal.now());
    (void)bus.stale_cycles(300);
    bus.segment.set_power(7, true, bus.osal.now());
    (void)bus.stale_cycles(1000);
    EXPECT_EQ(reads(), before);
    EXPECT_EQ(bus.status().ring, RingState::whole);
    EXPECT_EQ(reads(), before + 2) << "redundancy() asks both";
}

TEST(Ring, NoCycleIsStaleWhenACableBreaksOrHeals) {
    RingBus bus;
    bus.build_tree();
    bus.start();
    bus.run();
    ASSERT_EQ(bus.events(), Events());
    for (std::size_t n = 0; n < bus.ring_cables.size(); ++n) {
        SCOPED_TRACE("ring cable " + std::to_string(n));
        bus.cable(bus.ring_cables[n], false);
        EXPECT_EQ(bus.stale_cycles(20), 0U);
        EXPECT_EQ(*bus.wkc, bus.ctx->group(0).expected_wkc);
        const auto told = bus.events();
        ASSERT_EQ(told.size(), 1U) << bus.joined(told);
        const Slave& behind = bus.ctx->slave(bus.ring_cables[n].slave + 1);
        if (n == 0)
            EXPECT_EQ(told[0], "redundancy broken between the first NIC and slave 1");
        else if (n + 1 == bus.ring_cables.size())
            EXPECT_EQ(told[0], "redundancy broken between slave 20 port 1 and the second NIC");
        else
            EXPECT_EQ(told[0], "redundancy broken between slave " + std::to_string(behind.parent) +
                                   " port 1 and slave " + std::to_string(behind.number));
        const RedundancyStatus status = bus.status();
        EXPECT_EQ(status.ring, RingState::broken);
        EXPECT_EQ(status.cables[0].slaves + status.cables[1].slaves, 20U);
        for (const Slave& slave : bus.ctx->slaves()) {
            const bool end = slave.ring_position > status.cables[0].slaves;
            EXPECT_EQ(slave.ring, end ? RingEnd::second_nic : RingEnd::first_nic) << slave.number;
        }
        bus.cable(bus.ring_cables[n], true);
        EXPECT_EQ(bus.stale_cycles(20), 0U);
        EXPECT_EQ(bus.events(), Events{"redundancy restored: the ring is whole again"});
        EXPECT_EQ(bus.status().ring, RingState::whole);
        for (const Slave& slave : bus.ctx->slaves()) EXPECT_EQ(slave.ring, RingEnd::first_nic);
    }
    EXPECT_EQ(bus.status().breaks, bus.ring_cables.size());
    EXPECT_EQ(bus.status().heals, bus.ring_cables.size());
}

// A search after the break reads the places of the ring again, and cycles pass meanwhile. The branch at port 2 has
// another place in the broken ring.
TEST(Ring, ABreakIsReportedOnceWhenCyclesOverlap) {
    RingBus bus;
    for (unsigned n = 0; n < 8; ++n)
        if (const std::uint32_t at = bus.add_to_ring(); n == 0 || n == 5) (void)bus.add_behind(at, 2);
    bus.close_ring();
    bus.plug({.round_trip = 1400us});
    bus.start();
    const Group& group = bus.ctx->group(0);
    bus.ctx->group(0).config.cycles_in_flight = 2;
    const auto mapped = config_map(*bus.ctx, bus.image);
    ASSERT_TRUE(mapped.ok()) << bus.words(mapped.error());
    ASSERT_TRUE(submit(*bus.ctx, bus.supervision).ok());
    const auto cycles = [&](unsigned count) {
        for (unsigned n = 0; n < count; ++n) {
            bus.osal.advance(1ms - bus.osal.now().time_since_epoch() % 1ms);
            (void)send_processdata(*bus.ctx);
            if (group.cycles_sent - group.cycle_received >= 2) bus.wkc = receive_processdata(*bus.ctx, 2ms);
            (void)poll(*bus.ctx, bus.osal.now());
            bus.segment.advance(bus.osal.now());
        }
        return bus.events();
    };
    (void)cycles(1000);
    ASSERT_TRUE(bus.all_in_op());
    for (std::size_t n = 1; n < 8; ++n) {
        SCOPED_TRACE("ring cable " + std::to_string(n));
        const std::uint16_t before = bus.ctx->slave(static_cast<std::uint16_t>(n + 1)).parent;
        bus.cable(bus.ring_cables[n], false);
        EXPECT_EQ(cycles(300), Events{"redundancy broken between slave " + std::to_string(before) +
                                      " port 1 and slave " + std::to_string(n + 1)});
        bus.cable(bus.ring_cables[n], true);
        EXPECT_EQ(cycles(1000), Events{"redundancy restored: the ring is whole again"});
    }
}

// The cable breaks between the two copies of the frame, and heals in the same way. At most one cycle is stale.
TEST(Ring, AtMostOneCycleIsStaleWhenItBreaksBetweenTheCopies) {
    RingBus bus;
    bus.build_tree();
    bus.start();
    bus.run();
    for (std::size_t n = 0; n < bus.ring_cables.size(); ++n)
        for (const bool intact : {false, true}) {
            SCOPED_TRACE("ring cable " + std::to_string(n) + (intact ? " heals" : " breaks"));
            const std::uint64_t at = bus.frames + 1;  // before the copy of the second NIC
            bus.on_frame = [&, at](std::uint64_t frame) {
                if (frame == at) bus.cable(bus.ring_cables[n], intact);
            };
            EXPECT_LE(bus.stale_cycles(3), 1U);
            EXPECT_EQ(bus.stale_cycles(10), 0U);
            bus.on_frame = nullptr;
        }
}

// The slaves between two breaks are lost, the slaves at both ends continue, and the lost slaves come back.
TEST(Ring, SlavesBetweenTwoBreaksAreLostAndComeBack) {
    RingBus bus;
    bus.build_line(8);
    bus.start();
    bus.run();
    bus.cable(bus.ring_cables[3], false);  // behind slave 3
    EXPECT_EQ(bus.stale_cycles(5), 0U);
    (void)bus.events();
    bus.cable(bus.ring_cables[5], false);  // behind slave 5
    for (unsigned n = 0; n < 100; ++n) (void)bus.cycle();
    const auto told = bus.joined(bus.events());
    EXPECT_NE(told.find("slave 4: lost"), std::string::npos) << told;
    EXPECT_NE(told.find("slave 5: lost"), std::string::npos) << told;
    EXPECT_EQ(told.find("slave 3: lost"), std::string::npos) << told;
    EXPECT_EQ(told.find("slave 6: lost"), std::string::npos) << told;
    for (const std::size_t n : {1U, 2U, 3U, 6U, 7U, 8U}) EXPECT_EQ(bus.ctx->slave(n).al.state, AlState::op) << n;
    bus.cable(bus.ring_cables[5], true);
    EXPECT_TRUE(bus.until_all_in_op()) << bus.joined(bus.events());
    EXPECT_EQ(bus.stale_cycles(10), 0U);
    bus.cable(bus.ring_cables[3], true);
    EXPECT_EQ(bus.stale_cycles(20), 0U);
    EXPECT_EQ(bus.status().ring, RingState::whole);
}

// A slave behind the break is switched off and on. It has lost its address and is found by its position behind the
// break.
TEST(Ring, ASlaveThatRestartsBehindTheBreakComesBack) {
    RingBus bus;
    bus.build_line(8);
    bus.start();
    bus.run();
    bus.cable(bus.ring_cables[4], false);
    EXPECT_EQ(bus.stale_cycles(5), 0U);
    bus.segment.set_power(6, false, bus.osal.now());  // slave 7: slave 8 remains at the second NIC
    for (unsigned n = 0; n < 50; ++n) (void)bus.cycle();
    EXPECT_EQ(bus.ctx->slave(8).al.state, AlState::op);
    EXPECT_EQ(bus.ctx->slave(4).al.state, AlState::op);
    EXPECT_EQ(bus.ctx->slave(7).al.state, AlState::none);
    bus.segment.set_power(6, true, bus.osal.now());
    ASSERT_TRUE(bus.until_all_in_op()) << bus.joined(bus.events());
    EXPECT_EQ(bus.stale_cycles(10), 0U);
    EXPECT_EQ(bus.ctx->slave(7).ring, RingEnd::second_nic);
    EXPECT_EQ(bus.ctx->slave(7).ring_position, 7U);
    bus.cable(bus.ring_cables[4], true);
    EXPECT_EQ(bus.stale_cycles(10), 0U);
}

TEST(Ring, ABranchThatBreaksIsLostAndComesBack) {
    RingBus bus;
    bus.build_tree();
    bus.start();
    bus.run();
    for (const auto& end : bus.branch_cables) {
        bus.cable(end, false);
        for (unsigned n = 0; n < 60; ++n) (void)bus.cycle();
        EXPECT_EQ(bus.status().ring, RingState::whole);
        EXPECT_EQ(bus.ctx->slave(end.slave + 1).al.state, AlState::none);
        bus.cable(end, true);
        ASSERT_TRUE(bus.until_all_in_op()) << bus.joined(bus.events());
        EXPECT_EQ(bus.stale_cycles(5), 0U);
    }
}

// A branch at port 2 is behind the way to the next ring slave. In a whole ring only the frames of the second NIC reach
// it.
TEST(Ring, BranchesThatOnlyTheSecondNicReaches) {
    RingBus bus;
    bus.build_line(6);
    (void)bus.add_behind(4, 2);  // numbered in the order of the frames of the second NIC
    (void)bus.add_behind(1, 2);
    bus.start();
    EXPECT_EQ(bus.ctx->slave(7).parent, 5U);
    EXPECT_EQ(bus.ctx->slave(8).parent, 2U);
    EXPECT_EQ(bus.ctx->slave(7).parent_port, 2U);
    EXPECT_EQ(bus.ctx->slave(6).parent, 5U);
    EXPECT_FALSE(bus.ctx->errors().take().has_value());
    bus.run();
    EXPECT_EQ(bus.status().cables[0].slaves, 6U);
    EXPECT_EQ(bus.status().cables[1].slaves, 2U);
    EXPECT_EQ(bus.status().fault, CablingFault::none);
    for (std::size_t n = 0; n < bus.ring_cables.size(); ++n) {
        SCOPED_TRACE("ring cable " + std::to_string(n));
        bus.cable(bus.ring_cables[n], false);
        EXPECT_LE(bus.stale_cycles(20), 1U);
        EXPECT_EQ(bus.stale_cycles(5), 0U);
        bus.cable(bus.ring_cables[n], true);
        EXPECT_LE(bus.stale_cycles(20), 1U);
        EXPECT_EQ(bus.stale_cycles(5), 0U);
    }
}

// A slave whose port 0 has no link marks the frames as circulating, and the next such slave destroys them (ETG.1000.4).
// In a whole ring a branch that is connected by another port works. Behind a break its slaves and the first slave
// behind the break are two such slaves: no frame comes back from that part, whatever the master does, until the ring is
// whole.
TEST(Ring, ABranchByAnotherPortThanZero) {
    RingBus bus;
    for (unsigned n = 0; n < 3; ++n) (void)bus.add_to_ring();
    const auto branch = bus.add(RingBus::io_device());
    ASSERT_TRUE(bus.segment.connect({2, 3}, {branch, 1}));
    (void)bus.add_to_ring();
    bus.close_ring();
    bus.start();
    EXPECT_EQ(bus.ctx->slave(4).parent, 3U);
    EXPECT_EQ(bus.ctx->slave(4).parent_port, 3U);
    EXPECT_EQ(bus.ctx->slave(4).entry_port, 1U);
    bus.run();
    for (const std::size_t behind : {4U, 3U}) {  // the branch is in the part of the first NIC
        bus.cable(bus.ring_cables[behind], false);
        EXPECT_LE(bus.stale_cycles(20), 1U);
        bus.cable(bus.ring_cables[behind], true);
        EXPECT_LE(bus.stale_cycles(20), 1U);
    }
    for (const std::size_t before : {2U, 1U}) {
        SCOPED_TRACE("ring cable " + std::to_string(before));
        (void)bus.events();
        bus.cable(bus.ring_cables[before], false);
        for (unsigned n = 0; n < 200; ++n) (void)bus.cycle();
        EXPECT_FALSE(bus.wkc.ok()) << "a success without the slaves behind the break";
        for (std::uint16_t n = 1; n <= 5; ++n)
            EXPECT_EQ(bus.ctx->slave(n).al.state, n <= before ? AlState::op : AlState::none) << n;
        EXPECT_NE(bus.joined(bus.events()).find("slave 5"), std::string::npos);
        bus.cable(bus.ring_cables[before], true);
        ASSERT_TRUE(bus.until_all_in_op()) << bus.joined(bus.events());
        EXPECT_EQ(bus.stale_cycles(20), 0U);
    }
}

TEST(Ring, EitherNicMayBeUnplugged) {
    RingBus bus;
    bus.build_line(6);
    bus.start();
    bus.run();
    for (const unsigned which : {0U, 1U, 0U, 1U}) {
        const auto end = which == 0 ? bus.ring_cables.front() : bus.ring_cables.back();
        bus.cable(end, false);
        EXPECT_EQ(bus.stale_cycles(20), 0U) << which;
        EXPECT_EQ(bus.status().cables[which].link, LinkState::down);
        EXPECT_EQ(bus.status().cables[which].slaves, 0U);
        EXPECT_EQ(bus.status().cables[1 - which].slaves, 6U);
        EXPECT_GT(bus.status().cables[which].refused, 0U);
        bus.cable(end, true);
        EXPECT_EQ(bus.stale_cycles(20), 0U) << which;
        EXPECT_EQ(bus.status().cables[which].link, LinkState::up);
    }
    const auto told = bus.events();
    EXPECT_EQ(told.size(), 8U) << bus.joined(told);
}

// A NIC accepts frames without a link, and does not report the lost link. The cycle waits for its copies until two of
// them are lost. The copies of the other NIC have passed all slaves.
TEST(Ring, ANicThatDoesNotTellThatItIsUnplugged) {
    RingBus bus;
    bus.build_line(6);
    bus.start();
    bus.run();
    for (const unsigned which : {0U, 1U, 0U, 1U}) {
        const auto end = which == 0 ? bus.ring_cables.front() : bus.ring_cables.back();
        bus.nics[which]->tells_link = false;
        bus.cable(end, false);
        EXPECT_EQ(bus.stale_cycles(40), 0U) << which;
        EXPECT_EQ(bus.status().cables[which].link, LinkState::unknown);
        EXPECT_LE(bus.status().cables[which].lost, 6U);
        bus.cable(end, true);
        EXPECT_EQ(bus.stale_cycles(20), 0U) << which;
        bus.nics[which]->tells_link = true;
    }
}

// The same with queued datagrams in the frames of the cycle, with held inputs, and with the time of a clock.
TEST(Ring, ANicWithoutALinkBesideRequests) {
    for (const bool hold : {false, true}) {
        SCOPED_TRACE(hold);
        RingBus bus;
        for (unsigned n = 0; n < 5; ++n) (void)bus.add_to_ring();
        auto stack = std::make_unique<StackSlave>(std::uint16_t{128}, true);
        sim::Device device;
        device.chip = StackSlave::chip();
        device.sii = stack->sii();
        device.firmware = std::move(stack);
        (void)bus.add_to_ring(std::move(device));
        bus.close_ring();
        bus.start();
        bus.ctx->group(0).config.hold_inputs = hold;
        bus.run();
        std::vector<std::byte> value(900);
        SdoDownload write;
        write.slave = 6;
        write.index = 0x2008;
        write.data = value;
        for (const unsigned which : {0U, 1U}) {
            const auto end = which == 0 ? bus.ring_cables.front() : bus.ring_cables.back();
            ASSERT_TRUE(submit(*bus.ctx, write).ok());
            EXPECT_EQ(bus.stale_cycles(2), 0U);
            bus.nics[which]->tells_link = false;
            bus.cable(end, false);
            for (unsigned n = 0; n < 1000 && write.busy(); ++n) EXPECT_EQ(bus.cycle(), 0U) << n;
            EXPECT_EQ(write.state(), RequestState::success) << bus.words(write.error());
            EXPECT_EQ(bus.stale_cycles(40), 0U);
            bus.cable(end, true);
            EXPECT_EQ(bus.stale_cycles(40), 0U);
            bus.nics[which]->tells_link = true;
        }
    }
}

// In a broken ring, one part has no process data. When its copy is lost, the AL status of its slaves is missing.
TEST(Ring, TheAlStatusOfOnePartIsNotThatOfAllSlaves) {
    RingBus bus;
    for (unsigned n = 0; n < 3; ++n) (void)bus.add_to_ring();
    for (unsigned n = 0; n < 3; ++n) {
        auto device = sim::device_from_sii(io_image(0, 0));
        device.chip = sim::junction();
        (void)bus.add_to_ring(std::move(device));
    }
    bus.close_ring();
    bus.start();
    bus.ctx->group(0).config.al_status = true;
    bus.run();
    bus.cable(bus.ring_cables[3], false);
    for (unsigned n = 0; n < 100; ++n) (void)bus.cycle();
    const auto& read = bus.ctx->group(0).al_status;
    for (unsigned n = 0; n < 60; ++n) {
        bus.nics[1]->deaf = n % 20 == 0;
        (void)bus.cycle();
        EXPECT_TRUE(!read.came || read.slaves == 6) << n << ": " << read.slaves;
        EXPECT_TRUE(bus.nics[1]->deaf || read.came) << n;
    }
}

// The slaves of one part are missing. In the cycle in which they answer again, the other slaves do not answer. The
// working counter has the accepted value.
TEST(Ring, BothPartsHaveTheSameWorkingCounter) {
    RingBus bus;
    bus.build_line(6);
    bus.start();
    bus.run();
    bus.cable(bus.ring_cables[3], false);
    (void)bus.stale_cycles(20);
    bus.nics[1]->deaf = true;
    (void)bus.stale_cycles(300);
    ASSERT_EQ(bus.ctx->slave(4).al.state, AlState::none);
    ASSERT_TRUE(inputs_fresh(*bus.ctx, 1));
    bus.nics[0]->deaf = true;
    bus.nics[1]->deaf = false;
    for (unsigned n = 0; n < 20; ++n) {
        (void)bus.cycle();
        for (std::uint16_t s = 1; s <= 3; ++s)
            EXPECT_FALSE(inputs_fresh(*bus.ctx, s)) << "slave " << s << ", cycle " << n;
    }
}

TEST(Ring, FramesThatGetLostOnTop) {
    RingBus bus;
    bus.build_tree();
    bus.start();
    bus.run();
    bus.segment.set_noise({.lost = 0.05, .seed = 7});
    unsigned stale = 0;
    for (std::size_t n = 0; n < bus.ring_cables.size(); ++n) {
        bus.cable(bus.ring_cables[n], false);
        stale += bus.stale_cycles(40);
        bus.cable(bus.ring_cables[n], true);
        stale += bus.stale_cycles(40);
    }
    // In 1200 cycles, 5 % of the frames are lost. A broken ring needs both frames.
    EXPECT_LT(stale, 1200U / 8);
    EXPECT_GT(stale, 1200U / 40);
    bus.segment.set_noise({});
    EXPECT_TRUE(bus.until_all_in_op()) << bus.joined(bus.events());
    EXPECT_EQ(bus.stale_cycles(20), 0U);
    for (const Slave& slave : bus.ctx->slaves()) EXPECT_EQ(slave.al.state, AlState::op);
}

// Overlapped cycles: every cycle succeeds, and its inputs are the values at the time of its sending.
TEST(Ring, OverlappedCycles) {
    RingBus bus;
    bus.build_line(8);
    bus.start();
    bus.ctx->group(0).config.cycles_in_flight = 2;
    const auto mapped = config_map(*bus.ctx, bus.image);
    ASSERT_TRUE(mapped.ok()) << bus.words(mapped.error());
    const auto show = [&](unsigned value) {
        for (std::size_t n = 1; n <= 8; ++n) {
            bus.io(n)->inputs()[0] = static_cast<std::byte>(value);
            bus.io(n)->poke();
        }
    };
    show(0);
    ASSERT_TRUE(send_processdata(*bus.ctx).ok());
    unsigned shown = 0;
    unsigned wrong = 0;
    const auto cycle = [&] {
        bus.osal.advance(1ms);
        show(++shown);
        ASSERT_TRUE(send_processdata(*bus.ctx).ok());
        const auto wkc = receive_processdata(*bus.ctx, 500us);
        (void)poll(*bus.ctx, bus.osal.now());
        bool right = wkc.ok() && *wkc == bus.ctx->group(0).expected_wkc;
        for (std::size_t n = 1; n <= 8; ++n)
            right &= bus.ctx->slave(n).image.inputs.bytes[0] == static_cast<std::byte>(shown - 1);
        wrong += right ? 0 : 1;
    };
    for (unsigned n = 0; n < 10; ++n) cycle();
    ASSERT_EQ(wrong, 0U);
    for (const auto& end : bus.ring_cables) {
        bus.cable(end, false);
        for (unsigned n = 0; n < 10; ++n) cycle();
        bus.cable(end, true);
        for (unsigned n = 0; n < 10; ++n) cycle();
        EXPECT_EQ(wrong, 0U);
    }
    EXPECT_EQ(bus.status().breaks, bus.ring_cables.size());
    for (const unsigned which : {0U, 1U}) {  // a NIC does not tell that it has no link
        const auto end = which == 0 ? bus.ring_cables.front() : bus.ring_cables.back();
        bus.nics[which]->tells_link = false;
        bus.cable(end, false);
        for (unsigned n = 0; n < 10; ++n) cycle();
        bus.cable(end, true);
        for (unsigned n = 0; n < 10; ++n) cycle();
        bus.nics[which]->tells_link = true;
        EXPECT_EQ(wrong, 0U) << which;
    }
}

// The second break disconnects a slave, which is lost. This slave is not the slave before the break.
TEST(RingBroken, ASecondBreakIsBesideASlaveThatIsThere) {
    RingBus bus;
    bus.build_line(8);
    bus.start();
    bus.run();
    bus.cable(bus.ring_cables[8], false);
    (void)bus.stale_cycles(500);
    EXPECT_NE(bus.joined(bus.events()).find("between slave 8 port 1 and the second NIC"), std::string::npos);
    bus.cable(bus.ring_cables[7], false);
    (void)bus.stale_cycles(3000);
    std::vector<std::string> breaks;
    for (const std::string& text : bus.events())
        if (text.find("redundancy broken") != std::string::npos) breaks.push_back(text);
    EXPECT_EQ(breaks, std::vector<std::string>{"redundancy broken between slave 7 port 1 and the second NIC"});
}

// Frames pass branches behind port 2 in another order in a broken ring than in a whole ring. The event, and the end to
// which each slave is connected, do not depend on this order.
struct RingOfBranches : testing::Test {
    RingBus bus;

    void SetUp() override {
        (void)bus.add_to_ring();               // slave 1
        const auto two = bus.add_to_ring();    // slave 2
        (void)bus.add_behind(two, 3);          // slave 3
        const auto three = bus.add_to_ring();  // slave 4
        (void)bus.add_to_ring();               // slave 5
        (void)bus.add_behind(three, 2);        // slave 6
        (void)bus.add_behind(0, 2);            // slave 7
        bus.close_ring();
        bus.start();
        bus.run();
        (void)bus.stale_cycles(10);
        (void)bus.events();
    }
    std::vector<std::string> breaks() {
        std::vector<std::string> found;
        for (const std::string& text : bus.events())
            if (text.find("redundancy broken") != std::string::npos) found.push_back(text);
        return found;
    }
    std::string at_second() {
        std::string numbers;
        for (const Slave& slave : bus.ctx->slaves())
            if (slave.ring == RingEnd::second_nic && slave.al.state != AlState::none)
                numbers += std::to_string(slave.number);
        return numbers;
    }
};

TEST_F(RingOfBranches, ABrokenCableIsNamedAndTheSlavesBehindIt) {
    const struct {
        std::size_t cable;
        std::string between;
        std::string behind;
    } cases[] = {
        {0, "the first NIC and slave 1", "1234567"},  {1, "slave 1 port 1 and slave 2", "23456"},
        {2, "slave 2 port 1 and slave 4", "456"},     {3, "slave 4 port 1 and slave 5", "5"},
        {4, "slave 5 port 1 and the second NIC", ""},
    };
    for (const auto& one : cases) {
        SCOPED_TRACE(one.between);
        bus.cable(bus.ring_cables[one.cable], false);
        (void)bus.stale_cycles(300);
        EXPECT_EQ(breaks(), std::vector<std::string>{"redundancy broken between " + one.between});
        EXPECT_EQ(at_second(), one.behind);
        bus.cable(bus.ring_cables[one.cable], true);
        (void)bus.stale_cycles(300);
        (void)bus.events();
        EXPECT_EQ(at_second(), "");
    }
}

TEST_F(RingOfBranches, ALostSlaveIsBetweenTheSlavesOfTheBreak) {
    bus.segment.set_power(3, false, bus.osal.now());
    (void)bus.stale_cycles(1000);
    const auto found = breaks();
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found.back(), "redundancy broken between slave 2 port 1 and slave 5");
    EXPECT_EQ(at_second(), "5");
}

// While the only branch that the second NIC reaches is away, no slave processes the copies of this NIC. The first
// processed copy may come back before the copy of the first NIC, or after it.
TEST(RingWhole, ABranchOfTheSecondNicComesBackWhicheverCopyIsFirst) {
    for (const unsigned late : {0U, 1U}) {
        SCOPED_TRACE(late);
        RingBus bus;
        bus.later[late] = 20us;
        (void)bus.add_to_ring();
        (void)bus.add_to_ring();
        (void)bus.add_behind(1, 2);
        bus.close_ring();
        bus.start();
        bus.run();
        bus.segment.set_power(2, false, bus.osal.now());
        (void)bus.stale_cycles(300);
        bus.segment.set_power(2, true, bus.osal.now());
        EXPECT_TRUE(bus.until_all_in_op()) << bus.joined(bus.events());
        EXPECT_EQ(bus.stale_cycles(5), 0U);
    }
}

}  // namespace
}  // namespace margay
