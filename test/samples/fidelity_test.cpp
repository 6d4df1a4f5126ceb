// What real hardware answered, put to the simulation: the master's half of each recording goes to a segment
// of the same devices, and every answer is compared. Differences that remain are named here, one by one, with
// their reason.
#include "common/fidelity.hpp"
#include "common/capture_slaves.hpp"

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
                  ("margay-fidelity-" +
                   std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
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

    // The image of the EL1004, which nobody has as a file, out of what two masters read of it.
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
        return "[[slave]]\nsii_read_us = 100\nports = [\"ebus\", \"ebus\", \"none\", \"unused\"]\nsii = '" +
               path + "'\n";
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

// EEPROMs at least as quick as the real ones, so that data is there when the recording's master comes for it.
const std::string kEk1100 = "[[slave]]\nsii = \"ek1100.bin\"\nsii_read_us = 100\n";

TEST_F(Fidelity, Ek1100Alone) { expect_identical(measure("soem-sdinfo-ek1100-only", kEk1100)); }

TEST_F(Fidelity, Ek1100AndEl1004) {
    expect_identical(measure("soem-sdinfo-ek1100-el1004", kEk1100 + el1004()));
}

TEST_F(Fidelity, Ek1100AndTwoEl2004) {
    const std::string el2004 = "[[slave]]\nsii = \"el2004.bin\"\nsii_read_us = 100\n";
    expect_identical(measure("rs-example-sii-el2004", kEk1100 + el2004 + el2004));
}

// The EL2889 of these two recordings has an ESC with the DC unit on; that it has one at all its SII does not
// tell.
const std::string kEl28xx =
    "[[slave]]\nsii = \"el2828.bin\"\nsii_read_us = 100\n"
    "[[slave]]\nsii = \"el2889.bin\"\nsii_read_us = 100\nfeatures = 0x00FC\ndc = \"64\"\n";

TEST_F(Fidelity, Ek1100El2828El2889) {
    expect_identical(measure("replay-ek1100-el2828-el2889", kEk1100 + kEl28xx));
}

TEST_F(Fidelity, DistributedClocks) { expect_identical(measure("replay-dc", kEk1100 + kEl28xx)); }

TEST_F(Fidelity, TwinCatRunning) {
    // The recording begins when the segment is in PREOP already.
    const std::string preop = "preset = [[0x0120, 0x02, 0x00]]\n";
    expect_identical(measure("twincat-run-ek1100-el1004", kEk1100 + "station = 0x03E9\n" + preop + el1004() +
                                                              "station = 0x03EA\n" + preop));
}

TEST_F(Fidelity, TwinCatScanning) { expect_identical(measure("twincat-scan-boxes", kEk1100 + el1004())); }

}  // namespace
}  // namespace margay::samples
