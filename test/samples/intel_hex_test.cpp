// Intel HEX: records written by hand, every way in which a file can be wrong, and the reader and writer of binutils.
#include "common/intel_hex.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace margay::samples {
namespace {

std::vector<std::byte> octets_of(const std::string& text) {
    std::vector<std::byte> out;
    for (const char c : text) out.push_back(static_cast<std::byte>(c));
    return out;
}

// A record that most descriptions of the format contain.
TEST(IntelHex, ReadsAndWritesARecord) {
    const std::string text = ":0B0010006164647265737320676170A7\n:00000001FF\n";
    const auto read = parse_intel_hex(text);
    ASSERT_EQ(read.error, "");
    ASSERT_EQ(read.octets.size(), 0x1BU);
    for (std::size_t i = 0; i < 0x10; ++i)
        EXPECT_EQ(read.octets[i], std::byte{0xFF});  // octets without a record are 0xFF
    EXPECT_EQ(std::vector<std::byte>(read.octets.begin() + 0x10, read.octets.end()), octets_of("address gap"));
    EXPECT_EQ(to_intel_hex(octets_of("address gap")), ":0B0000006164647265737320676170B7\n:00000001FF\n");
}

TEST(IntelHex, TakesWhatOthersWrite) {
    // Lower case, carriage returns, blank lines, no end of line at the end, start addresses.
    const auto read = parse_intel_hex("\r\n:020000000a0be9\r\n\r\n:04000005000000CD2A\n:00000001ff");
    EXPECT_EQ(read.error, "");
    EXPECT_EQ(read.octets, (std::vector<std::byte>{std::byte{0x0A}, std::byte{0x0B}}));
    // Records in any order; both kinds of extended addresses.
    EXPECT_EQ(parse_intel_hex(":01000100AA54\n:01000000BB44\n:00000001FF").octets,
              (std::vector<std::byte>{std::byte{0xBB}, std::byte{0xAA}}));
    EXPECT_EQ(parse_intel_hex(":020000040001F9\n:0100000055AA\n:00000001FF\n").octets.size(), 0x10001U);
    EXPECT_EQ(parse_intel_hex(":020000021000EC\n:0100000055AA\n:00000001FF\n").octets.size(), 0x10001U);
}

TEST(IntelHex, NamesEveryFault) {
    const auto error = [](const std::string& text) {
        const auto read = parse_intel_hex(text);
        EXPECT_TRUE(read.octets.empty()) << text;
        return read.error;
    };
    EXPECT_EQ(error(":01000000AA56\n:00000001FF\n"), "line 1: the checksum is 0x56, the correct one is 0x55");
    EXPECT_EQ(error(":01000000AA55\nhello\n"), "line 2: not a record: it does not begin with a colon");
    EXPECT_EQ(error(":01000000AA55\n"), "there is no end record: the file is cut off");
    EXPECT_EQ(error(":01000000AA55\n:00000001F"), "line 2: an odd number of digits");
    EXPECT_EQ(error(":02000000AA54\n:00000001FF\n"), "line 1: the record says 2 octets and has 1");
    EXPECT_EQ(error(":0000\n"), "line 1: too short for a record");
    EXPECT_EQ(error(":01000000AG55\n"), "line 1: 'AG' is not two hexadecimal digits");
    EXPECT_EQ(error(":00000001FF\n:01000000AA55\n"), "line 2: there is text behind the end record");
    EXPECT_EQ(error(":01000000AA55\n:01000000AA55\n:00000001FF\n"), "line 2: the octet at 0x0 is given twice");
    EXPECT_EQ(error(":00000007F9\n:00000001FF\n"), "line 1: record type 7 does not exist");
    EXPECT_EQ(error(":0100000401FA\n"), "line 1: an address record has two octets, not 1");
    EXPECT_EQ(error(":020000040100F9\n:01000000AA55\n:00000001FF\n"), "line 2: address 0x1000000 is beyond any EEPROM");
    EXPECT_EQ(error(":00000001FF\n"), "there are no data records");
    EXPECT_EQ(error(""), "there is no end record: the file is cut off");
}

// Every truncated, changed or missing line of a good file is detected.
TEST(IntelHex, NoticesEveryDamage) {
    std::vector<std::byte> image(100);
    for (std::size_t i = 0; i < image.size(); ++i) image[i] = static_cast<std::byte>(i * 37);
    const auto text = to_intel_hex(image);
    ASSERT_EQ(parse_intel_hex(text).octets, image);
    for (std::size_t size = 0; size + 1 < text.size(); ++size)  // the last end of line can be missing
        EXPECT_NE(parse_intel_hex(text.substr(0, size)).error, "") << size;
    for (std::size_t at = 0; at < text.size(); ++at) {
        auto changed = text;
        changed[at] = changed[at] == '1' ? '2' : '1';
        if (at + 1 == text.size()) continue;
        EXPECT_NE(parse_intel_hex(changed).error, "") << at;
    }
}

TEST(IntelHex, IsToldFromBinary) {
    EXPECT_TRUE(looks_like_intel_hex(":00000001FF\n"));
    EXPECT_TRUE(looks_like_intel_hex("\r\n :00000001FF"));
    EXPECT_FALSE(looks_like_intel_hex(""));
    EXPECT_FALSE(looks_like_intel_hex(":"));
    EXPECT_FALSE(looks_like_intel_hex(std::string(":\0\0\0\0\0\0\0\0\0\0\0", 12)));
    EXPECT_FALSE(looks_like_intel_hex("0000000000000"));
}

struct Objcopy : testing::Test {
    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("margay-hex-" + std::to_string(::getpid()));
    void SetUp() override {
        if (std::system("command -v objcopy >/dev/null 2>&1") != 0)
            GTEST_SKIP() << "objcopy (binutils) is not installed";
        std::filesystem::create_directories(folder);
    }
    void TearDown() override { std::filesystem::remove_all(folder); }

    std::string convert(const std::string& content, const std::string& from, const std::string& to) const {
        std::ofstream(folder / "in", std::ios::binary) << content;
        const auto command =
            "objcopy -I " + from + " -O " + to + " " + (folder / "in").string() + " " + (folder / "out").string();
        EXPECT_EQ(std::system(command.c_str()), 0);
        std::ifstream in(folder / "out", std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in), {});
    }
};

TEST_F(Objcopy, ReadsWhatWeWriteAndWritesWhatWeRead) {
    for (const std::size_t size : {1U, 16U, 17U, 2048U, 0x10000U, 0x12345U}) {
        std::string image(size, '\0');
        for (std::size_t i = 0; i < size; ++i) image[i] = static_cast<char>((i * 131) ^ (i >> 8));
        EXPECT_EQ(convert(to_intel_hex(octets_of(image)), "ihex", "binary"), image) << size;
        const auto read = parse_intel_hex(convert(image, "binary", "ihex"));
        EXPECT_EQ(read.error, "");
        EXPECT_EQ(read.octets, octets_of(image)) << size;
    }
}

}  // namespace
}  // namespace margay::samples
