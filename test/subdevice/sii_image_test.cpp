// The SII image made from a device's description and dictionary, read back by the parser; EEPROM emulation.
#include "subdevice/sii_image.hpp"

#include "bench_device.hpp"
#include "wire/sii_check.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;
namespace sii = wire::sii;

class SiiImageTest : public ::testing::Test {
  protected:
    SiiImageTest() {
        const auto written = write_sii(bench.application.description(), {.pdi_control = 0x0C05, .alias = 0x1234},
                                       bench.dictionary, workspace, image);
        EXPECT_TRUE(written.ok()) << to_text(written.fault);
    }
    Bytes category(std::uint16_t type) {
        sii::CategoryChain chain(static_cast<std::uint32_t>(image.size() / 2));
        while (chain.more()) {
            const auto place = chain.step(Bytes(image).subspan(chain.header_word() * 2, 4));
            if (!place) break;
            if (place->type == type) return Bytes(image).subspan(place->word * 2, place->words * std::size_t{2});
        }
        return {};
    }
    Bench bench;
    SiiWorkspace<4, 16> workspace;
    std::vector<std::byte> image = std::vector<std::byte>(2048);
};

TEST_F(SiiImageTest, FixedPartSaysWhatTheDescriptionSays) {
    const auto fixed = sii::load_fixed_part(image);
    ASSERT_TRUE(fixed.ok());
    EXPECT_EQ(fixed.value.configuration.pdi_control, 0x0C05);
    EXPECT_EQ(fixed.value.configuration.alias, 0x1234);
    EXPECT_EQ(fixed.value.identity, (Identity{0x4D47, 0x10, 1, 7}));
    EXPECT_EQ(fixed.value.mailboxes.standard.out_start, 0x1000);
    EXPECT_EQ(fixed.value.mailboxes.standard.in_bytes, 128);
    EXPECT_EQ(fixed.value.mailboxes.standard.protocols, mailbox_protocol::kCoE);
    EXPECT_FALSE(fixed.value.mailboxes.boot.present());
}

TEST_F(SiiImageTest, CategoriesSayWhatTheDictionarySays) {
    const auto general = sii::parse_general(category(sii::category::kGeneral));
    ASSERT_TRUE(general.ok());
    EXPECT_EQ(general.value.coe_details, coe_detail::kSdo | coe_detail::kSdoInformation | coe_detail::kPdoAssignment |
                                             coe_detail::kPdoConfiguration | coe_detail::kCompleteAccess);
    sii::SyncManagers managers(category(sii::category::kSyncManager));
    EXPECT_EQ(managers.next()->control, 0x26);
    EXPECT_EQ(managers.next()->control, 0x22);
    const auto outputs = managers.next();
    EXPECT_EQ(outputs->control, 0x64);
    EXPECT_EQ(outputs->length_bytes, 4);
    const auto inputs = managers.next();
    EXPECT_EQ(inputs->control, 0x20);
    EXPECT_EQ(inputs->length_bytes, 6);
    EXPECT_EQ(inputs->start, 0x1300);
    sii::Pdos rx(category(sii::category::kRxPdo));
    const auto first = rx.next();
    ASSERT_TRUE(first);
    EXPECT_EQ(first->index, 0x1600);
    EXPECT_EQ(first->sync_manager, 2);
    EXPECT_EQ(first->entry_count, 3);
    EXPECT_EQ(first->flags & sii::pdo_flag::kFixedContent, 0);
    sii::PdoEntries entries(first->entries);
    const auto a = entries.next();
    EXPECT_EQ(a->index, 0x7000);
    EXPECT_EQ(a->subindex, 1);
    EXPECT_EQ(a->bit_length, 8);
    EXPECT_EQ(a->data_type, 5);
    const auto second = rx.next();
    ASSERT_TRUE(second);
    EXPECT_EQ(second->index, 0x1601);
    EXPECT_FALSE(second->assigned());
    EXPECT_NE(second->flags & sii::pdo_flag::kFixedContent, 0);
    EXPECT_FALSE(rx.next());
}

// The position of an entry in the category is the number of its SyncManager, also if the device has no lower
// SyncManagers.
TEST_F(SiiImageTest, UnusedSyncManagersHaveEntriesOfTheirOwn) {
    DeviceDescription inputs_only = bench.application.description();
    inputs_only.outputs = {};
    ASSERT_TRUE(write_sii(inputs_only, {}, bench.dictionary, workspace, image).ok());
    std::vector<SmType> types;
    sii::SyncManagers managers(category(sii::category::kSyncManager));
    while (const auto manager = managers.next()) types.push_back(manager->type);
    EXPECT_EQ(types, (std::vector{SmType::mailbox_out, SmType::mailbox_in, SmType::unused, SmType::inputs}));
    // Two uses of one SyncManager are an invalid description.
    inputs_only.inputs.sync_manager = 1;
    EXPECT_FALSE(write_sii(inputs_only, {}, bench.dictionary, workspace, image).ok());
}

TEST_F(SiiImageTest, AreasWithoutMemoryOfTheirOwnAreToldNotWritten) {
    using sii::Fault;
    const auto& right = bench.application.description();
    const auto fault = [&](auto change) {
        DeviceDescription wrong = right;
        change(wrong);
        return write_sii(wrong, {}, bench.dictionary, workspace, image).fault;
    };
    // Four octets of outputs in three buffers from 0x1200 on, six of inputs from 0x1300 on.
    EXPECT_EQ(fault([](auto& d) { d.inputs.start = 0x120C; }), Fault::none);
    EXPECT_EQ(fault([](auto& d) { d.inputs.start = 0x120B; }), Fault::sync_manager_overlap);
    EXPECT_EQ(fault([](auto& d) { d.inputs.start = 0x120B, d.outputs.three_buffers = false; }), Fault::none);
    EXPECT_EQ(fault([](auto& d) { d.inputs.start = 0x11EF; }), Fault::sync_manager_overlap);
    EXPECT_EQ(fault([](auto& d) { d.outputs.start = 0x117F; }), Fault::sync_manager_overlap) << "on a mailbox";
    EXPECT_EQ(fault([](auto& d) { d.outputs.start = 0x0FFE; }), Fault::sync_manager_outside);
    EXPECT_EQ(fault([](auto& d) { d.outputs.start = 0xFFF8; }), Fault::sync_manager_outside);
    EXPECT_EQ(fault([](auto& d) { d.mailbox.send.start = 0x107F; }), Fault::mailbox_overlap);
    EXPECT_EQ(fault([](auto& d) { d.mailbox.send.start = 0x0F00; }), Fault::mailbox_outside);
    EXPECT_EQ(fault([](auto& d) { d.boot_mailbox = d.mailbox, d.boot_mailbox.send.start = 0x1001; }),
              Fault::mailbox_overlap);
    EXPECT_EQ(fault([](auto& d) {
                  d.boot_mailbox = {{0x1200, 256}, {0x1300, 256}};
              }),
              Fault::none)
        << "BOOT has no process data";
    EXPECT_EQ(fault([](auto& d) { d.mailbox = {}; }), Fault::mailbox_without_size);
    for (const auto words : {Fault::sync_manager_outside, Fault::sync_manager_overlap})
        EXPECT_NE(to_text(words).find("SyncManager"), std::string_view::npos);
}

TEST_F(SiiImageTest, SizesAndTimesThatNoMasterCanUseAreToldNotWritten) {
    using sii::Fault;
    using std::chrono_literals::operator""ms;
    const auto& right = bench.application.description();
    const auto fault = [&](auto change) {
        DeviceDescription wrong = right;
        change(wrong);
        return write_sii(wrong, {}, bench.dictionary, workspace, image).fault;
    };
    EXPECT_EQ(fault([](auto& d) { d.mailbox.send.size_bytes = 16; }), Fault::none);
    EXPECT_EQ(fault([](auto& d) { d.mailbox.send.size_bytes = 15; }), Fault::mailbox_too_short);
    EXPECT_EQ(fault([](auto& d) { d.mailbox.receive.size_bytes = 8; }), Fault::mailbox_too_short);
    EXPECT_EQ(fault([](auto& d) { d.boot_mailbox = {{0x1000, 9}, {0x1100, 128}}; }), Fault::mailbox_too_short);
    const auto without_coe = [](auto& d) { d.protocols = {.foe = true}, d.mailbox.receive.size_bytes = 10; };
    EXPECT_EQ(fault(without_coe), Fault::none);
    EXPECT_EQ(fault([](auto& d) { d.dc.min_cycle = d.dc.max_cycle = 1ms; }), Fault::none);
    EXPECT_EQ(fault([](auto& d) { d.dc.min_cycle = 2ms, d.dc.max_cycle = 1ms; }), Fault::cycle_limits);
    EXPECT_NE(to_text(Fault::cycle_limits).find("cycle time"), std::string_view::npos);
}

TEST_F(SiiImageTest, TooLittleRoomIsToldNotWritten) {
    SiiWorkspace<2, 16> few_pdos;
    SiiWorkspace<4, 3> few_entries;
    std::vector<std::byte> small(256);
    const auto& device = bench.application.description();
    EXPECT_EQ(write_sii(device, {}, bench.dictionary, few_pdos, image).fault, sii::Fault::no_room);
    EXPECT_EQ(write_sii(device, {}, bench.dictionary, few_entries, image).fault, sii::Fault::no_room);
    EXPECT_EQ(write_sii(device, {}, bench.dictionary, workspace, small).fault, sii::Fault::no_room);
}

// --- Operation modes ---

// A master that uses the settings of the SII reaches SAFEOP in each operation mode.
TEST_F(SiiImageTest, TheDeviceAcceptsEachOperationModeOfItsSii) {
    auto& dc = bench.application.description_value.dc;
    for (const bool required : {false, true})
        for (const bool sync1 : {false, true}) {
            dc = {.supported = true, .required = required, .sync1 = sync1};
            // The initial values of the objects follow from the description.
            using Sync = SyncValues<Values::sync>;
            const auto& device = bench.application.description();
            Sync::output_type::store(bench.image, sync_entry::first_type(device, true));
            Sync::input_type::store(bench.image, sync_entry::first_type(device, false));
            ASSERT_TRUE(write_sii(device, {}, bench.dictionary, workspace, image).ok());
            sii::DcOpModes modes(category(sii::category::kDc));
            unsigned count = 0;
            while (const auto mode = modes.next()) {
                ++count;
                bench.esc.ecat_set<std::uint32_t>(0x09A0, 1'000'000);
                bench.esc.ecat_set(0x0980, mode->assign_activate);
                EXPECT_EQ(bench.request(0x14), (AlStatus{AlState::safeop, false, 0}))
                    << std::hex << mode->assign_activate << (required ? " required" : "") << (sync1 ? " SYNC1" : "");
                (void)bench.request(0x12);
            }
            EXPECT_EQ(count, required ? 1u : 2u);
        }
}

TEST_F(SiiImageTest, TheOperationModeSaysWhenSync1Comes) {
    auto& dc = bench.application.description_value.dc;
    const auto last = [&] {
        EXPECT_TRUE(write_sii(bench.application.description(), {}, bench.dictionary, workspace, image).ok());
        sii::DcOpModes modes(category(sii::category::kDc));
        sii::DcOpMode found;
        while (const auto mode = modes.next()) found = *mode;
        return found;
    };
    dc = {.supported = true, .sync1_cycle_factor = 5, .sync1_shift = 20us};
    EXPECT_EQ(last().assign_activate, 0x0300);
    EXPECT_EQ(last().sync1_cycle_factor, 0) << "not used";
    dc.sync1 = true;
    EXPECT_EQ(last().assign_activate, 0x0700);
    EXPECT_EQ(last().sync0_cycle_factor, 1);
    EXPECT_EQ(last().sync1_cycle_factor, 5);
    EXPECT_EQ(last().sync1_shift_time_ns, 20'000);
    dc.sync0_cycle_factor = -5;
    EXPECT_EQ(last().sync0_cycle_factor, -5) << "oversampling";
}

// --- Emulation: 0x0502 on the side of the PDI ---

class EepromTest : public SiiImageTest {
  protected:
    // Writes the master's command to the registers, as the PDI sees it.
    std::uint16_t command(std::uint16_t bits, std::uint32_t word, std::uint16_t data = 0) {
        bench.esc.ecat_set<std::uint16_t>(0x0502, bits);
        bench.esc.ecat_set<std::uint32_t>(0x0504, word);
        bench.esc.ecat_set<std::uint64_t>(0x0508, data);
        bench.esc.raise(wire::al_event::kEeprom);
        eeprom.step(bench.esc.events());
        return bench.esc.get<std::uint16_t>(0x0502);
    }
    EepromEmulation eeprom{bench.esc, image};
};

TEST_F(EepromTest, ReadsFourOrEightOctets) {
    EXPECT_EQ(command(0x0140, 8) & 0x7F00, 0x0100);
    EXPECT_EQ(bench.esc.get<std::uint64_t>(0x0508), 0x0000'0010'0000'4D47u);
    EXPECT_EQ(command(0x0100, 8) & 0x7F00, 0x0100);
    EXPECT_EQ(bench.esc.get<std::uint64_t>(0x0508), 0x0000'4D47u);
    EXPECT_EQ(command(0x0140, 1023) & 0x7F00, 0x0100) << "the last word";
    EXPECT_EQ(command(0x0140, 1024) & 0x7F00, 0x2100) << "there is no such word";
    EXPECT_EQ(command(0x0140, 0xFFFFFFFF) & 0x7F00, 0x2100);
}

TEST_F(EepromTest, WritesAWordAndTellsTheAuthor) {
    EXPECT_FALSE(eeprom.written());
    EXPECT_EQ(command(0x0201, 4, 0xBEEF) & 0x7F00, 0x0200);
    EXPECT_EQ(load_le<std::uint16_t>(image, 8), 0xBEEF);
    EXPECT_TRUE(eeprom.written());
    EXPECT_EQ(command(0x0201, 1024, 1) & 0x7F00, 0x2200);
    EXPECT_EQ(command(0x0400, 0) & 0x7F00, 0x0400);
    EXPECT_EQ(bench.esc.get<std::uint16_t>(0x0508), 0xBEEF) << "reload hands the alias over";
    image[1] = std::byte{0xA7};  // 0x0141: bit 1, and in bits 4 to 7 the bits of ports 1 and 3
    EXPECT_EQ(command(0x0400, 0) & 0x7F00, 0x0400);
    EXPECT_EQ(bench.esc.get<std::uint32_t>(0x0508), 0x0015'BEEFu) << "and enhanced link detection";
}

TEST_F(EepromTest, WithoutACommandNothingIsTouched) {
    const auto before = bench.esc.accesses;
    eeprom.step(~wire::al_event::kEeprom);
    EXPECT_EQ(bench.esc.accesses, before);
}

}  // namespace
}  // namespace margay::subdevice
