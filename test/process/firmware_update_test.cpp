// The program firmware_update on simulated bootloaders: complete updates, and all wrong inputs.
#include <places.hpp>
#include "process/shell.hpp"
#include "sim/devices.hpp"
#include "sim/library/bootloader.hpp"
#include "wire/sii.hpp"

#include <gtest/gtest.h>

namespace margay::process {
namespace {

using sim::Bootloader;

class FirmwareUpdate : public testing::Test {
  protected:
    ShellFolder folder;

    void write_image(const std::string& name, std::uint16_t major, std::uint16_t minor, std::size_t bytes,
                     std::uint32_t product = Bootloader::kProduct) const {
        const auto image = Bootloader::make_image(major, minor, bytes, product);
        std::string text;
        for (const auto octet : image) text += static_cast<char>(octet);
        folder.write(name, text);
    }
    [[nodiscard]] Ran update(const std::string& arguments) const {
        return folder.run("'" MARGAY_BIN_DIR "/firmware_update' " + arguments);
    }
    static std::string name_line(unsigned number, const char* name, const char* product) {
        return "slave " + std::to_string(number) + ": " + name + ", vendor 0x00004d47, product " + product +
               ", revision 0x00010000, software 1.0\n";
    }
};

TEST_F(FirmwareUpdate, WritesReadsBackAndTellsTheNewRevision) {
    write_image("firmware.bin", 2, 17, 30'000);
    const auto ran = update("sim:bootloader 2 firmware.bin --password 0x4d47 --read-back");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_EQ(ran.out, name_line(2, "Device with bootloader", "0x00005b00") +
                           "slave 2: 30016 octets written as 'firmware'\n"
                           "slave 2: 30016 octets read back, equal\n"
                           "slave 2 is back in PREOP\n"
                           "  before: vendor 0x00004d47, product 0x00005b00, revision 0x00010000, software 1.0\n"
                           "  now:    vendor 0x00004d47, product 0x00005b00, revision 0x00020011, software 2.17\n");
    EXPECT_EQ(ran.err, "");  // no progress without a terminal
}

TEST_F(FirmwareUpdate, ReadsTheFirmwareIntoAFile) {
    const auto ran = update("sim:bootloader 3 copy.bin --read --name firmware");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(contains(ran.out, "slave 3: 4112 octets of 'firmware' read into copy.bin\n")) << ran.out;
    const auto image = Bootloader::make_image(1, 0, 4096, Bootloader::kOpenProduct);
    const std::string content = content_of(folder.path() / "copy.bin");
    ASSERT_EQ(content.size(), image.size());
    for (std::size_t n = 0; n < image.size(); ++n) ASSERT_EQ(static_cast<std::byte>(content[n]), image[n]) << n;
    EXPECT_FALSE(std::filesystem::exists(folder.path() / "copy.bin.new"));
}

TEST_F(FirmwareUpdate, AFullDiskLeavesTheOldFile) {
    folder.write("copy.bin", "old");
    // The limit is one block of 512 octets.
    const auto ran = folder.run("ulimit -f 1; trap '' XFSZ; exec '" MARGAY_BIN_DIR
                                "/firmware_update' sim:bootloader 3 copy.bin --read --name firmware");
    EXPECT_EQ(ran.status, 3) << ran.out;
    EXPECT_TRUE(contains(ran.err, "copy.bin: cannot be written: File too large")) << ran.err;
    EXPECT_EQ(content_of(folder.path() / "copy.bin"), "old");
    EXPECT_FALSE(std::filesystem::exists(folder.path() / "copy.bin.new"));
}

TEST_F(FirmwareUpdate, ReadingOverwritesNoOtherFile) {
    folder.write("copy.bin.new", "of the user");
    EXPECT_EQ(update("sim:bootloader 3 copy.bin --read --name firmware").status, 0);
    EXPECT_EQ(content_of(folder.path() / "copy.bin").size(), 4112U);
    EXPECT_EQ(content_of(folder.path() / "copy.bin.new"), "of the user");
    EXPECT_FALSE(std::filesystem::exists(folder.path() / "copy.bin.new1"));
}

TEST_F(FirmwareUpdate, ADeviceFileIsWrittenAndNotReplaced) {
    const auto ran = update("sim:bootloader 3 /dev/full --read --name firmware");
    EXPECT_EQ(ran.status, 3);
    EXPECT_TRUE(contains(ran.err, "/dev/full: cannot be written: No space left on device")) << ran.err;
    EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST_F(FirmwareUpdate, FilesThatCannotBeUsed) {
    folder.write("empty.bin", "");
    const std::pair<const char*, const char*> kFiles[] = {
        {"absent.bin", "firmware_update: absent.bin: cannot be read: No such file or directory\n"},
        {"empty.bin", "firmware_update: empty.bin: the file is empty\n"},
        {".", "firmware_update: .: this is a folder\n"},
    };
    for (const auto& [file, words] : kFiles) {
        const auto ran = update(std::string("sim:bootloader 2 ") + file);
        EXPECT_EQ(ran.status, 3) << file;
        EXPECT_EQ(ran.err, words);
        EXPECT_EQ(ran.out, "") << "nothing was done on the segment";
    }
    EXPECT_EQ(update("sim:bootloader 3 no/such/folder/copy.bin --read").status, 3);
}

TEST_F(FirmwareUpdate, AFileThatMayNotBeRead) {
    write_image("secret.bin", 2, 0, 1000);
    std::filesystem::permissions(folder.path() / "secret.bin", std::filesystem::perms::none);
    // Root can read every file, so the program is executed without the capabilities of root.
    const auto ran = folder.run(
        "plain=; [ $(id -u) -ne 0 ] || plain='setpriv --bounding-set=-all --inh-caps=-all'; exec $plain "
        "'" MARGAY_BIN_DIR "/firmware_update' sim:bootloader 2 secret.bin");
    EXPECT_EQ(ran.status, 3) << ran.out;
    EXPECT_EQ(ran.err, "firmware_update: secret.bin: cannot be read: Permission denied\n");
    EXPECT_EQ(ran.out, "");
}

// The SII of the slave promises FoE and BOOT. First the slave has no FoE, then its SII has no bootstrap mailbox.
TEST_F(FirmwareUpdate, SlavesThatDoNotKeepThePromisesOfTheirSii) {
    write_image("firmware.bin", 2, 0, 1000);
    const auto write_sii = [&](const std::string& name, const std::vector<std::byte>& sii) {
        std::string text;
        for (const auto octet : sii) text += static_cast<char>(octet);
        folder.write(name, text);
    };
    auto sii = sim::make_device("bootloader_open")->sii;
    write_sii("no_foe.bin", sii);
    const auto no_foe = update("sim:no_foe.bin 1 firmware.bin");
    EXPECT_EQ(no_foe.status, 1);
    EXPECT_EQ(no_foe.err,
              "firmware_update: slave 1: FoE write: mailbox error reply (detail 0x0002: the mailbox protocol is not "
              "supported)\n"
              "firmware_update: nothing was written, slave 1 is back in PREOP\n");
    std::fill_n(sii.begin() + wire::sii::word::kBootMailbox * 2, 8, std::byte{0});
    write_sii("no_boot.bin", sii);
    const auto no_boot = update("sim:no_boot.bin 1 firmware.bin");
    EXPECT_EQ(no_boot.status, 1);
    EXPECT_EQ(no_boot.err,
              "firmware_update: slave 1 (Device with open bootloader) has no state BOOT: its SII "
              "describes no bootstrap mailbox\n");
}

TEST_F(FirmwareUpdate, ANameLongerThanTheMailboxChangesNothing) {
    write_image("firmware.bin", 2, 0, 1000);
    const auto ran = update("sim:bootloader 3 firmware.bin --name " + std::string(1100, 'n'));
    EXPECT_EQ(ran.status, 1) << ran.out;
    EXPECT_TRUE(contains(ran.err, "FoE write: ")) << ran.err;
    EXPECT_TRUE(contains(ran.err, "nothing was written, slave 3 is back in PREOP")) << ran.err;
}

TEST_F(FirmwareUpdate, AWrongPasswordChangesNothing) {
    write_image("firmware.bin", 2, 0, 1000);
    const auto ran = update("sim:bootloader 2 firmware.bin --password 1");
    EXPECT_EQ(ran.status, 1);
    EXPECT_EQ(ran.err,
              "firmware_update: slave 2: FoE write: the slave ended the file transfer (error code 0x800a: no access "
              "rights); the device says: wrong password\n"
              "firmware_update: nothing was written, slave 2 is back in PREOP\n");
    const auto other = update("sim:bootloader 2 firmware.bin --password 0x4d47 --name other");
    EXPECT_EQ(other.status, 1);
    EXPECT_TRUE(contains(other.err, "the only file is 'firmware'\n")) << other.err;
    EXPECT_TRUE(contains(other.err, "nothing was written")) << other.err;
}

TEST_F(FirmwareUpdate, AFileThatTheDeviceRefusesLeavesItInBoot) {
    write_image("large.bin", 2, 0, Bootloader::kFlashBytes);
    write_image("other.bin", 2, 0, 1000, Bootloader::kOpenProduct);
    const std::pair<const char*, const char*> kFiles[] = {{"large.bin", "the image is larger than the flash"},
                                                          {"other.bin", "the image is for another product"}};
    for (const auto& [file, words] : kFiles) {
        const auto ran = update(std::string("sim:bootloader 2 ") + file + " --name firmware --password 0x4d47");
        EXPECT_EQ(ran.status, 1);
        EXPECT_TRUE(contains(ran.err, words)) << ran.err;
        EXPECT_TRUE(contains(ran.err, "slave 2 is left in BOOT without a complete firmware")) << ran.err;
        EXPECT_TRUE(contains(ran.err,
                             "Do not switch it off. Execute the command again with a file that the device "
                             "accepts; other slaves are in PREOP\n"))
            << ran.err;
    }
}

TEST_F(FirmwareUpdate, SlavesThatTakeNoFirmware) {
    write_image("firmware.bin", 2, 0, 1000);
    const auto coupler = update("sim:bootloader 1 firmware.bin");
    EXPECT_EQ(coupler.status, 1);
    EXPECT_EQ(coupler.err, "firmware_update: slave 1 (EtherCAT coupler) has no FoE\n");
    const auto nobody = update("sim:bootloader 9 firmware.bin");
    EXPECT_EQ(nobody.status, 2);
    EXPECT_EQ(nobody.err, "firmware_update: NUMBER: there are slaves 1 to 5\n");
    EXPECT_EQ(update("sim:bootloader").status, 2);
    EXPECT_EQ(update("sim:bootloader 2").status, 2);
    EXPECT_EQ(update("sim:bootloader two firmware.bin").status, 2);
    EXPECT_EQ(update("sim:bootloader 2 firmware.bin --read --read-back").status, 2);
    EXPECT_EQ(update("sim:nothing 2 firmware.bin").status, 3);
}

TEST_F(FirmwareUpdate, ASlaveThatCannotBeReadSaysWhy) {
    write_image("firmware.bin", 2, 0, 1000);
    folder.write("blank.toml",
                 "[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = \"bootloader\"\nquirks = [\"sii_blank\"]\n");
    const auto ran = update("sim:blank.toml 2 firmware.bin");
    EXPECT_EQ(ran.status, 1);
    EXPECT_TRUE(contains(ran.err, "firmware_update: slave 2: ")) << ran.err;
    EXPECT_TRUE(contains(ran.err, "SII")) << ran.err;
    EXPECT_FALSE(contains(ran.err, "has no FoE")) << ran.err;
}

// The cable loses 2 % of the frames.
TEST_F(FirmwareUpdate, OverALineThatLosesFrames) {
    write_image("firmware.bin", 2, 17, 100'000);
    folder.write("line.toml",
                 "noise = { lost = 0.02, seed = 5 }\n[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = "
                 "\"bootloader\"\n");
    const auto ran = update("sim:line.toml 2 firmware.bin --password 0x4d47 --read-back");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(contains(ran.out, "100016 octets read back, equal")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "revision 0x00020011")) << ran.out;
}

}  // namespace
}  // namespace margay::process
