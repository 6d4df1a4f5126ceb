// "In sync" in a ring with two NICs, compared with the true time of the simulation: slaves that were away, and a
// reference that comes back. Meanwhile their clocks have run alone, or have started again.
#include "redundancy/clock_ring.hpp"

namespace margay {
namespace {

struct AwayBus : ClockRingBus {
    void prepare(unsigned slaves) {
        if (ring_cables.empty()) build(slaves, false);
        bring_up();
        (void)cycles(5000);
        (void)events();
    }
    bool all_in_sync() {
        for (std::uint16_t s = 1; s <= at.size(); ++s)
            if (!slave_clock(*ctx, s).in_sync) return false;
        return clock_status(*ctx, osal.now()).in_sync;
    }
    // The last two slaves are not connected to a NIC for a while. Then the cable of the second NIC is repaired.
    template <class Meanwhile>
    void come_back_behind_a_break(unsigned slaves, Duration away, Meanwhile meanwhile) {
        prepare(slaves);
        const auto last = static_cast<std::uint16_t>(slaves);
        cable(ring_cables[slaves - 2], false);
        cable(ring_cables[slaves], false);
        for (unsigned n = 0; n < 10; ++n) (void)cycle();
        meanwhile();
        EXPECT_EQ(wrong_cycles(static_cast<unsigned>(away / 1ms)), 0U);
        for (const std::uint16_t s : {static_cast<std::uint16_t>(slaves - 1), last}) {
            segment.set_power(at[s - 1U], true, osal.now());
            EXPECT_FALSE(slave_clock(*ctx, s).in_sync) << s;
        }
        cable(ring_cables[slaves], true);
        EXPECT_EQ(wrong_cycles(500), 0U);
        ASSERT_TRUE(until_all_in_op(10'000)) << joined(events());
        EXPECT_EQ(wrong_cycles(1000), 0U);
        EXPECT_EQ(status().second_reference, slaves - 1);
    }
    // The ring is whole again.
    void come_together(unsigned slaves) {
        cable(ring_cables[slaves - 2], true);
        EXPECT_EQ(wrong_cycles(1000), 0U);
        EXPECT_TRUE(all_in_sync()) << joined(events());
        EXPECT_LE(cycles(300), 100) << joined(events());
    }
    void expect_near(std::uint16_t slave, std::int64_t most_ns) {
        for (unsigned n = 0; n < 1000; ++n) {
            EXPECT_EQ(wrong_cycles(1), 0U);
            ASSERT_LE(std::abs(ahead_ns(slave)), most_ns) << slave << " " << n << "\n" << joined(events());
        }
    }
    std::int32_t drift_of(unsigned n) { return static_cast<std::int32_t>(n * 7919 % 201) * 1000 - 100'000; }
    void warm(unsigned n, std::int32_t by_ppb) { segment.slave(at[n]).set_drift(drift_of(n) + by_ppb, osal.now()); }
};
struct ClockAway : testing::Test, AwayBus {};

// The oscillators become warmer: 20 ppm for half a minute are 0.6 ms. Slave 5 is started again and loses its rate. It
// learns the rate before it becomes the second reference.
TEST_F(ClockAway, OscillatorsThatHaveChanged) {
    come_back_behind_a_break(6, 30s, [this] {
        for (const unsigned n : {4U, 5U}) warm(n, -20'000);
    });
    expect_near(5, 200);
    expect_near(6, 200);
    EXPECT_TRUE(all_in_sync()) << joined(events());
    come_together(6);
}

// The change is too small to start the slaves again.
TEST_F(ClockAway, OscillatorsThatHaveChangedALittle) {
    come_back_behind_a_break(6, 30s, [this] {
        for (const unsigned n : {4U, 5U}) warm(n, 1'000);
    });
    EXPECT_TRUE(all_in_sync()) << joined(events());
    expect_near(5, 200);
    expect_near(6, 200);
    come_together(6);
}

TEST_F(ClockAway, ALossOfPower) {
    come_back_behind_a_break(6, 3s, [this] {
        for (const unsigned n : {4U, 5U}) segment.set_power(at[n], false, osal.now());
    });
    expect_near(5, 200);
    expect_near(6, 200);
    EXPECT_TRUE(all_in_sync()) << joined(events());
    come_together(6);
}

// The oscillators of slaves 5 and 6 differ by 10 ppm from the oscillator of slave 1. The corrections keep their clocks
// within the limit.
TEST_F(ClockAway, ALossOfPowerOfGoodOscillators) {
    for (unsigned n = 0; n < 6; ++n) (void)add_to_ring(clocked(n < 4 ? 0 : 10'000, n * 0x3000'0001ULL));
    close_ring();
    come_back_behind_a_break(6, 3s, [this] {
        for (const unsigned n : {4U, 5U}) segment.set_power(at[n], false, osal.now());
    });
    EXPECT_TRUE(all_in_sync()) << joined(events());
    expect_near(5, 300);
    come_together(6);
}

// The copies for the two references differ by the way through all slaves. This is not a difference of clocks.
TEST_F(ClockAway, BehindABreakOfALongRing) {
    come_back_behind_a_break(24, 3s, [] {});
    EXPECT_TRUE(all_in_sync()) << joined(events());
    expect_near(23, 200);
    expect_near(24, 200);
    come_together(24);
}

// The application wakes up late, by up to 20 µs.
struct LateBus : AwayBus {
    std::uint32_t random = 1;
    void wake_late() {
        random = random * 1'664'525 + 1'013'904'223;
        osal.advance(std::chrono::nanoseconds((random >> 8) % 20'000));
    }
    void late_cycle() {
        wake_late();
        (void)cycle();
    }
    unsigned run(unsigned count) {
        unsigned wrong = 0;
        for (unsigned n = 0; n < count; ++n) {
            wake_late();
            wrong += wrong_cycles(1);
        }
        return wrong;
    }
};

// Slaves with power, among them the slave with the reference clock, are not connected to a NIC for a second. Another
// clock becomes the reference, and the first clock is the reference again when it is back. No clock exceeds its limit.
TEST(ClockAwayRing, TheFirstClockIsTheReferenceAgain) {
    for (const std::array<std::size_t, 2> cut : {std::array<std::size_t, 2>{0, 1}, {0, 4}, {0, 2}}) {
        SCOPED_TRACE(cut[1]);
        LateBus bus;
        bus.prepare(5);
        for (const std::size_t n : cut) bus.cable(bus.ring_cables[n], false);
        EXPECT_EQ(bus.run(1000), 0U);
        EXPECT_EQ(reference_clock(*bus.ctx), cut[1] + 1);
        for (const std::size_t n : cut) bus.cable(bus.ring_cables[n], true);
        EXPECT_EQ(bus.run(1000), 0U);
        EXPECT_EQ(reference_clock(*bus.ctx), 1);
        EXPECT_TRUE(bus.all_in_sync()) << AwayBus::joined(bus.events());
        (void)bus.events();
        EXPECT_EQ(bus.run(5000), 0U);
        EXPECT_TRUE(bus.all_in_sync());
        EXPECT_EQ(AwayBus::joined(bus.events()), "") << "no clock leaves the limit any more";
        EXPECT_LE(bus.cycles(100), 100);
    }
}

// Since its power is back, the first slave has compared its clock with the time that the master sends. The clock runs
// at its limit until it is set.
TEST(ClockAwayRing, TheFirstClockIsTheReferenceAgainAfterALossOfPower) {
    LateBus bus;
    bus.prepare(5);
    bus.segment.set_power(bus.at[0], false, bus.osal.now());
    EXPECT_EQ(bus.run(500), 0U);
    bus.segment.set_power(bus.at[0], true, bus.osal.now());
    EXPECT_EQ(bus.run(3000), 0U);
    EXPECT_EQ(reference_clock(*bus.ctx), 1) << AwayBus::joined(bus.events());
    EXPECT_TRUE(bus.all_in_sync()) << AwayBus::joined(bus.events());
}

// The cables are repaired one after the other. For a while the returned slaves and the reference are in two parts.
TEST(ClockAwayRing, TheFirstClockComesBackBeforeABreak) {
    LateBus bus;
    bus.prepare(5);
    for (const std::size_t n : {0U, 3U}) bus.cable(bus.ring_cables[n], false);
    EXPECT_EQ(bus.run(1000), 0U);
    EXPECT_EQ(reference_clock(*bus.ctx), 4);
    bus.cable(bus.ring_cables[0], true);
    EXPECT_EQ(bus.run(1500), 0U);
    EXPECT_EQ(reference_clock(*bus.ctx), 1) << AwayBus::joined(bus.events());
    EXPECT_EQ(bus.status().second_reference, 4);
    EXPECT_TRUE(bus.all_in_sync()) << AwayBus::joined(bus.events());
    bus.cable(bus.ring_cables[3], true);
    EXPECT_EQ(bus.run(1000), 0U);
    EXPECT_TRUE(bus.all_in_sync()) << AwayBus::joined(bus.events());
    EXPECT_LE(bus.cycles(300), 100);
}

// The first slave is disconnected, one cable after the other. Only the copies of the second NIC carry the time. Without
// a second reference that belongs to the new reference, all clocks would follow the time that the master has sent.
TEST(ClockAwayRing, TheFirstSlaveIsTakenOutByTwoCables) {
    for (const unsigned wait : {1U, 5U, 50U, 500U}) {
        SCOPED_TRACE(wait);
        LateBus bus;
        bus.prepare(5);
        bus.cable(bus.ring_cables[0], false);
        EXPECT_EQ(bus.run(wait), 0U);
        bus.cable(bus.ring_cables[1], false);
        std::int64_t most = 0;
        for (unsigned n = 0; n < 1000; ++n) {
            EXPECT_EQ(bus.run(1), 0U);
            for (std::uint16_t s = 3; s <= 5; ++s) most = std::max(most, std::abs(bus.ahead_ns(s, 2)));
        }
        EXPECT_EQ(reference_clock(*bus.ctx), 2);
        EXPECT_LE(most, 6'000) << "the rate of the new reference begins anew, no clock follows the jitter";
        EXPECT_TRUE(slave_clock(*bus.ctx, 5).in_sync) << AwayBus::joined(bus.events());
        bus.cable(bus.ring_cables[0], true);
        EXPECT_EQ(bus.run(1000), 0U);
        bus.cable(bus.ring_cables[1], true);
        EXPECT_EQ(bus.run(3000), 0U);
        EXPECT_EQ(reference_clock(*bus.ctx), 1);
        EXPECT_TRUE(bus.all_in_sync()) << AwayBus::joined(bus.events());
    }
}

// When the slave is back, its station address is 0. No slave answers as the reference, and no frame was lost.
TEST(ClockAwayRing, AShortLossOfPowerOfTheReference) {
    for (const unsigned away : {1U, 2U, 3U, 5U}) {
        SCOPED_TRACE(away);
        LateBus bus;
        bus.prepare(5);
        bus.segment.set_power(bus.at[0], false, bus.osal.now());
        for (unsigned n = 0; n < away; ++n) bus.late_cycle();
        bus.segment.set_power(bus.at[0], true, bus.osal.now());
        std::int64_t most = 0;
        for (unsigned n = 0; n < 1500; ++n) {
            bus.late_cycle();
            for (std::uint16_t s = 3; s <= 5; ++s) most = std::max(most, std::abs(bus.ahead_ns(s, 2)));
        }
        EXPECT_LE(most, 100) << AwayBus::joined(bus.events());
        EXPECT_EQ(reference_clock(*bus.ctx), 1);
    }
}

// Only the second NIC reaches slaves. A clock that appears before the reference does not change the time of the
// reference, and has become the reference when its slave is back in its state.
TEST(ClockAwayFirst, ReturnsBehindABreakBeforeTheReference) {
    for (std::uint16_t first = 1; first <= 4; ++first) {
        for (const bool power : {true, false}) {
            SCOPED_TRACE("slave " + std::to_string(first) + (power ? " without power" : " cut off"));
            AwayBus bus;
            bus.prepare(6);
            bus.cable(bus.ring_cables[first - 1U], false);
            if (first > 1) bus.cable(bus.ring_cables[0], false);
            EXPECT_EQ(bus.wrong_cycles(2000), 0U);
            EXPECT_EQ(reference_clock(*bus.ctx), first);
            if (power) bus.segment.set_power(first - 1U, false, bus.osal.now());
            if (!power) bus.cable(bus.ring_cables[first], false);
            EXPECT_EQ(bus.wrong_cycles(8000), 0U);
            EXPECT_EQ(reference_clock(*bus.ctx), first + 1);
            const std::int64_t rate = bus.ahead_ns(6, static_cast<std::uint16_t>(first + 1));
            EXPECT_LE(std::abs(rate), AwayBus::kMost_ns);
            if (power) bus.segment.set_power(first - 1U, true, bus.osal.now());
            if (!power) bus.cable(bus.ring_cables[first], true);
            EXPECT_EQ(bus.wrong_cycles(4000), 0U);
            EXPECT_EQ(reference_clock(*bus.ctx), first);
            EXPECT_EQ(bus.status().second_reference, first);
            if (testing::Test::HasFailure()) return;
        }
    }
}

// With clocks beside the ring, the library does not measure the ways of both copies. The first clock returns at the
// other side of a break, so the reference cannot set it. It becomes the reference when the ring is whole.
TEST(ClockAwayFirst, WaitsForTheWholeRingBesideClocks) {
    for (const bool power : {false, true}) {
        SCOPED_TRACE(power);
        AwayBus bus;
        for (unsigned n = 0; n < 6; ++n) (void)bus.add_to_ring(ClockRingBus::nth(n));
        (void)bus.add_behind(1, 2, ClockRingBus::nth(6));
        bus.close_ring();
        bus.later[1] = 7us;
        bus.at = {0, 1, 2, 3, 4, 5, 6};
        bus.prepare(6);
        bus.cable(bus.ring_cables[4], false);
        bus.cable(bus.ring_cables[0], false);
        (void)bus.cycles(2500);
        EXPECT_EQ(reference_clock(*bus.ctx), 5);
        if (power) bus.segment.set_power(0, false, bus.osal.now());
        (void)bus.cycles(10);
        if (power) bus.segment.set_power(0, true, bus.osal.now());
        bus.cable(bus.ring_cables[0], true);
        EXPECT_EQ(bus.wrong_cycles(4000), 0U);
        EXPECT_EQ(reference_clock(*bus.ctx), 5);
        EXPECT_FALSE(slave_clock(*bus.ctx, 1).in_sync);
        EXPECT_FALSE(clock_status(*bus.ctx, bus.osal.now()).in_sync);
        bus.cable(bus.ring_cables[4], true);
        (void)bus.cycles(8000);
        EXPECT_EQ(reference_clock(*bus.ctx), 1);
        EXPECT_EQ(bus.wrong_cycles(1000), 0U);
        EXPECT_TRUE(bus.all_in_sync()) << AwayBus::joined(bus.events());
    }
}

// Slave 1 is back alone, then slaves 2 to 5. The library does not know yet that slave 3 is present, so slave 6 still
// counts as behind the break. Slave 1 does not become the reference, because its way is not measured.
TEST(ClockAwayFirst, WaitsWhileASlaveAnswersThatIsNotKnown) {
    AwayBus bus;
    for (unsigned n = 0; n < 6; ++n) (void)bus.add_to_ring(ClockRingBus::nth(n));
    (void)bus.add_behind(5, 2, ClockRingBus::nth(6));
    bus.close_ring();
    bus.later[1] = 7us;
    bus.at = {0, 1, 2, 3, 4, 5, 6};
    bus.prepare(6);
    bus.cable(bus.ring_cables[5], false);
    bus.cable(bus.ring_cables[0], false);
    (void)bus.cycles(2500);
    EXPECT_EQ(reference_clock(*bus.ctx), 6);
    bus.cable(bus.ring_cables[1], false);
    bus.cable(bus.ring_cables[0], true);
    EXPECT_EQ(bus.wrong_cycles(100), 0U);
    bus.segment.set_power(2, false, bus.osal.now());
    bus.segment.set_power(2, true, bus.osal.now());
    bus.cable(bus.ring_cables[1], true);
    for (unsigned n = 0; n < 4000; ++n) {
        EXPECT_EQ(bus.wrong_cycles(1), 0U);
        ASSERT_EQ(reference_clock(*bus.ctx), 6) << n << "\n" << AwayBus::joined(bus.events());
    }
}

// The difference register contains a mean, which is delayed. A clock that passes the reference shows a small difference
// although it is already far away, and is not in sync.
TEST(ClockAwayRing, AClockThatPassesTheReferenceIsNotInSync) {
    for (const unsigned away : {200U, 300U, 400U}) {
        for (const std::int32_t warmer : {-10'000, 10'000}) {
            SCOPED_TRACE(std::to_string(away) + " cycles, " + std::to_string(warmer) + " ppb");
            AwayBus bus;
            bus.prepare(6);
            bus.cable(bus.ring_cables[3], false);
            bus.cable(bus.ring_cables[6], false);
            EXPECT_EQ(bus.wrong_cycles(10), 0U);
            bus.warm(4, warmer);
            EXPECT_EQ(bus.wrong_cycles(away), 0U);
            bus.cable(bus.ring_cables[3], true);
            EXPECT_EQ(bus.wrong_cycles(1000), 0U);
        }
    }
}

// Slave 1 is not connected to a NIC for a while, and its oscillator becomes warmer. When it is the reference again, the
// other clocks exceed the limit until they follow it.
TEST(ClockAwayFirst, IsNotInStepWhenTheReferenceIsLost) {
    AwayBus bus;
    for (unsigned n = 0; n < 8; ++n) (void)bus.add_to_ring(ClockRingBus::nth(n));
    (void)bus.add_behind(1, 2, ClockRingBus::nth(8));
    bus.close_ring();
    bus.at = {0, 1, 2, 3, 4, 5, 6, 7, 8};
    bus.prepare(8);
    bus.cable(bus.ring_cables[4], false);
    bus.cable(bus.ring_cables[0], false);
    bus.warm(0, 20'000);
    (void)bus.cycles(2500);
    EXPECT_EQ(reference_clock(*bus.ctx), 5);
    bus.cable(bus.ring_cables[0], true);
    EXPECT_EQ(bus.wrong_cycles(1000), 0U);
    EXPECT_TRUE(slave_clock(*bus.ctx, 7).in_sync);
    bus.cable(bus.ring_cables[5], false);
    EXPECT_EQ(bus.wrong_cycles(180), 0U);
    EXPECT_EQ(reference_clock(*bus.ctx), 1);
    bus.cable(bus.ring_cables[5], true);
    bus.cable(bus.ring_cables[4], true);
    EXPECT_EQ(bus.wrong_cycles(1000), 0U);
}

// Slave 1 hangs at no NIC for a while, and its oscillator gets warmer. When it is the reference again, it leads the
// other clocks out of the limit until they have followed it.
TEST_F(ClockAway, AReferenceThatComesBackWithAnotherRate) {
    prepare(6);
    cable(ring_cables[1], false);
    segment.set_master_cable(0, false);
    EXPECT_EQ(wrong_cycles(500), 0U);
    EXPECT_EQ(reference_clock(*ctx), 2);
    warm(0, 80'000);
    EXPECT_EQ(wrong_cycles(500), 0U);
    segment.set_master_cable(0, true);
    EXPECT_EQ(wrong_cycles(20), 0U);
    cable(ring_cables[1], true);
    EXPECT_EQ(wrong_cycles(3000), 0U);
    EXPECT_EQ(reference_clock(*ctx), 1);
    EXPECT_TRUE(all_in_sync()) << joined(events());
}

}  // namespace
}  // namespace margay
