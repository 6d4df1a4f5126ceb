// The figures of cycles in a file: the values that are read equal the written values, and contradictory values are
// refused.
#include "common/cycle_log_file.hpp"

#include <gtest/gtest.h>

namespace margay::samples {
namespace {

using namespace std::chrono_literals;

CycleFigures some_figures() {
    CycleFigures f;
    f.cycles = 1000;
    f.overruns = 3;
    f.skipped = 2;
    f.caught_up = 1;
    f.no_frame = 4;
    f.wrong_wkc = 5;
    for (int n = 0; n < 1000; ++n) {
        f.lateness.record(Duration(n * n));
        f.period.record(1ms + Duration(n));
        f.round_trip.record(n == 7 ? Duration(2h) : Duration(100us));  // longer than the last bucket begins
    }
    f.sent.record(0ns);
    return f;
}
CycleFigures with_frame_times() {
    CycleFigures f = some_figures();
    f.missed = 6;
    f.wire.unstamped = 7;
    for (int n = 0; n < 10; ++n) {
        f.wire.period.record(1ms + Duration(n));
        f.wire.round_trip.record(40us + Duration(n));
    }
    return f;
}

TEST(CycleLog, WhatIsReadIsWhatWasWritten) {
    for (const CycleFigures& figures : {some_figures(), with_frame_times(), CycleFigures{}}) {
        const auto log = parse_cycle_log(cycle_json(figures));
        ASSERT_EQ(log.fault, "");
        EXPECT_EQ(cycle_json(log.figures), cycle_json(figures));
        EXPECT_EQ(cycle_svg(log.figures), cycle_svg(figures));
    }
}

std::string fault_of(std::string from, std::string to) {
    std::string text = cycle_json(some_figures());
    const auto at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return parse_cycle_log(text.replace(at, from.size(), to)).fault;
}

TEST(CycleLog, WhatIsNoLogIsSaid) {
    const std::string none = "the file has no JSON object: figures of cycles are written by --histogram FILE.json";
    EXPECT_EQ(parse_cycle_log("").fault, none);
    EXPECT_EQ(parse_cycle_log("<svg/>").fault, none);
    EXPECT_EQ(parse_cycle_log(" {\"cycles\": 3,").fault,
              "the file has an error in its JSON object, or its end is missing");
    EXPECT_EQ(parse_cycle_log("[1]").fault, none);
    EXPECT_EQ(parse_cycle_log("{}").fault, "\"cycles\" is missing");
    EXPECT_EQ(fault_of("\"overruns\": 3", "\"overruns\": -3"), "\"overruns\" is no whole number of 0 or above");
    EXPECT_EQ(fault_of("\"overruns\": 3", "\"overruns\": \"3\""), "\"overruns\" is no whole number of 0 or above");
    EXPECT_EQ(fault_of("\"overruns\": 3", "\"overruns\": 18446744073709551615"),
              "\"overruns\" is no whole number of 0 or above");
    EXPECT_EQ(fault_of("lateness_ns", "late_ns"), "\"lateness_ns\" has no buckets");
    const std::string wrong = "\"lateness_ns\": its buckets, count and times contradict each other";
    EXPECT_EQ(fault_of("\"count\": 1000", "\"count\": 999"), wrong);
    EXPECT_EQ(fault_of("\"min\": 0", "\"min\": 1"), wrong) << "the first bucket has 0 alone";
    EXPECT_EQ(fault_of("\"from\": 1,", "\"from\": 0,"), wrong) << "no bucket";
    EXPECT_EQ(fault_of("\"max\": 998001", "\"max\": 99800100"), wrong) << "beyond the last bucket";
}

}  // namespace
}  // namespace margay::samples
