// Figures of a run as text and as SVG.
#include "common/cycle_report.hpp"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <fstream>

namespace margay::samples {
namespace {

using namespace std::chrono_literals;

CycleFigures some() {
    CycleFigures figures;
    for (int n = 0; n < 1000; ++n) {
        figures.lateness.record(Duration(1000 + n));
        figures.round_trip.record(std::chrono::microseconds(80 + n % 20));
    }
    figures.lateness.record(3ms);
    figures.cycles = 1001;
    figures.overruns = 2;
    figures.skipped = 5;
    figures.caught_up = 7;
    figures.no_frame = 3;
    figures.wrong_wkc = 4;
    return figures;
}

std::size_t count_of(const std::string& in, const std::string& what) {
    std::size_t count = 0;
    for (auto at = in.find(what); at != std::string::npos; at = in.find(what, at + 1)) ++count;
    return count;
}

TEST(CycleReport, TextTellsWhatWentWrongAndHowTheTimesSpread) {
    const auto text = cycle_text(some());
    EXPECT_NE(text.find("1001 cycles, 2 overruns, 3 without all frames, 4 with a wrong working counter"),
              std::string::npos);
    EXPECT_NE(text.find("; after overruns 5 left out, 7 made up for"), std::string::npos);
    EXPECT_NE(text.find("wake-up after the deadline: min 1 µs"), std::string::npos) << text;
    EXPECT_NE(text.find("max 3 ms"), std::string::npos) << text;
    EXPECT_GE(count_of(text, "#"), 60U) << "bars";
}

TEST(CycleReport, JsonHasEveryFigureAndEveryBucket) {
    const auto json = nlohmann::json::parse(cycle_json(some()));
    EXPECT_EQ(json["cycles"], 1001);
    EXPECT_EQ(json["overruns"], 2);
    EXPECT_EQ(json["skipped"], 5);
    EXPECT_EQ(json["caught_up"], 7);
    EXPECT_EQ(json["without_all_frames"], 3);
    EXPECT_EQ(json["wrong_working_counter"], 4);
    EXPECT_EQ(json["lateness_ns"]["max"], 3'000'000);
    EXPECT_EQ(json["period_ns"], (nlohmann::json{{"count", 0}, {"buckets", nlohmann::json::array()}})) << "no times";
    std::uint64_t in_buckets = 0;
    for (const auto& bucket : json["lateness_ns"]["buckets"]) in_buckets += bucket["count"].get<std::uint64_t>();
    EXPECT_EQ(in_buckets, 1001U);
    for (const char* name : {"sent_ns", "received_ns", "round_trip_ns"}) EXPECT_TRUE(json.contains(name)) << name;
}

TEST(CycleReport, TheTimesOfTheNicAreShownWhereThereAreAny) {
    auto figures = some();
    EXPECT_EQ(cycle_text(figures).find("by the NIC"), std::string::npos);
    EXPECT_FALSE(nlohmann::json::parse(cycle_json(figures)).contains("wire_period_ns"));
    figures.missed = 3;
    figures.wire.unstamped = 2;
    figures.wire.period.record(1ms);
    figures.wire.round_trip.record(30us);
    const auto text = cycle_text(figures);
    EXPECT_NE(text.find("; 3 frames not sent at their time; 2 without time stamps of the NIC\n"), std::string::npos)
        << text;
    EXPECT_NE(text.find("time between cycles on the wire, by the NIC: min 1 ms"), std::string::npos) << text;
    EXPECT_NE(text.find("round trip on the wire, by the NIC: min 30 µs"), std::string::npos) << text;
    const auto json = nlohmann::json::parse(cycle_json(figures));
    EXPECT_EQ(json["not_sent_at_their_time"], 3);
    EXPECT_EQ(json["without_stamps"], 2);
    EXPECT_EQ(json["wire_period_ns"]["max"], 1'000'000);
    EXPECT_EQ(json["wire_round_trip_ns"]["min"], 30'000);
}

TEST(CycleReport, NothingYetIsNoError) {
    EXPECT_NE(cycle_text({}).find("0 cycles"), std::string::npos);
    EXPECT_NE(cycle_text({}).find("\nround trip: none\n"), std::string::npos) << cycle_text({});
    EXPECT_NE(cycle_svg({}).find("</svg>"), std::string::npos);
}

TEST(CycleReport, PictureHasABarForWhatCameAndStaysInItsFrame) {
    const auto svg = cycle_svg(some());
    EXPECT_EQ(svg.substr(0, 5), "<svg ");
    EXPECT_EQ(count_of(svg, "<rect "), count_of(svg, "</rect>"));
    EXPECT_GE(count_of(svg, "<rect "), 6U);
    for (auto at = svg.find("<rect "); at != std::string::npos; at = svg.find("<rect ", at + 1)) {
        double x = 0;
        double y = 0;
        double width = 0;
        double height = 0;
        ASSERT_EQ(std::sscanf(svg.c_str() + at, "<rect x=\"%lf\" y=\"%lf\" width=\"%lf\" height=\"%lf\"", &x, &y,
                              &width, &height),
                  4);
        EXPECT_GE(x, 0);
        EXPECT_LE(x + width, 801);
        EXPECT_GE(y, 0);
        EXPECT_GT(height, 0);
        EXPECT_LE(y + height, 1240);
    }
}

}  // namespace
}  // namespace margay::samples
