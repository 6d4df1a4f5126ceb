// Images read from real devices. The expected values were written by hand: names, currents, ports and objects come
// from the vendors' catalogues, manuals and device descriptions, addresses from a dump.
#include <places.hpp>
#include "sii_image.hpp"
#include "wire/sii_check.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

namespace margay::wire::sii {
namespace {

struct ExpectedPdo {
    std::uint16_t index;
    std::uint8_t sync_manager;
    std::vector<std::uint32_t> entries;  // as in a PDO mapping object: index, subindex, bit length
};

struct Expected {
    const char* file;
    Identity identity;
    std::string order;
    std::string name;
    std::int16_t ebus_current_ma;
    std::array<PhysicalPort, 4> ports;
    std::vector<FmmuUse> fmmus;
    std::vector<SmInfo> sync_managers;
    std::vector<ExpectedPdo> inputs;
    std::vector<ExpectedPdo> outputs;
};

constexpr auto kEbus = PhysicalPort::ebus;
constexpr auto kMii = PhysicalPort::mii;
constexpr auto kNo = PhysicalPort::unused;

// Channel n of a digital output terminal: PDO 0x1600+n with 0x7000+16n:01, one bit.
std::vector<ExpectedPdo> digital_outputs(unsigned channels) {
    std::vector<ExpectedPdo> out;
    for (unsigned n = 0; n < channels; ++n)
        out.push_back(
            {static_cast<std::uint16_t>(0x1600 + n), static_cast<std::uint8_t>(n / 8), {0x70000101 + (n << 20)}});
    return out;
}

// The channels of the EL2262: a cycle counter, an output of one bit or of an oversampled octet, and gaps of one to
// seven bits.
std::vector<ExpectedPdo> oversampled_outputs() {
    return {{0x1700, 0, {0x78000110}}, {0x1600, 0, {0x70000101}}, {0x1800, 0, {0x72000108}}, {0x1710, 0, {1}},
            {0x1711, 0, {2}},          {0x1712, 0, {3}},          {0x1713, 0, {4}},          {0x1714, 0, {5}},
            {0x1715, 0, {6}},          {0x1716, 0, {7}},          {0x1701, 1, {0x78000210}}, {0x1680, 1, {0x70000201}},
            {0x1880, 1, {0x72000208}}, {0x1718, 1, {1}},          {0x1719, 1, {2}},          {0x171A, 1, {3}},
            {0x171B, 1, {4}},          {0x171C, 1, {5}},          {0x171D, 1, {6}},          {0x171E, 1, {7}}};
}

std::vector<Expected> devices() {
    return {
        {"ek1100.bin",
         {2, 0x044C2C52, 0x00120000, 0},
         "EK1100",
         "EK1100 EtherCAT-Koppler (2A E-Bus)",
         -2000,
         {kMii, kEbus, kMii, kNo},
         {},
         {},
         {},
         {}},
        {"el2004.bin",
         {2, 0x07D43052, 0x00100000, 0},
         "EL2004",
         "EL2004 4K. Dig. Ausgang 24V, 0.5A",
         100,
         {kEbus, kEbus, kNo, kNo},
         {FmmuUse::outputs},
         {{0x0F00, 0, 0x44, 0x09, SmType::outputs}},
         {},
         digital_outputs(4)},
        {"el2262.bin",
         {2, 0x08D63052, 0x00030000, 0},
         "EL2262",
         "EL2262 2K. Dig. Ausgang 24V, 1\u00B5s, DC Oversample",
         70,
         {kEbus, kEbus, kNo, kNo},
         {FmmuUse::outputs, FmmuUse::outputs, FmmuUse::inputs},
         {{0x1000, 0, 0x64, 0x09, SmType::outputs},
          {0x1200, 0, 0x64, 0x09, SmType::outputs},
          {0x0998, 0, 0x00, 0x04, SmType::inputs}},
         {{0x1702, 2, {0x1D099820}}} /* start time of the next output */,
         oversampled_outputs()},
        {"el2828.bin",
         {2, 0x0B0C3052, 0x00110000, 0},
         "EL2828",
         "EL2828 8K. Dig. Ausgang 24V, 2A",
         110,
         {kEbus, kEbus, kNo, kNo},
         {FmmuUse::outputs},
         {{0x0F00, 1, 0x44, 0x09, SmType::outputs}},
         {},
         digital_outputs(8)},
        {"el2889.bin",
         {2, 0x0B493052, 0x00110000, 0},
         "EL2889",
         "EL2889 16K. Dig. Ausgang 24V, 0.5A, negativ",
         140,
         {kEbus, kEbus, kNo, kNo},
         {FmmuUse::outputs},
         {{0x0F00, 1, 0x44, 0x09, SmType::outputs}, {0x0F01, 1, 0x44, 0x09, SmType::outputs}},
         {},
         digital_outputs(16)},
    };
}

class SiiImages : public ::testing::Test {
  protected:
    void SetUp() override {
        if (!have_images()) GTEST_SKIP() << "MARGAY_SII_DIR is not set: no images of real devices";
    }
};

std::string string_of(Bytes image, StringNumber number) {
    const auto found = string(find_category(image, category::kStrings).value_or(Bytes{}), number);
    std::array<char, 256> out{};
    return found.ok() ? std::string(to_utf8(found.value, out)) : "no string " + std::to_string(number);
}

std::vector<ExpectedPdo> pdos_of(Bytes image, std::uint16_t type) {
    std::vector<ExpectedPdo> out;
    Pdos pdos(find_category(image, type).value_or(Bytes{}));
    while (const auto pdo = pdos.next()) {
        out.push_back({pdo->index, pdo->sync_manager, {}});
        PdoEntries entries(pdo->entries);
        while (const auto entry = entries.next())
            out.back().entries.push_back((std::uint32_t{entry->index} << 16) | (std::uint32_t{entry->subindex} << 8) |
                                         entry->bit_length);
    }
    EXPECT_EQ(pdos.fault(), Fault::none);
    return out;
}

void expect_pdos(Bytes image, std::uint16_t type, const std::vector<ExpectedPdo>& expected) {
    const auto found = pdos_of(image, type);
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
        EXPECT_EQ(found[i].index, expected[i].index);
        EXPECT_EQ(found[i].sync_manager, expected[i].sync_manager) << std::hex << found[i].index;
        EXPECT_EQ(found[i].entries, expected[i].entries) << std::hex << found[i].index;
    }
}

void expect_sync_managers(Bytes image, const std::vector<SmInfo>& expected) {
    SyncManagers managers(find_category(image, category::kSyncManager).value_or(Bytes{}));
    ASSERT_EQ(managers.count(), expected.size());
    for (const auto& wanted : expected) {
        const auto found = managers.next().value_or(SmInfo{});
        EXPECT_EQ(found.start, wanted.start);
        EXPECT_EQ(found.length_bytes, wanted.length_bytes);
        EXPECT_EQ(found.control, wanted.control);
        EXPECT_EQ(found.enable, wanted.enable);
        EXPECT_EQ(found.type, wanted.type);
    }
}

// Without the unused entry that fills a word.
std::vector<FmmuUse> fmmus_of(Bytes image) {
    std::vector<FmmuUse> out;
    FmmuUses uses(find_category(image, category::kFmmu).value_or(Bytes{}));
    while (const auto use = uses.next())
        if (*use != FmmuUse::unused) out.push_back(*use);
    return out;
}

TEST_F(SiiImages, TerminalsAreWhatTheirVendorSays) {
    for (const auto& expected : devices()) {
        SCOPED_TRACE(expected.file);
        const auto image = image_of(expected.file);
        ASSERT_EQ(image.size(), 2048U);
        const auto fixed = load_fixed_part(image);
        EXPECT_TRUE(fixed.ok()) << to_text(fixed.fault);
        EXPECT_EQ(fixed.value.identity, expected.identity);
        EXPECT_EQ(fixed.value.eeprom_bytes, 2048U);
        EXPECT_EQ(fixed.value.version, 1);
        EXPECT_FALSE(fixed.value.mailboxes.standard.present());
        EXPECT_EQ(fixed.value.mailboxes.standard.protocols, 0);
        const auto general = parse_general(find_category(image, category::kGeneral).value_or(Bytes{}));
        ASSERT_TRUE(general.ok());
        EXPECT_EQ(string_of(image, general.value.order), expected.order);
        EXPECT_EQ(string_of(image, general.value.name), expected.name);
        EXPECT_EQ(general.value.ebus_current_ma, expected.ebus_current_ma);
        EXPECT_EQ(general.value.coe_details, 0);
        for (unsigned port = 0; port < 4; ++port)
            EXPECT_EQ(physical_port(general.value, port), expected.ports[port]) << "port " << port;
        EXPECT_EQ(fmmus_of(image), expected.fmmus);
        expect_sync_managers(image, expected.sync_managers);
        expect_pdos(image, category::kTxPdo, expected.inputs);
        expect_pdos(image, category::kRxPdo, expected.outputs);
    }
}

TEST_F(SiiImages, GroupsAndChannelsHaveTheirNames) {
    const auto image = image_of("el2889.bin");
    const auto general = parse_general(find_category(image, category::kGeneral).value_or(Bytes{}));
    EXPECT_EQ(string_of(image, general.value.group), "DigOut");
    Pdos outputs(find_category(image, category::kRxPdo).value_or(Bytes{}));
    for (int channel = 1; const auto pdo = outputs.next(); ++channel) {
        EXPECT_EQ(string_of(image, pdo->name), "Channel " + std::to_string(channel));
        PdoEntries entries(pdo->entries);
        EXPECT_EQ(string_of(image, entries.next().value_or(PdoEntry{}).name), "Output");
    }
}

TEST_F(SiiImages, OversamplingTerminalHasItsOperationModes) {
    const auto image = image_of("el2262.bin");
    const auto fixed = load_fixed_part(image);
    EXPECT_EQ(fixed.value.configuration.sync_pulse_length_10ns, 16);
    DcOpModes modes(find_category(image, category::kDc).value_or(Bytes{}));
    ASSERT_EQ(modes.count(), 4U);
    for (const auto* name : {"DcSync", "DcSync2", "DcSync_1", "DcSync2_1"}) {
        const auto mode = modes.next().value_or(DcOpMode{});
        EXPECT_EQ(string_of(image, mode.name), name);
        EXPECT_EQ(mode.assign_activate, 0x0730);  // SYNC0 and SYNC1
        EXPECT_EQ(mode.sync1_cycle_factor, -1);
        EXPECT_EQ(mode.sync0_cycle_factor, std::string_view(name).starts_with("DcSync2") ? -8 : -1);
    }
}

TEST_F(SiiImages, DriveHasMailboxesObjectsAndModes) {
    const auto image = image_of("akd.bin");
    ASSERT_EQ(image.size(), 2048U);
    const auto fixed = load_fixed_part(image);
    EXPECT_TRUE(fixed.ok());
    EXPECT_EQ(fixed.value.identity.vendor, 0x6AU);         // Kollmorgen
    EXPECT_EQ(fixed.value.identity.product, 0x00414B44U);  // "AKD"
    EXPECT_EQ(fixed.value.identity.revision, 2U);
    const auto& mailbox = fixed.value.mailboxes.standard;
    EXPECT_EQ(mailbox.out_start, 0x1800);
    EXPECT_EQ(mailbox.out_bytes, 1024);
    EXPECT_EQ(mailbox.in_start, 0x1C00);
    EXPECT_EQ(mailbox.in_bytes, 1024);
    EXPECT_EQ(mailbox.protocols, mailbox_protocol::kEoE | mailbox_protocol::kCoE | mailbox_protocol::kFoE);
    EXPECT_EQ(fixed.value.mailboxes.boot.out_start, 0x1800);
    EXPECT_EQ(fixed.value.mailboxes.boot.in_bytes, 1024);

    const auto general = parse_general(find_category(image, category::kGeneral).value_or(Bytes{}));
    ASSERT_TRUE(general.ok());
    EXPECT_EQ(string_of(image, general.value.order), "AKD");
    EXPECT_EQ(string_of(image, general.value.name), "AKD EtherCAT Drive (CoE)");
    EXPECT_EQ(general.value.coe_details, coe_detail::kSdo | coe_detail::kPdoAssignment | coe_detail::kPdoConfiguration);
    EXPECT_EQ(general.value.foe_details & 1, 1);
    EXPECT_EQ(general.value.eoe_details & 1, 1);
    EXPECT_EQ(general.value.ds402_channels, 1);
    EXPECT_EQ(general.value.flags, general_flag::kEnableSafeOp | general_flag::kMailboxDataLink);
    EXPECT_EQ(physical_port(general.value, 0), kMii);
    EXPECT_EQ(physical_port(general.value, 1), kMii);
    EXPECT_EQ(fmmus_of(image), (std::vector{FmmuUse::outputs, FmmuUse::inputs, FmmuUse::mailbox_status}));
    expect_sync_managers(image, {{0x1800, 1024, 0x26, 1, SmType::mailbox_out},
                                 {0x1C00, 1024, 0x22, 1, SmType::mailbox_in},
                                 {0x1100, 0, 0x24, 1, SmType::outputs},
                                 {0x1140, 0, 0x20, 1, SmType::inputs}});
    // The vendor-specific categories: order number and version.
    const auto order_number = find_category(image, 0x0800);
    ASSERT_TRUE(order_number);
    EXPECT_TRUE(text(*order_number).starts_with("AKD-P00606-NBCC-E000"));

    DcOpModes modes(find_category(image, category::kDc).value_or(Bytes{}));
    ASSERT_EQ(modes.count(), 2U);
    const auto sync = modes.next().value_or(DcOpMode{});
    EXPECT_EQ(string_of(image, sync.name), "DcSync");
    EXPECT_EQ(sync.assign_activate, 0x0300);
    EXPECT_EQ(sync.sync0_cycle_factor, 1);
    const auto off = modes.next().value_or(DcOpMode{});
    EXPECT_EQ(string_of(image, off.name), "DcOff");
    EXPECT_EQ(off.assign_activate, 0);
}

// The drive's manual lists its PDOs: 0x1B01 and 0x1701 are the default assignment.
TEST_F(SiiImages, DriveAssignsTheDefaultPdos) {
    const auto image = image_of("akd.bin");
    const auto assigned = [&](std::uint16_t type) {
        auto found = pdos_of(image, type);
        std::erase_if(found, [](const auto& pdo) { return pdo.sync_manager == Pdo::kNoSyncManager; });
        return found;
    };
    const auto inputs = assigned(category::kTxPdo);
    ASSERT_EQ(inputs.size(), 1U);
    EXPECT_EQ(inputs[0].index, 0x1B01);
    EXPECT_EQ(inputs[0].sync_manager, 3);
    EXPECT_EQ(inputs[0].entries, (std::vector<std::uint32_t>{0x60630020, 0x60410010}));
    const auto outputs = assigned(category::kRxPdo);
    ASSERT_EQ(outputs.size(), 1U);
    EXPECT_EQ(outputs[0].index, 0x1701);
    EXPECT_EQ(outputs[0].sync_manager, 2);
    EXPECT_EQ(outputs[0].entries, (std::vector<std::uint32_t>{0x60C10120, 0x60400010}));
    std::vector<unsigned> indices;
    for (const auto& pdo : pdos_of(image, category::kRxPdo)) indices.push_back(pdo.index);
    EXPECT_EQ(indices, (std::vector<unsigned>{0x1600, 0x1601, 0x1602, 0x1603, 0x1701, 0x1702, 0x1720, 0x1721, 0x1722,
                                              0x1723, 0x1724, 0x1725}));
}

TEST_F(SiiImages, TheStrictCheckFindsNothing) {
    for (const auto* file : {"akd.bin", "ek1100.bin", "el2004.bin", "el2262.bin", "el2828.bin", "el2889.bin"}) {
        std::array<Finding, 4> findings{};
        EXPECT_EQ(check_image(image_of(file), findings), 0U) << file << ": " << to_text(findings[0].fault);
    }
}

}  // namespace
}  // namespace margay::wire::sii
