// The dump of an image: it contains everything in the image, and all faults.
#include "common/sii_text.hpp"

#include "wire/sii_writer.hpp"

#include <gtest/gtest.h>

#include <random>

namespace margay::samples {
namespace {

namespace sii = wire::sii;

std::vector<std::byte> image() {
    static constexpr sii::PdoEntryDescription entries[] = {{0x6000, 1, "Level", 0x05, 8, 0}, {0, 0, "", 0, 8, 0}};
    static constexpr sii::PdoDescription inputs[] = {{0x1A00, 3, 0, "Inputs", sii::pdo_flag::kMandatory, entries},
                                                     {0x1A01, sii::Pdo::kNoSyncManager, 0, "", 0, {}}};
    static constexpr FmmuUse fmmus[] = {FmmuUse::inputs, FmmuUse::mailbox_status};
    static constexpr SmInfo managers[] = {{0x1000, 128, 0x26, 1, SmType::mailbox_out},
                                          {0x1400, 2, 0x20, 9, SmType::inputs}};
    static constexpr sii::DcDescription dc[] = {{{.sync0_shift_time_ns = -5, .assign_activate = 0x0300}, "DC", ""}};
    static constexpr std::byte vendor_octets[] = {std::byte{'o'}, std::byte{'k'}, std::byte{0}, std::byte{0xFE}};
    static const sii::RawCategory others[] = {{0x8007, vendor_octets}};
    std::vector<std::byte> out(1024);
    EXPECT_TRUE(
        sii::write_image({.configuration = {.sync_pulse_length_10ns = 100, .alias = 0x0203},
                          .identity = {0x4D47, 0x11223344, 5, 6},
                          .mailbox = {0x1000, 128, 0x1080, 128, mailbox_protocol::kCoE | mailbox_protocol::kEoE},
                          .name = "Tank \xB5",
                          .general = {.coe_details = coe_detail::kSdo, .ebus_current_ma = -12, .physical_ports = 0x31},
                          .fmmus = fmmus,
                          .sync_managers = managers,
                          .tx_pdos = inputs,
                          .dc = dc,
                          .others = others},
                         out)
            .ok());
    return out;
}

TEST(SiiText, ShowsWhatIsInAnImage) {
    const auto text = sii_text(image());
    for (const auto* line : {
             "size                   1024 octets by word 0x003e, 1024 here\n",
             "SYNC pulse length      1000 ns\n",
             "alias                  0x0203\n",
             "vendor                 0x00004d47\n",
             "product                0x11223344\n",
             "mailbox                out 0x1000 128 octets, in 0x1080 128 octets\n",
             "boot mailbox           none\n",
             "mailbox protocols      EoE CoE\n",
             "  name                 \"Tank \u00B5\" (1)\n",
             "  CoE                  SDO\n",
             "  E-bus current        -12 mA (fed in)\n",
             "  ports                MII, E-bus, -, -\n",
             "  FMMU 1  mailbox status\n",
             "  SM 1  0x1400     2 octets  control 0x20  inputs  enabled op-only\n",
             "  PDO 0x1a00  SM 3  mandatory  \"Inputs\" (2)\n",
             "    0x6000:1     8 bits  USINT  \"Level\" (3)\n",
             "    gap          8 bits\n",
             "  PDO 0x1a01  not assigned  none\n",
             "  mode \"DC\" (4)\n",
             "    AssignActivate 0x0300\n",
             "    SYNC0 cycle 0 ns, factor 0, shift -5 ns\n",
             "category 32775 vendor specific",
             "  0000  6f 6b 00 fe                                      ok..\n",
         })
        EXPECT_NE(text.find(line), text.npos) << line << "is not in\n" << text;
    EXPECT_NE(text.find(", right\n"), text.npos);
    EXPECT_EQ(text.find("faults"), text.npos) << text;
}

TEST(SiiText, NamesTheFaults) {
    auto damaged = image();
    damaged[14] = std::byte{0};
    damaged.resize(1000);
    const auto text = sii_text(damaged);
    EXPECT_NE(text.find("\nfaults\n  word 0x0007: the checksum of the configuration area is wrong (expected 0x"),
              text.npos)
        << text;
    EXPECT_NE(text.find("  word 0x003e: the size word is not the size of the image (expected 1000, found 1024)\n"),
              text.npos)
        << text;
    EXPECT_NE(text.find("Level"), text.npos);  // and the readable parts are shown
    EXPECT_EQ(sii_text(std::vector<std::byte>(64, std::byte{0xFF})), "the EEPROM is blank (every octet is 0xFF)\n");
    EXPECT_NE(sii_text({}).find("faults\n  word 0x0000: the content ends too early (expected 128, found 0)\n"),
              std::string::npos);
}

TEST(SiiText, SurvivesAnything) {
    std::mt19937 random(3);
    for (int round = 0; round < 500; ++round) {
        auto damaged = image();
        for (int i = 0; i < 20; ++i) damaged[random() % 500] = static_cast<std::byte>(random());
        damaged.resize(random() % damaged.size());
        const auto text = sii_text(damaged);
        for (const char c : text) ASSERT_TRUE(c == '\n' || static_cast<unsigned char>(c) >= 0x20);
        ASSERT_NE(text.find("faults"), text.npos);
    }
}

}  // namespace
}  // namespace margay::samples
