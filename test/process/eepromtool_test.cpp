// The program eepromtool, executed on simulated slaves and on files.
#include <places.hpp>
#include "process/shell.hpp"
#include "wire/sii_writer.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace margay::process {
namespace {

namespace fs = std::filesystem;
namespace sii = wire::sii;

class Eepromtool : public testing::Test {
  protected:
    Eepromtool() {
        fs::create_directories(folder_);
        write(a_, image(1));
        write(b_, image(2));
    }
    ~Eepromtool() override { fs::remove_all(folder_); }

    [[nodiscard]] std::string file(const std::string& name) const { return folder_ / name; }
    static void write(const std::string& path, const std::string& content) {
        std::ofstream(path, std::ios::binary) << content;
    }
    static std::string content(const std::string& path) {
        std::ifstream in(path, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in), {});
    }
    static std::string image(std::uint32_t product, std::size_t size = 1024, const std::string& group = "") {
        std::vector<std::byte> octets(size);
        const auto name = "Made up " + std::to_string(product);
        EXPECT_TRUE(sii::write_image({.configuration = {.pdi_control = 0x0104},
                                      .identity = {0x4D47, product, 1, 1},
                                      .group = group,
                                      .name = name},
                                     octets)
                        .ok());
        std::string out;
        for (const auto octet : octets) out += static_cast<char>(octet);
        return out;
    }

    // Executes eepromtool in the folder of the test.
    [[nodiscard]] Ran tool(const std::string& arguments) const {
        const auto command = "cd '" + folder_.string() + "' && '" MARGAY_BIN_DIR "/eepromtool' " + arguments +
                             " >.out 2>.err </dev/null";
        const int status = std::system(command.c_str());
        return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, content(file(".out")), content(file(".err"))};
    }

    fs::path folder_ = fs::temp_directory_path() / ("margay-eepromtool-" + std::to_string(::getpid()));
    std::string a_ = file("a.bin");
    std::string b_ = file("b.bin");
};

bool contains(const std::string& text, const std::string& part) { return text.find(part) != text.npos; }

TEST_F(Eepromtool, ReadsASlaveIntoBothKindsOfFiles) {
    const auto binary = tool("sim:a.bin,b.bin 2 read out.bin");
    EXPECT_EQ(binary.status, 0) << binary.err;
    EXPECT_EQ(binary.out, "slave 2: 1024 octets read into out.bin\n");
    EXPECT_EQ(binary.err, "");  // no progress without a terminal
    EXPECT_EQ(content(file("out.bin")), content(b_));

    EXPECT_EQ(tool("sim:a.bin,b.bin 2 read out.hex").status, 0);
    EXPECT_TRUE(content(file("out.hex")).starts_with(":10000000"));
    EXPECT_EQ(tool("file:out.hex read again.bin").status, 0);
    EXPECT_EQ(content(file("again.bin")), content(b_));
}

TEST_F(Eepromtool, ReadsToStandardOutput) {
    EXPECT_EQ(tool("sim:a.bin 1 read").out, content(a_));
    EXPECT_EQ(tool("sim:a.bin 1 read -").out, content(a_));
    const auto hex = tool("sim:a.bin 1 read - --format hex");
    EXPECT_TRUE(hex.out.starts_with(":10000000"));
    EXPECT_TRUE(hex.out.ends_with(":00000001FF\n"));
}

TEST_F(Eepromtool, WritesASlaveAndSaysWhatBecomesOfIt) {
    const auto ran = tool("sim:a.bin,b.bin 1 write b.bin");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(contains(ran.out, " of 512 words were different and are written, all verified\n")) << ran.out;
    EXPECT_TRUE(contains(ran.err, "a simulated slave forgets this")) << ran.err;
    EXPECT_EQ(content(a_), image(1));  // the image file of the simulated slave is not changed
}

TEST_F(Eepromtool, WritesAFileInPlace) {
    EXPECT_EQ(tool("file:b.bin read b.hex").status, 0);
    const auto ran = tool("file:a.bin write b.hex");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(contains(ran.out, "a.bin: ")) << ran.out;
    EXPECT_EQ(content(a_), content(b_));
    EXPECT_EQ(ran.err, "");
}

TEST_F(Eepromtool, DumpsByCategory) {
    const auto slave = tool("sim:a.bin,b.bin 2 dump");
    EXPECT_EQ(slave.status, 0) << slave.err;
    EXPECT_TRUE(contains(slave.out, "category 10 strings")) << slave.out;
    EXPECT_TRUE(contains(slave.out, "\"Made up 2\" (1)"));
    EXPECT_EQ(tool("file:b.bin dump").out, slave.out);
    EXPECT_EQ(tool("file:b.bin 1 dump").out, slave.out);
}

// The size word gives 4 MiB, which would take minutes to read. Only the part in use is read; --size reads all.
TEST_F(Eepromtool, ReadsNoMoreThanIsInUseWhereTheSizeIsAbsurd) {
    auto big = image(4);
    big[0x7C] = '\xFF';
    big[0x7D] = '\x7F';
    write(file("big.bin"), big);
    const auto ran = tool("sim:big.bin 1 read out.bin");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(contains(ran.err,
                         "note: word 0x003e of slave 1 gives 4194304 octets; only the part up to the end mark is read, "
                         "use --size 4194304 to read all"))
        << ran.err;
    const auto read = content(file("out.bin"));
    EXPECT_LT(read.size(), 300U);
    EXPECT_EQ(read, big.substr(0, read.size()));
    EXPECT_EQ(tool("sim:big.bin 1 read out.bin --size 1024").status, 0);
    EXPECT_EQ(content(file("out.bin")), big);
}

TEST_F(Eepromtool, ShowsAndWritesTheAlias) {
    EXPECT_EQ(tool("sim:a.bin 1 alias").out, "0x0000\n");
    EXPECT_TRUE(contains(tool("sim:a.bin 1 alias 0x1234").out, "alias 0x1234, before 0x0000"));
    EXPECT_EQ(tool("file:a.bin alias 4660").status, 0);
    EXPECT_EQ(tool("file:a.bin alias").out, "0x1234\n");
    EXPECT_TRUE(contains(tool("file:a.bin dump").out, ", right\n"));  // the checksum
    EXPECT_EQ(tool("sim:a.bin 1 alias").out, "0x1234\n");
    EXPECT_EQ(tool("file:a.bin alias 010").status, 0);
    EXPECT_EQ(tool("file:a.bin alias").out, "0x000a\n") << "not octal";
    EXPECT_EQ(tool("file:a.bin alias 0x1234").status, 0);
    EXPECT_EQ(tool("file:a.bin alias 65536").status, 2);
    EXPECT_EQ(tool("file:a.bin alias -- -1").status, 2);
    EXPECT_EQ(tool("file:a.bin alias").out, "0x1234\n");
}

TEST_F(Eepromtool, RefusesWhatDoesNotFit) {
    write(file("large.bin"), image(3, 2048));
    const auto slave = tool("sim:a.bin 1 write large.bin");
    EXPECT_EQ(slave.status, 1);
    EXPECT_EQ(slave.err,
              "eepromtool: large.bin is not written: it has 2048 octets, the EEPROM of slave 1 has 1024; "
              "use --size if this is wrong\n");
    const auto other = tool("file:a.bin write large.bin");
    EXPECT_EQ(other.status, 1);
    EXPECT_EQ(content(a_), image(1));
    // The image does not fit, also with a larger --size. The word after the end is not written.
    const std::string name(250, 'x');
    write(file("full.bin"), image(3, 2048, name));
    write(file("small.bin"), image(1, 256));
    const auto lied = tool("sim:small.bin 1 write full.bin --size 2048");
    EXPECT_EQ(lied.status, 1) << lied.out;
    EXPECT_TRUE(contains(lied.err, "it is uncertain whether word 0x0080 was written: slave 1")) << lied.err;
    EXPECT_FALSE(contains(lied.out, "verified"));
}

TEST_F(Eepromtool, RefusesBadImagesUnlessForced) {
    auto bad = image(3);
    bad[14] ^= 1;
    write(file("bad.bin"), bad);
    const auto refused = tool("file:a.bin write bad.bin");
    EXPECT_EQ(refused.status, 1);
    EXPECT_TRUE(contains(refused.err, "checksum")) << refused.err;
    EXPECT_TRUE(contains(refused.err, "--force")) << refused.err;
    EXPECT_EQ(content(a_), image(1));
    const auto forced = tool("file:a.bin write bad.bin --force");
    EXPECT_EQ(forced.status, 0) << forced.err;
    EXPECT_TRUE(contains(forced.err, "warning: word 0x0007")) << forced.err;
    EXPECT_EQ(content(a_), bad);

    const auto aliased = tool("file:a.bin alias 3");
    EXPECT_EQ(aliased.status, 1);
    EXPECT_TRUE(contains(aliased.err, "--force")) << aliased.err;
    EXPECT_EQ(content(a_), bad);

    write(file("odd.bin"), image(3) + "x");
    EXPECT_EQ(tool("file:a.bin write odd.bin --force").status, 1);
    write(file("broken.hex"), ":00000001FE\n");
    EXPECT_TRUE(contains(tool("file:a.bin write broken.hex").err, "broken.hex: line 1: the checksum"));
    EXPECT_TRUE(contains(tool("file:a.bin write none.bin").err, "none.bin: cannot be read: No such file"));
}

TEST_F(Eepromtool, DumpOfAFaultyContentEndsWithOne) {
    EXPECT_EQ(tool("file:a.bin dump").status, 0);
    std::string junk(1024, '\x5A');
    write(file("junk.bin"), junk);
    const auto dumped = tool("file:junk.bin dump");
    EXPECT_EQ(dumped.status, 1);
    EXPECT_NE(dumped.out, "") << "the content is shown nevertheless";
    EXPECT_TRUE(contains(dumped.err, "eepromtool: the content of junk.bin has faults: ")) << dumped.err;
    EXPECT_TRUE(contains(tool("dump --help").out, "ends with 1 when the content has faults"))
        << tool("dump --help").out << tool("--help").out;
}

// A size word that is too small does not prevent the program from reading and writing the words after the given size.
TEST_F(Eepromtool, RepairsASizeWordThatIsTooSmall) {
    auto image_of_128 = content(file("a.bin"));
    image_of_128[0x7C] = '\0';  // word 0x003E: 128 octets
    image_of_128[0x7D] = '\0';
    write(file("short.bin"), image_of_128);
    const auto size = std::to_string(image_of_128.size());
    EXPECT_EQ(tool("sim:short.bin 1 read out.bin --size " + size).status, 0);
    EXPECT_EQ(content(file("out.bin")), image_of_128);
    const auto written = tool("sim:short.bin 1 write a.bin --size " + size);
    EXPECT_EQ(written.status, 0) << written.err;
    EXPECT_TRUE(contains(written.out, "verified")) << written.out;
}

TEST_F(Eepromtool, NamesTheCommandsWhenNoneIsGiven) {
    const auto none = tool("sim:a.bin 1");
    EXPECT_EQ(none.status, 2);
    EXPECT_TRUE(contains(none.err, "eepromtool: the command is missing: read, write, dump, alias; see ")) << none.err;
}

TEST_F(Eepromtool, HandlesBlankEeproms) {
    write(file("blank.bin"), std::string(1024, '\xFF'));
    const auto unknown = tool("sim:a.bin,blank.bin 2 read out.bin");
    EXPECT_EQ(unknown.status, 1);
    EXPECT_TRUE(contains(unknown.err, "the size of the EEPROM of slave 2 is unknown")) << unknown.err;
    EXPECT_TRUE(contains(unknown.err, "--size")) << unknown.err;
    EXPECT_FALSE(fs::exists(file("out.bin")));
    EXPECT_EQ(tool("sim:a.bin,blank.bin 2 read out.bin --size 1024").status, 0);
    EXPECT_EQ(content(file("out.bin")), content(file("blank.bin")));
    const auto dumped = tool("sim:a.bin,blank.bin 2 dump --size 1024");
    EXPECT_TRUE(contains(dumped.out, "the EEPROM is blank"));
    EXPECT_EQ(dumped.status, 1);
    const auto written = tool("sim:a.bin,blank.bin 2 write a.bin");
    EXPECT_EQ(written.status, 0) << written.err;
    EXPECT_TRUE(contains(written.out, "verified"));
    EXPECT_EQ(tool("sim:a.bin 1 write blank.bin").status, 1);
}

TEST_F(Eepromtool, NamesWhatIsWrongWithItsArguments) {
    EXPECT_TRUE(contains(tool("sim:a.bin,b.bin 3 dump").err, "there is no slave 3: there are slaves 1 to 2"));
    EXPECT_EQ(tool("sim:a.bin,b.bin 3 dump").status, 2);
    EXPECT_TRUE(contains(tool("sim:a.bin dump").err, "NUMBER"));
    EXPECT_EQ(tool("sim:a.bin 0 dump").status, 2);
    EXPECT_TRUE(contains(tool("file:a.bin 2 dump").err, "NUMBER is 1"));
    EXPECT_TRUE(contains(tool("file:none dump").err, "none: cannot be read"));
    EXPECT_EQ(tool("sim:a.bin 1").status, 2);
    EXPECT_EQ(tool("sim:a.bin 1 erase").status, 2);
    EXPECT_EQ(tool("sim:a.bin 1 write").status, 2);
    EXPECT_EQ(tool("sim:a.bin 1 read out.bin --format tape").status, 2);
    EXPECT_EQ(tool("sim:a.bin 1 read out.bin --size 3").status, 2);
    EXPECT_FALSE(fs::exists(file("out.bin")));
    const auto unwritable = tool("sim:a.bin 1 read none/out.bin");
    EXPECT_EQ(unwritable.status, 3);
    EXPECT_EQ(unwritable.err, "eepromtool: none/out.bin: cannot be written: No such file or directory\n");
    EXPECT_EQ(unwritable.out, "");
}

// A replay contains only the answers to the recorded requests, so the verification of another value fails.
TEST_F(Eepromtool, WorksOnItsOwnRecording) {
    const auto live = tool("--record r.pcap sim:a.bin,b.bin 2 dump");
    EXPECT_EQ(live.status, 0) << live.err;
    const auto replayed = tool("pcap:r.pcap 2 dump");
    EXPECT_EQ(replayed.status, 0) << replayed.err;
    EXPECT_EQ(replayed.out, live.out);
    EXPECT_EQ(tool("--record w.pcap sim:a.bin,b.bin 2 alias 7").status, 0);
    const auto other = tool("pcap:w.pcap 2 alias 8");
    EXPECT_EQ(other.status, 1);
    EXPECT_TRUE(contains(other.err, "it is uncertain whether word ")) << other.err;
}

TEST_F(Eepromtool, ShowsProgressOnATerminalOnly) {
    if (std::system("script -qec true /dev/null >/dev/null 2>&1 </dev/null") != 0)
        GTEST_SKIP() << "no script (bsdutils), or no pseudo-terminal for it";
    const auto command = "cd '" + folder_.string() +
                         "' && script -qec \"'" MARGAY_BIN_DIR
                         "/eepromtool' sim:a.bin 1 write b.bin\" /dev/null >.tty </dev/null";
    EXPECT_EQ(std::system(command.c_str()), 0);
    const auto shown = content(file(".tty"));
    EXPECT_TRUE(contains(shown, "reading 0 of 1024")) << shown;
    EXPECT_TRUE(contains(shown, "writing 0 of ")) << shown;
    EXPECT_TRUE(contains(shown, "verifying 1024 of 1024")) << shown;
    EXPECT_TRUE(contains(shown, "all verified")) << shown;

    // Standard output on a terminal gets text, not octets.
    const auto read = "cd '" + folder_.string() +
                      "' && script -qec \"'" MARGAY_BIN_DIR
                      "/eepromtool' sim:a.bin 1 read\" /dev/null >.tty </dev/null";
    EXPECT_EQ(std::system(read.c_str()), 0);
    EXPECT_TRUE(contains(content(file(".tty")), ":00000001FF"));
}

}  // namespace
}  // namespace margay::process
