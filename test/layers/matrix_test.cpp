// test/matrix.md and test/README.md claim nothing without a test.
#include <places.hpp>
#include "layers/matrix_check.hpp"

#include <gtest/gtest.h>

namespace margay::layers {
namespace {

const std::filesystem::path kSources = MARGAY_SOURCE_DIR;

TEST(Matrix, ClaimsWhatTestsProve) {
    const auto tree = load_tree(MARGAY_SOURCE_DIR);
    for (const std::string file : {"test/matrix.md", "test/README.md"}) {
        const auto text = text_of(kSources / file);
        ASSERT_NE(text.find("| works |"), std::string::npos) << file;
        const auto faults = matrix_faults(text, tree, file);
        EXPECT_TRUE(faults.empty()) << joined(faults);
    }
}

TEST(Matrix, EachThreadOfTheFieldNotesHasOnePlaceAndAStatus) {
    const auto text = text_of(kSources / "test/README.md");
    ASSERT_NE(text.find("| `S#725`, `S#741` | works |"), std::string::npos);
    const auto faults = thread_faults(text, "test/README.md");
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
    EXPECT_EQ(faults_of("| scan | planned | `wire/Gone` |"), 1U);
    EXPECT_EQ(faults_of("| scan | `S#1` | works | `wire/SiiCheck` |"), 0U);
    EXPECT_EQ(faults_of("| scan | `S#1` | works | |"), 1U);
    EXPECT_EQ(faults_of("| scan | `S#1` | partly | `wire/SiiCheck.Loses…` |"), 1U);
    EXPECT_EQ(matrix_faults("| scan | works | |", tree, "test/README.md")[0].rfind("test/README.md: ", 0), 0U);
}

TEST(Matrix, CatchesThreadsWithoutAPlaceOfTheirOwn) {
    const auto faults_of = [](const std::string& text) { return thread_faults(text, "x").size(); };
    EXPECT_EQ(faults_of("| scan | `S#1`, `S#2` | works | |\n| map | `O#1` | planned | |\n"), 0U);
    EXPECT_EQ(faults_of("| scan | `S#1`, `S#1` | works | |\n"), 1U);
    EXPECT_EQ(faults_of("| scan | `S#1` | works | |\n| map | `S#1` | partly | |\n"), 1U);
    EXPECT_EQ(faults_of("| scan | `S#1` | surely | |\n"), 1U);
}

}  // namespace
}  // namespace margay::layers
