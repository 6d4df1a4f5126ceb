// Slaves whose EEPROM is not as it should be: what the master makes of them. test/README.md says which note each test
// is of.
#include "mailbox/mailbox_bus.hpp"
#include "segment/field_notes.hpp"

#include "wire/sii_writer.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

// A device behind a processor that has process data and no mailbox, of an SII made for the test.
sim::Device plain_device(std::span<const SmInfo> sync_managers, std::span<const wire::sii::PdoDescription> rx,
                         std::span<const wire::sii::PdoDescription> tx) {
    const std::array fmmus{FmmuUse::outputs, FmmuUse::inputs};
    std::vector<std::byte> image(1024);
    const auto written = wire::sii::write_image({.configuration = {.pdi_control = 0x0005},
                                                 .identity = {.vendor = sim::kVendorId, .product = 0x0200},
                                                 .name = "plain",
                                                 .fmmus = fmmus,
                                                 .sync_managers = sync_managers,
                                                 .tx_pdos = tx,
                                                 .rx_pdos = rx},
                                                image);
    EXPECT_TRUE(written.ok());
    return sim::device_from_sii(image);
}

class FieldNotesSii : public FieldNotes {};

// Whatever is wrong with one, it is told, and its neighbours work.
TEST_F(FieldNotesSii, OddImagesAreToldAndDoNotSpoilTheNeighbours) {
    struct Case {
        std::string_view manner;
        Errc told;  // of the bring-up
        bool reaches_op;
    };
    const Case cases[] = {
        {"sii_blank", Errc::sii_blank, false},
        {"sii_bad_checksum", Errc::sii_checksum, true},
        {"sii_no_mailbox_sizes", Errc::sii_format, false},
        {"sii_no_pdos", Errc::none, true},
        {"sii_null_strings", Errc::none, true},
        {"sii_endless", Errc::none, true},  // behind all that the scan needs
        {"sii_no_watchdog_trigger", Errc::none, true},
        {"sii_sync_managers_off", Errc::none, true},
        {"sii_4_bytes", Errc::none, true},
        {"sii_slow", Errc::none, true},
        {"sii_nacks", Errc::none, true},
    };
    plug_odd({});
    for (const auto& c : cases) plug_odd({c.manner});
    plug_odd({});
    start();
    const auto last = std::size(cases) + 2;
    for (std::size_t n = 2; n < last; ++n) {
        const auto& c = cases[n - 2];
        EXPECT_EQ(ctx.slave(n).error.code, c.told) << c.manner << ": " << told(n);
        EXPECT_LE(ctx.slave(n).mailbox.in_bytes, 128) << c.manner;
    }
    map();
    cycles(5);
    (void)to(AlState::op, 300);
    cycles(500);
    (void)readstate(ctx);
    for (std::size_t n = 1; n <= last; ++n) {
        const bool odd = n > 1 && n < last;
        if (odd && !cases[n - 2].reaches_op) continue;
        EXPECT_EQ(ctx.slave(n).al, (AlStatus{AlState::op, false, 0}))
            << (odd ? cases[n - 2].manner : "neighbour") << ": " << told(n);
    }
}

// The length of a SyncManager is its PDOs'; what has one is switched on, whatever the SII's enable octet says.
TEST_F(FieldNotesSii, ASyncManagerThatGetsItsLengthFromPdosIsEnabled) {
    const std::array rx_entries{wire::sii::PdoEntryDescription{.index = 0x7000, .subindex = 1, .bit_length = 32}};
    const std::array tx_entries{wire::sii::PdoEntryDescription{.index = 0x6000, .subindex = 1, .bit_length = 16},
                                wire::sii::PdoEntryDescription{.bit_length = 8}};  // a gap, and it counts
    const std::array rx{wire::sii::PdoDescription{.index = 0x1600, .sync_manager = 0, .entries = rx_entries}};
    const std::array tx{wire::sii::PdoDescription{.index = 0x1A00, .sync_manager = 1, .entries = tx_entries}};
    const std::array sms{SmInfo{0x1000, 0, 0x64, 0, SmType::outputs}, SmInfo{0x1400, 0, 0x20, 0, SmType::inputs}};
    plug(plain_device(sms, rx, tx));
    start();
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    EXPECT_EQ(wire::load_sync_manager(segment.slave(0).peek(0x0800, 8)), (wire::SyncManager{0x1000, 4, 0x64, 1}));
    EXPECT_EQ(wire::load_sync_manager(segment.slave(0).peek(0x0808, 8)), (wire::SyncManager{0x1400, 3, 0x20, 1}));
    EXPECT_EQ(*cycle(), 3U);
}

TEST_F(FieldNotesSii, WithoutPdosTheSyncManagersLengthCounts) {
    const std::array sms{SmInfo{0x1000, 5, 0x64, 1, SmType::outputs}, SmInfo{0x1400, 7, 0x20, 1, SmType::inputs}};
    plug(plain_device(sms, {}, {}));
    start();
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    EXPECT_EQ(ctx.slave(1).image.outputs.bits, 40U);
    EXPECT_EQ(ctx.slave(1).image.inputs.bits, 56U);
    EXPECT_EQ(*cycle(), 3U);
}

// The SII leaves the watchdog trigger out of the outputs' control octet. A watchdog that the application asks for bites
// all the same.
TEST_F(FieldNotesSii, AWatchdogThatIsAskedForIsFedThoughTheSiiForgotIt) {
    plug_odd({"sii_no_watchdog_trigger"});
    plug_odd({"sii_no_watchdog_trigger"});
    start();
    ctx.slave(2).config.process_data_watchdog = 25ms;
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(at<std::uint8_t>(0, 0x0814), 0x24) << "as the SII has it";
    EXPECT_EQ(at<std::uint8_t>(1, 0x0814), 0x64);
    for (int n = 0; n < 100; ++n) ASSERT_TRUE(cycle());
    osal.advance(60ms);
    ASSERT_TRUE(readstate(ctx));
    EXPECT_EQ(ctx.slave(1).al, (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(ctx.slave(2).al, (AlStatus{AlState::safeop, true, 0x001B}));
}

// A slave that refuses to go without a watchdog (0x001F), and whose SII forgot to say so.
TEST(FieldNotesWatchdog, ASlaveThatInsistsOnAWatchdogGetsOne) {
    MailboxBus bus;
    bus.add_stack().application.description_value.outputs.watchdog_required = true;
    bus.start();
    bus.ctx->slave(1).sync_managers[2].control = 0x24;
    std::vector<std::byte> image(64);
    ASSERT_TRUE(config_map(*bus.ctx, image));
    EXPECT_EQ(bus.ctx->slave(1).al, (AlStatus{AlState::safeop, false, 0})) << bus.words(bus.ctx->slave(1).error);
    EXPECT_EQ(bus.segment.slave(0).registers().get<std::uint8_t>(0x0814), 0x64);
}

// Ten milliseconds a word, and two commands in a row that the EEPROM does not acknowledge.
TEST_F(FieldNotesSii, ASlowEepromIsWrittenWordByWordAndReadBack) {
    plug_odd({"sii_slow", "sii_nacks"});
    start();
    std::array<std::byte, 32> text{};
    for (std::size_t i = 0; i < text.size(); ++i) text[i] = static_cast<std::byte>(0xA0 + i);
    const Time before = osal.now();
    const auto written = eeprom_write(ctx, 1, 0x30, text);
    ASSERT_TRUE(written) << words(written.error());
    EXPECT_GE(osal.now() - before, 16 * 13ms) << "written and read, each word by itself";
    EXPECT_TRUE(std::equal(text.begin(), text.end(), segment.slave(0).sii().image().begin() + 0x60));
}

}  // namespace
}  // namespace margay
