// The program firmware_update over a cable, when something ends it in the middle: the device loses its power, the
// program is stopped or killed. Each time the same command works afterwards.
#include <places.hpp>
#include "netns.hpp"
#include "sim/library/bootloader.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

namespace margay::process {
namespace {

using namespace std::chrono_literals;
using sim::Bootloader;

const std::string kFirmwareUpdate = std::string(MARGAY_BIN_DIR) + "/firmware_update";
const std::string kServeBootloaders = std::string(MARGAY_BIN_DIR) + "/virtual_segment";

class FirmwareInTheMiddle : public testing::Test {
  protected:
    Cable cable;
    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("margay-firmware-" + std::to_string(::getpid()));
    int commands = -1;
    std::unique_ptr<Child> segment;

    void SetUp() override {
        if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
        std::filesystem::create_directories(folder);
        ASSERT_EQ(::mkfifo(file("commands").c_str(), 0600), 0);
        commands = ::open(file("commands").c_str(), O_RDWR | O_CLOEXEC);
        ASSERT_GE(commands, 0);
        std::ofstream(file("line.toml")) << "[[slave]]\ndevice = \"coupler\"\n[[slave]]\nname = \"loader\"\n"
                                            "device = \"bootloader_open\"\n";
        // The large file takes minutes, so that each test ends it in the middle.
        write_image("large.bin", 3, 30'000'000);
        write_image("small.bin", 2, 4'000);
        segment = std::make_unique<Child>(
            cable.segment_namespace(),
            std::vector<std::string>{"/bin/sh", "-c",
                                     "exec " + kServeBootloaders + " " + Cable::kSegment + " " + file("line.toml") +
                                         " --record " + file("record.pcap") + " < " + file("commands")});
        ASSERT_TRUE(segment->says("serving 2 slaves on", 30s)) << segment->errors();
    }
    ~FirmwareInTheMiddle() override {
        if (commands >= 0) ::close(commands);
        std::error_code ignored;
        std::filesystem::remove_all(folder, ignored);
    }
    std::string file(const std::string& name) const { return folder / name; }
    void write_image(const std::string& name, std::uint16_t major, std::size_t bytes) const {
        const auto image = Bootloader::make_image(major, 0, bytes, Bootloader::kOpenProduct);
        std::string text(image.size(), '\0');
        for (std::size_t n = 0; n < image.size(); ++n) text[n] = static_cast<char>(image[n]);
        std::ofstream(file(name), std::ios::binary) << text;
    }
    void command(const std::string& text) const {
        const auto line = text + "\n";
        ASSERT_EQ(::write(commands, line.data(), line.size()), static_cast<ssize_t>(line.size()));
    }
    std::unique_ptr<Child> update(const std::string& image) const {
        return std::make_unique<Child>(
            cable.master_namespace(),
            std::vector<std::string>{"/bin/sh", "-c",
                                     "echo $$ > " + file("pid") + "; exec " + kFirmwareUpdate + " " + Cable::kMaster +
                                         " 2 " + file(image) + " --name firmware"});
    }
    // Starts the update and waits until a part of the file is in the device: the recording of the segment grows.
    std::unique_ptr<Child> update_in_the_middle() {
        auto child = update("large.bin");
        EXPECT_TRUE(segment->says("slave 2 (loader): BOOT", 60s)) << segment->output() << child->errors();
        const auto begin = std::filesystem::file_size(file("record.pcap"));
        while (!child->ended() && std::filesystem::file_size(file("record.pcap")) < begin + 400'000)
            std::this_thread::sleep_for(5ms);
        EXPECT_FALSE(child->ended()) << child->output() << child->errors();
        return child;
    }
    void signal(int number) const {
        pid_t id = 0;
        std::ifstream(file("pid")) >> id;
        ASSERT_GT(id, 1);
        ASSERT_EQ(::kill(id, number), 0);
    }
    void expect_second_try_works() {
        const auto child = update("small.bin");
        EXPECT_EQ(child->wait(120s), 0) << child->output() << child->errors();
        EXPECT_NE(child->output().find("slave 2: 4016 octets written as 'firmware'\n"), std::string::npos)
            << child->output();
        EXPECT_NE(child->output().find("revision 0x00020000"), std::string::npos) << child->output();
    }
};

TEST_F(FirmwareInTheMiddle, APowerLossOfTheDeviceIsToldAndTheSecondTryWorks) {
    const auto child = update_in_the_middle();
    command("power off 2");
    EXPECT_EQ(child->wait(120s), 1) << child->output();
    EXPECT_NE(child->errors().find("slave 2 does not answer any more, and has no complete firmware. When it answers "
                                   "again, execute the same command again to write the whole file"),
              std::string::npos)
        << child->errors();
    EXPECT_EQ(child->output().find("written as"), std::string::npos) << child->output();
    command("power on 2");
    ASSERT_TRUE(segment->says("slave 2 (loader): INIT", 30s)) << segment->output();
    expect_second_try_works();
}

TEST_F(FirmwareInTheMiddle, CtrlCEndsTheTransferAndTheSecondTryWorks) {
    const auto child = update_in_the_middle();
    signal(SIGINT);
    EXPECT_EQ(child->wait(120s), 1) << child->output();
    EXPECT_NE(child->errors().find("stopped after "), std::string::npos) << child->errors();
    EXPECT_NE(child->errors().find("slave 2 is left in BOOT without a complete firmware. Do not switch it off. Execute "
                                   "the same command again"),
              std::string::npos)
        << child->errors();
    expect_second_try_works();
}

// After an earlier run, a device is in BOOT. It stays in BOOT after it was read.
TEST_F(FirmwareInTheMiddle, ReadingDoesNotTakeTheDeviceOutOfBoot) {
    const auto child = update_in_the_middle();
    signal(SIGINT);
    EXPECT_EQ(child->wait(120s), 1) << child->output();
    Child read(cable.master_namespace(),
               {kFirmwareUpdate, Cable::kMaster, "2", file("copy.bin"), "--read", "--name", "firmware"});
    EXPECT_EQ(read.wait(120s), 0) << read.output() << read.errors();
    EXPECT_NE(read.errors().find("slave 2 was in BOOT before, and is left there: its firmware may be incomplete"),
              std::string::npos)
        << read.errors();
    const std::string said = segment->output();
    EXPECT_EQ(said.rfind("slave 2 (loader): "), said.rfind("slave 2 (loader): BOOT")) << said;
    expect_second_try_works();
}

// The computer of the master loses its power.
TEST_F(FirmwareInTheMiddle, AfterAKilledProgramTheSecondTryWorks) {
    const auto child = update_in_the_middle();
    signal(SIGKILL);
    EXPECT_EQ(child->wait(120s), -1);
    expect_second_try_works();
}

}  // namespace
}  // namespace margay::process
