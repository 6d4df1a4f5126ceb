// A file that replaces another one only when it is complete.
#include "common/new_file.hpp"
#include "process/shell.hpp"

#include <gtest/gtest.h>

#include <filesystem>

namespace margay::samples {
namespace {

namespace fs = std::filesystem;
using process::content_of;

struct NewFileTest : testing::Test {
    process::ShellFolder folder;
    [[nodiscard]] std::string at(const std::string& name) const { return (folder.path() / name).string(); }
};

TEST_F(NewFileTest, TheOldContentStaysUntilCommit) {
    folder.write("a", "old");
    fs::permissions(folder.path() / "a", fs::perms::owner_read | fs::perms::owner_write);
    NewFile file(at("a"));
    EXPECT_EQ(file.write(""), "");
    EXPECT_EQ(file.write("new"), "");
    EXPECT_EQ(content_of(at("a")), "old");
    EXPECT_EQ(content_of(file.beside()), "new");
    EXPECT_EQ(file.commit(), "");
    EXPECT_EQ(content_of(at("a")), "new");
    EXPECT_EQ(fs::status(at("a")).permissions(), fs::perms::owner_read | fs::perms::owner_write);
    EXPECT_FALSE(fs::exists(file.beside()));
}

TEST_F(NewFileTest, WithoutCommitNothingChanges) {
    folder.write("a", "old");
    {
        NewFile file(at("a"));
        EXPECT_EQ(file.write("new"), "");
    }
    EXPECT_EQ(content_of(at("a")), "old");
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
    // What another program has left there is not removed by a run that has written nothing.
    folder.write("a.new", "of another one");
    { const NewFile file(at("a")); }
    EXPECT_EQ(content_of(at("a.new")), "of another one");
}

TEST_F(NewFileTest, ALinkStaysALink) {
    folder.write("a", "old");
    fs::create_symlink("a", folder.path() / "link");
    NewFile file(at("link"));
    EXPECT_EQ(file.write("new"), "");
    EXPECT_EQ(file.commit(), "");
    EXPECT_TRUE(fs::is_symlink(folder.path() / "link"));
    EXPECT_EQ(content_of(at("a")), "new");
}

TEST_F(NewFileTest, ErrorsNameTheFileOfTheUser) {
    NewFile nowhere(at("missing/a"));
    EXPECT_EQ(nowhere.write("new"), at("missing/a") + ": cannot be written: No such file or directory");
    NewFile full("/dev/full");
    EXPECT_EQ(full.write(""), "");
    EXPECT_EQ(full.write("new"), "/dev/full: cannot be written: No space left on device");
    NewFile folder_itself(folder.path().string());
    EXPECT_NE(folder_itself.write("new"), "");
}

}  // namespace
}  // namespace margay::samples
