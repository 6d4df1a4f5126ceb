// A complete scan: of the simulation, of its recording, and over a wire that loses, delays, duplicates and damages
// frames.
#include "common/slave_report.hpp"
#include "common/source.hpp"
#include "oshw/filters/drop_nic.hpp"
#include "oshw/filters/duplicate_nic.hpp"
#include "oshw/filters/holding_nic.hpp"

#include <gtest/gtest.h>
#include <unistd.h>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <fstream>

namespace margay::samples {
namespace {

using namespace std::chrono_literals;

// The segment behind a NIC as text, or the error of the scan.
std::string scan(Nic& nic, Osal& osal) {
    HostContext ctx(Limits{.slaves = 64});
    if (const auto ready = init(ctx, nic, osal); !ready) return sentence(ready.error());
    if (const auto found = config_init(ctx); !found) return sentence(found.error());
    return segment_json(ctx).dump(1);
}

struct SessionTest : testing::Test {
    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("margay-session-" + std::to_string(::getpid()));
    SessionTest() { std::filesystem::create_directories(folder); }
    ~SessionTest() override { std::filesystem::remove_all(folder); }

    std::string file(const std::string& name) const { return folder / name; }
    static std::string content(const std::string& path) {
        std::ifstream in(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    static std::string scan_source(const std::string& text, const std::string& record = {}) {
        auto source = open_source(text, {.record = record});
        EXPECT_TRUE(source) << source.error();
        if (!source) return {};
        const auto seen = scan(source->nic(), source->osal());
        EXPECT_EQ(source->finish(), "");
        return seen;
    }
};

TEST_F(SessionTest, ARecordingShowsWhatTheSimulationShowed) {
    const auto simulated = scan_source("sim:demo", file("a.pcap"));
    EXPECT_NE(simulated.find("PREOP"), std::string::npos) << simulated;
    EXPECT_EQ(scan_source("pcap:" + file("a.pcap")), simulated);
}

TEST_F(SessionTest, TwoRunsInVirtualTimeAreTheSameOctetByOctet) {
    (void)scan_source("sim:demo", file("a.pcap"));
    (void)scan_source("sim:demo", file("b.pcap"));
    EXPECT_GT(content(file("a.pcap")).size(), 10'000u);
    EXPECT_TRUE(content(file("a.pcap")) == content(file("b.pcap")));
    // The recording of a replay is equal to the recording: the same requests, answers and times.
    (void)scan_source("pcap:" + file("a.pcap"), file("c.pcap"));
    EXPECT_TRUE(content(file("a.pcap")) == content(file("c.pcap")));
}

TEST_F(SessionTest, AStrictReplayFindsEveryOctetInItsPlace) {
    const auto simulated = scan_source("sim:demo", file("a.pcap"));
    VirtualOsal osal;
    PcapStrictReplayNic nic(osal);
    ASSERT_TRUE(nic.load(file("a.pcap")).ok()) << nic.problem();
    EXPECT_EQ(scan(nic, osal), simulated);
    EXPECT_TRUE(nic.finished()) << nic.problem();
}

// Lost, late and duplicated replies: the recording contains the retries, and the replay repeats them.
TEST_F(SessionTest, ARecordingOfABadWireShowsTheSame) {
    const auto clean = scan_source("sim:demo");
    std::uint64_t disturbed = 0;
    for (std::uint64_t seed = 1; seed <= 100; ++seed) {
        SCOPED_TRACE(seed);
        const auto path = file(std::to_string(seed) + ".pcap");
        std::string seen;
        {
            auto source = open_source("sim:demo");
            ASSERT_TRUE(source) << source.error();
            std::vector<HeldFrame> late(256);
            DropNic drop(source->nic(), {.seed = seed, .sent = Rate::percent(3), .received = Rate::percent(3)});
            ReorderNic reorder(drop, source->osal(), late, {.seed = seed, .rate = Rate::percent(10), .hold = 130us});
            DuplicateNic twice(reorder, {.seed = seed, .received = Rate::percent(5)});
            PcapRecorder recorder(twice, source->osal());
            ASSERT_TRUE(recorder.open(path).ok());
            seen = scan(recorder, source->osal());
            ASSERT_TRUE(recorder.close().ok());
            disturbed += drop.dropped() + reorder.held() + twice.duplicated();
        }
        EXPECT_EQ(seen, clean) << "the master copes";
        auto replay = open_source("pcap:" + path);
        ASSERT_TRUE(replay) << replay.error();
        EXPECT_EQ(scan(replay->nic(), replay->osal()), seen);
        EXPECT_EQ(replay->finish(), "");
    }
    EXPECT_GT(disturbed, 500u);
}

}  // namespace
}  // namespace margay::samples
