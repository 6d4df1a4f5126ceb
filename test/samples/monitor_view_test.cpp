// The lines of segment_monitor.
#include "common/monitor_view.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace margay::samples {
namespace {

using namespace std::chrono_literals;

struct MonitorView : testing::Test {
    std::vector<Slave> slaves = std::vector<Slave>(20);
    std::vector<LineErrors> line_errors = std::vector<LineErrors>(20);
    MonitorModel model;

    void SetUp() override {
        for (std::size_t i = 0; i < slaves.size(); ++i) {
            slaves[i].number = static_cast<std::uint16_t>(i + 1);
            slaves[i].al.state = AlState::op;
        }
        slaves[3].al = {.state = AlState::safeop, .error = true, .code = 0x001B};
        slaves[7].al.state = AlState::none;
        line_errors[2].ports[1] = {.invalid_frames = 3, .rx_errors = 2, .forwarded = 7, .lost_links = 1};
        model.source = "eth0";
        model.slaves = slaves;
        model.line_errors = line_errors;
        model.expected_wkc = 60;
        model.last = 60U;
        model.figures.cycles = 1234;
        for (int n = 0; n < 9; ++n) model.events.push_back("event " + std::to_string(n));
    }
    [[nodiscard]] static bool holds(const std::vector<std::string>& lines, std::string_view text) {
        return std::any_of(lines.begin(), lines.end(),
                           [&](const std::string& line) { return line.find(text) != std::string::npos; });
    }
};

TEST_F(MonitorView, TellsStatesCountersAndErrors) {
    const auto lines = monitor_lines(model, 120, 40, 0);
    ASSERT_EQ(lines.size(), 40U);
    EXPECT_EQ(lines[0], "eth0   20 slaves:  18 in OP  1 in SAFEOP  1 lost  1 with an error");
    EXPECT_EQ(lines[1], "cycle 1234  working counter 60 of 60  wrong wkc 0  incomplete 0  overruns 0");
    EXPECT_TRUE(holds(lines, "    8  lost"));
    EXPECT_TRUE(holds(lines, "port 1: 5 damaged, 7 forwarded, 1 lost links"));
    EXPECT_EQ(lines.back(), "event 8");
    EXPECT_EQ(lines[34], "event 3") << "the newest six";
}

TEST_F(MonitorView, SaysWhatTheLastCycleLacked) {
    model.last = Error{.code = Errc::working_counter, .expected = 60, .actual = 57};
    EXPECT_TRUE(holds(monitor_lines(model, 120, 40, 0), "working counter 57 of 60"));
    model.last = Error{.code = Errc::no_frame};
    EXPECT_TRUE(holds(monitor_lines(model, 120, 40, 0), "working counter - of 60"));
}

TEST_F(MonitorView, FitsAnyScreenAndScrolls) {
    for (std::size_t height = 0; height < 50; ++height)
        for (const std::size_t width : {0U, 1U, 10U, 80U}) {
            const auto lines = monitor_lines(model, width, height, 0);
            ASSERT_EQ(lines.size(), height);
            for (const auto& line : lines) EXPECT_LE(line.size(), width + 1) << "µ has two octets";
        }
    const auto down = monitor_lines(model, 80, 20, 1000);
    EXPECT_TRUE(holds(down, "   20  OP")) << "the last slave stays in sight";
    EXPECT_FALSE(holds(down, "    1  OP"));
    model.slaves = {};
    EXPECT_EQ(monitor_lines(model, 80, 24, 3).size(), 24U);
}

TEST_F(MonitorView, ACableWithTwoEndsIsReportedOnce) {
    CableReports cables(50ms);
    const auto lost = [&](Duration at, std::uint16_t slave, std::uint16_t other, std::uint32_t times) {
        return cables.repeats(
            {.at = Time(at), .kind = EventKind::link_lost, .port = 1, .slave = slave, .other = other, .actual = times});
    };
    EXPECT_FALSE(lost(100ms, 7, 8, 1));
    EXPECT_TRUE(lost(100ms, 7, 8, 1)) << "the other end";
    EXPECT_FALSE(lost(101ms, 7, 8, 1)) << "both ends have reported: interrupted again";
    EXPECT_FALSE(lost(200ms, 7, 8, 1)) << "too late for the other end";
    EXPECT_FALSE(lost(201ms, 7, 8, 2)) << "another number of interruptions";
    EXPECT_FALSE(lost(300ms, 3, 0, 1));
    EXPECT_FALSE(lost(300ms, 3, 0, 1)) << "a port without a slave behind it has one end";
    EXPECT_FALSE(lost(300ms, 2, 3, 1)) << "another cable";
    EXPECT_FALSE(cables.repeats(
        {.at = Time(300ms), .kind = EventKind::line_errors, .port = 1, .slave = 2, .other = 3, .actual = 1}))
        << "damaged frames are counted in the direction in which they went";
}

TEST_F(MonitorView, SparkLineIsHighestWhereMostCame) {
    DurationHistogram histogram;
    for (int n = 0; n < 1000; ++n) histogram.record(3us);
    histogram.record(1ms);
    histogram.record(std::chrono::seconds(2));
    const auto line = spark_line(histogram);
    EXPECT_EQ(line.size(), 18U) << "the doublings from 64 ns to 16 ms";
    EXPECT_EQ(line[5], '#') << "2 to 4 µs: " << line;
    EXPECT_NE(line[13], ' ') << "half a ms to one: " << line;
    EXPECT_NE(line[17], ' ') << "all that is longer: " << line;
    EXPECT_EQ(line[0], ' ');
    EXPECT_EQ(spark_line({}), std::string(18, ' '));
}

}  // namespace
}  // namespace margay::samples
