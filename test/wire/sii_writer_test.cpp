// The writer of SII images: compared octet by octet with the standard, and read back by the readers.
#include "sii_image.hpp"
#include "wire/sii_check.hpp"

#include <gtest/gtest.h>

#include <array>

namespace margay::wire::sii {
namespace {

std::string string_of(Bytes image, StringNumber number) {
    const auto strings = find_category(image, category::kStrings);
    if (!strings) return "no strings";
    const auto found = string(*strings, number);
    return found.ok() ? text(found.value) : "missing";
}

TEST(SiiWriter, WritesTheSmallestDeviceOctetByOctet) {
    std::vector<std::byte> eeprom(256);
    const auto written = write_image({.configuration = {.pdi_control = 0x0104, .reserved = {0, 0}},
                                      .identity = {0x4D47, 1, 2, 3},
                                      .name = "A",
                                      .general = {.ebus_current_ma = 100, .physical_ports = 0x33}},
                                     eeprom);
    ASSERT_TRUE(written.ok());
    const auto fixed = bytes({0x04, 0x01, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x39, 0,  //
                              0x47, 0x4D, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0,    0});

    EXPECT_EQ(std::vector<std::byte>(eeprom.begin(), eeprom.begin() + 32), fixed);
    for (std::size_t i = 32; i < 0x7C; ++i) EXPECT_EQ(eeprom[i], std::byte{0}) << i;
    const auto rest = bytes({0x01, 0x00, 0x01, 0x00,                // 2 KiBit, version 1
                             10,   0,    2,    0,    1, 1, 'A', 0,  // one string, padded
                             30,   0,    16,   0,    0, 0, 0,   1, 0, 0, 0, 0, 0, 0, 0, 0, 100, 0,
                             0,    0,    0x33, 0,    0, 0, 0,   0, 0, 0, 0, 0, 0, 0, 0, 0, 0,   0,  //
                             0xFF, 0xFF});
    EXPECT_EQ(std::vector<std::byte>(eeprom.begin() + 0x7C, eeprom.begin() + 0x7C + static_cast<long>(rest.size())),
              rest);
    EXPECT_EQ(written.value, 0x7C + rest.size());
    EXPECT_TRUE(is_blank(Bytes(eeprom).subspan(written.value)));
}

TEST(SiiWriter, WhatItWritesIsReadBack) {
    const MadeUpDevice device;
    const auto image = device.image();
    ASSERT_EQ(image.size(), 2048U);
    const auto fixed = load_fixed_part(image);
    ASSERT_TRUE(fixed.ok());
    EXPECT_EQ(fixed.value.configuration.pdi_control, 0x0C08);
    EXPECT_EQ(fixed.value.configuration.alias, 0x1234);
    EXPECT_EQ(fixed.value.identity, device.description.identity);
    EXPECT_EQ(fixed.value.mailboxes.standard.out_start, 0x1000);
    EXPECT_EQ(fixed.value.mailboxes.standard.in_bytes, 128);
    EXPECT_EQ(fixed.value.mailboxes.boot.in_start, 0x1200);
    EXPECT_EQ(fixed.value.mailboxes.boot.out_bytes, 256);
    EXPECT_EQ(fixed.value.mailboxes.standard.protocols, 0x0C);
    EXPECT_EQ(fixed.value.eeprom_bytes, 2048U);
    EXPECT_EQ(fixed.value.version, 1);

    const auto general = parse_general(find_category(image, category::kGeneral).value_or(Bytes{}));
    ASSERT_TRUE(general.ok());
    auto expected = device.description.general;
    expected.order = general.value.order;
    expected.group = general.value.group;
    expected.name = general.value.name;
    EXPECT_EQ(general.value, expected);
    EXPECT_EQ(string_of(image, general.value.order), "MG-1");
    EXPECT_EQ(string_of(image, general.value.group), "Made up");
    EXPECT_EQ(string_of(image, general.value.name), "Made up drive");
    EXPECT_EQ(general.value.image, 0);

    FmmuUses fmmus(find_category(image, category::kFmmu).value_or(Bytes{}));
    ASSERT_EQ(fmmus.count(), 4U);  // three entries, and one that fills the word
    EXPECT_EQ(fmmus.next(), FmmuUse::outputs);
    EXPECT_EQ(fmmus.next(), FmmuUse::inputs);
    EXPECT_EQ(fmmus.next(), FmmuUse::mailbox_status);
    EXPECT_EQ(fmmus.next(), FmmuUse::unused);

    SyncManagers managers(find_category(image, category::kSyncManager).value_or(Bytes{}));
    for (const auto& wanted : MadeUpDevice::kSyncManagers) {
        const auto manager = managers.next();
        ASSERT_TRUE(manager);
        EXPECT_EQ(manager->start, wanted.start);
        EXPECT_EQ(manager->length_bytes, wanted.length_bytes);
        EXPECT_EQ(manager->control, wanted.control);
        EXPECT_EQ(manager->enable, wanted.enable);
        EXPECT_EQ(manager->type, wanted.type);
    }
    EXPECT_FALSE(managers.next());
}

TEST(SiiWriter, PdosAndOperationModesAreReadBack) {
    const auto image = MadeUpDevice{}.image();
    Pdos inputs(find_category(image, category::kTxPdo).value_or(Bytes{}));
    const auto first = inputs.next();
    ASSERT_TRUE(first);
    EXPECT_EQ(first->index, 0x1A00);
    EXPECT_EQ(first->sync_manager, 3);
    EXPECT_TRUE(first->assigned());
    EXPECT_EQ(first->flags, 0x0011);
    EXPECT_EQ(string_of(image, first->name), "Inputs");
    PdoEntries entries(first->entries);
    ASSERT_EQ(entries.count(), 3U);
    for (const auto& wanted : MadeUpDevice::kStatus) {
        const auto entry = entries.next();
        ASSERT_TRUE(entry);
        EXPECT_EQ(entry->index, wanted.index);
        EXPECT_EQ(entry->subindex, wanted.subindex);
        EXPECT_EQ(entry->data_type, wanted.data_type);
        EXPECT_EQ(entry->bit_length, wanted.bit_length);
        EXPECT_EQ(string_of(image, entry->name), wanted.name);
    }
    const auto second = inputs.next();
    ASSERT_TRUE(second);
    EXPECT_FALSE(second->assigned());
    EXPECT_EQ(second->entry_count, 0);
    EXPECT_EQ(second->synchronization, 1);
    EXPECT_EQ(second->name, first->name);  // equal texts are stored once
    EXPECT_FALSE(inputs.next());
    EXPECT_EQ(inputs.fault(), Fault::none);

    DcOpModes modes(find_category(image, category::kDc).value_or(Bytes{}));
    const auto mode = modes.next();
    ASSERT_TRUE(mode);
    auto wanted = MadeUpDevice::kDc[0].mode;
    wanted.name = mode->name;
    wanted.description = mode->description;
    EXPECT_EQ(*mode, wanted);
    EXPECT_EQ(string_of(image, mode->name), "DC");
    EXPECT_EQ(string_of(image, mode->description), "Distributed clocks");
    ASSERT_TRUE(modes.next());
    EXPECT_FALSE(modes.next());
}

TEST(SiiWriter, WritesNothingThatTheCheckComplainsAbout) {
    std::array<Finding, 8> findings{};
    EXPECT_EQ(check_image(MadeUpDevice{}.image(), findings), 0U) << to_text(findings[0].fault);
    EXPECT_EQ(check_image(MadeUpDevice{}.image(1024), findings), 0U) << to_text(findings[0].fault);
}

// Every size that is too small is refused, the first sufficient size is accepted, and nothing behind the EEPROM is
// written.
TEST(SiiWriter, RefusesWhatDoesNotFit) {
    const MadeUpDevice device;
    std::vector<std::byte> large(2048);
    const auto used = write_image(device.description, large);
    ASSERT_TRUE(used.ok());
    for (std::size_t size = 128; size <= 2048; size += 128) {
        std::vector<std::byte> memory(size + 16, std::byte{0x5A});
        const auto written = write_image(device.description, MutableBytes(memory).first(size));
        EXPECT_EQ(written.fault, size >= used.value ? Fault::none : Fault::no_room) << size;
        for (std::size_t i = size; i < memory.size(); ++i) EXPECT_EQ(memory[i], std::byte{0x5A});
    }
    std::vector<std::byte> odd(1000);
    EXPECT_EQ(write_image(device.description, odd).fault, Fault::odd_length);
    EXPECT_EQ(write_image(device.description, {}).fault, Fault::odd_length);
}

TEST(SiiWriter, RefusesWhatCannotBeCounted) {
    std::vector<std::byte> eeprom(std::size_t{256} * 1024);
    const std::string long_text(256, 'x');
    EXPECT_EQ(write_image({.name = long_text}, eeprom).fault, Fault::too_long);
    EXPECT_EQ(write_image({.name = std::string_view(long_text).substr(1)}, eeprom).fault, Fault::none);

    const std::vector<PdoEntryDescription> entries(256);
    std::vector<PdoDescription> pdos{{.index = 0x1600, .entries = entries}};
    EXPECT_EQ(write_image({.rx_pdos = pdos}, eeprom).fault, Fault::too_long);
    pdos[0].entries = std::span(entries).first(255);
    EXPECT_EQ(write_image({.rx_pdos = pdos}, eeprom).fault, Fault::none);

    std::vector<std::string> names;
    for (int i = 0; i < 256; ++i) names.push_back("n" + std::to_string(i));
    std::vector<PdoDescription> named;
    for (const auto& name : names) named.push_back({.index = 0x1600, .name = name});
    EXPECT_EQ(write_image({.rx_pdos = named}, eeprom).fault, Fault::too_long);
    EXPECT_EQ(write_image({.rx_pdos = std::span(named).first(255)}, eeprom).fault, Fault::none);

    const std::vector<std::byte> blob(std::size_t{65536} * 2);
    const RawCategory raw[] = {{0x8001, Bytes(blob)}};
    EXPECT_EQ(write_image({.others = raw}, eeprom).fault, Fault::too_long);
    const RawCategory fits[] = {{0x8001, Bytes(blob).first(65535 * 2)}};
    EXPECT_EQ(write_image({.others = fits}, eeprom).fault, Fault::none);
}

TEST(SiiWriter, RawCategoriesStandWhereTheyBelong) {
    const auto before = bytes({1, 2, 3});
    const auto behind = bytes({9, 8});
    const RawCategory device_specific[] = {{3, before}};
    const RawCategory others[] = {{0x8123, behind}};
    std::vector<std::byte> eeprom(512);
    ASSERT_TRUE(write_image({.name = "N", .device_specific = device_specific, .others = others}, eeprom).ok());
    std::vector<std::uint16_t> types;
    CategoryWalker walker(eeprom);
    while (const auto found = walker.next()) {
        types.push_back(found->place.type);
        if (found->place.type == 3) {
            EXPECT_EQ(std::vector<std::byte>(found->content.begin(), found->content.end()), bytes({1, 2, 3, 0}));
        }
    }
    EXPECT_EQ(walker.fault(), Fault::none);
    EXPECT_EQ(types, (std::vector<std::uint16_t>{3, category::kStrings, category::kGeneral, 0x8123}));
}

}  // namespace
}  // namespace margay::wire::sii
