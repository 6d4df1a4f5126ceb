// The latch inputs of a slave: times and counts of edges.
#include "clock/clock_bus.hpp"
#include "oshw/filter_nic.hpp"
#include "wire/datagram.hpp"

#include <margay/latches.hpp>

namespace margay {
namespace {

using namespace std::chrono_literals;
using sim::DcUnit;

struct Latches : testing::Test, ClockBus {
    LatchRequest request;

    void bring_up(DcUnit unit = DcUnit::bits64) {
        add({});
        add({.drift_ppb = 30'000, .start_ns = 0x1'2345'6789, .unit = unit});
        start();
        ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
        run();
        request.slave = 2;
        ASSERT_TRUE(submit(*ctx, request).ok());
        cycles(20);
    }
    void follow_the_cycles(bool supervised) {
        constexpr std::int32_t kDrift_ppb = 1'000'000;
        add({.drift_ppb = kDrift_ppb, .start_ns = 5});
        add({.drift_ppb = kDrift_ppb, .start_ns = 0x1'2345'6789, .unit = DcUnit::bits32});
        start();
        ClockSettings settings = kFewFrames;
        settings.watch_interval = 0ms;
        ASSERT_TRUE(configdc(*ctx, settings).ok());
        run();
        if (!supervised) supervision.cancel();
        request.slave = 2;
        ASSERT_TRUE(submit(*ctx, request).ok());
        const auto slow_cycles = [this](int count) {
            for (; count > 0; --count) {
                osal.advance(9ms);
                cycles(1);
            }
        };
        slow_cycles(40'000);  // 0.4 s away
        const auto about = [this] { return segment.slave(0).clock().copy(osal.now()); };
        const std::uint64_t time = edge(1, false);
        slow_cycles(10);
        ASSERT_EQ(request.edges[3].count, 1U);
        EXPECT_NEAR(static_cast<double>(static_cast<std::int64_t>(request.edges[3].time_ns - time)), 0, 200);
        const std::uint64_t known = clock_status(*ctx, osal.now()).system_time_ns;
        EXPECT_NEAR(static_cast<double>(static_cast<std::int64_t>(known - about())), 0, 2000);
    }
    // Makes an edge now. Returns its system time.
    std::uint64_t edge(unsigned input, bool rising) {
        segment.advance(osal.now());
        segment.slave(1).latch(input, rising, osal.now());
        return segment.slave(0).clock().copy(osal.now());
    }
};

// A slave that was reset shows the time since then until its clock is set again.
TEST_F(Latches, AnEdgeBeforeTheClockIsSetAgainIsNotReported) {
    bring_up();
    segment.set_power(1, false, osal.now());
    cycles(100);
    segment.set_power(1, true, osal.now());
    std::uint32_t seen = request.edges[0].count;
    int after = 0;
    for (int n = 0; n < 2000; ++n) {
        const std::uint64_t time = edge(0, true);
        cycles(1);
        if (request.edges[0].count == seen) continue;
        seen = request.edges[0].count;
        ++after;
        EXPECT_LE(std::abs(static_cast<std::int64_t>(request.edges[0].time_ns - time)), 20'000'000) << n;
    }
    EXPECT_GE(after, 500) << "the clock is set, and the latch control is written again";
}

// The slave has kept the latch control of an earlier request, and an edge since then.
TEST_F(Latches, AnEdgeBeforeTheRequestIsNotCounted) {
    bring_up();
    request.cancel();
    cycles(5);
    (void)edge(0, true);
    cycles(1000);
    ASSERT_TRUE(submit(*ctx, request).ok());
    cycles(20);
    EXPECT_EQ(request.edges[0].count, 0U);
    const std::uint64_t time = edge(0, true);
    cycles(5);
    EXPECT_EQ(request.edges[0].count, 1U);
    EXPECT_LE(std::abs(static_cast<std::int64_t>(request.edges[0].time_ns - time)), 200);
}

// Does not send frames that read the time of an edge.
struct DropsEdgeTimes final : FilterNic {
    bool on = false;
    unsigned dropped = 0;

    using FilterNic::FilterNic;
    SendStatus send(std::span<const std::byte> frame) noexcept override {
        wire::DatagramReader reader(frame);
        while (const auto d = reader.next())
            if (on && d->header.command == wire::Command::FPRD &&
                d->header.address.ado() == wire::reg::kLatch0PositiveEdge.address) {
                ++dropped;
                return SendStatus::sent;
            }
        return inner().send(frame);
    }
};

// The time of an old edge cannot be read at first.
TEST_F(Latches, AnOldEdgeIsNotCountedAfterALostReading) {
    add({});
    add({.drift_ppb = 30'000, .start_ns = 0x1'2345'6789, .unit = DcUnit::bits32});
    segment.power_up(osal.now());
    nic = std::make_unique<SimulatedNic>(segment, osal);
    DropsEdgeTimes drops(*nic);
    ctx = std::make_unique<HostContext>(limits);
    ASSERT_TRUE(init(*ctx, drops, osal).ok());
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    run();
    request.slave = 2;
    ASSERT_TRUE(submit(*ctx, request).ok());
    cycles(20);
    request.cancel();
    cycles(5);
    (void)edge(0, true);
    cycles(6000);
    drops.on = true;
    ASSERT_TRUE(submit(*ctx, request).ok());
    cycles(200);
    EXPECT_GE(drops.dropped, 1U);
    drops.on = false;
    cycles(200);
    EXPECT_EQ(request.edges[0].count, 0U);
    request.cancel();
    supervision.cancel();
    cycles(2);
    ctx.reset();
}

// The time of a clock of 32 bits wraps after 4.29 s.
TEST_F(Latches, AnEdgeWhoseTimeMayHaveWrappedIsLeftOut) {
    bring_up(DcUnit::bits32);
    LatchRequest slow;
    slow.slave = 2;
    slow.interval = 3s;
    EXPECT_EQ(submit(*ctx, slow).error().code, Errc::invalid_argument);
    for (const int seconds : {3, 6}) {
        const std::uint32_t before = request.edges[0].count;
        segment.set_cable({1, 0}, false);
        cycles(100);
        const std::uint64_t time = edge(0, true);
        cycles(seconds * 1000);
        segment.set_cable({1, 0}, true);
        cycles(200);
        EXPECT_EQ(request.edges[0].count, before + (seconds == 3 ? 1U : 0U)) << seconds;
        EXPECT_TRUE(seconds != 3 || std::abs(static_cast<std::int64_t>(request.edges[0].time_ns - time)) < 1'000'000);
        (void)edge(0, true);
        cycles(10);
        EXPECT_EQ(request.edges[0].count, before + (seconds == 3 ? 2U : 1U)) << "the next edge is kept";
    }
}

TEST_F(Latches, EachEdgeHasItsTime) {
    bring_up();
    (void)events();
    std::array<std::uint64_t, 4> times{};
    for (unsigned n = 0; n < 4; ++n) {
        times[n] = edge(n / 2, n % 2 == 0);
        osal.advance(10us);
    }
    cycles(10);
    for (unsigned n = 0; n < 4; ++n) {
        EXPECT_EQ(request.edges[n].count, 1U) << n;
        EXPECT_NEAR(static_cast<double>(request.edges[n].time_ns - times[n]), 0, 200) << n;
    }
    const auto all = events();
    EXPECT_EQ(told(all, "slave 2: rising edge at latch input 0 at "), 1) << joined(all);
    EXPECT_EQ(told(all, "slave 2: falling edge at latch input 1 at "), 1) << joined(all);
    EXPECT_EQ(told(all, std::to_string(request.edges[2].time_ns) + " ns"), 1) << joined(all);
    for (unsigned n = 2; n <= 6; ++n) {
        const std::uint64_t time = edge(0, true);
        cycles(10);
        EXPECT_EQ(request.edges[0].count, n);
        EXPECT_NEAR(static_cast<double>(request.edges[0].time_ns - time), 0, 200);
        EXPECT_EQ(request.edges[1].count, 1U);
    }
    request.cancel();
    cycles(5);
    EXPECT_EQ(request.error().code, Errc::canceled);
}

TEST_F(Latches, OfAClockOf32BitsHave64) {
    bring_up(DcUnit::bits32);
    cycles(5000);  // past the wrap
    const std::uint64_t time = edge(1, false);
    cycles(10);
    ASSERT_EQ(request.edges[3].count, 1U);
    EXPECT_GT(time >> 32, 0U);
    EXPECT_NEAR(static_cast<double>(request.edges[3].time_ns - time), 0, 200);
}

// The clock of the reference is 0.1 % faster than the clock of the master. Only the cycles bring its time.
TEST_F(Latches, WithoutASupervisionTheTimeOfTheCyclesIsKnown) { follow_the_cycles(false); }
TEST_F(Latches, WithoutAWatchTheTimeOfTheCyclesIsKnown) { follow_the_cycles(true); }

// A slave that was switched off has lost its latch control.
TEST_F(Latches, GoOnWhenTheSlaveComesBack) {
    bring_up();
    power(1, false);
    cycles(50);
    EXPECT_TRUE(request.busy());
    power(1, true);
    cycles(1500);
    (void)edge(0, true);
    cycles(10);
    EXPECT_EQ(request.edges[0].count, 1U);
}

TEST_F(Latches, MistakesAreNamed) {
    add({});
    add({.unit = DcUnit::none});
    start();
    const auto refused = [this](std::uint16_t slave, Duration interval = 1ms) {
        LatchRequest wrong;
        wrong.slave = slave;
        wrong.interval = interval;
        if (const auto submitted = submit(*ctx, wrong); !submitted) return submitted.error();
        for (int n = 0; n < 50 && wrong.busy(); ++n) cycles(1);
        return wrong.error();
    };
    EXPECT_EQ(words(refused(2)), "slave 2: watching latch inputs: no clock that runs");
    EXPECT_EQ(refused(3).code, Errc::unknown_slave);
    EXPECT_EQ(refused(1, 0ms).code, Errc::invalid_argument);
    constexpr std::array<std::byte, 1> kPdi{std::byte{0x10}};
    ASSERT_TRUE(write_register(*ctx, 1, wire::reg::kCyclicUnitControl.address, kPdi).ok());
    EXPECT_EQ(refused(1).code, Errc::unsupported);
}

}  // namespace
}  // namespace margay
