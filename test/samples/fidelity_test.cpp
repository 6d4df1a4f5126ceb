// The simulation compared with recorded hardware. The requests of each recording are sent to a simulated segment of
// the same devices, and every answer is compared. The remaining differences are listed here one by one with their
// reason.
#include "common/fidelity.hpp"
#include <places.hpp>
#include "common/capture_slaves.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace margay::samples {
namespace {

const std::string kCaptures = MARGAY_CAPTURES_DIR;
const std::string kImages = MARGAY_SII_DIR;

class Fidelity : public ::testing::Test {
  protected:
    void SetUp() override {
        if (kCaptures.empty() || kImages.empty())
            GTEST_SKIP() << "the folders of recordings and SII images are not there";
        folder_ = std::filesystem::temp_directory_path() /
                  ("margay-fidelity-" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
        std::filesystem::create_directories(folder_);
    }
    void TearDown() override {
        std::error_code ignored;
        std::filesystem::remove_all(folder_, ignored);
    }

    static Capture capture(const std::string& name) {
        auto loaded = load_capture(kCaptures + "/" + name + ".pcapng");
        EXPECT_EQ(loaded.error, "");
        return loaded;
    }

    // The image of the EL1004. There is no file of it, so it is rebuilt from what two masters read.
    std::string el1004() {
        std::vector<std::byte> sii;
        for (const auto* recording : {"soem-sdinfo-ek1100-el1004", "twincat-scan-boxes"}) {
            const auto slaves = slaves_of(capture(recording));
            EXPECT_EQ(slaves.size(), 2u);
            const auto& read = slaves.at(1).sii;
            sii.resize(std::max(sii.size(), read.size()), std::byte{0xFF});
            for (std::size_t i = 0; i < read.size(); ++i)
                if (sii[i] == std::byte{0xFF}) sii[i] = read[i];
        }
        const auto path = (folder_ / "el1004.bin").string();
        std::ofstream out(path, std::ios::binary);
        out.write(reinterpret_cast<const char*>(sii.data()), static_cast<std::streamsize>(sii.size()));
        return "[[slave]]\nsii_read_us = 100\nports = [\"ebus\", \"ebus\", \"none\", \"unused\"]\nsii = '" + path +
               "'\n";
    }

    static FidelityReport measure(const std::string& recording, const std::string& description) {
        auto segment = parse_segment(description, recording, kImages);
        EXPECT_TRUE(segment) << segment.error();
        if (!segment) return {};
        const auto report = measure_fidelity(capture(recording), *segment);
        EXPECT_GT(report.frames, 50u);
        return report;
    }

    static void expect_identical(const FidelityReport& report) {
        EXPECT_EQ(report.equal_wkc, report.datagrams) << to_text(report);
        EXPECT_EQ(report.equal_octets, report.data_octets) << to_text(report);
    }

    std::filesystem::path folder_;
};

// EEPROMs at least as fast as the real ones, so that the data are ready when the recorded master reads them.
const std::string kEk1100 = "[[slave]]\nsii = \"ek1100.bin\"\nsii_read_us = 100\n";

TEST_F(Fidelity, Ek1100Alone) { expect_identical(measure("soem-sdinfo-ek1100-only", kEk1100)); }

TEST_F(Fidelity, Ek1100AndEl1004) { expect_identical(measure("soem-sdinfo-ek1100-el1004", kEk1100 + el1004())); }

TEST_F(Fidelity, Ek1100AndTwoEl2004) {
    const std::string el2004 = "[[slave]]\nsii = \"el2004.bin\"\nsii_read_us = 100\n";
    expect_identical(measure("rs-example-sii-el2004", kEk1100 + el2004 + el2004));
}

// The EL2889 of these two recordings has an ESC whose DC unit is switched on, which its SII does not show.
const std::string kEl28xx =
    "[[slave]]\nsii = \"el2828.bin\"\nsii_read_us = 100\n"
    "[[slave]]\nsii = \"el2889.bin\"\nsii_read_us = 100\nfeatures = 0x00FC\ndc = \"64\"\n";

TEST_F(Fidelity, Ek1100El2828El2889) { expect_identical(measure("replay-ek1100-el2828-el2889", kEk1100 + kEl28xx)); }

TEST_F(Fidelity, DistributedClocks) { expect_identical(measure("replay-dc", kEk1100 + kEl28xx)); }

TEST_F(Fidelity, TwinCatRunning) {
    // At the beginning of the recording the segment is already in PREOP.
    const std::string preop = "preset = [[0x0120, 0x02, 0x00]]\n";
    expect_identical(measure("twincat-run-ek1100-el1004",
                             kEk1100 + "station = 0x03E9\n" + preop + el1004() + "station = 0x03EA\n" + preop));
}

TEST_F(Fidelity, TwinCatScanning) { expect_identical(measure("twincat-scan-boxes", kEk1100 + el1004())); }

// Devices with a processor. Their mailboxes answer with objects of the simulation, which are not compared. The
// simulated program reacts to an event after a millisecond, as the real ones do. Thus an AL control write before that
// is lost, and the mailbox is full when the master reads it.
struct FidelityOfProcessors : Fidelity {
    FidelityReport measure_rebuilt(const std::string& recording) {
        const auto slaves = slaves_of(capture(recording));
        EXPECT_FALSE(slaves.empty());
        for (const auto& slave : slaves) {
            std::ofstream out(folder_ / ("slave" + std::to_string(slave.position + 1) + ".bin"), std::ios::binary);
            out.write(reinterpret_cast<const char*>(slave.sii.data()), static_cast<std::streamsize>(slave.sii.size()));
        }
        std::string text = describe_segment(slaves, recording);
        for (auto at = text.find("[[slave]]"); at != std::string::npos; at = text.find("[[slave]]", at + 10))
            text.insert(at + 9, "\nfirmware_us = 1000");
        auto segment = parse_segment(text, recording, folder_.string());
        EXPECT_TRUE(segment) << segment.error();
        return segment ? measure_fidelity(capture(recording), *segment) : FidelityReport{};
    }
    // Only the listed differences occur, and not more often than listed.
    static void expect_only(const FidelityReport& report, const std::map<std::string, std::size_t>& reasons) {
        for (const auto& [kind, entry] : report.kinds) {
            const auto known = reasons.find(kind);
            ASSERT_NE(known, reasons.end()) << to_text(report);
            EXPECT_LE(entry.count, known->second) << to_text(report);
        }
    }
};

// The clock in a recording: the features give its width, the answers show whether it is on. The features of the EL2828
// and the EL1004 announce a clock of 64 bits (0x01FC), but 0x0918 does not answer.
TEST_F(FidelityOfProcessors, TheClockIsRebuiltAsTheRecordingShowsIt) {
    const std::map<std::string, std::vector<std::string>> clocks{
        {"replay-dc", {"64", "receive_times", "64"}},
        {"soem-sdinfo-ek1100-el1004", {"64", "receive_times"}},
        {"soem-dual-lan9252", {"64", "64"}},
        {"soem-sdinfo-akd", {"32"}},  // 0x0008 = 0x0184
    };
    for (const auto& [recording, expected] : clocks) {
        const auto text = describe_segment(slaves_of(capture(recording)), recording);
        std::vector<std::string> found;
        for (auto at = text.find("\ndc = \""); at != std::string::npos; at = text.find("\ndc = \"", at + 1))
            found.push_back(text.substr(at + 7, text.find('"', at + 7) - at - 7));
        EXPECT_EQ(found, expected) << recording << "\n" << text;
    }
    // With these settings, each clock register answers exactly when the register of the hardware answers.
    for (const auto* recording : {"soem-sdinfo-ek1100-el1004", "replay-dc"}) {
        const auto report = measure_rebuilt(recording);
        for (const auto& [kind, entry] : report.kinds) {
            const auto at = kind.find("(0x09");
            EXPECT_TRUE(at == std::string::npos || !kind.starts_with("working counter")) << recording << "\n"
                                                                                         << to_text(report);
        }
    }
}

// 0x0008 of the drive says 32 bits: the upper half of its times is always zero.
TEST_F(FidelityOfProcessors, TheFeaturesChooseTheWidthOfTheClock) {
    for (const auto& [features, wide] : {std::pair{0x0184, false}, std::pair{0x018C, true}}) {
        auto segment = parse_segment("[[slave]]\nsii = \"ek1100.bin\"\nclock_start_ns = 5000000000\nfeatures = " +
                                         std::to_string(features) + "\n",
                                     "x", kImages);
        ASSERT_TRUE(segment) << segment.error();
        segment->segment.advance(Time{} + std::chrono::seconds(6));
        std::array<std::byte, 8> time{};
        segment->segment.slave(0).read(0x0910, time);
        EXPECT_NE(load_le<std::uint32_t>(time, 0), 0U);
        EXPECT_EQ(load_le<std::uint32_t>(time, 4) != 0, wide) << features;
    }
}

// test/sim SyncManagerTest.AMailboxThatIsBeingWritten… expects the same values in the same order.
TEST_F(Fidelity, AMailboxInWritingShowsBit7) {
    std::string states;
    for (const auto* recording : {"soem-single-lan9252", "soem-sdinfo-akd"})
        for (const auto& exchange : capture(recording).exchanges)
            for (const auto& pair : pairs_of(exchange))
                if (pair.wkc == 1 && pair.request.command == wire::Command::FPRD &&
                    pair.request.address.ado() == 0x080D) {
                    const auto state = fmt::format("{:02x} ", std::to_integer<unsigned>(pair.received[0]));
                    if (!states.ends_with(state)) states += state;
                }
    EXPECT_TRUE(states.starts_with("00 09 02 80 09 02 80 09 02 ")) << states;
    for (const auto* wrong : {"80 00", "80 02", "09 80", "00 80"}) EXPECT_EQ(states.find(wrong), states.npos) << wrong;
}

// Recorded by TwinCAT from chips with an E-bus: 0xC7.
TEST_F(Fidelity, DlControlAfterPowerUp) {
    std::size_t seen = 0;
    for (const auto& exchange : capture("twincat-scan-boxes").exchanges)
        for (const auto& pair : pairs_of(exchange))
            if (pair.wkc == 1 && pair.request.command == wire::Command::APRD && pair.request.address.ado() == 0x0102) {
                EXPECT_EQ(pair.received[0], std::byte{0xC7});
                ++seen;
            }
    EXPECT_GE(seen, 2U);
}

TEST_F(Fidelity, ARecordingWithoutAnswersHasNothingToCompare) {
    const auto recording = capture("soem-sdinfo-no-slaves");
    EXPECT_EQ(no_slaves_reason(recording), "no slave answers in this recording");
    auto segment = parse_segment(kEk1100, "x", kImages);
    ASSERT_TRUE(segment);
    const auto text = to_text(measure_fidelity(recording, *segment));
    EXPECT_NE(text.find("working counters  nothing to compare\n"), std::string::npos) << text;
    EXPECT_EQ(text.find("100"), std::string::npos) << text;
}

// Only broadcasts: they count the slaves, but do not identify them.
TEST_F(Fidelity, SlavesThatNobodyAddressedAreCounted) {
    auto recording = capture("soem-sdinfo-ek1100-el1004");
    std::erase_if(recording.exchanges, [](const Exchange& exchange) {
        for (const auto& pair : pairs_of(exchange))
            if (pair.request.command != wire::Command::BRD) return true;
        return false;
    });
    EXPECT_TRUE(slaves_of(recording).empty());
    EXPECT_EQ(no_slaves_reason(recording).substr(0, 50), "2 slaves answer in this recording (working counter");
}

// A recorder that was killed leaves an incomplete packet at the end. The packets before it are used.
TEST_F(Fidelity, ARecordingThatIsCutOffIsReadUpToItsEnd) {
    const std::string whole = kCaptures + "/soem-sdinfo-ek1100-el1004.pcapng";
    const auto cut = folder_ / "cut.pcapng";
    std::filesystem::copy_file(whole, cut, std::filesystem::copy_options::overwrite_existing);
    std::filesystem::permissions(cut, std::filesystem::perms::owner_all);
    std::filesystem::resize_file(cut, std::filesystem::file_size(whole) - 10);
    const auto recording = load_capture(cut.string());
    EXPECT_EQ(recording.error, "");
    EXPECT_NE(recording.remark, "");
    EXPECT_EQ(capture("soem-sdinfo-ek1100-el1004").remark, "");
    EXPECT_EQ(slaves_of(recording).size(), 2U);
}

// The AL status differs: these programs need 2 to 8 ms for a state change, the simulated ones change at once.
TEST_F(FidelityOfProcessors, Lan9252) {
    // After its start this program does not read AL control for 7 ms. Therefore AL control is full at a third write,
    // too.
    const auto report = measure_rebuilt("soem-single-lan9252");
    EXPECT_EQ(report.equal_wkc + 1, report.datagrams) << to_text(report);
    expect_only(report, {{"data of BRD AL status (0x0130)", 7},
                         {"data of FPRD AL status (0x0130)", 9},
                         {"working counter of BWR AL control (0x0120)", 1}});
}

TEST_F(FidelityOfProcessors, TwoLan9252) {
    const auto report = measure_rebuilt("soem-dual-lan9252");
    EXPECT_EQ(report.equal_wkc, report.datagrams) << to_text(report);
    // With two slaves, a broadcast read does not show the type of each.
    expect_only(report, {{"data of BRD AL status (0x0130)", 3},
                         {"data of FPRD AL status (0x0130)", 2},
                         {"data of BRD type (0x0000)", 1}});
}

// This drive refuses SAFEOP for reasons of its own, and reports PREOP with an error in all of the 2997 reads that the
// master makes in six seconds. The SII contains no reason for a refusal.
TEST_F(FidelityOfProcessors, Akd) {
    const auto report = measure_rebuilt("soem-sdinfo-akd");
    EXPECT_EQ(report.equal_wkc, report.datagrams) << to_text(report);
    expect_only(report, {{"data of BRD AL status (0x0130)", 2998}, {"data of FPRD AL status (0x0130)", 5}});
}

}  // namespace
}  // namespace margay::samples
