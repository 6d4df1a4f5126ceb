// README.md claims nothing that no test proves.
#include "layers/matrix_check.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

namespace margay::layers {
namespace {

TEST(Matrix, ClaimsWhatTestsProve) {
    std::ifstream in(MARGAY_SOURCE_DIR "/README.md", std::ios::binary);
    const std::string readme{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
    ASSERT_NE(readme.find("| works |"), std::string::npos);
    const auto faults = matrix_faults(readme, load_tree(MARGAY_SOURCE_DIR));
    EXPECT_TRUE(faults.empty()) << joined(faults);
}

TEST(Matrix, CatchesEmptyClaims) {
    const SourceTree tree = {{"test/wire/sii_test.cpp", "TEST_F(SiiCheck, FindsBlank) {}"},
                             {"test/bench/scan.cpp", ""}};
    const auto faults_of = [&](const std::string& row) { return matrix_faults(row + "\n", tree).size(); };
    EXPECT_EQ(faults_of("| scan | works | `wire/SiiCheck`, `bench_scan` |"), 0U);
    EXPECT_EQ(faults_of("| scan | works | `wire/SiiCheck.Finds…` |"), 0U);
    EXPECT_EQ(faults_of("| scan | planned | |"), 0U);
    EXPECT_EQ(faults_of("| scan | partly | to come |"), 0U);
    EXPECT_EQ(faults_of("| scan | works | |"), 1U);
    EXPECT_EQ(faults_of("| scan | works | surely |"), 1U);
    EXPECT_EQ(faults_of("| scan | works | `wire/SiiCheck.Loses…` |"), 1U);
    EXPECT_EQ(faults_of("| scan | works | `engine/SiiCheck` |"), 1U);
    EXPECT_EQ(faults_of("| scan | works | `bench_cycle` |"), 1U);
    EXPECT_EQ(faults_of("| scan | partly | `wire/Gone` |"), 1U);
    EXPECT_EQ(faults_of("| scan | works | `fuzz/gone` |"), 1U);
}

}  // namespace
}  // namespace margay::layers
