// Compares the analysis of recordings of real segments with the output of tshark for the same files.
#include <places.hpp>
#include "analyse/recording.hpp"

#include "wire/esc.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <sstream>

namespace margay::analyse {
namespace {

std::string file_of(const std::string& name) { return std::string(MARGAY_CAPTURES_DIR) + "/" + name; }

// The lines that tshark prints for the fields of the frames that the filter passes.
std::vector<std::string> tshark(const std::string& name, const std::string& filter, const std::string& fields) {
    const auto command =
        "tshark -n -r '" + file_of(name) + "' -Y '" + filter + "' -T fields " + fields + " 2>/dev/null";
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(::popen(command.c_str(), "r"), ::pclose);
    std::vector<std::string> lines;
    std::array<char, 4096> line{};
    while (pipe != nullptr && std::fgets(line.data(), static_cast<int>(line.size()), pipe.get()) != nullptr) {
        lines.emplace_back(line.data());
        if (lines.back().ends_with('\n')) lines.back().pop_back();
    }
    return lines;
}

bool has_tshark() { return std::system("tshark -v > /dev/null 2>&1") == 0; }

std::vector<std::string> captures() {
    std::vector<std::string> all;
    if (std::string(MARGAY_CAPTURES_DIR).empty()) return all;
    for (const auto& entry : std::filesystem::directory_iterator(MARGAY_CAPTURES_DIR))
        if (entry.path().extension() == ".pcapng") all.push_back(entry.path().filename());
    std::sort(all.begin(), all.end());
    return all;
}

struct AnalyseCapture : testing::TestWithParam<std::string> {};

TEST_P(AnalyseCapture, CountsWhatTsharkCounts) {
    if (!has_tshark()) GTEST_SKIP() << "no tshark";
    const auto a = analyse_file(file_of(GetParam()));
    ASSERT_EQ(a.problem, "");
    const auto printed = tshark(GetParam(), "frame", "-e frame.number -e eth.src -e ecat.cmd");
    std::uint64_t requests = 0;
    std::uint64_t replies = 0;
    for (const auto& line : printed) {
        std::istringstream in(line);
        std::string number, source, commands;
        in >> number >> source >> commands;
        if (commands.empty()) continue;
        ++((std::stoul(source.substr(0, 2), nullptr, 16) & 2U) != 0 ? replies : requests);
    }
    EXPECT_EQ(a.frames.packets, printed.size());
    EXPECT_EQ(a.frames.ethercat, requests + replies);
    EXPECT_EQ(a.frames.requests, requests);
    EXPECT_EQ(a.frames.replies, replies);
    EXPECT_EQ(a.frames.replies - a.frames.unasked + a.frames.lost + a.frames.open,
              a.directions == Directions::requests_only ? 0 : a.frames.requests);
    EXPECT_EQ(a.frames.damaged + a.frames.cut, 0u);
}

// Each CoE message that tshark decodes in a datagram with working counter 1 is in a conversation.
TEST_P(AnalyseCapture, HasTheSdosOfTshark) {
    if (!has_tshark()) GTEST_SKIP() << "no tshark";
    const auto a = analyse_file(file_of(GetParam()));
    std::vector<std::string> asked;
    std::vector<std::pair<std::uint64_t, std::uint64_t>> values;  // frame of the response, value as a number
    for (const auto& line : tshark(GetParam(), "ecat_mailbox.coe && ecat.cnt == 1",
                                   "-e frame.number -e ecat_mailbox.coe.type -e ecat_mailbox.coe.sdoidx "
                                   "-e ecat_mailbox.coe.sdosub -e ecat_mailbox.coe.sdodata")) {
        std::istringstream in(line);
        std::string number, type, index, subindex, value;
        in >> number >> type >> index >> subindex >> value;
        if (std::stoul(type, nullptr, 0) == 2) asked.push_back(number + "\t" + index + "\t" + subindex);
        if (std::stoul(type, nullptr, 0) == 3 && !value.empty())
            values.emplace_back(std::stoull(number), std::stoull(value, nullptr, 0));
    }
    std::vector<std::string> ours;
    for (const auto& c : a.conversations.items) {
        if (c.action != Action::sdo_upload && c.action != Action::sdo_download) continue;
        std::array<char, 64> line{};
        (void)std::snprintf(line.data(), line.size(), "%llu\t0x%04x\t0x%02x",
                            static_cast<unsigned long long>(c.begin.frame), c.index, c.subindex);
        ours.emplace_back(line.data());
    }
    EXPECT_EQ(ours, asked);
    EXPECT_EQ(values.empty(), asked.empty()) << "some responses have a value that tshark prints as a number";
    for (const auto& [frame, value] : values) {
        const auto& all = a.conversations.items;
        const auto found = std::ranges::find(all, frame, [](const Conversation& c) { return c.end.frame; });
        ASSERT_NE(found, all.end()) << frame;
        if (found->bytes > 4) continue;  // tshark prints the first octets
        std::uint64_t got = 0;
        for (std::size_t i = 0; i < found->data.size(); ++i)
            got |= std::to_integer<std::uint64_t>(found->data[i]) << (8 * i);
        const auto mask = (std::uint64_t{1} << (8 * found->data.size())) - 1;
        EXPECT_EQ(got, value & mask) << "frame " << frame;
    }
}

// Each report of a slave's state agrees with the AL status that tshark prints for this frame.
TEST_P(AnalyseCapture, ReportsTheStatesOfTshark) {
    if (!has_tshark()) GTEST_SKIP() << "no tshark";
    const auto a = analyse_file(file_of(GetParam()));
    std::map<std::uint64_t, std::vector<unsigned>> printed;
    for (const auto& line : tshark(GetParam(), "ecat.reg.alstatus", "-e frame.number -e ecat.reg.alstatus")) {
        std::istringstream in(line);
        std::uint64_t frame = 0;
        std::string values;
        in >> frame >> values;
        std::istringstream list(values);
        for (std::string one; std::getline(list, one, ',');)
            printed[frame].push_back(static_cast<unsigned>(std::stoul(one, nullptr, 0)));
    }
    std::size_t checked = 0;
    for (const auto& event : a.states.items) {
        if (event.requested) continue;
        const auto found = printed.find(event.when.frame);
        if (found == printed.end()) continue;  // the datagram reads several registers, which tshark does not decode
        const unsigned word = static_cast<unsigned>(event.status.state) | (event.status.error ? 0x10U : 0U);
        EXPECT_NE(std::ranges::count_if(found->second, [&](unsigned v) { return (v & 0x1FU) == word; }), 0)
            << "frame " << event.when.frame;
        ++checked;
    }
    if (!printed.empty() && a.directions == Directions::marked) {
        EXPECT_GT(checked, 0u);
    }
}

INSTANTIATE_TEST_SUITE_P(Captures, AnalyseCapture, testing::ValuesIn(captures()), [](const auto& instance) {
    auto name = instance.param.substr(0, instance.param.rfind('.'));
    std::ranges::replace(name, '-', '_');
    return name;
});
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(AnalyseCapture);

struct Facts {
    std::string file;
    std::string master;
    std::vector<std::uint32_t> products;  // by position
};

TEST(AnalyseCaptures, NamesMastersAndDevices) {
    if (captures().empty()) GTEST_SKIP() << "no captures of real segments (MARGAY_CAPTURES_DIR is empty)";
    const Facts all[] = {
        {"replay-dc.pcapng", "ethercrab", {0x044C2C52, 0x0B0C3052, 0x0B493052}},
        {"rs-example-sii-el2004.pcapng", "ethercrab", {0x044C2C52, 0x07D43052, 0x07D43052}},
        {"soem-sdinfo-no-slaves.pcapng", "SOEM", {}},
        {"soem-sdinfo-ek1100-only.pcapng", "SOEM", {0x044C2C52}},
        {"soem-sdinfo-ek1100-el1004.pcapng", "SOEM", {0x044C2C52, 0x03EC3052}},
        {"soem-dual-lan9252.pcapng", "SOEM", {0x9252, 0x9252}},
        {"soem-sdinfo-akd.pcapng", "SOEM", {0x00414B44}},
        {"twincat-scan-boxes.pcapng", "TwinCAT", {0x044C2C52, 0x03EC3052}},
    };
    for (const auto& facts : all) {
        SCOPED_TRACE(facts.file);
        const auto a = analyse_file(file_of(facts.file));
        EXPECT_EQ(a.master.name, facts.master);
        ASSERT_EQ(a.slaves.size(), facts.products.size());
        for (std::size_t i = 0; i < a.slaves.size(); ++i) {
            EXPECT_EQ(a.slaves[i].position, i);
            EXPECT_EQ(a.slaves[i].product, facts.products[i]);
        }
    }
    const auto run = analyse_file(file_of("twincat-run-ek1100-el1004.pcapng"));
    EXPECT_EQ(run.master.name, "TwinCAT");
    ASSERT_EQ(run.slaves.size(), 2u);
    EXPECT_EQ(run.slaves[0].station, 1001);
    EXPECT_FALSE(run.slaves[0].position) << "no auto-increment address shows it";
}

TEST(AnalyseCaptures, TheDriveRefusesSafeopAndItsPdosAreNamed) {
    if (captures().empty()) GTEST_SKIP() << "no captures of real segments (MARGAY_CAPTURES_DIR is empty)";
    const auto a = analyse_file(file_of("soem-sdinfo-akd.pcapng"));
    ASSERT_FALSE(a.states.items.empty());
    const auto& last = a.states.items.back();
    EXPECT_EQ(last.when.frame, 760u);
    EXPECT_EQ(last.status, (AlStatus{AlState::preop, true, 0x001D}));
    ASSERT_EQ(a.slaves.size(), 1u);
    EXPECT_TRUE(a.slaves[0].pdos_by_coe);
    ASSERT_EQ(a.slaves[0].pdos.size(), 8u);
    EXPECT_EQ(a.slaves[0].pdos[2].entries.at(1).index, 0x607A);
    EXPECT_EQ(a.slaves[0].pdos[2].entries.at(1).bits, 32);
    EXPECT_EQ(a.frames.lost, 3u);
}

TEST(AnalyseCaptures, TheCycleOfAClock) {
    if (captures().empty()) GTEST_SKIP() << "no captures of real segments (MARGAY_CAPTURES_DIR is empty)";
    const auto a = analyse_file(file_of("replay-dc.pcapng"));
    ASSERT_EQ(a.slaves.size(), 3u);
    EXPECT_EQ(a.slaves[0].clock.sync0_cycle_ns, 5'000'000u);
    EXPECT_EQ(a.slaves[2].clock.delay_ns, 300u);
    EXPECT_EQ(a.reference.slave, 0u);
    ASSERT_EQ(a.cyclic.size(), 2u);
    EXPECT_EQ(a.cyclic[1].count, 257u);
    EXPECT_NEAR(a.cyclic[1].intervals.mean_ns, 5.085e6, 1e4);
    EXPECT_EQ(a.cyclic[1].datagrams.at(1).most_wkc, 4);
}

}  // namespace
}  // namespace margay::analyse
