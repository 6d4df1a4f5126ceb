// The log of the master's clock, read by dc_plot.
#include "common/clock_log_file.hpp"

#include <margay/master_clock.hpp>

#include <gtest/gtest.h>

#include <array>

namespace margay::samples {
namespace {

std::string log_of(std::initializer_list<ClockRecord> records) {
    std::array<char, 400> head{};
    std::string text(write_clock_log_head(head));
    for (const ClockRecord& record : records) {
        std::array<char, 300> line{};
        text += write_clock_log(record, line);
    }
    return text;
}

TEST(ClockLogFile, ReadsWhatTheLibraryWrites) {
    using namespace std::chrono_literals;
    const auto log =
        parse_clock_log(log_of({{.at = Time{1s},
                                 .bus_time_off_ns = 700'000,
                                 .error_ns = -1234,
                                 .drift_ppb = 80'500,
                                 .cycle_ns = 1'000'000,
                                 .difference_ns = 15},
                                {.at = Time{1001ms}, .error_ns = 7, .drift_ppb = -1, .difference_ns = 31}}));
    EXPECT_EQ(log.fault, "");
    ASSERT_EQ(log.times_s.size(), 2U);
    EXPECT_EQ(log.times_s[0], 0);
    EXPECT_NEAR(log.times_s[1], 0.001, 1e-9);
    EXPECT_EQ(log.offset_ns[0], 700'000);
    EXPECT_EQ(log.error_ns[0], -1234);
    EXPECT_EQ(log.drift_ppm[0], 80.5);
    EXPECT_EQ(log.drift_ppm[1], -0.001);
    EXPECT_EQ(log.difference_ns[1], 31);
    const auto diagrams = clock_diagrams(log);
    ASSERT_EQ(diagrams.size(), 4U);
    EXPECT_EQ(diagrams[2].curves[0].values, log.error_ns);
}

TEST(ClockLogFile, TakesTheColumnsByNameWithAnySeparator) {
    const auto log = parse_clock_log(
        "Drift [ppm];CtlErr [ns];Time[ms];BusTimeOff;SystemTimeDifference [ns]\r\n"
        "1.5; -20 ;1000;5;7\r\n");
    EXPECT_EQ(log.fault, "");
    ASSERT_EQ(log.error_ns.size(), 1U);
    EXPECT_EQ(log.error_ns[0], -20);
    EXPECT_EQ(log.drift_ppm[0], 1.5);
}

TEST(ClockLogFile, SaysWhyATextIsNoLog) {
    EXPECT_EQ(parse_clock_log("").fault, "the first line has no column Time");
    EXPECT_EQ(parse_clock_log("Time,Drift\n").fault, "the first line has no column BusTimeOff");
    EXPECT_EQ(parse_clock_log(log_of({})).fault, "it has no lines");
    EXPECT_EQ(parse_clock_log(log_of({}) + "1,2,x\n").fault, "line 2: BusTimeOff is no number");
    const std::string head = "Time;BusTimeOff;Drift;CtlErr;SystemTimeDifference\n";
    EXPECT_EQ(parse_clock_log(head + "1;2;3;nan;5\n").fault, "line 2: CtlErr is no number");
    EXPECT_EQ(parse_clock_log(head + "1;2;inf;4;5\n").fault, "line 2: Drift is no number");
    EXPECT_EQ(parse_clock_log(head + "0,305;2;3;4;5\n").fault, "line 2 has 6 cells, and the first line 5");
    EXPECT_EQ(parse_clock_log(head + "2;2;3;4;5\n1;2;3;4;5\n").fault,
              "line 3: the time is before that of the line before");
    EXPECT_FALSE(parse_clock_log(head + "1;2;3;4;5\n").tells_sync);
}

// Lines before the first line in sync belong to the start.
TEST(ClockLogFile, TellsWhenTheClocksLostTheirSync) {
    const auto line = [](int ms, PhaseState state, bool clocks) {
        return ClockRecord{.at = Time{std::chrono::milliseconds(ms)}, .state = state, .clocks_in_sync = clocks};
    };
    const auto kept = parse_clock_log(log_of({line(1, PhaseState::busy, true), line(2, PhaseState::in_sync, true)}));
    EXPECT_TRUE(kept.tells_sync);
    EXPECT_EQ(kept.first_in_sync, 3U);
    EXPECT_EQ(kept.out_of_sync, 0U);
    const auto lost = parse_clock_log(log_of({line(1, PhaseState::in_sync, true), line(2, PhaseState::in_sync, false),
                                              line(3, PhaseState::error_too_large, true)}));
    EXPECT_EQ(lost.fault, "");
    EXPECT_EQ(lost.first_in_sync, 2U);
    EXPECT_EQ(lost.out_of_sync, 2U);
    EXPECT_EQ(lost.first_out, 3U);
    const auto never = parse_clock_log(log_of({line(1, PhaseState::busy, false)}));
    EXPECT_TRUE(never.tells_sync);
    EXPECT_EQ(never.first_in_sync, 0U);
}

}  // namespace
}  // namespace margay::samples
