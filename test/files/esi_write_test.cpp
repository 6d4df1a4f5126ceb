// ESI files that the library writes: the reader returns the same device, and the SII image of a real device is the same
// after it was an ESI.
#include <margay/files/esi.hpp>
#include <margay/host_configuration.hpp>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include "files/examples.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "wire/sii_category.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <places.hpp>

namespace margay::files {
namespace {

namespace sii = wire::sii;

void expect_same_device(const EsiDevice& a, const EsiDevice& b) {
    EXPECT_EQ(a.type, b.type);
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.identity.product, b.identity.product);
    EXPECT_EQ(a.identity.revision, b.identity.revision);
    EXPECT_EQ(a.ports, b.ports);
    EXPECT_EQ(a.no_lrw, b.no_lrw);
    EXPECT_EQ(a.ebus_current_ma, b.ebus_current_ma);
    ASSERT_EQ(a.sync_managers.size(), b.sync_managers.size());
    for (std::size_t n = 0; n < a.sync_managers.size(); ++n) {
        EXPECT_EQ(a.sync_managers[n].type, b.sync_managers[n].type);
        EXPECT_EQ(a.sync_managers[n].start, b.sync_managers[n].start);
        EXPECT_EQ(a.sync_managers[n].control, b.sync_managers[n].control);
        EXPECT_EQ(a.sync_managers[n].default_bytes, b.sync_managers[n].default_bytes);
        EXPECT_EQ(a.sync_managers[n].enabled, b.sync_managers[n].enabled);
        EXPECT_EQ(a.sync_managers[n].op_only, b.sync_managers[n].op_only);
    }
    ASSERT_EQ(a.fmmus.size(), b.fmmus.size());
    for (std::size_t n = 0; n < a.fmmus.size(); ++n) EXPECT_EQ(a.fmmus[n].use, b.fmmus[n].use);
    ASSERT_EQ(a.pdos.size(), b.pdos.size());
    for (std::size_t n = 0; n < a.pdos.size(); ++n) {
        EXPECT_EQ(a.pdos[n].index, b.pdos[n].index);
        EXPECT_EQ(a.pdos[n].name, b.pdos[n].name);
        EXPECT_EQ(a.pdos[n].sync_manager, b.pdos[n].sync_manager);
        EXPECT_EQ(a.pdos[n].mandatory, b.pdos[n].mandatory);
        ASSERT_EQ(a.pdos[n].entries.size(), b.pdos[n].entries.size());
        for (std::size_t e = 0; e < a.pdos[n].entries.size(); ++e) {
            EXPECT_EQ(a.pdos[n].entries[e].index, b.pdos[n].entries[e].index);
            EXPECT_EQ(a.pdos[n].entries[e].bits, b.pdos[n].entries[e].bits);
            if (a.pdos[n].entries[e].index == 0) continue;
            EXPECT_EQ(a.pdos[n].entries[e].name, b.pdos[n].entries[e].name);
            EXPECT_EQ(a.pdos[n].entries[e].data_type, b.pdos[n].entries[e].data_type);
        }
    }
    EXPECT_EQ(a.mailbox.has_value(), b.mailbox.has_value());
    if (a.mailbox && b.mailbox) {
        EXPECT_EQ(a.mailbox->protocols, b.mailbox->protocols);
        // A device with CoE always has SDOs.
        EXPECT_EQ(a.mailbox->coe_details | coe_detail::kSdo, b.mailbox->coe_details | coe_detail::kSdo);
        EXPECT_EQ(a.mailbox->ds402_channels, b.mailbox->ds402_channels);
    }
    ASSERT_EQ(a.modes.size(), b.modes.size());
    for (std::size_t n = 0; n < a.modes.size(); ++n) {
        EXPECT_EQ(a.modes[n].name, b.modes[n].name);
        EXPECT_EQ(a.modes[n].assign_activate, b.modes[n].assign_activate);
        EXPECT_EQ(a.modes[n].sync0_factor, b.modes[n].sync0_factor);
        EXPECT_EQ(a.modes[n].sync0_shift_ns, b.modes[n].sync0_shift_ns);
    }
}

TEST(EsiWriter, WhatIsReadIsWhatWasWritten) {
    const auto esi = read_esi(kExampleEsi);
    ASSERT_TRUE(esi);
    const Written written = write_esi(*esi);
    const auto again = read_esi(written.text);
    ASSERT_TRUE(again) << to_text(again.problem) << "\n" << written.text;
    EXPECT_EQ(again->vendor, esi->vendor);
    EXPECT_EQ(again->vendor_name, esi->vendor_name);
    expect_same_device(esi->devices[0], again->devices[0]);
    EXPECT_EQ(again->devices[0].dictionary.size(), 2U);
    EXPECT_EQ(again->devices[0].dictionary[1].items.size(), 3U);
    EXPECT_EQ(again->devices[0].mailbox->commands.size(), 1U);
    EXPECT_EQ(make_sii(esi->devices[0]).octets, make_sii(again->devices[0]).octets);
    EXPECT_EQ(write_esi(*again).text, written.text);
}

// The test compares the SyncManagers of the SII, unused ones included, and the number of DS402 channels.
TEST(EsiWriter, TheSiiOfADeviceComesBack) {
    namespace sii = wire::sii;
    for (const char* name : {"drive", "bootloader", "bootloader_open", "analog_in_4"}) {
        const auto image = sim::make_device(name)->sii;
        const auto described = describe_sii(image);
        ASSERT_TRUE(described) << name;
        EsiFile esi{.vendor = described->identity.vendor, .vendor_name = "Vendor"};
        esi.devices.push_back(*described);
        const Written written = write_esi(esi);
        EXPECT_TRUE(written.remarks.empty()) << name;
        const auto read = read_esi(written.text);
        ASSERT_TRUE(read) << to_text(read.problem);
        for (const Remark& remark : read.remarks) ADD_FAILURE() << name << ": " << to_text(remark);
        for (const EsiDevice* device : {&*described, read->devices.data()}) {
            const auto again = make_sii(*device);
            ASSERT_TRUE(again) << again.error;
            const auto ours = sii::find_category(again.octets, sii::category::kSyncManager).value_or(Bytes{});
            EXPECT_TRUE(
                std::ranges::equal(ours, sii::find_category(image, sii::category::kSyncManager).value_or(Bytes{})))
                << name;
            const auto general = [](Bytes of) {
                return sii::parse_general(sii::find_category(of, sii::category::kGeneral).value_or(Bytes{})).value;
            };
            EXPECT_EQ(general(again.octets).ds402_channels, general(image).ds402_channels) << name;
        }
    }
    const auto drive = describe_sii(sim::make_device("drive")->sii);
    ASSERT_TRUE(drive);
    EXPECT_EQ(drive->mailbox->ds402_channels, 1);
}

// An ESI has the number of DS402 channels for slaves with CoE only. The writer writes no references to further files.
TEST(EsiWriter, WhatIsLeftOutIsNamed) {
    auto esi = read_esi(kExampleEsi);
    ASSERT_TRUE(esi);
    EXPECT_TRUE(write_esi(*esi).remarks.empty());
    esi->devices[0].mailbox->protocols = mailbox_protocol::kSoE;
    esi->devices[0].mailbox->ds402_channels = 2;
    esi->further_files.emplace_back("modules.xml");
    EXPECT_EQ(
        write_esi(*esi).remarks,
        (std::vector<std::string>{"EX100: the number of DS402 channels is left out: an ESI has it for slaves with CoE",
                                  "the references to further files (InfoReference) are left out"}));
}

// Names come from slaves. XML 1.0 has no characters below U+0020 except tab and line ends, and neither U+FFFE nor
// U+FFFF.
TEST(EsiWriter, NamesHaveCharactersOfXmlOnly) {
    auto esi = read_esi(kExampleEsi);
    ASSERT_TRUE(esi);
    esi->devices[0].name = "a\x1B\xEF\xBF\xBE\xEF\xBF\xBF<&\xC3\xA4";
    esi->devices[0].fmmus[0] = {FmmuUse::unused, "b\x02"};  // the text of an FMMU without a known use
    esi->devices[0].mailbox->commands[0].comment = "c\x03";
    const std::string text = write_esi(*esi).text;
    EXPECT_EQ(text.find("\xEF\xBF\xBE"), std::string::npos);
    EXPECT_EQ(text.find("\xEF\xBF\xBF"), std::string::npos);
    const auto again = read_esi(text);
    ASSERT_TRUE(again) << to_text(again.problem);
    EXPECT_EQ(again->devices[0].fmmus[0].text, "b");
    EXPECT_EQ(again->devices[0].name, "a \xEF\xBF\xBD\xEF\xBF\xBD<&\xC3\xA4");
}

// The order of the children of Device in ETG.2000.
TEST(EsiWriter, ElementsHaveTheOrderOfTheStandard) {
    const auto esi = read_esi(kExampleEsi);
    ASSERT_TRUE(esi);
    const std::string text = write_esi(*esi).text;
    std::size_t last = 0;
    for (const char* element : {"<Type ", "<Name", "<Info>", "<GroupType>", "<Profile>", "<Fmmu>", "<Sm ", "<RxPdo",
                                "<TxPdo", "<Mailbox DataLinkLayer", "<Dc>", "<ESC>", "<Eeprom>"}) {
        const auto at = text.find(element, text.find("<Device "));
        ASSERT_NE(at, std::string::npos) << element;
        EXPECT_GT(at, last) << element;
        last = at;
    }
}

TEST(EsiWriter, ModulesKeepTheirSlots) {
    const auto esi = read_esi(kModularEsi);
    ASSERT_TRUE(esi) << to_text(esi.problem);
    const auto again = read_esi(write_esi(*esi).text);
    ASSERT_TRUE(again) << to_text(again.problem);
    for (const EsiFile* file : {&*esi, &*again}) {
        HostConfiguration owner;
        const auto made = configure(*file, file->devices[0], {.modules = {{0x11, 0x22, 0x11}}}, owner);
        ASSERT_NE(made.config, nullptr) << made.error;
        ASSERT_EQ(made.pdos.size(), 3U);
        EXPECT_EQ(made.pdos[0].index, 0x1A00);
        EXPECT_EQ(made.pdos[1].index, 0x1601);
        EXPECT_EQ(made.pdos[1].sync_manager, 2) << "the outputs, since the module does not say it";
        EXPECT_EQ(made.pdos[2].index, 0x1A02);
        EXPECT_EQ(made.pdos[2].entries[0].index, 0x6020);
        // The list of modules: the count 0, three idents, the count. Then the commands of the modules.
        const auto startup = made.config->startup();
        ASSERT_EQ(startup.size(), 7U);
        EXPECT_EQ(startup[0].index, 0xF030);
        EXPECT_EQ(startup[2].subindex, 2);
        EXPECT_EQ(startup[2].octets()[0], std::byte{0x22});
        EXPECT_EQ(startup[4].octets()[0], std::byte{3});
        EXPECT_EQ(startup[4].transitions, Transition::init_to_preop);
        EXPECT_EQ(startup[5].index, 0x8000);
        EXPECT_EQ(startup[6].index, 0x8020);
        EXPECT_EQ(configure(*file, file->devices[0], {}, owner).pdos.size(), 3U) << "the default module in each slot";
        EXPECT_EQ(configure(*file, file->devices[0], {.modules = {{0x33}}}, owner).error,
                  "slot 0: module 0x00000033 is not described in this file");
        EXPECT_EQ(configure(*file, file->devices[0], {.modules = {{1, 1, 1, 1}}}, owner).error,
                  "4 modules are given, and Station has 3 slots");
    }
}

class RealSii : public ::testing::TestWithParam<const char*> {};

TEST_P(RealSii, SurvivesTheWayThroughAnEsi) {
    if (std::string_view(MARGAY_SII_DIR).empty()) GTEST_SKIP() << "MARGAY_SII_DIR is not set";
    const auto content = read_file(std::string(MARGAY_SII_DIR) + "/" + GetParam());
    const auto theirs = std::as_bytes(std::span(content.octets));
    const auto described = describe_sii(theirs);
    ASSERT_TRUE(described);
    EsiFile esi{.vendor = described->identity.vendor, .vendor_name = "Vendor"};
    esi.devices.push_back(*described);
    const auto read = read_esi(write_esi(esi).text);
    ASSERT_TRUE(read) << to_text(read.problem);
    const auto ours = make_sii(read->devices[0]);
    ASSERT_TRUE(ours) << ours.error;
    for (std::size_t n = 0; n < 58; ++n) {
        if ((n >= 28 && n < 32) || n == 14) continue;  // the serial number; the checksum
        EXPECT_EQ(ours.octets[n], theirs[n]) << "octet " << n;
    }
    const auto again = describe_sii(ours.octets);
    ASSERT_TRUE(again);
    expect_same_device(*described, *again);
}

INSTANTIATE_TEST_SUITE_P(Devices, RealSii,
                         ::testing::Values("akd.bin", "ek1100.bin", "el2004.bin", "el2262.bin", "el2828.bin",
                                           "el2889.bin"));

// For each ready-made device: the library makes an ESI of the SII image, and the same SII image of this ESI.
TEST(EsiWriter, TheSiiOfEachDeviceSurvivesTheWayThroughAnEsi) {
    for (const std::string_view name : sim::device_names()) {
        const auto model = sim::make_device(name);
        ASSERT_TRUE(model);
        const Bytes theirs = model->sii;
        const auto described = describe_sii(theirs);
        ASSERT_TRUE(described) << name;
        EsiFile esi{.vendor = described->identity.vendor, .vendor_name = "Vendor"};
        esi.devices.push_back(*described);
        const Written written = write_esi(esi);
        const auto read = read_esi(written.text);
        ASSERT_TRUE(read) << to_text(read.problem);
        EXPECT_TRUE(read.remarks.empty()) << name << ": " << to_text(read.remarks[0]);
        const auto ours = make_sii(read->devices[0]);
        ASSERT_TRUE(ours) << ours.error;
        ASSERT_EQ(ours.octets.size(), theirs.size()) << name;
        const auto general = sii::find_category(theirs, sii::category::kGeneral);
        const auto channels = static_cast<std::size_t>(general->data() - theirs.data()) + 9;
        const auto uses = sii::find_category(theirs, sii::category::kFmmu);  // an unused FMMU is 0 or 0xFF
        const auto first_use = uses ? static_cast<std::size_t>(uses->data() - theirs.data()) : 0;
        for (std::size_t n = 0; n < theirs.size(); ++n) {
            if (n >= 28 && n < 32) continue;                          // the serial number
            if (!written.remarks.empty() && n == channels) continue;  // a remark names it
            if (uses && n >= first_use && n < first_use + uses->size() && theirs[n] == std::byte{0}) continue;
            EXPECT_EQ(ours.octets[n], theirs[n]) << name << ", octet " << n;
        }
        EXPECT_EQ(written.remarks.size(), name == "soe_drive" ? 1U : 0U) << name;
    }
}

TEST(EsiWriter, WhatAnSiiCarriesBesidesTheDescriptionIsKept) {
    auto esi = read_esi(kExampleEsi);
    ASSERT_TRUE(esi);
    EsiDevice& device = esi->devices[0];
    device.sysman_class = 17;
    device.mailbox->ds402_channels = 2;
    device.identity.serial = 0x77;
    device.eeprom->categories = {{2, {std::byte{1}, std::byte{2}}}, {0x0801, {std::byte{3}, std::byte{4}}}};
    const auto again = read_esi(write_esi(*esi).text);
    ASSERT_TRUE(again) << to_text(again.problem);
    EXPECT_TRUE(again.remarks.empty());
    EXPECT_EQ(again->devices[0].identity.serial, 0x77U);
    const auto image = make_sii(again->devices[0]);
    ASSERT_TRUE(image) << image.error;
    EXPECT_EQ(image.octets, make_sii(device).octets);
    const auto general = sii::parse_general(*sii::find_category(image.octets, sii::category::kGeneral)).value;
    EXPECT_EQ(general.sysman_class, 17);
    EXPECT_EQ(sii::find_category(image.octets, 0x0801)->size(), 2U);
    auto described = describe_sii(image.octets);
    ASSERT_TRUE(described);
    EXPECT_TRUE(described.remarks.empty());
    EXPECT_EQ(described->identity.serial, 0U) << "the number of one slave";
    EXPECT_EQ(described->sysman_class, 17);
    ASSERT_EQ(described->eeprom->categories.size(), 2U);
    EXPECT_EQ(described->eeprom->categories[1].type, 0x0801);
    described->identity.serial = 0x77;
    EXPECT_EQ(make_sii(*described).octets, image.octets);
    device.eeprom->categories = {{3, {std::byte{1}, std::byte{2}}}};
    const auto with_production_data = describe_sii(make_sii(device).octets);
    ASSERT_EQ(with_production_data.remarks.size(), 1U);
    EXPECT_EQ(with_production_data.remarks[0].text,
              "category 3 of the SII, with production data of one slave, is left out");
}

TEST(EsiWriter, TheNameOfAGroupIsInTheSii) {
    auto esi = read_esi(kExampleEsi);
    ASSERT_TRUE(esi);
    ASSERT_EQ(esi->devices[0].group_name, "Drives");
    esi->devices[0].group = "Drive";
    const auto described = describe_sii(make_sii(esi->devices[0]).octets);
    ASSERT_TRUE(described);
    EXPECT_EQ(described->group, "Drive");
    EXPECT_EQ(described->group_name, "Drives");
}

TEST(EsiWriter, StringsHaveTheirLengthInTheNameOfTheirType) {
    auto esi = read_esi(kExampleEsi);
    ASSERT_TRUE(esi);
    esi->devices[0].dictionary = {
        {.index = 0x1008, .name = "Name", .data_type = "VISIBLE_STRING", .bits = 96},
        {.index = 0x2000,
         .name = "Record",
         .items = {{.subindex = 1, .name = "Octets", .data_type = "OCTET_STRING", .bits = 40}}}};
    const Written written = write_esi(*esi);
    EXPECT_NE(written.text.find("<Type>STRING(12)</Type>"), std::string::npos) << written.text;
    EXPECT_NE(written.text.find("<Type>OCTET_STRING(5)</Type>"), std::string::npos);
    EXPECT_EQ(written.text.find("VISIBLE_STRING"), std::string::npos);
    EXPECT_TRUE(read_esi(written.text));
}

TEST(EsiWriter, DescribesASlaveWithItsDictionary) {
    VirtualOsal osal;
    sim::Segment segment;
    const auto n = segment.add(std::move(*sim::make_device("drive")).assemble());
    segment.connect_master({n, 0});
    segment.power_up(osal.now());
    SimulatedNic nic(segment, osal);
    HostContext ctx;
    ASSERT_TRUE(init(ctx, nic, osal));
    ASSERT_TRUE(config_init(ctx));
    const auto device = describe_slave(ctx, 1);
    ASSERT_TRUE(device) << to_text(device.problem);
    EXPECT_EQ(device->identity.product, ctx.slave(1).identity.product);
    EXPECT_EQ(device->name, ctx.slave(1).name());
    EXPECT_EQ(entry_name(*device, Direction::outputs, 0x6040, 0).empty(), false);
    EXPECT_GT(device->dictionary.size(), 20U);
    EsiFile esi{.vendor = device->identity.vendor, .vendor_name = "Vendor"};
    esi.devices.push_back(*device);
    const auto read = read_esi(write_esi(esi).text);
    ASSERT_TRUE(read) << to_text(read.problem);
    expect_same_device(*device, read->devices[0]);
    ASSERT_EQ(read->devices[0].dictionary.size(), device->dictionary.size());
    for (std::size_t o = 0; o < device->dictionary.size(); ++o)
        EXPECT_EQ(read->devices[0].dictionary[o].items.size(), device->dictionary[o].items.size());
}

}  // namespace
}  // namespace margay::files
