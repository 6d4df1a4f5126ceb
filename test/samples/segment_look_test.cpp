// look_at_segment(), the check before a scan, in virtual time.
#include "common/segment_look.hpp"
#include "common/segment_file.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"

#include <gtest/gtest.h>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <margay/redundancy.hpp>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace margay::samples {
namespace {

using namespace std::chrono_literals;

// The first frames of the master are lost, and the link can be down for some time.
struct BadWire final : Nic {
    explicit BadWire(Nic& under, Osal& clock) : nic(under), osal(clock) {}
    SendStatus send(std::span<const std::byte> frame) noexcept override {
        return ++sent <= lost ? SendStatus::sent : nic.send(frame);
    }
    std::size_t receive(std::span<std::byte> into) noexcept override { return nic.receive(into); }
    LinkState link_state() noexcept override { return osal.now() < link_from ? LinkState::down : LinkState::up; }
    Time next_arrival() const noexcept override { return nic.next_arrival(); }

    Nic& nic;
    Osal& osal;
    int sent = 0;
    int lost = 0;
    Time link_from{};
};

struct SegmentLookTest : testing::Test {
    VirtualOsal osal;
    LoadedSegment loaded = load_segment("demo");
    SimulatedNic simulated{loaded->segment, osal, SimulatedNic::Options{.round_trip = 100us, .wire_time = true}};
    BadWire nic{simulated, osal};

    unsigned state(std::uint32_t slave) {
        return loaded->segment.slave(slave).registers().get<std::uint16_t>(0x0130) & 0x0Fu;
    }
};

TEST_F(SegmentLookTest, SlavesInInitAndPreopAreFree) {
    const auto look = look_at_segment(nic, osal);
    EXPECT_TRUE(look.link);
    EXPECT_EQ(look.slaves, 5);
    EXPECT_EQ(look.al_status, 1);
    EXPECT_FALSE(look.running());
    EXPECT_EQ(nic.sent, 1);
    HostContext ctx(Limits{.slaves = 8});
    ASSERT_TRUE(init(ctx, nic, osal));
    ASSERT_TRUE(config_init(ctx));
    EXPECT_FALSE(look_at_segment(nic, osal).running());
}

TEST_F(SegmentLookTest, TheStateOfEachSlaveInTheOrderOfTheRing) {
    // From INIT to SAFEOP is no transition: invalid requested state change.
    auto& esc = loaded->segment.slave(3);
    (void)esc.ecat_write(0x0120, std::array{std::byte{4}, std::byte{0}}, osal.now());
    esc.frame_end({.good = true, .at = osal.now(), .processing = osal.now()});
    osal.wait(osal.now() + 10ms, -1);
    nic.lost = 3;
    const auto states = look_at_states(nic, osal);
    ASSERT_EQ(states.size(), 5U);
    EXPECT_EQ(states[3], (AlStatus{.state = AlState::init, .error = true, .code = 0x0011}));
    for (const std::size_t n : {0U, 1U, 2U, 4U}) EXPECT_EQ(states[n], AlStatus{.state = AlState::init}) << n;
    EXPECT_EQ(state(3), 1U) << "nothing was written";
    loaded->segment.set_power(3, false, osal.now());
    nic.link_from = osal.now() + 1h;
    EXPECT_EQ(look_at_states(nic, osal), std::vector<AlStatus>()) << "no link";
}

TEST_F(SegmentLookTest, OneSlaveInSafeopIsEnoughAndIsLeftThere) {
    HostContext ctx(Limits{.slaves = 8});
    std::array<std::byte, 100> image{};
    ASSERT_TRUE(init(ctx, nic, osal));
    ASSERT_TRUE(config_init(ctx));
    ASSERT_TRUE(config_map(ctx, image));
    for (std::uint16_t slave = 1; slave <= 4; ++slave) ASSERT_TRUE(writestate(ctx, slave, AlState::init));
    osal.advance(10ms);
    loaded->segment.advance(osal.now());
    ASSERT_EQ(state(0), 1u);
    ASSERT_EQ(state(4), 4u);
    const auto look = look_at_segment(nic, osal);
    EXPECT_EQ(look.slaves, 5);
    EXPECT_TRUE(look.running());
    EXPECT_EQ(state(4), 4u);
}

TEST_F(SegmentLookTest, LostFramesAndALateLinkDoNotHideTheSlaves) {
    nic.lost = 4;
    nic.link_from = osal.now() + 3s;
    EXPECT_EQ(look_at_segment(nic, osal).slaves, 5);
}

TEST_F(SegmentLookTest, NobodyThereAndNoLinkAreTold) {
    nic.lost = 1000;
    const auto nobody = look_at_segment(nic, osal);
    EXPECT_TRUE(nobody.link);
    EXPECT_EQ(nobody.slaves, 0);
    EXPECT_FALSE(nobody.running());
    nic.link_from = kNever;
    EXPECT_FALSE(look_at_segment(nic, osal).link);
}

// A ring of three slaves with two NICs, whose cables may be broken or swapped. The last slave is in SAFEOP.
struct RingLookTest : testing::Test {
    VirtualOsal osal;
    sim::Segment segment;
    std::optional<SimulatedNic> nics[2];

    // `branch`: the fourth slave is behind port 2 of the first slave. In the whole ring, only the frames from the end
    // of the ring reach it. Then this slave is in SAFEOP.
    void build(bool swapped, bool branch = false) {
        for (std::uint32_t n = 0; n < (branch ? 4 : 3); ++n) {
            auto device = std::move(*sim::make_device("digital_io_16"));
            device.chip = sim::junction();
            (void)segment.add(std::move(device).assemble());
            ASSERT_TRUE(n == 0 || n == 3 || segment.connect({n - 1, 1}, {n, 0}));
        }
        if (branch) {
            ASSERT_TRUE(segment.connect({0, 2}, {3, 0}));
        }
        ASSERT_TRUE(segment.connect_master({0, 0}, swapped ? 1 : 0));
        ASSERT_TRUE(segment.connect_master({2, 1}, swapped ? 0 : 1));
        segment.power_up(osal.now());
        for (unsigned n = 0; n < 2; ++n)
            nics[n].emplace(segment, osal, SimulatedNic::Options{.round_trip = 100us, .master_port = n});
        nics[0]->set_other_end(&*nics[1]);
        nics[1]->set_other_end(&*nics[0]);
        HostContext ctx(Limits{.slaves = 8, .redundancy = true});
        std::array<std::byte, 100> image{};
        ASSERT_TRUE(init_redundant(ctx, *nics[0], *nics[1], osal));
        ASSERT_TRUE(config_init(ctx));
        ASSERT_TRUE(config_map(ctx, image));
        for (std::uint16_t slave = 1; slave <= (branch ? 3 : 2); ++slave)
            ASSERT_TRUE(writestate(ctx, slave, AlState::init));
        osal.advance(10ms);
        segment.advance(osal.now());
    }
};

TEST_F(RingLookTest, SlavesAtABranchThatOnlyTheFramesFromTheEndReach) {
    const std::vector<AlStatus> states{
        {.state = AlState::init}, {.state = AlState::init}, {.state = AlState::init}, {.state = AlState::safeop}};
    for (const bool swapped : {false, true}) {
        SCOPED_TRACE(swapped);
        segment = {};
        ASSERT_NO_FATAL_FAILURE(build(swapped, true));
        const auto look = look_at_segment(*nics[0], osal, &*nics[1]);
        EXPECT_EQ(look.slaves, 4);
        EXPECT_TRUE(look.running());
        const auto seen = look_at_states(*nics[0], osal, &*nics[1]);
        ASSERT_EQ(seen.size(), 4U);
        EXPECT_EQ(std::ranges::count(seen, states[3]), 1);
        if (!swapped) {
            EXPECT_EQ(seen, states);
        }
    }
}

TEST_F(RingLookTest, EachNicAsksAndEitherReceives) {
    const std::vector<AlStatus> states{{.state = AlState::init}, {.state = AlState::init}, {.state = AlState::safeop}};
    for (const bool swapped : {false, true}) {
        segment = {};
        ASSERT_NO_FATAL_FAILURE(build(swapped));
        for (int broken = -1; broken <= 3; ++broken) {
            SCOPED_TRACE("swapped " + std::to_string(swapped) + ", broken cable " + std::to_string(broken));
            const auto set = [&](bool intact) {
                if (broken == 0 || broken == 3)
                    segment.set_master_cable((broken == 3) != swapped ? 1 : 0, intact);
                else if (broken > 0)
                    segment.set_cable({static_cast<std::uint32_t>(broken), 0}, intact);
            };
            set(false);
            const auto look = look_at_segment(*nics[0], osal, &*nics[1]);
            EXPECT_TRUE(look.link);
            EXPECT_EQ(look.slaves, 3);
            EXPECT_TRUE(look.running());
            EXPECT_EQ(look_at_states(*nics[0], osal, &*nics[1]), states);
            set(true);
        }
    }
}

}  // namespace
}  // namespace margay::samples
