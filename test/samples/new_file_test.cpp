// A file that replaces another file only when it is complete.
#include "common/new_file.hpp"
#include "common/firmware_file.hpp"
#include "process/shell.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <memory>

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
    // A run that has written nothing does not remove a file of another program.
    folder.write("a.new", "of another one");
    { const NewFile file(at("a")); }
    EXPECT_EQ(content_of(at("a.new")), "of another one");
}

TEST_F(NewFileTest, AFileOfTheUserBesideItStays) {
    folder.write("a", "old");
    folder.write("a.new", "of the user");
    folder.write("victim", "of the user");
    fs::create_symlink("victim", folder.path() / "a.new1");
    NewFile file(at("a"));
    EXPECT_EQ(file.write("new"), "");
    EXPECT_EQ(file.write("newer"), "");
    EXPECT_EQ(file.beside(), at("a.new2"));
    EXPECT_EQ(file.commit(), "");
    EXPECT_EQ(content_of(at("a")), "newer");
    EXPECT_EQ(content_of(at("a.new")), "of the user");
    EXPECT_EQ(content_of(at("victim")), "of the user");
    EXPECT_TRUE(fs::is_symlink(folder.path() / "a.new1"));
    EXPECT_FALSE(fs::is_symlink(folder.path() / "a"));
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

TEST_F(NewFileTest, ALinkThatLeadsToNoFileIsRefused) {
    fs::create_symlink("nothing", folder.path() / "link");
    const std::string refusal = at("link") + ": this symbolic link leads to no file";
    NewFile file(at("link"));
    EXPECT_EQ(file.write("new"), refusal);
    EXPECT_EQ(file.commit(), refusal);
    EXPECT_EQ(FirmwareCopy(at("link")).error(), refusal);
    EXPECT_TRUE(fs::is_symlink(folder.path() / "link"));
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

// This is the case of /dev/stdout when a shell has opened a file for it: the program would replace the file that the
// shell uses.
TEST_F(NewFileTest, AnOpenFileIsRefused) {
    folder.write("a", "old");
    const std::unique_ptr<std::FILE, CloseFirmware> open(std::fopen(at("a").c_str(), "ab"));
    ASSERT_NE(open, nullptr);
    const std::string descriptor = "/proc/self/fd/" + std::to_string(fileno(open.get()));
    fs::create_symlink(descriptor, folder.path() / "link");
    for (const std::string& path : {descriptor, at("link"), "/dev/fd/" + std::to_string(fileno(open.get()))}) {
        const std::string refusal = path + ": this is a regular file that is open: give its own name";
        EXPECT_EQ(NewFile(path).write("new"), refusal);
        EXPECT_EQ(FirmwareCopy(path).error(), refusal);
    }
    EXPECT_EQ(content_of(at("a")), "old");
}

TEST_F(NewFileTest, AFirmwareIsReadIntoTheFileBehindALink) {
    folder.write("a", "old");
    fs::create_symlink("a", folder.path() / "second");
    fs::create_symlink(folder.path() / "second", folder.path() / "link");
    static constexpr std::array kOctets{std::byte{'n'}, std::byte{'e'}, std::byte{'w'}};
    {
        FirmwareCopy copy(at("link"));
        ASSERT_EQ(copy.error(), "");
        EXPECT_EQ(copy.push(kOctets).bytes, 3U);
        EXPECT_EQ(content_of(at("a")), "old");
        EXPECT_EQ(copy.complete(), "");
    }
    EXPECT_TRUE(fs::is_symlink(folder.path() / "link"));
    EXPECT_TRUE(fs::is_symlink(folder.path() / "second"));
    EXPECT_EQ(content_of(at("a")), "new");
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 3);
    FirmwareCopy null("/dev/null");
    EXPECT_EQ(null.push(kOctets).bytes, 3U);
    EXPECT_EQ(null.complete(), "");
    EXPECT_TRUE(fs::is_character_file("/dev/null"));
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
