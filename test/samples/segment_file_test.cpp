// Segment descriptions: the effect of each key, and errors with their line.
#include "common/segment_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace margay::samples {
namespace {

std::string error_of(const std::string& text) {
    auto loaded = parse_segment(text, "plant.toml", "/nowhere");
    return loaded ? "" : loaded.error();
}

const std::string kCoupler = "[[slave]]\nname = \"a\"\ndevice = \"coupler\"\n";

TEST(SegmentFile, WhatIsWrongIsToldWithItsLine) {
    const std::pair<std::string, std::string> wrong[] = {
        {"", "plant.toml: there are no slaves: each is a [[slave]]"},
        {"title = \"x\"\n[[slave]\n", "plant.toml: line 2: "},
        {"speed = 3\n" + kCoupler, "plant.toml: line 1: the description has no key 'speed'; its keys are: title"},
        {kCoupler + "colour = 3\n", "plant.toml: line 4: a slave has no key 'colour'; its keys are: name, device"},
        {"[[slave]]\nname = \"a\"\n", "plant.toml: line 1: a slave is made by either 'device' or 'sii'"},
        {kCoupler + "sii = \"x.bin\"\n", "plant.toml: line 1: a slave is made by either 'device' or 'sii'"},
        {"[[slave]]\ndevice = \"odd_device\"\nquirks = [\"polite\"]\n",
         "plant.toml: line 3: there is no quirk 'polite'; there are: sii_blank"},
        {"[[slave]]\ndevice = \"coupler\"\nquirks = [\"replies_twice\"]\n",
         "plant.toml: line 3: 'replies_twice' is a quirk of the slave stack, but this device has no slave stack"},
        {"[[slave]]\ndevice = \"toaster\"\n",
         "plant.toml: line 2: there is no device 'toaster' in the library; there are: coupler"},
        {"[[slave]]\nsii = \"gone.bin\"\n", "plant.toml: line 2: cannot read the SII image '/nowhere/gone.bin'"},
        // Loops, ports used twice, missing parents.
        {kCoupler + "[[slave]]\nname = \"b\"\ndevice = \"junction\"\nparent = \"c\"\n[[slave]]\nname = \"c\"\ndevice = "
                    "\"junction\"\nparent = \"b\"\n",
         "plant.toml: line 7: the parent 'c' is defined later, in line 8: define a parent before its children, so that "
         "cables cannot form a loop"},
        {kCoupler + "[[slave]]\nname = \"b\"\ndevice = \"junction\"\nparent = \"b\"\n",
         "plant.toml: line 7: the parent 'b' is defined later, in line 4: define a parent before its children"},
        {kCoupler + "parent = \"a\"\n",
         "plant.toml: line 4: the first slave is connected to the master and has no parent"},
        {kCoupler + "[[slave]]\ndevice = \"digital_in_8\"\nparent = \"z\"\n",
         "plant.toml: line 6: there is no slave 'z'"},
        {kCoupler +
             "[[slave]]\ndevice = \"digital_in_8\"\n[[slave]]\ndevice = \"digital_in_8\"\nparent = \"a\"\nport = 1\n",
         "plant.toml: line 9: port 1 of the slave 'a' is taken already"},
        {kCoupler + "[[slave]]\ndevice = \"digital_in_8\"\nport = 0\n",
         "plant.toml: line 6: port 0 of the slave 'a' is taken already"},
        {kCoupler + "[[slave]]\ndevice = \"digital_in_8\"\nport = 3\n",
         "plant.toml: line 6: the slave 'a' has no port 3"},
        {kCoupler + "[[slave]]\ndevice = \"digital_in_8\"\nenter = 3\n", "plant.toml: line 4: the slave has no port 3"},
        {kCoupler + "[[slave]]\nname = \"a\"\ndevice = \"coupler\"\n",
         "plant.toml: line 5: there is a slave 'a' already"},
        {kCoupler + "[[slave]]\nname = \"b\"\ndevice = \"digital_in_8\"\n[[slave]]\ndevice = "
                    "\"digital_in_8\"\n[[slave]]\ndevice "
                    "= \"digital_in_8\"\nparent = \"b\"\n",
         "plant.toml: line 9: the slave 'b' has no free port"},
        {kCoupler + "count = 2\nalias = 7\n",
         "plant.toml: line 5: 'alias' is allowed for one slave only, but 'count' is 2"},
        {kCoupler + "count = 0\n", "plant.toml: line 4: 'count' is 0, it must be from 1 to 65535"},
        // Values.
        {kCoupler + "serial = \"x\"\n", "plant.toml: line 4: 'serial' must be an integer"},
        {kCoupler + "fmmus = 17\n", "plant.toml: line 4: 'fmmus' is 17, it must be from 0 to 16"},
        {kCoupler + "cable_ns = -1\n", "plant.toml: line 4: 'cable_ns' is -1, it must be from 0 to 1000000"},
        {kCoupler + "dc = \"16\"\n", "plant.toml: line 4: 'dc' is \"none\", \"receive_times\", \"32\" or \"64\""},
        {kCoupler + "chip = \"z80\"\n", "plant.toml: line 4: there is no chip 'z80'; there are: et1100"},
        {kCoupler + "ports = [\"mii\", \"usb\"]\n", "plant.toml: line 4: there is no kind of port 'usb'"},
        {kCoupler + "power = 1\n", "plant.toml: line 4: 'power' must be true or false"},
        {kCoupler + "preset = [[0x0120]]\n", "plant.toml: line 4: a preset is an address followed by octets"},
        {kCoupler + "errors = 3\n", "plant.toml: line 4: 'errors' is a list of lists: [[0, 14, 1], …]"},
        {kCoupler + "errors = [[0, 14]]\n",
         "plant.toml: line 4: an entry of 'errors' is a port, its damaged frames and its lost links"},
        {kCoupler + "errors = [[4, 1, 1]]\n", "plant.toml: line 4: 'errors' is 4, it must be from 0 to 3"},
        {kCoupler + "errors = [[0, 256, 1]]\n", "plant.toml: line 4: 'errors' is 256, it must be from 0 to 255"},
        {"ring = { slave = \"z\" }\n" + kCoupler, "plant.toml: line 1: there is no slave 'z'"},
        {"ring = { slave = \"a\", port = 0 }\n" + kCoupler,
         "plant.toml: line 1: port 0 of the slave 'a' does not exist or is taken already"},
        {"noise = { lost = 2.0 }\n" + kCoupler, "plant.toml: line 1: 'lost' is a number from 0 to 1"},
        {"slave = 3\n", "plant.toml: there are no slaves: each is a [[slave]]"},
        {"slave = [3]\n", "plant.toml: line 1: a slave is a table: [[slave]]"},
    };
    for (const auto& [text, told] : wrong) {
        const auto error = error_of(text);
        EXPECT_EQ(error.substr(0, told.size()), told) << text;
    }
}

struct SegmentFiles : testing::Test {
    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("margay-segment-file-" + std::to_string(::getpid()));
    SegmentFiles() { std::filesystem::create_directories(folder); }
    ~SegmentFiles() override { std::filesystem::remove_all(folder); }
    void write(const std::string& name, const std::string& content) const {
        std::ofstream(folder / name, std::ios::binary) << content;
    }
    std::string error(const std::string& text) const {
        auto loaded = parse_segment(text, "plant.toml", folder.string());
        return loaded ? "" : loaded.error();
    }
};

TEST_F(SegmentFiles, UnreadableSiiIsToldWithItsLine) {
    write("empty.bin", "");
    write("short.bin", std::string(100, '\x07'));
    write("text.bin", std::string(1000, 'a'));
    std::filesystem::create_directory(folder / "folder.bin");
    const auto path = [&](const std::string& name) { return (folder / name).string(); };
    EXPECT_EQ(error("[[slave]]\nsii = \"empty.bin\"\n"),
              "plant.toml: line 2: '" + path("empty.bin") +
                  "' is no SII image: 0 octets, where the fixed part alone takes 128");
    EXPECT_EQ(error("[[slave]]\nsii = \"short.bin\"\n")
                  .find("plant.toml: line 2: '" + path("short.bin") + "' is no SII image: 100"),
              0u);
    EXPECT_EQ(error("[[slave]]\nsii = \"text.bin\"\n").find("plant.toml: line 2: '" + path("text.bin") + "' is text"),
              0u);
    EXPECT_EQ(error("[[slave]]\nsii = \"folder.bin\"\n"),
              "plant.toml: line 2: '" + path("folder.bin") + "' is a folder, not an SII image");
}

// An image with useless content also makes a device, like hardware with a blank EEPROM.
TEST_F(SegmentFiles, BlankAndBrokenImagesAreDevices) {
    write("blank.bin", std::string(2048, '\xFF'));
    write("zero.bin", std::string(2048, '\0'));
    std::string noise(2048, '\0');
    for (std::size_t i = 0; i < noise.size(); ++i) noise[i] = static_cast<char>(i * i * 31 + i * 7 + 128);
    write("noise.bin", noise);
    auto loaded =
        parse_segment("[[slave]]\nsii = \"blank.bin\"\n[[slave]]\nsii = \"zero.bin\"\n[[slave]]\nsii = \"noise.bin\"\n",
                      "plant.toml", folder.string());
    ASSERT_TRUE(loaded) << loaded.error();
    // ESC data sheets: a checksum error sets "device information not loaded" in 0x0502 bits 11 and 12.
    EXPECT_EQ(loaded->segment.slave(0).registers().get<std::uint16_t>(0x0502) & 0x1800, 0x1800);
    EXPECT_EQ(loaded->segment.slave(0).registers().get<std::uint16_t>(0x0110) & 1, 0);
}

TEST(SegmentFile, KeysOfASlaveDoWhatTheySay) {
    auto loaded = parse_segment(R"(
round_trip_us = 33
noise = { lost = 0.5, seed = 7 }
ring = { slave = "end2", port = 1 }
[[slave]]
name = "first"
device = "coupler"
chip = "junction"
type = 0x22
revision = 3
build = 0x0102
fmmus = 5
sync_managers = 6
ram_kib = 7
features = 0x01CC
alias = 0x1234
drift_ppb = 500
clock_start_ns = 77000
sii_read_us = 11
sii_8_bytes = false
sii_status = 0x10
station = 0x1001
preset = [[0x0120, 0x02, 0x00], [0x0F80, 1, 2, 3]]
[[slave]]
name = "end"
device = "pulse_axis"
count = 2
cable_ns = 100
serial = 99
[[slave]]
name = "off"
device = "pulse_axis"
parent = "first"
power = false
)",
                                "plant.toml", ".");
    ASSERT_TRUE(loaded) << loaded.error();
    EXPECT_EQ(loaded->names, (std::vector<std::string>{"first", "end1", "end2", "off"}));
    EXPECT_EQ(loaded->round_trip, std::chrono::microseconds(33));
    EXPECT_EQ(loaded->segment.noise().lost, 0.5);
    EXPECT_EQ(loaded->segment.noise().seed, 7u);
    EXPECT_TRUE(loaded->segment.master_link(1));
    EXPECT_FALSE(loaded->segment.powered(3));
    const auto& first = loaded->segment.slave(0);
    EXPECT_EQ(first.peek(0x0000, 10),
              (std::vector<std::byte>{std::byte{0x22}, std::byte{3}, std::byte{2}, std::byte{1}, std::byte{5},
                                      std::byte{6}, std::byte{7}, std::byte{0xFF}, std::byte{0xCC}, std::byte{1}}));
    EXPECT_EQ(first.station(), 0x1001);
    EXPECT_EQ(first.alias(), 0x1234);
    EXPECT_EQ(first.registers().get<std::uint16_t>(0x0130), 2);
    EXPECT_EQ(first.registers().get<std::uint16_t>(0x0502), 0x0010);
    EXPECT_EQ(first.registers().get<std::uint8_t>(0x0F82), 3);
    EXPECT_EQ(first.clock().local(Time{} + std::chrono::seconds(1)), 1'000'077'500u);
    EXPECT_EQ(load_le<std::uint32_t>(loaded->segment.slave(2).sii().image(), 28), 99u);
    EXPECT_EQ(loaded->segment.order(), (std::vector<std::uint32_t>{0, 1, 2}));
}

}  // namespace
}  // namespace margay::samples
