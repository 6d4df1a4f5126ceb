// Breaks and losses of power at given cycles, after which clocks come back before the reference. Each cycle compares
// "in sync" with the true time.
#include "redundancy/clock_ring.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace margay {
namespace {

struct Branch {
    std::uint32_t at;   // place in the segment of the slave before this slave
    std::uint8_t port;  // of this slave
};
enum class Part : std::uint8_t { ring_cable, branch_cable, power };
struct Act {
    unsigned cycles;  // since the act before
    Part part;
    std::size_t number;  // of the cable, or place of the slave in the segment
    bool on;
};

struct TimetableBus : ClockRingBus {
    TimetableBus(unsigned ring, const std::vector<Branch>& branches, std::chrono::microseconds first,
                 std::chrono::microseconds second) {
        for (unsigned n = 0; n < ring; ++n) (void)add_to_ring(numbered());
        for (const Branch& branch : branches) (void)add_behind(branch.at, branch.port, numbered());
        close_ring();
        later[0] = first;
        later[1] = second;
        start();
        for (std::uint16_t n = 1; n <= segment.size(); ++n)
            for (std::uint32_t place = 0; place < segment.size(); ++place)
                if (segment.slave(place).station() == ctx->slave(n).station_address.value) at.push_back(place);
        numbers.assign(at.size(), 0);
        for (std::uint16_t n = 0; n < at.size(); ++n) numbers[at[n]] = static_cast<std::uint16_t>(n + 1);
        EXPECT_TRUE(clocks().ok());
        run();
        (void)cycles(2000);
    }
    sim::Device numbered() {
        const auto n = static_cast<unsigned>(segment.size());
        auto made = nth(n);
        made.sii[0x1C] = static_cast<std::byte>(n + 1);  // the serial number
        return made;
    }
    // Cycles in succession in which a present clock was reported as in sync, but was not in sync.
    unsigned most_wrong = 0;
    void judged_cycle() {
        (void)cycle();
        const std::uint16_t reference = reference_clock(*ctx);
        bool is_wrong = false;
        for (std::uint16_t s = 1; s <= at.size(); ++s)
            is_wrong |= ctx->slave(reference).al.state != AlState::none && ctx->slave(s).al.state != AlState::none &&
                        segment.powered(at[s - 1U]) && slave_clock(*ctx, s).in_sync &&
                        std::abs(ahead_ns(s, reference)) > kMost_ns;
        wrong_ = is_wrong ? wrong_ + 1 : 0;
        most_wrong = std::max(most_wrong, wrong_);
    }
    void judged_cycles(unsigned count) {
        while (count-- > 0) judged_cycle();
    }
    void follow(const std::vector<Act>& acts) {
        for (const Act& act : acts) {
            judged_cycles(act.cycles);
            if (act.part == Part::power)
                segment.set_power(static_cast<std::uint32_t>(act.number), act.on, osal.now());
            else
                cable((act.part == Part::ring_cable ? ring_cables : branch_cables)[act.number], act.on);
        }
        judged_cycles(8000);
        EXPECT_LE(most_wrong, 2U);
        EXPECT_EQ(reference_clock(*ctx), 1);
        EXPECT_LE(cycles(300), 150) << joined(events());
        for (std::uint16_t s = 1; s <= at.size(); ++s) EXPECT_TRUE(slave_clock(*ctx, s).in_sync) << s;
    }

  private:
    unsigned wrong_ = 0;
};

// The first clock has followed the time of the master, so it becomes the reference with the rate of its oscillator. The
// clocks that follow it are not in sync until they have learned this rate.
TEST(ClockTimetable, TheReferenceHasAnotherRate) {
    TimetableBus bus(8, {{1, 3}, {8, 1}, {1, 2}, {3, 2}, {11, 1}, {4, 3}, {13, 1}, {4, 2}, {15, 1}, {7, 3}, {17, 1}},
                     std::chrono::microseconds(0), std::chrono::microseconds(7));
    bus.follow({{0, Part::branch_cable, 1, false},
                {2086, Part::power, 4, false},
                {1203, Part::ring_cable, 0, false},
                {855, Part::ring_cable, 6, false},
                {670, Part::branch_cable, 2, false},
                {1384, Part::ring_cable, 6, true},
                {99, Part::ring_cable, 7, false},
                {1072, Part::ring_cable, 0, true},
                {40, Part::ring_cable, 7, true},
                {26, Part::power, 4, true},
                {19, Part::branch_cable, 1, true},
                {0, Part::branch_cable, 2, true}});
}

// While the delays are measured, a slave answers that was not found yet. The frames pass its branch, too.
TEST(ClockTimetable, ABranchIsBackBeforeItIsFound) {
    TimetableBus bus(7, {{1, 2}, {3, 2}, {8, 1}}, std::chrono::microseconds(2), std::chrono::microseconds(0));
    bus.follow({{0, Part::power, 0, false},
                {1422, Part::ring_cable, 2, false},
                {104, Part::ring_cable, 3, false},
                {148, Part::power, 6, false},
                {76, Part::ring_cable, 1, false},
                {94, Part::branch_cable, 0, false},
                {101, Part::ring_cable, 3, true},
                {116, Part::ring_cable, 1, true},
                {42, Part::ring_cable, 2, true},
                {55, Part::power, 0, true},
                {27, Part::power, 6, true},
                {19, Part::branch_cable, 0, true}});
}

// The rate of the first clock differs by more than 60 ppm from that of the reference.
TEST(ClockTimetable, TheFirstClockRunsAwayFromTheReference) {
    TimetableBus bus(4, {{0, 3}, {2, 3}}, std::chrono::microseconds(0), std::chrono::microseconds(13));
    bus.follow({{0, Part::power, 2, false},
                {44, Part::power, 5, false},
                {457, Part::power, 2, true},
                {58, Part::ring_cable, 0, false},
                {1060, Part::ring_cable, 1, false},
                {1455, Part::ring_cable, 1, true},
                {97, Part::ring_cable, 1, false},
                {462, Part::ring_cable, 0, true},
                {43, Part::ring_cable, 1, true},
                {52, Part::power, 5, true}});
}

}  // namespace
}  // namespace margay
