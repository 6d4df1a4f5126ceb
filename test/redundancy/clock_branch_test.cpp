// "In sync" in a ring with branches, against the simulation's true time: cables and slaves that fail and come back, in
// sequences that random faults have found.
#include "redundancy/clock_ring.hpp"

namespace margay {
namespace {

struct ClockBranch : testing::Test, ClockRingBus {
    // The limit of ClockSettings, the rounding of the register, and the drift of a clock until it is read.
    static constexpr std::int64_t kMost_ns = 400;
    // The number of cycles until the library knows an event.
    static constexpr unsigned kUntilItIsKnown = 60;

    std::vector<std::uint32_t> ring;
    std::uint32_t late_us = 0;
    std::uint32_t random = 1;
    std::vector<unsigned> wrong;  // cycles in succession, by slave number

    void add_ring(unsigned slaves) {
        for (unsigned n = 0; n < slaves; ++n) ring.push_back(add_to_ring(nth(n)));
    }
    // Adds slaves behind a slave of the ring (the first slave is 1). Port 2 comes after the way to the next ring slave,
    // port 3 before it.
    void add_branch(unsigned behind, std::uint8_t port, unsigned slaves = 1) {
        std::uint32_t at_slave = add_behind(ring[behind - 1U], port, nth(50 + behind));
        for (unsigned n = 1; n < slaves; ++n) at_slave = add_behind(at_slave, 1, nth(60 + n));
    }
    void bring_up_ring() {
        close_ring();
        start();
        at.assign(segment.size(), 0);  // by the station addresses that the scan has written
        for (std::uint32_t n = 0; n < segment.size(); ++n) {
            std::array<std::byte, 2> address{};
            segment.slave(n).read(wire::reg::kStationAddress.address, address);
            for (const Slave& slave : ctx->slaves())
                if (slave.station_address.value == load_le<std::uint16_t>(address, 0)) at[slave.number - 1U] = n;
        }
        wrong.assign(segment.size() + 1, 0);
        bring_up();
        go(3000);
    }
    // Executes cycles while the application wakes up late. No clock is wrong for longer than the library needs to know
    // an event.
    void go(unsigned count) {
        for (unsigned n = 0; n < count; ++n) {
            random = random * 1'664'525 + 1'013'904'223;
            if (late_us != 0) osal.advance(std::chrono::nanoseconds((random >> 8) % (late_us * 1000)));
            (void)cycle();
            const std::uint16_t reference = reference_clock(*ctx);
            for (std::uint16_t s = 1; s <= at.size(); ++s) {
                const bool powered = segment.powered(at[s - 1U]) && segment.powered(at[reference - 1U]);
                const bool is_wrong =
                    powered && slave_clock(*ctx, s).in_sync && std::abs(ahead_ns(s, reference)) > kMost_ns;
                wrong[s] = is_wrong ? wrong[s] + 1 : 0;
                ASSERT_LE(wrong[s], kUntilItIsKnown) << "slave " << s << " is in sync and " << ahead_ns(s, reference)
                                                     << " ns ahead of slave " << reference << ", cycle " << n;
            }
        }
    }
    void cut(std::size_t ring_cable, unsigned then) {
        cable(ring_cables[ring_cable], false);
        go(then);
    }
    void mend(std::size_t ring_cable, unsigned then) {
        cable(ring_cables[ring_cable], true);
        go(then);
    }
    void power(std::uint16_t slave, bool on, unsigned then) {
        segment.set_power(at[slave - 1U], on, osal.now());
        go(then);
    }
    void expect_all_in_step() {
        for (std::uint16_t s = 1; s <= at.size(); ++s) {
            EXPECT_TRUE(slave_clock(*ctx, s).in_sync) << s;
            EXPECT_LE(std::abs(ahead_ns(s)), 200) << s;
        }
        EXPECT_EQ(reference_clock(*ctx), 1);
    }
};

// The clock beside the ring has followed the time of the master for a moment, and gets a lesson when the ring is whole.
// Comparisons from before the break are not used for a constant.
TEST_F(ClockBranch, ABreakOfAMoment) {
    add_ring(6);
    add_branch(2, 2);
    late_us = 100;
    bring_up_ring();
    for (const std::size_t n : {3U, 1U, 4U, 3U}) {
        cut(n, 30);
        mend(n, 2500);
        expect_all_in_step();
    }
}

// Slaves 3 and 4 are lost while the delays for the broken ring are written, and come back in the whole ring.
TEST_F(ClockBranch, ASlaveThatWasAwayHasTheDelayOfTheWholeRing) {
    add_ring(4);
    add_branch(4, 2, 2);
    bring_up_ring();
    cut(2, 10);
    cut(1, 3);
    power(4, false, 1);
    mend(1, 450);
    mend(2, 728);
    power(4, true, 6000);
    expect_all_in_step();
}

// Slave 7 at a branch of slave 6 comes back during a lesson for slave 8, which is beside the ring. The delays of the
// lesson do not belong to its way any more.
TEST_F(ClockBranch, ASlaveThatComesBackDuringALesson) {
    add_ring(6);
    add_branch(3, 2, 2);
    add_branch(6, 3);
    bring_up_ring();
    cut(6, 10);
    power(2, false, 1);
    power(7, false, 3);
    mend(6, 133);
    power(2, true, 199);
    power(7, true, 8000);
    expect_all_in_step();
}

// The frames to slaves 2 and 3 pass the branch of slave 1 until it is lost. Then their delays are measured again.
TEST_F(ClockBranch, ABranchThatIsLost) {
    add_ring(3);
    add_branch(1, 3, 2);
    bring_up_ring();
    cable(branch_cables[0], false);
    go(2000);
    for (const std::uint16_t s : std::initializer_list<std::uint16_t>{1, 4, 5}) {
        EXPECT_TRUE(slave_clock(*ctx, s).in_sync) << s;
        EXPECT_LE(std::abs(ahead_ns(s)), 100) << s;
    }
    cable(branch_cables[0], true);
    go(3000);
    expect_all_in_step();
}

// Behind a break, the frames pass both branches before the ring slaves. The branch of slave 5 is lost when the ring
// breaks. Then the way from the second reference, at the branch of slave 8, is shorter.
TEST_F(ClockBranch, ABranchThatIsLostBesideABreak) {
    add_ring(8);
    add_branch(5, 2, 2);
    add_branch(8, 2);
    bring_up_ring();
    cable(branch_cables[0], false);
    go(27);
    cut(4, 2000);
    mend(4, 3000);
    cable(branch_cables[0], true);
    go(8000);
    expect_all_in_step();
}

// The delays are measured again while slave 5 is the reference and slaves 1 and 2, which were away, are before it.
TEST_F(ClockBranch, DelaysOfClocksBeforeTheReference) {
    add_ring(6);
    late_us = 20;
    bring_up_ring();
    cut(0, 1000);
    power(3, false, 30);
    cut(4, 300);
    mend(0, 400);
    mend(4, 645);
    power(3, true, 8000);
    expect_all_in_step();
}

// Each measurement opens the ring. The second reference keeps its rate, and the branch takes part in every cycle.
TEST_F(ClockBranch, DelaysThatAreMeasuredAgainAndAgain) {
    add_ring(5);
    add_branch(3, 2, 2);
    clock_settings.delay_interval = 100ms;
    bring_up_ring();
    EXPECT_NE(status().second_reference, 0);
    EXPECT_EQ(stale_cycles(1000), 0U);
    go(4000);
    expect_all_in_step();
}

// The frames of the head bring the time to the clocks beside the ring. For this the ring is opened and closed.
TEST_F(ClockBranch, NoCycleIsStaleWhenClocksAreTaught) {
    add_ring(6);
    add_branch(2, 2, 2);
    late_us = 100;
    bring_up_ring();
    for (const std::size_t n : {3U, 1U, 4U, 3U}) {
        cut(n, 30);
        mend(n, 30);
        EXPECT_EQ(stale_cycles(2500), 0U) << n;
    }
    expect_all_in_step();
}

// Faults in a ring without branches, some ten milliseconds apart.
TEST_F(ClockBranch, FaultsBeforeTheClocksAreCompared) {
    add_ring(5);
    bring_up_ring();
    cut(1, 3);
    power(4, false, 30);
    cut(0, 1);
    cut(2, 30);
    mend(0, 1077);
    mend(1, 507);
    mend(2, 379);
    power(4, true, 5000);
    expect_all_in_step();
}

// The copy of the first NIC reaches the branch at port 3 in the whole ring. While the delays are measured after a
// repair, this NIC does not accept some frames. The clock of the branch still follows the reference clock.
TEST_F(ClockBranch, ANicThatDoesNotAcceptSomeFramesAfterARepair) {
    add_ring(3);
    add_branch(3, 3);
    bring_up_ring();
    for (const SendStatus refusal : {SendStatus::busy, SendStatus::failed})
        for (unsigned each = 2; each < 8; ++each) {
            SCOPED_TRACE("one frame of " + std::to_string(each));
            cut(3, 500);
            power(4, false, 500);
            power(4, true, 2000);
            nics[0]->refusal = refusal;
            cable(ring_cables[3], true);
            for (unsigned n = 0; n < 2500; ++n) {
                if (n % each == 0) nics[0]->refused = refusal == SendStatus::busy ? 2 : 1;
                go(1);
                ASSERT_EQ(status().second_reference, 0) << n;
            }
            go(3000);
            expect_all_in_step();
        }
}

// Each break and each repair has counted the error of the clock at that moment as a difference of the ways. These
// errors added up, and the clock was reported in sync. Now the clock has another rate and is corrected every 10 ms.
TEST_F(ClockBranch, ErrorsOfBreaksAndRepairsDoNotAddUp) {
    add_ring(6);
    add_branch(4, 2);
    bring_up_ring();
    segment.slave(at[6]).set_drift(15'000, osal.now());  // before: -1 ppm
    go(5000);
    expect_all_in_step();
    for (unsigned n = 0; n < 40; ++n) {
        cut(2, 150);
        mend(2, 250);
        go(1500);
        SCOPED_TRACE(n);
        EXPECT_TRUE(slave_clock(*ctx, 7).in_sync);
        for (unsigned c = 0; c < 20; ++c) {
            go(1);
            EXPECT_LE(std::abs(ahead_ns(7)), 120);
        }
    }
    expect_all_in_step();
}

}  // namespace
}  // namespace margay
