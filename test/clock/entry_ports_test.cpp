// Frames that enter slaves at ports other than 0, with other slaves behind them. The processing unit is behind port 0:
// a frame that enters at port 1 passes the slaves at ports 2 and 0 before the processing unit. The simulation knows the
// true delays.
#include "clock/clock_bus.hpp"
#include "clock/frame_ways.hpp"

#include <random>

namespace margay {
namespace {

using namespace std::chrono_literals;

// The port of the slave that is nearer to the master, the slave that is behind it, and its port.
struct Cable {
    sim::PortRef from;
    sim::PortRef to;
    Duration delay = 500ns;
};

struct EntryPortsBus : ClockBus {
    // The first cable is the cable of the master.
    void connect(std::uint32_t slaves, sim::PortRef master, std::span<const Cable> cables) {
        for (std::uint32_t n = 0; n < slaves; ++n) {
            const auto drift = static_cast<std::int32_t>(n * 7919 % 201) * 100;
            auto made = clocked({.drift_ppb = drift, .start_ns = n * 0x3000'0001ULL});
            made.chip.ports = sim::junction().ports;
            segment.add(std::move(made).assemble());
        }
        ASSERT_TRUE(segment.connect_master(master));
        for (const Cable& cable : cables) ASSERT_TRUE(segment.connect(cable.from, cable.to, cable.delay));
    }
    // The numbers in the segment differ from the order in the ring.
    std::int64_t error_ns(std::uint32_t slaves) {
        std::int64_t most = 0;
        const Time now = osal.now();
        for (std::uint32_t n = 1; n < slaves; ++n) {
            const auto ahead =
                static_cast<std::int64_t>(segment.slave(n).clock().copy(now) - segment.slave(0).clock().copy(now));
            most = std::max(most, std::abs(ahead));
        }
        return most;
    }
    void expect_in_step(std::uint32_t slaves) {
        start();
        const auto reference = configdc(*ctx, kFewFrames);
        ASSERT_TRUE(reference.ok()) << words(reference.error());
        run();
        cycles(500);
        EXPECT_TRUE(clock_status(*ctx, osal.now()).in_sync) << joined(events());
        EXPECT_LE(error_ns(slaves), 30);
    }
};

struct EntryPorts : testing::Test, EntryPortsBus {};

TEST_F(EntryPorts, OfOneSlaveInALine) {
    const std::array cables{Cable{{0, 1}, {1, 1}}, Cable{{1, 0}, {2, 0}, 5us}};
    connect(3, {0, 0}, cables);
    expect_in_step(3);
    // The slave behind slave 3 answers before slave 3.
    EXPECT_EQ(ctx->slave(3).parent, 1);
    EXPECT_EQ(ctx->slave(3).parent_port, 1);
    EXPECT_EQ(ctx->slave(3).entry_port, 1);
    EXPECT_EQ(ctx->slave(2).parent, 3);
    EXPECT_EQ(ctx->slave(2).parent_port, 0);
    EXPECT_EQ(ctx->slave(2).entry_port, 0);
    EXPECT_EQ(ctx->slave(1).ports[1].neighbour, 3);
    EXPECT_EQ(ctx->slave(3).ports[1].neighbour, 1);
    EXPECT_EQ(ctx->slave(3).ports[0].neighbour, 2);
    EXPECT_EQ(ctx->slave(2).ports[0].neighbour, 3);
}

TEST_F(EntryPorts, OfAllSlavesOfALine) {
    const std::array cables{Cable{{0, 0}, {1, 1}, 3us}, Cable{{1, 0}, {2, 1}}, Cable{{2, 0}, {3, 1}, 7us}};
    connect(4, {0, 1}, cables);
    expect_in_step(4);
}

// Port 0 has no cable: the slave at port 1 comes before the unit, too.
TEST_F(EntryPorts, WithoutACableAtPort0) {
    const std::array cables{Cable{{0, 1}, {1, 3}}, Cable{{1, 1}, {2, 0}, 5us}};
    connect(3, {0, 0}, cables);
    expect_in_step(3);
}

TEST_F(EntryPorts, OfJunctions) {
    const std::array cables{Cable{{0, 3}, {1, 2}, 2us}, Cable{{1, 0}, {2, 0}},      Cable{{1, 3}, {3, 0}, 4us},
                            Cable{{1, 1}, {4, 3}},      Cable{{4, 2}, {5, 0}, 1us}, Cable{{4, 0}, {6, 0}, 9us},
                            Cable{{0, 1}, {7, 1}},      Cable{{7, 0}, {8, 0}, 3us}};
    connect(9, {0, 0}, cables);
    expect_in_step(9);
}

// Both lines have the same order of processing units and the same ports. Only the lengths of the cables make the
// receive times different.
TEST_F(EntryPorts, TheTimesTellWhichSlaveIsBehindWhich) {
    const std::array outer{Cable{{0, 0}, {1, 0}, 3us}, Cable{{1, 1}, {2, 0}, 5us}};
    connect(3, {0, 1}, outer);
    expect_in_step(3);
}

TEST_F(EntryPorts, TheTimesTellWhichSlaveIsBehindTheOther) {
    const std::array inner{Cable{{0, 1}, {1, 1}, 3us}, Cable{{1, 0}, {2, 0}, 5us}};
    connect(3, {0, 0}, inner);
    expect_in_step(3);
}

TEST_F(EntryPorts, ASlaveBehindComesBack) {
    const std::array cables{Cable{{0, 1}, {1, 1}}, Cable{{1, 0}, {2, 0}, 5us}};
    connect(3, {0, 0}, cables);
    expect_in_step(3);
    for (int times = 0; times < 3; ++times) {
        segment.set_power(2, false, osal.now());
        cycles(700);
        EXPECT_LE(error_ns(2), 30);
        segment.set_power(2, true, osal.now());
        const auto back = [this] { return all_in_op() && clock_status(*ctx, osal.now()).in_sync; };
        ASSERT_TRUE(until(back, 5000)) << joined(events());
        cycles(500);
        EXPECT_LE(error_ns(3), 100) << joined(events());
    }
}

// The first slave forwards the frame by port 1, the third slave by port 0, and the frame enters the third slave by port
// 1. Each of them can be behind the other.
TEST(FindWays, FollowTheTimes) {
    std::array<DelayNode, 3> nodes{};
    nodes[0].open = nodes[2].open = 0b11;
    nodes[1].open = 0b01;
    nodes[2].entry_port = 1;
    nodes[0].arrival_ps = 9000;
    nodes[2].arrival_ps = 5000;
    ASSERT_TRUE(find_ways(nodes));
    EXPECT_EQ(nodes[0].parent, 0);
    EXPECT_EQ(nodes[1].parent, 3);
    EXPECT_EQ(nodes[1].parent_port, 0);
    EXPECT_EQ(nodes[2].parent, 1);
    EXPECT_EQ(nodes[2].parent_port, 1);
    nodes[0].arrival_ps = 3000;
    ASSERT_TRUE(find_ways(nodes));
    EXPECT_EQ(nodes[0].parent, 3);
    EXPECT_EQ(nodes[1].parent, 1);
    EXPECT_EQ(nodes[2].parent, 0);
}

TEST(FindWays, SayWhatTheyCannotKnow) {
    std::array<DelayNode, 3> nodes{};
    nodes[0].open = nodes[2].open = 0b11;
    nodes[1].open = 0b01;
    nodes[2].entry_port = 1;
    nodes[2].arrival_ps = 5000;
    nodes[0].arrival_ps = -1;  // no receive times
    EXPECT_FALSE(find_ways(nodes));
    nodes[0].arrival_ps = 9000;
    nodes[2].open = 0b111;  // nothing is connected to port 2
    EXPECT_FALSE(find_ways(nodes));
}

// Trees, entry ports and cables by seed. A slave without a link at port 0 marks a frame as circulating, and a second
// such slave destroys the frame. Therefore the frame enters this slave at port 0.
TEST(EntryPortsStorm, OfTreesBySeed) {
    for (unsigned seed = 1; seed <= 60; ++seed) {
        SCOPED_TRACE(seed);
        EntryPortsBus bus;
        std::minstd_rand random(seed);
        const auto slaves = static_cast<std::uint32_t>(3 + random() % 10);
        std::vector<unsigned> used(slaves, 0);
        std::vector<std::uint8_t> entry(slaves, 0);
        std::vector<Cable> cables;
        const auto take_port = [&](std::uint32_t slave) {
            std::uint8_t port = 0;
            do port = static_cast<std::uint8_t>(random() % 4);
            while ((used[slave] >> port & 1) != 0);
            used[slave] |= 1U << port;
            return port;
        };
        entry[0] = take_port(0);
        for (std::uint32_t n = 1; n < slaves; ++n) {
            auto parent = static_cast<std::uint32_t>(random() % n);
            while (used[parent] == 15) parent = static_cast<std::uint32_t>(random() % n);
            const std::uint8_t port = take_port(parent);
            entry[n] = take_port(n);
            cables.push_back({{parent, port}, {n, entry[n]}, Duration(50 + random() % 5000)});
        }
        for (Cable& cable : cables)
            if ((used[cable.to.slave] & 1) == 0) cable.to.port = 0;
        const sim::PortRef master{0, (used[0] & 1) == 0 ? std::uint8_t{0} : entry[0]};
        bus.connect(slaves, master, cables);
        bus.expect_in_step(slaves);
    }
}

}  // namespace
}  // namespace margay
