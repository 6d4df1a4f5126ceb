// Slaves with a wrong EEPROM, and the reaction of the master. test/README.md lists the field note of each test.
#include "facts.hpp"
#include "mailbox/mailbox_bus.hpp"
#include "segment/field_notes.hpp"

#include "wire/sii_writer.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

// A device with a processor and process data, without a mailbox; the test makes its SII.
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

// Every fault of an image is reported, and the neighbouring slaves work.
TEST_F(FieldNotesSii, OddImagesAreToldAndDoNotSpoilTheNeighbours) {
    struct Case {
        std::string_view manner;
        Errc told;  // by the bring-up
        bool reaches_op;
    };
    const Case cases[] = {
        {"sii_blank", Errc::sii_blank, false},
        {"sii_bad_checksum", Errc::sii_checksum, false},  // its PDI does not work: no program answers AL control
        {"sii_no_mailbox_sizes", Errc::sii_format, false},
        {"sii_no_pdos", Errc::none, true},
        {"sii_null_strings", Errc::none, true},
        {"sii_endless", Errc::none, true},  // the fault is behind all data that the scan needs
        {"sii_no_watchdog_trigger", Errc::none, true},
        {"sii_sync_managers_off", Errc::none, true},
        {"sii_4_bytes", Errc::none, true},
        {"sii_slow", Errc::none, true},
        {"sii_busy_until_stored", Errc::none, true},
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
    // The slave without a PDI does not accept AL control: the register is still full, because no program read the last
    // request.
    const auto written = writestate(ctx, 0, AlState::op);
    ASSERT_FALSE(written);
    EXPECT_EQ(written.error().code, Errc::timeout) << words(written.error());
    cycles(800);
    (void)readstate(ctx);
    for (std::size_t n = 1; n <= last; ++n) {
        const bool odd = n > 1 && n < last;
        if (odd && !cases[n - 2].reaches_op) continue;
        EXPECT_EQ(ctx.slave(n).al, (AlStatus{AlState::op, false, 0}))
            << (odd ? cases[n - 2].manner : "neighbour") << ": " << told(n);
    }
}

// The PDOs give the length of a SyncManager. A SyncManager with a length is enabled, whatever the enable octet of the
// SII says.
TEST_F(FieldNotesSii, ASyncManagerThatGetsItsLengthFromPdosIsEnabled) {
    const std::array rx_entries{wire::sii::PdoEntryDescription{.index = 0x7000, .subindex = 1, .bit_length = 32}};
    const std::array tx_entries{wire::sii::PdoEntryDescription{.index = 0x6000, .subindex = 1, .bit_length = 16},
                                wire::sii::PdoEntryDescription{.bit_length = 8}};  // a gap, which counts, too
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

// In the SII, the control octet of the outputs has no watchdog trigger. When the application requests a watchdog, the
// master sets the trigger, and the watchdog works.
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

// A slave that refuses to operate without a watchdog (0x001F), and whose SII does not set the trigger.
TEST(FieldNotesWatchdog, ASlaveThatInsistsOnAWatchdogGetsOne) {
    MailboxBus bus;
    bus.add_stack().application.description_value.outputs.watchdog_required = true;
    bus.start();
    facts(bus.ctx->slave(1)).sync_managers[2].control = 0x24;
    std::vector<std::byte> image(64);
    ASSERT_TRUE(config_map(*bus.ctx, image));
    EXPECT_EQ(bus.ctx->slave(1).al, (AlStatus{AlState::safeop, false, 0})) << bus.words(bus.ctx->slave(1).error);
    EXPECT_EQ(bus.segment.slave(0).registers().get<std::uint8_t>(0x0814), 0x64);
}

// A mailbox size that no frame can carry is not sent. The error names the mailbox, its size and the largest possible
// size.
TEST_F(FieldNotesSii, AMailboxThatNoFrameCarriesIsToldAndNotUsed) {
    struct Case {
        std::uint32_t word;
        std::uint16_t bytes;
        std::string_view words;
        bool usable;
    };
    const Case cases[] = {
        {0x19, 1487,
         "at word 0x0019: the content contradicts itself (the mailbox out has 1487 octets, a frame carries 1486)",
         false},
        {0x1B, 1500, "(the mailbox in has 1500 octets, a frame carries 1486)", false},
        {0x19, 65535, "(the mailbox out has 65535 octets, a frame carries 1486)", false},
        {0x15, 1487, "(the boot mailbox out has 1487 octets, a frame carries 1486)", true},
        {0x17, 65535, "(the boot mailbox in has 65535 octets, a frame carries 1486)", true},
    };
    plug_odd({});
    for (const auto& c : cases) {
        auto device = sim::make_device("odd_device").value();
        if (c.word < 0x18)  // the device has no boot mailbox: write a complete one
            for (const auto& [word, value] : {std::pair{0x14, 0x1000}, {0x15, 0x80}, {0x16, 0x1080}, {0x17, 0x80}})
                store_le(MutableBytes(device.sii), static_cast<std::size_t>(word) * 2,
                         static_cast<std::uint16_t>(value));
        store_le(MutableBytes(device.sii), c.word * 2, c.bytes);
        plug(std::move(device));
    }
    const Time before = osal.now();
    start();
    EXPECT_LT(osal.now() - before, 20s);
    EXPECT_EQ(ctx.slave(1).error.code, Errc::none) << told(1);
    for (std::size_t n = 0; n < std::size(cases); ++n) {
        const auto& slave = ctx.slave(n + 2);
        EXPECT_EQ(slave.mailbox.present(), cases[n].usable);
        EXPECT_FALSE(slave.boot_mailbox.present()) << n;
        bool found = told(n + 2).find(cases[n].words) != std::string::npos;
        while (const auto error = ctx.errors().take())
            found |= words(*error).find(cases[n].words) != std::string::npos && error->slave == n + 2;
        EXPECT_TRUE(found) << cases[n].words << " was expected, found: " << told(n + 2);
    }
}

// The same for the SyncManager category: its mailbox lengths are not used, and a wrong length is reported.
TEST_F(FieldNotesSii, AMailboxSyncManagerThatNoFrameCarriesIsToldAndHasNoLength) {
    auto device = sim::make_device("odd_device").value();
    wire::sii::CategoryWalker walker(device.sii);
    while (const auto category = walker.next())
        if (category->place.type == wire::sii::category::kSyncManager)
            store_le<std::uint16_t>(MutableBytes(device.sii), category->place.word * 2 + 2, 65535);
    plug(std::move(device));
    start();
    EXPECT_EQ(ctx.slave(1).error.code, Errc::sii_format);
    EXPECT_NE(told(1).find("(the mailbox SyncManager has 65535 octets, a frame carries 1486)"), std::string::npos)
        << told(1);
    EXPECT_EQ(ctx.slave(1).sync_managers[0].length_bytes, 0);
    EXPECT_TRUE(ctx.slave(1).mailbox.present());
    EXPECT_EQ(ctx.slave(1).al.state, AlState::preop);
}

// The size word gives 4 MiB and the categories have no end: reading has a limit, for the mapping, too.
TEST_F(FieldNotesSii, ASizeWordOf4MiBIsNotFollowed) {
    auto device = sim::make_device("analog_in_4").value();
    device.sii.resize(1024 * 1024);
    store_le<std::uint16_t>(MutableBytes(device.sii), wire::sii::word::kSize * 2, 0x7FFF);
    wire::sii::CategoryWalker walker(device.sii);
    while (walker.next()) continue;
    auto at = walker.stopped_at() * 2;  // in place of the end mark: PDO heads without entries, without end
    for (; at + 8 <= device.sii.size(); at += 8)
        store_le<std::uint64_t>(MutableBytes(device.sii), at, 0x1A00 | std::uint64_t{9} << 24);
    for (at = walker.stopped_at() * 2; at + 4 <= device.sii.size(); at += 4 + 0x7000 * 2) {
        store_le<std::uint16_t>(MutableBytes(device.sii), at, wire::sii::category::kTxPdo);
        store_le<std::uint16_t>(MutableBytes(device.sii), at + 2, 0x7000);
    }
    plug(std::move(device));
    const Time before = osal.now();
    start();
    (void)config_map(ctx, image);
    EXPECT_LT(osal.now() - before, 8s);
}

// Recorded on an EK1100: storing a word needs 3.8 ms, but the interface is busy for only 0.3 ms of it. Alias and
// checksum are written in sequence.
TEST_F(FieldNotesSii, AnEepromThatAcknowledgesNothingWhileItStoresIsWritten) {
    plug_odd({});
    start();
    const auto& memory = segment.slave(0).sii().image();
    std::array<std::byte, 16> area{};
    std::copy_n(memory.begin(), area.size(), area.begin());
    area[8] = std::byte{0x34};
    area[14] = static_cast<std::byte>(wire::sii::checksum(area));
    const auto written = write_sii(ctx, 1, 0, area);
    ASSERT_TRUE(written) << words(written.error());
    EXPECT_TRUE(std::equal(area.begin(), area.end(), memory.begin()));
}

// Power fails after any number of words of the area: the content is the old one, the new one, or has a wrong checksum.
TEST_F(FieldNotesSii, AnAbortOfAnyWordOfTheAreaIsSafe) {
    plug_odd({});
    start();
    auto& memory = segment.slave(0).sii().image();
    const std::vector<std::byte> old(memory.begin(), memory.begin() + 16);
    std::vector<std::byte> wanted(16);
    for (std::size_t i = 0; i < 14; ++i) wanted[i] = old[i] ^ static_cast<std::byte>(0x11 * (i + 1));
    wanted[14] = static_cast<std::byte>(wire::sii::checksum(wanted));
    for (std::size_t words_before = 0;; ++words_before) {
        std::copy(old.begin(), old.end(), memory.begin());
        SiiWriteRequest request;
        request.slave = 1;
        request.word = 0;
        request.data = wanted;
        ASSERT_TRUE(submit(ctx, request));
        std::size_t changes = 0;
        auto last = std::vector<std::byte>(memory.begin(), memory.begin() + 16);
        while (request.busy() && changes < words_before) {
            (void)poll(ctx, osal.now());
            osal.advance(20us);
            const std::vector<std::byte> present(memory.begin(), memory.begin() + 16);
            changes += present != last;
            last = present;
        }
        const bool done = !request.busy();
        request.cancel();  // and power off
        const std::vector<std::byte> left(memory.begin(), memory.begin() + 16);
        EXPECT_TRUE(left == old || left == wanted || !wire::sii::checksum_right(left)) << words_before;
        if (done || words_before > 10) break;
    }
    EXPECT_EQ(std::vector<std::byte>(memory.begin(), memory.begin() + 16), wanted);
}

// Ten milliseconds per word, and two commands in sequence that the EEPROM does not acknowledge.
TEST_F(FieldNotesSii, ASlowEepromIsWrittenWordByWordAndReadBack) {
    plug_odd({"sii_slow", "sii_nacks"});
    start();
    std::array<std::byte, 32> text{};
    for (std::size_t i = 0; i < text.size(); ++i) text[i] = static_cast<std::byte>(0xA0 + i);
    const Time before = osal.now();
    const auto written = write_sii(ctx, 1, 0x30, text);
    ASSERT_TRUE(written) << words(written.error());
    EXPECT_GE(osal.now() - before, 16 * 13ms) << "written and read, each word by itself";
    EXPECT_TRUE(std::equal(text.begin(), text.end(), segment.slave(0).sii().image().begin() + 0x60));
}

}  // namespace
}  // namespace margay
