// A clock behind a break that had no power learns the rate of the reference before it becomes the second reference.
// Otherwise it would move at the rate of its own oscillator between two corrections: in these rings by up to 1.8 µs.
#include "redundancy/clock_ring.hpp"

namespace margay {
namespace {

bool are_all_in_sync(ClockRingBus& bus) {
    for (std::uint16_t n = 1; n <= bus.at.size(); ++n)
        if (!slave_clock(*bus.ctx, n).in_sync) return false;
    return true;
}

// The second reference loses its power at any moment of a round of the supervision. Meanwhile the next clock replaces
// it, and the clocks behind the break stay in step.
TEST(ClockRingRate, IsLearnedBeforeAnotherSecondReferenceIsReplaced) {
    for (const unsigned moment : {0U, 1U, 3U, 4U, 7U, 13U, 40U}) {
        SCOPED_TRACE(moment);
        ClockRingBus bus;
        bus.build(6, false);
        bus.bring_up();
        bus.cable(bus.ring_cables[2], false);
        (void)bus.cycles(500 + moment);
        bus.segment.set_power(bus.at[2], false, bus.osal.now());
        EXPECT_EQ(bus.wrong_cycles(1000), 0U);
        bus.segment.set_power(bus.at[2], true, bus.osal.now());
        ASSERT_TRUE(bus.until_all_in_op(6000)) << bus.joined(bus.events());
        EXPECT_LE(bus.cycles(3000), 500) << bus.joined(bus.events());
        EXPECT_EQ(bus.wrong_cycles(300), 0U);
        EXPECT_LE(bus.cycles(300), 200);
        EXPECT_EQ(bus.status().second_reference, 3);
        EXPECT_TRUE(are_all_in_sync(bus)) << bus.joined(bus.events());
        bus.cable(bus.ring_cables[2], true);
        EXPECT_LE(bus.cycles(1000), 200) << "the clock has kept the rate when the ring is whole";
        EXPECT_LE(bus.cycles(300), 100);
    }
}

// All slaves behind the break lose their power. So no second reference brings a time to the first one that is back.
TEST(ClockRingRate, IsLearnedWithoutAnotherSecondReference) {
    for (const unsigned front : {2U, 4U, 5U}) {
        SCOPED_TRACE(front);
        ClockRingBus bus;
        bus.build(6, false);
        bus.bring_up();
        bus.cable(bus.ring_cables[front], false);
        (void)bus.cycles(500);
        for (unsigned n = front; n < 6; ++n) bus.segment.set_power(bus.at[n], false, bus.osal.now());
        (void)bus.cycles(500);
        for (unsigned n = front; n < 6; ++n) bus.segment.set_power(bus.at[n], true, bus.osal.now());
        ASSERT_TRUE(bus.until_all_in_op(8000)) << bus.joined(bus.events());
        EXPECT_EQ(bus.wrong_cycles(4000), 0U);
        EXPECT_LE(bus.cycles(300), 200) << bus.joined(bus.events());
        EXPECT_EQ(bus.status().second_reference, front + 1);
        EXPECT_TRUE(are_all_in_sync(bus)) << bus.joined(bus.events());
        bus.cable(bus.ring_cables[front], true);
        EXPECT_LE(bus.cycles(1000), 300);
        EXPECT_LE(bus.cycles(300), 100);
    }
}

// The master sends wrong times, because it cannot know the moment of the next cycle.
TEST(ClockRingRate, IsLearnedWhileTheCycleVaries) {
    for (const unsigned jitter_ns : {500U, 2000U, 5000U}) {
        SCOPED_TRACE(jitter_ns);
        ClockRingBus bus;
        bus.build(6, false);
        bus.bring_up();
        std::uint32_t random = 12345;
        const auto go = [&](unsigned count) {
            std::int64_t most = 0;
            for (unsigned n = 0; n < count; ++n) {
                random = random * 1664525U + 1013904223U;
                bus.osal.advance(std::chrono::nanoseconds((random >> 8) % jitter_ns));
                most = std::max(most, bus.cycles(1));
            }
            return most;
        };
        bus.cable(bus.ring_cables[2], false);
        (void)go(500);
        bus.segment.set_power(bus.at[2], false, bus.osal.now());
        (void)go(1000);
        bus.segment.set_power(bus.at[2], true, bus.osal.now());
        (void)go(6000);
        ASSERT_TRUE(bus.all_in_op()) << bus.joined(bus.events());
        EXPECT_EQ(bus.status().second_reference, 3);
        EXPECT_LE(go(1000), 200) << bus.joined(bus.events());
        EXPECT_TRUE(are_all_in_sync(bus)) << bus.joined(bus.events());
    }
}

// The number of datagrams of the frame that bring the time of this station to other slaves.
unsigned times_of(std::uint16_t station, std::span<const std::byte> frame) {
    unsigned count = 0;
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next())
        if (d->header.command == wire::Command::FRMW && d->header.address.adp() == station) ++count;
    return count;
}

// The break moves towards the head between two cycles. The copies then pass clocks before the present second reference.
// These clocks would take the time that the master has sent. So the copies soon carry no time of this second reference.
TEST(ClockRingRate, IsKeptWhenTheBreakMovesBeforeTheSecondReference) {
    for (const unsigned moment : {0U, 1U, 3U, 4U, 7U}) {
        SCOPED_TRACE(moment);
        ClockRingBus bus;
        bus.build(6, false);
        bus.bring_up();
        bus.cable(bus.ring_cables[4], false);
        EXPECT_EQ(bus.wrong_cycles(500 + moment), 0U);
        ASSERT_EQ(bus.status().second_reference, 5);
        const std::uint16_t second = bus.ctx->slave(5).station_address.value;
        unsigned copies = 0;
        for (auto& nic : bus.nics)
            nic->sees_frame = [&](std::span<const std::byte> frame) { copies += times_of(second, frame); };
        EXPECT_EQ(bus.wrong_cycles(50), 0U);
        EXPECT_GE(copies, 50U) << "each cycle carries the time";
        copies = 0;
        bus.cable(bus.ring_cables[4], true);
        bus.cable(bus.ring_cables[2], false);
        EXPECT_EQ(bus.wrong_cycles(500), 0U);
        EXPECT_LE(copies, 3U);
        EXPECT_EQ(bus.status().second_reference, 3);
        EXPECT_LE(bus.cycles(300), 100) << bus.joined(bus.events());
        EXPECT_TRUE(are_all_in_sync(bus)) << bus.joined(bus.events());
    }
}

// The cable of the first NIC was broken, so the copies of the second NIC carried the time of the reference. The break
// moves behind the reference: these copies do not reach the reference any more, and would bring the time of the master.
TEST(ClockRingRate, IsKeptWhenTheBreakMovesBehindTheReference) {
    ClockRingBus bus;
    bus.build(6, false);
    bus.bring_up();
    bus.cable(bus.ring_cables[0], false);
    (void)bus.wrong_cycles(1500);
    const std::uint16_t reference = bus.ctx->slave(1).station_address.value;
    unsigned copies = 0;
    bus.nics[1]->sees_frame = [&](std::span<const std::byte> frame) { copies += times_of(reference, frame); };
    EXPECT_EQ(bus.wrong_cycles(50), 0U);
    EXPECT_GE(copies, 50U) << "each cycle carries the time";
    copies = 0;
    bus.cable(bus.ring_cables[0], true);
    bus.cable(bus.ring_cables[2], false);
    (void)bus.wrong_cycles(500);
    EXPECT_LE(copies, 3U);
    EXPECT_LE(bus.cycles(300), 200) << bus.joined(bus.events());
    EXPECT_TRUE(are_all_in_sync(bus)) << bus.joined(bus.events());
}

TEST(ClockRingRate, IsLearnedWithLostFrames) {
    ClockRingBus bus;
    bus.build(6, false);
    bus.bring_up();
    bus.cable(bus.ring_cables[2], false);
    (void)bus.cycles(500);
    bus.segment.set_power(bus.at[2], false, bus.osal.now());
    (void)bus.cycles(500);
    bus.segment.set_noise({.lost = 0.01, .seed = 3});
    bus.segment.set_power(bus.at[2], true, bus.osal.now());
    (void)bus.cycles(6000);
    bus.segment.set_noise({});
    ASSERT_TRUE(bus.until_all_in_op(6000)) << bus.joined(bus.events());
    (void)bus.cycles(1500);
    EXPECT_EQ(bus.status().second_reference, 3);
    EXPECT_LE(bus.cycles(300), 200) << bus.joined(bus.events());
}

// All slaves have lost their power in parts of the ring, so the clocks behind the break run at the rate of the second
// reference, which has kept the rate of its own oscillator: the master compensates it in each round. When the ring is
// whole, the second reference follows the reference, and moves away until it has learned the rate of the reference.
TEST(ClockRingRate, IsNotKnownAtTheRepair) {
    for (const std::int32_t drift : {-24'000, -12'000, 12'000, 24'000}) {
        SCOPED_TRACE(drift);
        ClockRingBus bus;
        for (unsigned n = 0; n < 4; ++n) (void)bus.add_to_ring(ClockRingBus::clocked(n < 2 ? 0 : drift, n * 1000));
        bus.close_ring();
        bus.bring_up();
        const auto power = [&bus](std::initializer_list<unsigned> slaves, bool on) {
            for (const unsigned n : slaves) bus.segment.set_power(bus.at[n], on, bus.osal.now());
        };
        bus.cable(bus.ring_cables[2], false);
        (void)bus.cycles(500);
        power({0, 1}, false);
        (void)bus.cycles(500);
        power({2, 3}, false);
        (void)bus.cycles(500);
        power({2, 3}, true);
        (void)bus.cycles(2000);
        power({0, 1}, true);
        ASSERT_TRUE(bus.until_all_in_op(8000)) << bus.joined(bus.events());
        (void)bus.cycles(4000);
        EXPECT_EQ(bus.status().second_reference, 3);
        EXPECT_TRUE(slave_clock(*bus.ctx, 3).in_sync);
        const auto told = bus.joined(bus.events());
        bus.cable(bus.ring_cables[2], true);
        EXPECT_EQ(bus.wrong_cycles(1000), 0U) << told;
        (void)bus.cycles(2000);
        EXPECT_TRUE(are_all_in_sync(bus)) << bus.joined(bus.events());
    }
}

// Clocks that have learned the rate of the reference stay in sync at a break and at a repair.
TEST(ClockRingRate, IsKnownAtTheRepair) {
    ClockRingBus bus;
    bus.build(6, false);
    bus.bring_up();
    for (unsigned n = 0; n < 12; ++n) {
        bus.cable(bus.ring_cables[1 + n % 5], n % 2 != 0);
        for (unsigned cycles = 0; cycles < 400; ++cycles) {
            (void)bus.cycle();
            ASSERT_TRUE(are_all_in_sync(bus)) << n << ", " << cycles << "\n" << bus.joined(bus.events());
        }
        if (n % 2 == 0) bus.cable(bus.ring_cables[1 + n % 5], true);
        (void)bus.cycles(200);
    }
}

}  // namespace
}  // namespace margay
