// The SII image of a device of an ESI, compared with the reader of SIIs and with images of the same devices.
#include <margay/files/esi.hpp>

#include "files/examples.hpp"
#include "sim/devices.hpp"
#include "wire/sii_category.hpp"
#include "wire/sii_check.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <places.hpp>

namespace margay::files {
namespace {

namespace sii = wire::sii;

std::string faults(Bytes image) {
    std::array<sii::Finding, 8> findings{};
    const auto count = sii::check_image(image, findings);
    std::string text;
    for (std::size_t n = 0; n < std::min(count, findings.size()); ++n)
        text += std::string(to_text(findings[n].fault)) + " at word " + std::to_string(findings[n].word) + "; ";
    return text;
}

struct PdoInImage {
    std::uint16_t index;
    std::uint8_t sync_manager;
    std::uint16_t flags;
    std::vector<std::array<unsigned, 4>> entries;
    std::vector<std::string> names;
    bool operator==(const PdoInImage&) const = default;
};

// All PDOs of a type, of all categories of this type: some generators write one category for each PDO.
std::vector<PdoInImage> pdos(Bytes image, std::uint16_t type) {
    std::vector<PdoInImage> all;
    const Bytes strings = sii::find_category(image, sii::category::kStrings).value_or(Bytes{});
    const auto text = [&](sii::StringNumber number) {
        std::array<char, 256> into{};
        return std::string(sii::to_utf8(sii::string(strings, number).value, into));
    };
    sii::CategoryWalker walker(image);
    while (const auto category = walker.next()) {
        if (category->place.type != type) continue;
        sii::Pdos list(category->content);
        while (const auto pdo = list.next()) {
            PdoInImage one{pdo->index, pdo->sync_manager, pdo->flags, {}, {text(pdo->name)}};
            sii::PdoEntries entries(pdo->entries);
            while (const auto entry = entries.next()) {
                // The tool of these images writes UINT (6) for entries of 8 bits that the ESI files call UINT8.
                const bool octet = entry->data_type == 6 && entry->bit_length == 8;
                const unsigned data_type = octet ? 5 : entry->data_type;
                one.entries.push_back({entry->index, entry->subindex, data_type, entry->bit_length});
                one.names.push_back(text(entry->name));
            }
            all.push_back(std::move(one));
        }
    }
    return all;
}

std::vector<std::byte> octets_of(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(in)), {});
    const auto bytes = std::as_bytes(std::span(text));
    return {bytes.begin(), bytes.end()};
}

TEST(EsiSii, TheImageSaysWhatTheFileSays) {
    const auto esi = read_esi(kExampleEsi);
    ASSERT_TRUE(esi);
    const auto image = make_sii(esi->devices[0]);
    ASSERT_TRUE(image) << image.error;
    EXPECT_EQ(image.octets.size(), 2048U);
    EXPECT_EQ(faults(image.octets), "");
    const auto fixed = sii::load_fixed_part(image.octets);
    ASSERT_TRUE(fixed.ok());
    EXPECT_EQ(fixed.value.identity, esi->devices[0].identity);
    EXPECT_EQ(fixed.value.configuration.pdi_control, 0x0E05);
    EXPECT_EQ(fixed.value.mailboxes.standard.out_start, 0x1000);
    EXPECT_EQ(fixed.value.mailboxes.standard.in_bytes, 128);
    EXPECT_EQ(fixed.value.mailboxes.standard.protocols, 0x0C);
    EXPECT_EQ(fixed.value.mailboxes.boot.out_start, 0x1000);
    const auto general = sii::parse_general(*sii::find_category(image.octets, sii::category::kGeneral));
    EXPECT_EQ(general.value.coe_details, 0x27);
    EXPECT_EQ(general.value.physical_ports, 0x0301);
    EXPECT_EQ(general.value.ebus_current_ma, 70);
    const auto outputs = pdos(image.octets, sii::category::kRxPdo);
    ASSERT_EQ(outputs.size(), 2U);
    EXPECT_EQ(outputs[0].sync_manager, 2);
    EXPECT_EQ(outputs[0].flags, sii::pdo_flag::kFixedContent);
    EXPECT_EQ(outputs[0].entries,
              (std::vector<std::array<unsigned, 4>>{{0x6040, 0, 6, 16}, {0, 0, 0, 8}, {0x607A, 0, 4, 32}}));
    EXPECT_EQ(outputs[1].sync_manager, 0xFF);
    sii::DcOpModes modes(*sii::find_category(image.octets, sii::category::kDc));
    ASSERT_EQ(modes.count(), 2U);
    (void)modes.next();
    const auto mode = modes.next();
    EXPECT_EQ(mode->assign_activate, 0x0300);
    EXPECT_EQ(mode->sync0_cycle_factor, -2);
    EXPECT_EQ(mode->sync0_shift_time_ns, -3);
    EXPECT_EQ(sii::find_category(image.octets, 1)->size(), 2U);
}

TEST(EsiSii, WhatDoesNotFitIsSaid) {
    auto esi = read_esi(kExampleEsi);
    ASSERT_TRUE(esi);
    EsiDevice device = esi->devices[0];
    device.eeprom->bytes = 256;
    EXPECT_EQ(make_sii(device).error.substr(0, 68),
              "the image of EX100 cannot be made for an EEPROM of 256 octets: the i");
    device.eeprom->bytes = 1000;
    EXPECT_EQ(make_sii(device).error,
              "ByteSize of the EEPROM is 1000: it must be a multiple of 128, and at most 4194304");
    device = esi->devices[0];
    device.pdos[0].entries[0].bits = 300;
    EXPECT_EQ(make_sii(device).error, "the entry 0x6040 of PDO 0x1600 has 300 bits, and the SII has room for 255");
    device = esi->devices[0];
    device.eeprom->bytes = 8192;
    device.pdos[0].entries[0].bits = 1;
    for (int n = 0; n < 300; ++n) {
        EsiEntry entry = device.pdos[0].entries[0];
        entry.name = "entry " + std::to_string(n);
        (n < 200 ? device.pdos[0] : device.pdos[1]).entries.push_back(entry);
    }
    const auto many = make_sii(device);
    ASSERT_TRUE(many) << many.error;  // the SII refers to a string by one octet
    EXPECT_EQ(many.remarks, std::vector<std::string>{"the names of entries do not fit and are left out"});
    EXPECT_EQ(faults(many.octets), "");
}

TEST(EsiSii, WhatAnSiiCannotSayIsNamed) {
    auto esi = read_esi(kExampleEsi);
    ASSERT_TRUE(esi);
    EsiDevice device = esi->devices[0];
    EXPECT_TRUE(make_sii(device).remarks.empty());
    device.name = "10 € – µ";
    device.modes[1].sync1_cycle_ns = 500;
    EXPECT_EQ(
        make_sii(device).remarks,
        (std::vector<std::string>{"the SII has characters of ISO 8859-1 only, the others become '?': '10 € – µ'",
                                  "CycleTimeSync1 of the operation mode 'DC' is 500 ns: the SII has its factor only"}));
}

// Images that another tool made from the same files. The tool could not read the id of the vendor and used 0. The SM
// types and the second DC mode of its images are wrong, too.
class FieldEsi : public ::testing::TestWithParam<const char*> {};

TEST_P(FieldEsi, GivesTheImageThatBelongsToIt) {
    const std::filesystem::path folder = std::filesystem::path(MARGAY_XML_DIR) / "esi";
    if (std::string_view(MARGAY_XML_DIR).empty()) GTEST_SKIP() << "MARGAY_XML_DIR is not set";
    const auto content = read_file((folder / GetParam()).string() + ".xml");
    const auto esi = read_esi(content.octets);
    ASSERT_TRUE(esi) << to_text(esi.problem);
    const auto theirs = octets_of((folder / GetParam()).string() + ".bin");
    ASSERT_GT(theirs.size(), 256U);
    const auto ours = make_sii(esi->devices.at(0));
    ASSERT_TRUE(ours) << ours.error;
    EXPECT_EQ(faults(ours.octets), "");
    for (std::size_t n = 0; n < 128; ++n) {
        if (n >= 16 && n < 20) continue;  // the vendor ID
        EXPECT_EQ(ours.octets[n], theirs[n]) << "octet " << n;
    }
    EXPECT_EQ(load_le<std::uint32_t>(ours.octets, 16), 0xF3FU);
    EXPECT_EQ(pdos(ours.octets, sii::category::kTxPdo), pdos(theirs, sii::category::kTxPdo));
    EXPECT_EQ(pdos(ours.octets, sii::category::kRxPdo), pdos(theirs, sii::category::kRxPdo));
    sii::SyncManagers our_sms(*sii::find_category(ours.octets, sii::category::kSyncManager));
    sii::SyncManagers their_sms(*sii::find_category(theirs, sii::category::kSyncManager));
    while (const auto theirs_one = their_sms.next()) {
        const auto ours_one = our_sms.next();
        ASSERT_TRUE(ours_one);
        EXPECT_EQ(ours_one->start, theirs_one->start);
        EXPECT_EQ(ours_one->length_bytes, theirs_one->length_bytes);
        EXPECT_EQ(ours_one->control, theirs_one->control);
        EXPECT_EQ(ours_one->enable, theirs_one->enable);
    }
}

INSTANTIATE_TEST_SUITE_P(Pollen, FieldEsi,
                         ::testing::Values("pollen_Orbita2d", "pollen_Orbita3d", "pollen_NeckOrbita3d_15"));

TEST(FieldFiles, TheDoubledPrefixesOfPollenAreNamed) {
    if (std::string_view(MARGAY_XML_DIR).empty()) GTEST_SKIP() << "MARGAY_XML_DIR is not set";
    const auto esi = read_esi(read_file(std::string(MARGAY_XML_DIR) + "/esi/pollen_Orbita2d.xml").octets);
    ASSERT_TRUE(esi);
    EXPECT_EQ(esi->devices[0].pdos[0].entries[0].index, 0x6041);
    const auto named = std::ranges::count_if(esi.remarks, [](const Remark& one) {
        return one.text.find("has two prefixes, '#x0x6041': read as 0x6041") != std::string::npos && one.line == 34;
    });
    EXPECT_EQ(named, 1);
}

}  // namespace
}  // namespace margay::files
