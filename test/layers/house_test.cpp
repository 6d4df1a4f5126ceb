// File lengths, a README.md in every folder, and no unknown files at the top level.
#include <places.hpp>
#include "layers/house_check.hpp"

#include <gtest/gtest.h>

namespace margay::layers {
namespace {

const std::filesystem::path kTop = MARGAY_SOURCE_DIR;

TEST(House, FilesAreShort) {
    const auto faults = length_faults(load_tree(kTop));
    EXPECT_TRUE(faults.empty()) << joined(faults);
}

TEST(House, LinesFitAPage) {
    const auto faults = width_faults(load_tree(kTop));
    EXPECT_TRUE(faults.empty()) << joined(faults);
}

TEST(House, EveryFolderHasItsReadme) {
    std::set<std::string> notes;
    for (const auto* folder : {"include", "src", "osal", "oshw", "samples", "test"})
        for (const auto& entry : std::filesystem::recursive_directory_iterator(kTop / folder))
            if (entry.path().filename() == "README.md")
                notes.insert(entry.path().lexically_relative(kTop).generic_string());
    const auto faults = readme_faults(load_tree(kTop), notes);
    EXPECT_TRUE(faults.empty()) << joined(faults);
}

TEST(House, NothingElseAtTheTopLevel) {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(kTop)) names.insert(entry.path().filename().string());
    const auto faults = top_level_faults(names);
    EXPECT_TRUE(faults.empty()) << joined(faults);
}

TEST(House, ProgramsWaitForBothNicsOfARing) {
    EXPECT_EQ(joined(wait_faults(load_tree(kTop))), "");
    EXPECT_EQ(wait_faults({{"samples/a.cpp", "osal.wait(next, source_.nic().wait_handle());"}}).size(), 1U);
}

TEST(House, CatchesLongFilesAndMissingNotes) {
    std::string text;
    for (std::size_t i = 0; i < kMaxFileLines; ++i) text += "\n";
    EXPECT_EQ(length_faults({{"src/util/a.cpp", text}}).size(), 0U);
    EXPECT_EQ(length_faults({{"src/util/a.cpp", text + "x"}}).size(), 1U);
    std::string wide;
    for (std::size_t i = 0; i < kMaxColumns; ++i) wide += "é";
    EXPECT_EQ(width_faults({{"src/util/a.cpp", wide + "\n"}}).size(), 0U);
    EXPECT_EQ(joined(width_faults({{"test/a.cpp", "\n" + wide + "x\n"}})), "\ntest/a.cpp:2: wider than 120 columns");
    const SourceTree tree = {
        {"src/util/a.cpp", ""}, {"src/util/b.cpp", ""}, {"src/wire/c.cpp", ""}, {"test/x/y.cpp", ""}};
    EXPECT_EQ(joined(readme_faults(tree, {"src/util/README.md", "test/README.md"})),
              "\nsrc/wire: no README.md says what lives here");
}

TEST(House, CatchesWhatLiesAbout) {
    const std::set<std::string> sound = {"include", "src",     "osal",      "oshw",           "samples",
                                         "test",    "LICENSE", "README.md", "CMakeLists.txt", ".git",
                                         ".ci",     "build",   "build-arm"};
    EXPECT_EQ(joined(top_level_faults(sound)), "");
    auto untidy = sound;
    untidy.insert("docs");
    untidy.erase("LICENSE");
    EXPECT_EQ(top_level_faults(untidy).size(), 2U);
}

}  // namespace
}  // namespace margay::layers
