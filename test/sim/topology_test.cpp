// The segment in physical order: line, tree, star, drop lines, rings; broken cables, slaves without power, lost
// frames. Order of processing: ETG.1000.4 "Frame processing order"; port states: table "DL status".
#include "rig.hpp"

#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"

#include <algorithm>
#include <string>
#include <tuple>

namespace margay::sim::test {
namespace {

using namespace std::chrono_literals;

struct Topology : testing::Test {
    Rig rig;
    std::uint32_t add() { return rig.segment.add(std::make_unique<Esc>(junction(), sii_image(kEmulationWithDc))); }
    void connect(PortRef a, PortRef b) { EXPECT_TRUE(rig.segment.connect(a, b)); }
    void add_line(std::uint32_t count) {
        for (std::uint32_t n = 0; n < count; ++n) {
            const auto slave = add();
            if (n == 0) {
                EXPECT_TRUE(rig.segment.connect_master({0, 0}));
            } else {
                connect({slave - 1, 1}, {slave, 0});
            }
        }
    }
    Reply count(unsigned port = 0) {
        return rig.frame({{Command::BRD, {std::uint16_t{0}, 0x0000}, bytes({0})}}, port).at(0);
    }
    std::uint16_t dl_status(std::uint32_t n) { return rig.slave(n).registers().get<std::uint16_t>(0x0110); }
    using Order = std::vector<std::uint32_t>;
};

// After a port, a frame goes to the next port in the order 0, 3, 1, 2.
TEST_F(Topology, StarIsProcessedInPortOrder) {
    for (int i = 0; i < 4; ++i) add();
    EXPECT_TRUE(rig.segment.connect_master({0, 0}));
    connect({0, 1}, {1, 0});
    connect({0, 2}, {2, 0});
    connect({0, 3}, {3, 0});
    rig.on();
    EXPECT_EQ(rig.segment.order(), (Order{0, 3, 1, 2}));
    EXPECT_EQ(count().wkc, 4);
    EXPECT_EQ(dl_status(0), 0xAAF1) << "link and communication at all four";
    EXPECT_EQ(dl_status(1), 0x5611);
}

TEST_F(Topology, DropLinesAndBranches) {
    add_line(4);
    for (int i = 0; i < 3; ++i) add();
    connect({1, 3}, {4, 0});  // a drop line of two at the second slave
    connect({4, 1}, {5, 0});
    connect({2, 2}, {6, 0});  // one more slave behind the fourth slave
    rig.on();
    EXPECT_EQ(rig.segment.order(), (Order{0, 1, 4, 5, 2, 3, 6}));
    EXPECT_EQ(count().wkc, 7);
    rig.segment.set_cable({4, 0}, false);
    EXPECT_EQ(rig.segment.order(), (Order{0, 1, 2, 3, 6}));
    rig.segment.set_cable({1, 3}, true);  // reconnected at its other end
    EXPECT_EQ(rig.segment.order(), (Order{0, 1, 4, 5, 2, 3, 6}));
}

TEST_F(Topology, WhatCannotBePluggedIsRefused) {
    add_line(2);
    EXPECT_FALSE(rig.segment.connect({0, 1}, {1, 2})) << "taken";
    EXPECT_FALSE(rig.segment.connect({0, 2}, {0, 2})) << "into itself";
    EXPECT_FALSE(rig.segment.connect({0, 2}, {5, 0})) << "no such slave";
    EXPECT_FALSE(rig.segment.connect({0, 2}, {1, 4})) << "no such port";
    EXPECT_FALSE(rig.segment.connect_master({1, 2}, 0)) << "the master's port is taken";
    EXPECT_FALSE(rig.segment.connect_master({1, 2}, 2)) << "it has two";
    rig.segment.add(std::make_unique<Esc>(et1200(), sii_image(kDigitalIo)));
    EXPECT_FALSE(rig.segment.connect({1, 1}, {2, 3})) << "that chip has no port 3";
}

// Slaves that are connected in a circle without the master. A circulating frame is stopped.
TEST_F(Topology, ACircleOfSlavesEndsFrames) {
    add_line(3);
    connect({2, 1}, {0, 2});
    rig.on();
    (void)count();
    SUCCEED() << "it ends";
}

// --- Breaks and reconnections ---

TEST_F(Topology, ABreakAtAnyPlaceShortensTheLine) {
    add_line(5);
    rig.on();
    for (std::uint32_t n = 1; n < 5; ++n) {
        rig.segment.set_cable({n, 0}, false);
        EXPECT_EQ(count().wkc, n);
        EXPECT_EQ(dl_status(n - 1) & 0x0C20, 0x0400) << "port 1: no link, loop closed, no communication";
        rig.segment.set_cable({n, 0}, true);
        EXPECT_EQ(count().wkc, 5);
        EXPECT_EQ(dl_status(n - 1) & 0x0C20, 0x0820);
    }
    rig.segment.set_cable({0, 0}, false);
    EXPECT_FALSE(count().returned);
    EXPECT_FALSE(rig.segment.master_link());
    rig.segment.set_cable({0, 0}, true);
    EXPECT_TRUE(count().returned);
}

TEST_F(Topology, ASlaveWithoutPowerEndsTheLineAndComesBackFresh) {
    add_line(3);
    rig.on();
    (void)rig.put<std::uint16_t>(1, 0x0010, 0x1002);
    (void)rig.put<std::uint16_t>(2, 0x0010, 0x1003);
    rig.segment.set_power(1, false, rig.now);
    EXPECT_EQ(count().wkc, 1) << "those behind it are cut off";
    rig.segment.set_power(1, true, rig.now);
    EXPECT_EQ(count().wkc, 3);
    EXPECT_EQ(rig.get<std::uint16_t>(1, 0x0010), 0) << "its registers are as after switching on";
    EXPECT_EQ(rig.get<std::uint16_t>(2, 0x0010), 0x1003) << "the one behind kept its power";
    rig.segment.set_power(0, false, rig.now);
    EXPECT_FALSE(count().returned);
    EXPECT_FALSE(rig.segment.master_link());
}

TEST_F(Topology, HotConnectAndRemoval) {
    add_line(2);
    const auto tool = add();
    connect({0, 3}, {tool, 0});
    rig.on();
    rig.segment.set_cable({tool, 0}, false);
    EXPECT_EQ(rig.segment.order(), (Order{0, 1}));
    (void)rig.send(Command::BRD, {std::uint16_t{0}, 0x0110}, bytes({0, 0}));
    rig.segment.set_cable({tool, 0}, true);
    EXPECT_EQ(rig.segment.order(), (Order{0, tool, 1})) << "it comes first, by its port";
    EXPECT_EQ(rig.get<std::uint16_t>(0, 0x0210) & 4, 4) << "the dock says that its links have changed";
    EXPECT_EQ(count().wkc, 3);
}

// --- The ring with a second master port ---

TEST_F(Topology, RingGoesThroughAndBreaksIntoTwoLines) {
    add_line(4);
    EXPECT_TRUE(rig.segment.connect_master({3, 1}, 1));
    rig.on();
    const auto pass = [&](unsigned port) {
        std::array<std::byte, 60> raw{};
        wire::FrameBuilder builder(raw, {0, 1, 1, 1, 1, 1});
        (void)builder.append(Command::BRD, 0, {std::uint16_t{0}, 0x0000}, 1);
        const auto size = builder.finish().size();
        rig.now += 100us;
        const auto passage = rig.segment.process(MutableBytes(raw).first(size), rig.now, port);
        return std::tuple(passage.returned, passage.master_port, load_le<std::uint16_t>(raw, size - 2));
    };
    EXPECT_EQ(pass(0), std::tuple(true, 1u, 4)) << "through all of them, and out at the other port";
    EXPECT_EQ(pass(1), std::tuple(true, 0u, 0)) << "the other way round nobody processes: port 0 is the exit";
    EXPECT_EQ(dl_status(3), 0x5A31);
    for (std::uint32_t n = 1; n < 4; ++n) {
        rig.segment.set_cable({n, 0}, false);
        EXPECT_EQ(pass(0), std::tuple(true, 0u, static_cast<int>(n)));
        EXPECT_EQ(pass(1), std::tuple(true, 1u, static_cast<int>(4 - n)))
            << "turned at a closed port 0, and processed there";
        rig.segment.set_cable({n, 0}, true);
        EXPECT_EQ(pass(0), std::tuple(true, 1u, 4));
    }
    // The cable of the second NIC.
    rig.segment.set_cable({3, 1}, false);
    EXPECT_EQ(pass(0), std::tuple(true, 0u, 4));
    EXPECT_FALSE(std::get<0>(pass(1)));
}

// Both NICs of one master, through SimulatedNic.
TEST_F(Topology, FramesArriveAtTheOtherNic) {
    add_line(2);
    EXPECT_TRUE(rig.segment.connect_master({1, 1}, 1));
    rig.on();
    VirtualOsal osal;
    SimulatedNic first(rig.segment, osal, {.master_port = 0});
    SimulatedNic second(rig.segment, osal, {.master_port = 1});
    first.set_other_end(&second);
    second.set_other_end(&first);
    std::array<std::byte, 1518> buffer{};
    const auto send = [&](SimulatedNic& nic) {
        wire::FrameBuilder builder(buffer, nic.source_mac());
        (void)builder.append(Command::BRD, 0, {std::uint16_t{0}, 0x0000}, 1);
        EXPECT_EQ(nic.send(builder.finish()), SendStatus::sent);
        osal.advance(1ms);
    };
    send(first);
    EXPECT_EQ(first.receive(buffer), 0u);
    EXPECT_EQ(second.receive(buffer), 29u);
    rig.segment.set_cable({1, 0}, false);
    send(first);
    EXPECT_EQ(first.receive(buffer), 29u);
    EXPECT_EQ(second.receive(buffer), 0u);
    rig.segment.set_cable({1, 1}, false);
    EXPECT_EQ(second.link_state(), LinkState::down);
}

// --- Loss and damage at a rate ---

TEST_F(Topology, NoiseIsAShareOfFramesAndTheSameForTheSameSeed) {
    add_line(3);
    rig.on();
    const auto lost = [&](std::uint64_t seed) {
        rig.segment.set_noise({.lost = 0.1, .corrupted = 0.05, .seed = seed});
        std::string fate;
        for (int i = 0; i < 2000; ++i) fate += count().returned ? '.' : 'x';
        return fate;
    };
    const auto once = lost(1);
    EXPECT_NEAR(static_cast<double>(std::count(once.begin(), once.end(), 'x')), 300.0, 60.0);
    EXPECT_EQ(lost(1), once);
    EXPECT_NE(lost(2), once);
    rig.segment.set_noise({});
    for (int i = 0; i < 100; ++i) EXPECT_TRUE(count().returned);
}

TEST_F(Topology, ALostFrameHasDoneWhatItDidBefore) {
    add_line(3);
    rig.on();
    rig.segment.lose_next({2, 0});
    EXPECT_FALSE(rig.send(Command::BWR, {std::uint16_t{0}, 0x0010}, bytes({0x34, 0x12})).returned);
    EXPECT_EQ(rig.slave(1).station(), 0x1234);
    EXPECT_EQ(rig.slave(2).station(), 0);
    for (std::uint32_t n = 0; n < 3; ++n)
        EXPECT_EQ(rig.slave(n).peek(0x0300, 14), std::vector<std::byte>(14)) << "nobody counts it";
}

// A thousand slaves in a line, and a slave at each port of the last one.
TEST_F(Topology, LongLine) {
    add_line(1000);
    rig.on();
    const auto reply = count();
    EXPECT_EQ(reply.wkc, 1000);
    EXPECT_EQ(reply.header.address.adp(), 1000);
    EXPECT_EQ(rig.get<std::uint8_t>(999, 0x0000), 0x11);
    rig.segment.set_cable({500, 0}, false);
    EXPECT_EQ(count().wkc, 500);
}

}  // namespace
}  // namespace margay::sim::test
