// Distributed clocks in a ring with two NICs, against the simulation's true time.
#include "redundancy/clock_ring.hpp"

namespace margay {
namespace {

struct ClockRing : testing::Test, ClockRingBus {};

// The cycle is on the wire during poll(), so the measurement of the delays takes many cycles. Meanwhile the ring is
// open, and no time arrives.
TEST_F(ClockRing, KeepsStepAlsoWhenDelaysAreMeasuredAgainAndAgain) {
    build(4, false);
    clock_settings.delay_interval = 100ms;
    bring_up();
    std::int64_t most = 0;
    Time due = osal.now();
    for (unsigned n = 0; n < 20'000; ++n) {
        osal.wait(due, -1);
        (void)receive_processdata(*ctx, 0us);
        ASSERT_TRUE(send_processdata(*ctx).ok());
        (void)poll(*ctx, osal.now());
        due += 1ms;
        if (n > 5000) most = std::max(most, apart_ns());
    }
    EXPECT_LE(most, 100);
}

// The delays in a ring are the delays of the line that remains without the cable to the second NIC.
TEST_F(ClockRing, DelaysAreThoseOfALine) {
    build(6);
    start();
    const auto breaks = status().breaks;
    ASSERT_TRUE(clocks().ok());
    EXPECT_EQ(status().breaks, breaks) << "the library has opened the ring itself: nothing is reported";
    EXPECT_EQ(status().ring, RingState::whole);
    std::vector<std::uint32_t> ring;
    for (std::uint16_t n = 1; n <= 8; ++n) ring.push_back(slave_clock(*ctx, n).delay_ns);
    EXPECT_EQ(status().cables[1].lost, 0U);
    cable(ring_cables.back(), false);
    for (unsigned n = 0; n < 5; ++n) (void)cycle();
    ASSERT_TRUE(readstate(*ctx).ok());
    const auto line = clocks();
    ASSERT_TRUE(line.ok()) << words(line.error()) << "broken at the second NIC is a line";
    for (std::uint16_t n = 1; n <= 8; ++n)
        EXPECT_NEAR(static_cast<double>(slave_clock(*ctx, n).delay_ns), static_cast<double>(ring[n - 1U]), 2) << n;
    EXPECT_GT(ring.back(), 2000U);
}

// The port of the last slave is open again, also in the chip's lasting settings.
TEST_F(ClockRing, ThePortIsOpenAgain) {
    build(3, false);
    start();
    ASSERT_TRUE(clocks().ok());
    EXPECT_EQ(segment.slave(2).dl_control() & 0xFF02, 0U);
    osal.advance(2s);
    EXPECT_EQ(segment.slave(2).dl_control() & 0xFF02, 0U);
}

// Each cable of the ring breaks for two seconds and heals.
TEST_F(ClockRing, BehindABreakTheClocksKeepInStep) {
    build(6);
    bring_up();
    EXPECT_LE(cycles(500), 100);
    for (std::size_t n = 0; n < ring_cables.size(); ++n) {
        const std::uint64_t first = pulses(1);
        const std::uint64_t last = pulses(8);
        const Time begin = osal.now();
        cable(ring_cables[n], false);
        EXPECT_LE(cycles(2000), 1000) << "broken at cable " << n;
        EXPECT_EQ(status().ring, RingState::broken);
        const bool parted = n != 0 && n + 1 != ring_cables.size();
        EXPECT_EQ(status().second_reference != 0 && status().second_reference != 1, parted) << n;
        cable(ring_cables[n], true);
        EXPECT_LE(cycles(300), 1000) << "no step when cable " << n << " heals";
        EXPECT_LE(cycles(1000), 100) << "whole again after cable " << n;
        EXPECT_EQ(status().second_reference, 0);
        const auto passed = static_cast<double>((osal.now() - begin) / 1ms);
        EXPECT_NEAR(static_cast<double>(pulses(1) - first), passed, 2) << "no SYNC0 is missed or doubled";
        EXPECT_NEAR(static_cast<double>(pulses(8) - last), passed, 2);
    }
    const auto all = events();
    EXPECT_EQ(std::ranges::count_if(all, [](const std::string& e) { return e.find("out of sync") != e.npos; }), 0)
        << joined(all);
}

// The oscillator of the second reference changes by 5 ppm: without the master, the parts would be 65 µs apart.
TEST_F(ClockRing, TheMasterSteersTheSecondReference) {
    build(5, false);
    bring_up();
    cable(ring_cables[2], false);
    EXPECT_LE(cycles(1000), 1000);
    segment.slave(at[2]).set_drift(60'000 + 5'000, osal.now());
    EXPECT_LE(cycles(3000), 2000) << "5 ppm at once";
    EXPECT_LE(cycles(10'000), 1000);
    EXPECT_EQ(status().second_reference, 3);
    EXPECT_LE(std::abs(status().second_ahead_ns), 1000);
}

// The slave with the second reference loses its power, then the slave with the reference loses its power.
TEST_F(ClockRing, AnotherClockTakesOverInEitherPart) {
    build(6, false);
    bring_up();
    cable(ring_cables[2], false);  // between slaves 2 and 3
    EXPECT_LE(cycles(500), 1000);
    segment.set_power(at[2], false, osal.now());
    EXPECT_LE(cycles(1000), 1000);
    EXPECT_EQ(status().second_reference, 4);
    segment.set_power(at[2], true, osal.now());
    ASSERT_TRUE(until_all_in_op(6000)) << joined(events());
    (void)cycles(3000);
    EXPECT_EQ(status().second_reference, 3);
    EXPECT_LE(cycles(300), 1000);
    cable(ring_cables[2], true);
    (void)cycles(1000);
    EXPECT_LE(cycles(300), 100);
    segment.set_power(at[0], false, osal.now());
    (void)cycles(1000);
    EXPECT_LE(cycles(300), 1000);
    EXPECT_EQ(reference_clock(*ctx), 2);
    segment.set_power(at[0], true, osal.now());
    ASSERT_TRUE(until_all_in_op(6000)) << joined(events());
    (void)cycles(2000);
    EXPECT_LE(cycles(300), 100) << joined(events());
}

TEST_F(ClockRing, WithLostFrames) {
    build(6);
    bring_up();
    segment.set_noise({.lost = 0.01, .seed = 7});
    for (const std::size_t n : {1U, 3U, 5U}) {
        cable(ring_cables[n], false);
        EXPECT_LE(cycles(1000), 1000) << n;
        cable(ring_cables[n], true);
        EXPECT_LE(cycles(1000), 1000) << n;
    }
    segment.set_noise({});
    ASSERT_TRUE(until_all_in_op(6000)) << joined(events());
    (void)cycles(1500);
    EXPECT_LE(cycles(300), 100);
}

// The cable of the second NIC is unplugged and plugged in again while a ring cable is broken, so a search has read the
// ports of the broken ring. When the ring is whole, the delays are measured by the ways of the whole ring, also if
// frames are lost meanwhile.
TEST(ClockRingSearch, BehindABreakDoesNotChangeTheDelays) {
    for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U, 6U}) {
        SCOPED_TRACE(seed);
        ClockRingBus bus;
        bus.build(5);
        bus.bring_up();
        std::vector<std::uint32_t> right;
        for (std::uint16_t n = 1; n <= 7; ++n) right.push_back(slave_clock(*bus.ctx, n).delay_ns);
        const sim::PortRef broken = bus.ring_cables[3];
        bus.cable(broken, false);
        (void)bus.cycles(250);
        bus.cable(bus.ring_cables.back(), false);
        (void)bus.cycles(290);
        EXPECT_EQ(bus.ctx->slave(7).al.state, AlState::none);
        bus.cable(bus.ring_cables.back(), true);
        (void)bus.cycles(100);
        ASSERT_TRUE(bus.all_in_op());
        bus.segment.set_noise({.lost = 0.05, .seed = seed});
        (void)bus.cycles(100);
        bus.cable(broken, true);
        (void)bus.cycles(1500);
        bus.segment.set_noise({});
        (void)bus.cycles(2000);
        EXPECT_EQ(bus.status().ring, RingState::whole);
        for (std::uint16_t n = 1; n <= 7; ++n) EXPECT_NEAR(slave_clock(*bus.ctx, n).delay_ns, right[n - 1U], 2) << n;
        EXPECT_LE(bus.cycles(300), 100);
    }
}

// The NICs are swapped: the ring begins at the second NIC.
TEST_F(ClockRing, WithInterchangedCables) {
    for (unsigned n = 0; n < 5; ++n) (void)add_to_ring(nth(n));
    close_ring();
    segment.disconnect({0, 0});
    segment.disconnect({4, 1});
    ASSERT_TRUE(segment.connect_master({0, 0}, 1));
    ASSERT_TRUE(segment.connect_master({4, 1}, 0));
    start();
    at = {0, 1, 2, 3, 4};
    const auto reference = clocks();
    ASSERT_TRUE(reference.ok()) << words(reference.error());
    for (std::uint16_t n = 1; n <= 5; ++n) ctx->slave(n).config.setup = &every_ms;
    run();
    (void)cycles(1000);
    EXPECT_LE(cycles(300), 100);
    cable(ring_cables[2], false);
    EXPECT_LE(cycles(2000), 1000);
    EXPECT_EQ(status().second_reference, 3);
    cable(ring_cables[2], true);
    EXPECT_LE(cycles(300), 1000);
    EXPECT_LE(cycles(1000), 100);
}

// Each cable in turn is broken from the start. The clocks of both parts are in sync with each other. When the ring is
// whole, all clocks follow one reference, with the delays of a ring that was whole from the start.
TEST(ClockRingStart, WhileTheRingIsBroken) {
    std::vector<std::uint32_t> whole;
    {
        ClockRingBus bus;
        bus.build(6);
        bus.bring_up();
        for (std::uint16_t n = 1; n <= 8; ++n) whole.push_back(slave_clock(*bus.ctx, n).delay_ns);
    }
    for (std::size_t broken = 0; broken < 7; ++broken) {
        SCOPED_TRACE("ring cable " + std::to_string(broken));
        ClockRingBus bus;
        bus.build(6);
        bus.plug();
        bus.at = bus.segment.order();
        bus.cable(bus.ring_cables[broken], false);
        bus.start();
        const auto reference = bus.clocks();
        ASSERT_TRUE(reference.ok()) << bus.words(reference.error());
        EXPECT_EQ(*reference, 1);
        for (std::uint16_t n = 1; n <= 8; ++n) bus.ctx->slave(n).config.setup = &bus.every_ms;
        bus.run();
        (void)bus.cycles(500);
        EXPECT_LE(bus.cycles(1000), 1000) << "between the parts";
        const bool parted = broken != 0 && broken != 6;
        const std::uint16_t second = bus.status().second_reference;
        // The first slave behind the break. The branch of slave 3 has the numbers 4 and 5.
        const std::uint16_t behind = static_cast<std::uint16_t>(broken < 3 ? broken + 1 : broken + 3);
        EXPECT_EQ(second, broken == 6 ? 0 : behind);
        for (std::uint16_t n = 1; n <= 8; ++n) {
            const std::uint16_t first = parted && n >= behind ? behind : std::uint16_t{1};
            const auto delay = [&](std::uint16_t of) { return slave_clock(*bus.ctx, of).delay_ns; };
            EXPECT_NEAR(static_cast<double>(delay(n) - delay(first)),
                        static_cast<double>(whole[n - 1U] - whole[first - 1U]), 25)
                << "in its part, slave " << n << ": the first slave turns the frames 20 ns faster";
        }
        const std::uint64_t edges = bus.pulses(1);
        const std::uint64_t last_edges = bus.pulses(8);
        const Time begin = bus.osal.now();
        bus.cable(bus.ring_cables[broken], true);
        EXPECT_LE(bus.cycles(1000), 1500) << "no step when the cable heals";
        (void)bus.cycles(2000);
        EXPECT_LE(bus.cycles(500), 100);
        EXPECT_EQ(bus.status().second_reference, 0);
        for (std::uint16_t n = 1; n <= 8; ++n)
            EXPECT_NEAR(static_cast<double>(slave_clock(*bus.ctx, n).delay_ns), static_cast<double>(whole[n - 1U]), 3)
                << "measured anew, slave " << n;
        const auto passed = static_cast<double>((bus.osal.now() - begin) / 1ms);
        EXPECT_NEAR(static_cast<double>(bus.pulses(1) - edges), passed, 2) << "no SYNC0 is missed or doubled";
        EXPECT_NEAR(static_cast<double>(bus.pulses(8) - last_edges), passed, 2);
        // Then the ring breaks at another cable.
        bus.cable(bus.ring_cables[2], false);
        EXPECT_LE(bus.cycles(1500), 1000);
    }
}

TEST(ClockRingStart, WithClocksOf32Bits) {
    ClockRingBus bus;
    for (unsigned n = 0; n < 5; ++n)
        (void)bus.add_to_ring(ClockRingBus::clocked(10'000, n * 77'777, sim::DcUnit::bits32));
    bus.close_ring();
    bus.plug();
    bus.at = bus.segment.order();
    bus.cable(bus.ring_cables[2], false);
    bus.start();
    const auto reference = bus.clocks();
    ASSERT_TRUE(reference.ok()) << bus.words(reference.error());
    bus.run();
    (void)bus.cycles(500);
    EXPECT_LE(bus.cycles(500), 1000);
    bus.cable(bus.ring_cables[2], true);
    (void)bus.cycles(2000);
    EXPECT_LE(bus.cycles(500), 100);
}

// The ring breaks after the scan, and before configdc().
TEST(ClockRingStart, WhenTheRingBreaksBefore) {
    for (const std::size_t broken : {1U, 4U, 5U}) {
        SCOPED_TRACE(broken);
        ClockRingBus bus;
        bus.build(6);
        bus.start();
        bus.at = bus.segment.order();
        bus.cable(bus.ring_cables[broken], false);
        for (unsigned n = 0; n < 5; ++n) (void)readstate(*bus.ctx);
        const auto reference = bus.clocks();
        ASSERT_TRUE(reference.ok()) << bus.words(reference.error());
        bus.run();
        (void)bus.cycles(500);
        EXPECT_LE(bus.cycles(500), 1000);
        bus.cable(bus.ring_cables[broken], true);
        (void)bus.cycles(2000);
        EXPECT_LE(bus.cycles(500), 100);
    }
}

// A slave behind the break has no clock.
TEST(ClockRingStart, WithASlaveWithoutAClock) {
    ClockRingBus bus;
    for (unsigned n = 0; n < 6; ++n) (void)bus.add_to_ring(n == 4 ? RingBus::io_device() : ClockRingBus::nth(n));
    bus.close_ring();
    bus.plug();
    bus.at = bus.segment.order();
    bus.cable(bus.ring_cables[3], false);
    bus.start();
    const auto reference = bus.clocks();
    ASSERT_TRUE(reference.ok()) << bus.words(reference.error());
    bus.run();
    (void)bus.cycles(500);
    EXPECT_LE(bus.cycles(500), 1000);
    EXPECT_EQ(bus.status().second_reference, 4);
    bus.cable(bus.ring_cables[3], true);
    (void)bus.cycles(2000);
    EXPECT_LE(bus.cycles(500), 100);
}

// While the ring is whole, the frames of the first NIC do not reach slaves 6 and 7. They are at branches of slaves 2
// and 4 of the ring.
struct BesideTheRing : ClockRing {
    void build_beside() {
        std::vector<std::uint32_t> ring;
        for (unsigned n = 0; n < 5; ++n) ring.push_back(add_to_ring(nth(n)));
        (void)add_behind(ring[3], 2, nth(50));
        (void)add_behind(ring[1], 2, nth(51));
        close_ring();
        at = {0, 1, 2, 3, 4, 5, 6};
    }
};

TEST_F(BesideTheRing, DelaysAreThoseOfALine) {
    build_beside();
    start();
    const auto reference = clocks();
    ASSERT_TRUE(reference.ok()) << words(reference.error());
    EXPECT_LE(apart_ns(), 100);
    std::vector<std::uint32_t> ring;
    for (std::uint16_t n = 1; n <= 7; ++n) ring.push_back(slave_clock(*ctx, n).delay_ns);
    cable(ring_cables.back(), false);
    for (unsigned n = 0; n < 5; ++n) (void)cycle();
    ASSERT_TRUE(readstate(*ctx).ok());
    const auto line = clocks();
    ASSERT_TRUE(line.ok()) << words(line.error());
    for (std::uint16_t n = 1; n <= 7; ++n)
        EXPECT_NEAR(static_cast<double>(slave_clock(*ctx, n).delay_ns), static_cast<double>(ring[n - 1U]), 2) << n;
}

TEST_F(BesideTheRing, KeepsInStepThroughBreaks) {
    build_beside();
    bring_up();
    EXPECT_EQ(status().second_reference, 6) << "the first that the frames of the second NIC reach";
    EXPECT_LE(cycles(500), 100);
    for (std::size_t n = 0; n < ring_cables.size(); ++n) {
        const std::uint64_t first = pulses(1);
        const std::uint64_t last = pulses(7);
        const Time begin = osal.now();
        cable(ring_cables[n], false);
        EXPECT_LE(cycles(2000), 1000) << "broken at cable " << n;
        EXPECT_LE(cycles(500), 200) << "broken at cable " << n;
        cable(ring_cables[n], true);
        EXPECT_LE(cycles(300), 1000) << "no step when cable " << n << " heals";
        EXPECT_LE(cycles(1000), 100) << "whole again after cable " << n;
        EXPECT_EQ(status().second_reference, 6);
        const auto passed = static_cast<double>((osal.now() - begin) / 1ms);
        EXPECT_NEAR(static_cast<double>(pulses(1) - first), passed, 2) << "no SYNC0 is missed or doubled";
        EXPECT_NEAR(static_cast<double>(pulses(7) - last), passed, 2);
    }
    const auto all = events();
    EXPECT_EQ(std::ranges::count_if(all, [](const std::string& e) { return e.find("out of sync") != e.npos; }), 0)
        << joined(all);
}

// Slaves 6 and 7 are at branches of slaves 2 and 4. Meanwhile a clock of a branch is not the reference, and a constant
// is not measured while the branches are not in step.
TEST_F(BesideTheRing, AreInStepAfterALossOfPowerOfTheReference) {
    for (unsigned n = 0; n < 5; ++n) {
        const std::uint32_t here = add_to_ring(nth(n));
        if (n == 1 || n == 3) (void)add_behind(here, 2, nth(60 + n));
    }
    close_ring();
    at = {0, 1, 3, 4, 6, 2, 5};
    bring_up();
    (void)cycles(2000);
    segment.set_power(at[0], false, osal.now());
    for (unsigned n = 0; n < 1000; ++n) {
        (void)cycle();
        ASSERT_LE(reference_clock(*ctx), 5) << joined(events());
    }
    segment.set_power(at[0], true, osal.now());
    ASSERT_TRUE(until_all_in_op(6000)) << joined(events());
    (void)cycles(7000);
    EXPECT_LE(cycles(300), 200) << joined(events());
    EXPECT_EQ(reference_clock(*ctx), 1);
    for (std::uint16_t n = 1; n <= 7; ++n) EXPECT_TRUE(slave_clock(*ctx, n).in_sync) << n;
}

// The only clock beside the ring is 2 ms away, so one lesson is too short for it. It must not be moved back to its old
// time.
TEST(BesideTheRingFar, ComesBackInStep) {
    for (const unsigned later : {0U, 60U, 240U}) {
        SCOPED_TRACE(later);
        ClockRingBus bus;
        std::vector<std::uint32_t> ring;
        for (unsigned n = 0; n < 3; ++n) ring.push_back(bus.add_to_ring(ClockRingBus::nth(n)));
        (void)bus.add_behind(ring[1], 2, ClockRingBus::nth(50));
        bus.close_ring();
        bus.at = {0, 1, 2, 3};
        bus.bring_up();
        bus.segment.set_power(bus.at[0], false, bus.osal.now());
        (void)bus.cycles(1500);
        bus.segment.set_cable({bus.at[3], 0}, false);
        (void)bus.cycles(500);
        bus.segment.set_power(bus.at[0], true, bus.osal.now());
        (void)bus.cycles(later);
        bus.segment.set_cable({bus.at[3], 0}, true);
        (void)bus.cycles(16'000);
        EXPECT_TRUE(slave_clock(*bus.ctx, 4).in_sync) << bus.joined(bus.events());
        EXPECT_LE(bus.cycles(300), 100) << bus.joined(bus.events());
    }
}

// If this clock were the reference, the other clocks would follow the time that the master has sent.
TEST_F(BesideTheRing, CannotHaveTheReference) {
    build_beside();
    start();
    const auto refused = configdc(*ctx, {.reference = 7, .burst_frames = 200});
    EXPECT_EQ(refused.error().code, Errc::unsupported);
    EXPECT_EQ(refused.error().slave, 7) << words(refused.error());
}

// The event names the place where the ring is open, and Slave::ring the end to which a slave is connected.
TEST_F(BesideTheRing, TheBreakIsNamed) {
    build_beside();
    bring_up();
    cable(ring_cables[2], false);
    (void)cycles(50);
    const auto all = joined(events());
    EXPECT_NE(all.find("between slave 2 port 1 and slave 3"), std::string::npos) << all;
    for (const unsigned slave : {1U, 2U, 7U}) EXPECT_EQ(ctx->slave(slave).ring, RingEnd::first_nic) << slave;
    for (const unsigned slave : {3U, 4U, 5U, 6U}) EXPECT_EQ(ctx->slave(slave).ring, RingEnd::second_nic) << slave;
}

// The slave with the second reference loses its power and comes back. The next clock beside the ring replaces it.
TEST_F(BesideTheRing, AnotherClockTakesOver) {
    build_beside();
    bring_up();
    segment.set_power(at[5], false, osal.now());
    EXPECT_LE(cycles(1500), 1000);
    EXPECT_EQ(status().second_reference, 7);
    segment.set_power(at[5], true, osal.now());
    ASSERT_TRUE(until_all_in_op(6000)) << joined(events());
    (void)cycles(2000);
    EXPECT_EQ(status().second_reference, 6);
    EXPECT_LE(cycles(300), 100) << joined(events());
}

TEST_F(BesideTheRing, WithLostFrames) {
    build_beside();
    bring_up();
    segment.set_noise({.lost = 0.01, .seed = 7});
    for (const std::size_t n : {1U, 3U, 5U}) {
        cable(ring_cables[n], false);
        EXPECT_LE(cycles(1000), 1000) << n;
        cable(ring_cables[n], true);
        EXPECT_LE(cycles(1000), 1000) << n;
    }
    segment.set_noise({});
    ASSERT_TRUE(until_all_in_op(6000)) << joined(events());
    (void)cycles(1500);
    EXPECT_LE(cycles(300), 100);
}

// The second NIC is not connected at the start. The segment is a line until the ring is closed.
TEST_F(BesideTheRing, TheRingIsClosedLater) {
    build_beside();
    plug();
    cable(ring_cables.back(), false);
    start();
    const auto reference = clocks();
    ASSERT_TRUE(reference.ok()) << words(reference.error());
    for (std::uint16_t n = 1; n <= 7; ++n) ctx->slave(n).config.setup = &every_ms;
    run();
    EXPECT_LE(cycles(50), 200) << "the clocks ran by themselves since configdc()";
    EXPECT_LE(cycles(450), 100);
    cable(ring_cables.back(), true);
    EXPECT_LE(cycles(3000), 1000) << joined(events());
    EXPECT_LE(cycles(300), 100);
    EXPECT_EQ(status().second_reference, 6);
    cable(ring_cables[3], false);
    EXPECT_LE(cycles(2000), 1000) << joined(events());
}

// The ring is broken between slaves at the start, and is closed later. A branch in each part is numbered before the
// slaves behind the break.
TEST(BesideTheRingStart, WhileTheRingIsBroken) {
    for (const std::size_t broken : {1U, 2U, 3U, 4U}) {
        SCOPED_TRACE("ring cable " + std::to_string(broken));
        ClockRingBus bus;
        std::vector<std::uint32_t> ring;
        for (unsigned n = 0; n < 5; ++n) ring.push_back(bus.add_to_ring(ClockRingBus::nth(n)));
        (void)bus.add_behind(ring[1], 2, ClockRingBus::nth(50));
        bus.close_ring();
        bus.plug();
        bus.cable(bus.ring_cables[broken], false);
        bus.start();
        ASSERT_EQ(bus.ctx->slaves().size(), 6U);
        bus.at = {0, 1, 2, 3, 4, 5};
        const auto reference = bus.clocks();
        ASSERT_TRUE(reference.ok()) << bus.words(reference.error());
        for (std::uint16_t n = 1; n <= 6; ++n) bus.ctx->slave(n).config.setup = &bus.every_ms;
        const auto mapped = config_map(*bus.ctx, bus.image);
        ASSERT_TRUE(mapped.ok()) << bus.words(mapped.error());
        ASSERT_TRUE(submit(*bus.ctx, bus.supervision).ok());
        (void)bus.cycles(2000);
        EXPECT_LE(bus.cycles(500), 1000) << "between the parts";
        bus.cable(bus.ring_cables[broken], true);
        EXPECT_LE(bus.cycles(3000), 2500) << "the delays were guessed until then";
        EXPECT_LE(bus.cycles(500), 100) << bus.joined(bus.events());
        EXPECT_EQ(bus.ctx->slave(static_cast<std::uint16_t>(broken + 1)).ring_position, 6) << "the branch";
        EXPECT_EQ(bus.status().second_reference, broken + 1);
        bus.cable(bus.ring_cables[1], false);
        EXPECT_LE(bus.cycles(1500), 1000) << bus.joined(bus.events());
    }
}

}  // namespace
}  // namespace margay
