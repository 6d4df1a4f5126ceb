// BOOT: the way to it and back by the calls for states, its own mailboxes, and the supervision.
#include "mailbox/foe_bus.hpp"
#include "mailbox/spoilt_frames.hpp"
#include "oshw/filter_nic.hpp"
#include "sim/library/quirks.hpp"
#include "wire/sync_manager.hpp"

#include <functional>

namespace margay {
namespace {

using sim::Bootloader;
constexpr std::uint32_t kPassword = Bootloader::kPassword;
namespace reg = wire::reg;

// Passes each datagram that the master sends to a function.
class Watcher final : public FilterNic {
  public:
    using FilterNic::FilterNic;
    std::function<void(const wire::DatagramView&)> seen;
    SendStatus send(std::span<const std::byte> frame) noexcept override {
        wire::DatagramReader reader(frame);
        while (const auto datagram = reader.next())
            if (seen) seen(*datagram);
        return inner().send(frame);
    }
};

// The registers of SyncManagers 0 and 1 as the master has written them. The master must never write another start or
// length to an enabled SyncManager, because an ESC ignores such a write according to its data sheet.
struct SyncManagerWrites {
    std::array<std::byte, 2 * reg::kSyncManagerStride> now{};
    unsigned moved = 0;
    unsigned moved_while_on = 0;

    void operator()(const wire::DatagramView& datagram) {
        if (datagram.header.command != wire::Command::FPWR && datagram.header.command != wire::Command::BWR) return;
        const std::size_t first = datagram.header.address.ado();
        for (std::size_t n = 0; n < 2; ++n) {
            const std::size_t at = reg::kSyncManagerBase + n * reg::kSyncManagerStride;
            const bool on = (now[n * 8 + wire::SyncManagerLayout::activate::offset] & std::byte{1}) != std::byte{0};
            bool other = false;
            for (std::size_t i = 0; i < datagram.data.size(); ++i) {
                const std::size_t address = first + i;
                if (address < at || address >= at + reg::kSyncManagerStride) continue;
                const std::size_t offset = address - at;
                other |= offset < 4 && now[n * 8 + offset] != datagram.data[i];
                // With the SyncManager on, start and length keep their values.
                if (offset >= 4 || !on) now[n * 8 + offset] = datagram.data[i];
            }
            const bool off_by_this =
                (now[n * 8 + wire::SyncManagerLayout::activate::offset] & std::byte{1}) == std::byte{0};
            moved += other ? 1 : 0;
            moved_while_on += other && on && !off_by_this ? 1 : 0;
        }
    }
};

class Boot : public testing::Test {
  protected:
    MailboxBus bus;
    std::vector<std::byte> image = std::vector<std::byte>(64);

    void start(std::initializer_list<const char*> devices) {
        for (const char* name : devices) bus.add_device(sim::make_device(name).value());
        bus.start();
    }
    [[nodiscard]] AlState state(std::uint16_t slave = 1) { return bus.ctx->slave(slave).al.state; }
    [[nodiscard]] Result<std::size_t> version(std::span<char> text) {
        const auto read = SDOread_text(*bus.ctx, 1, 0x100A, 0, text);
        return read ? Result<std::size_t>(read->size()) : Result<std::size_t>(read.error());
    }
};

TEST_F(Boot, ByStateRequestFromPreopAndBackToPreop) {
    start({"bootloader"});
    EXPECT_EQ(bring(bus, AlState::boot).code, Errc::none);
    EXPECT_EQ(state(), AlState::boot);
    // Files use the mailboxes of BOOT: a full packet has 500 octets.
    const auto firmware = Bootloader::make_image(2, 17, 20'000);
    const auto before = *mailbox_statistics(*bus.ctx, 1);
    ASSERT_TRUE(FOEwrite(*bus.ctx, 1, "firmware", kPassword, firmware).ok());
    const auto after = *mailbox_statistics(*bus.ctx, 1);
    EXPECT_LT(after.sent - before.sent, firmware.size() / 500 + 80);  // with the packets that are repeated for a busy
                                                                      // slave
    EXPECT_EQ(bring(bus, AlState::init).code, Errc::none);
    EXPECT_EQ(state(), AlState::init);
    std::array<char, 32> text{};
    EXPECT_EQ(version(text).error().code, Errc::wrong_state) << "the mailbox of BOOT is closed";
    bus.idle(500ms);  // the device restarts
    EXPECT_EQ(bring(bus, AlState::preop).code, Errc::none);
    const auto read = version(text);
    ASSERT_TRUE(read.ok()) << bus.words(read.error());
    EXPECT_EQ(std::string(text.data(), *read), "2.17");
}

TEST_F(Boot, FromBootToPreopGoesThroughInit) {
    start({"bootloader"});
    ASSERT_EQ(bring(bus, AlState::boot).code, Errc::none);
    EXPECT_EQ(bring(bus, AlState::preop).code, Errc::none);
    EXPECT_EQ(state(), AlState::preop);
    std::array<char, 32> text{};
    EXPECT_TRUE(version(text).ok());
}

TEST_F(Boot, FromOpGoesDownFirstAndLeavesTheExchange) {
    start({"bootloader", "digital_io_16"});
    ASSERT_TRUE(config_map(*bus.ctx, image).ok());
    ASSERT_TRUE(reach(*bus.ctx, AlState::op, 5s).ok());
    ASSERT_EQ(bring(bus, AlState::boot).code, Errc::none);
    EXPECT_EQ(state(), AlState::boot);
    EXPECT_FALSE(bus.ctx->slave(1).takes_part);
    // The process data of the cycle is not written over the mailboxes of BOOT.
    std::array<std::byte, 16> fmmu{};
    ASSERT_TRUE(read_register(*bus.ctx, 1, reg::kFmmuBase, fmmu).ok());
    for (const std::byte octet : fmmu) EXPECT_EQ(octet, std::byte{0});
    const auto firmware = Bootloader::make_image(2, 3, 5000);
    EXPECT_TRUE(FOEwrite(*bus.ctx, 1, "firmware", kPassword, firmware).ok());
    // Only the complete start-up brings the slave back.
    ASSERT_EQ(bring(bus, AlState::init).code, Errc::none);
    bus.idle(500ms);
    // New firmware may have other PDOs.
    EXPECT_EQ(reconfigure_slave(*bus.ctx, 1).error().code, Errc::remapping_needed);
    EXPECT_EQ(bus.ctx->slave(1).identity.revision, 0x0002'0003U);
    const auto mapped = config_map(*bus.ctx, image);
    EXPECT_TRUE(mapped.ok()) << bus.words(mapped.error());
    const auto op = reach(*bus.ctx, AlState::op, 5s);
    EXPECT_TRUE(op.ok()) << bus.words(op.error());
}

// The bootloader is another program. A mapping neither reads its process data nor brings it out of BOOT.
TEST_F(Boot, AMappingLeavesASlaveInBootAlone) {
    start({"bootloader", "digital_io_16"});
    ASSERT_EQ(bring(bus, AlState::boot).code, Errc::none);
    const auto mapped = config_map(*bus.ctx, image);
    EXPECT_EQ(mapped.error().slave, 1) << bus.words(mapped.error());
    EXPECT_EQ(state(), AlState::boot);
    EXPECT_EQ(bus.ctx->slave(2).al.state, AlState::safeop);
    const auto firmware = Bootloader::make_image(2, 3, 5000);
    EXPECT_TRUE(FOEwrite(*bus.ctx, 1, "firmware", kPassword, firmware).ok());
    ASSERT_EQ(bring(bus, AlState::init).code, Errc::none);
    bus.idle(500ms);
    const auto again = config_map(*bus.ctx, image);
    EXPECT_TRUE(again.ok()) << bus.words(again.error());
    const auto op = reach(*bus.ctx, AlState::op, 5s);
    EXPECT_TRUE(op.ok()) << bus.words(op.error());
}

TEST_F(Boot, ByWritestateAndStatecheck) {
    start({"bootloader"});
    ASSERT_TRUE(writestate(*bus.ctx, 1, AlState::boot).ok());
    const auto reached = statecheck(*bus.ctx, 1, AlState::boot, 2s);
    ASSERT_TRUE(reached.ok());
    EXPECT_EQ(*reached, (AlStatus{AlState::boot, false, 0}));
    const auto firmware = Bootloader::make_image(2, 3, 5000);
    const auto written = FOEwrite(*bus.ctx, 1, "firmware", kPassword, firmware);
    EXPECT_TRUE(written.ok()) << bus.words(written.error());
    ASSERT_TRUE(writestate(*bus.ctx, 1, AlState::init).ok());
    EXPECT_EQ(statecheck(*bus.ctx, 1, AlState::init, 2s)->state, AlState::init);
    bus.idle(500ms);
    ASSERT_TRUE(writestate(*bus.ctx, 1, AlState::preop).ok());
    EXPECT_EQ(statecheck(*bus.ctx, 1, AlState::preop, 2s)->state, AlState::preop);
    std::array<char, 32> text{};
    EXPECT_TRUE(version(text).ok());
}

// A program repeats its request while the slave is on its way.
TEST_F(Boot, AWritestateThatIsRepeatedOnTheWayBeginsNothingAgain) {
    auto slow = sim::make_device("bootloader").value();
    ASSERT_TRUE(sim::add_quirk(slow, "slow_firmware"));  // 5 ms to react
    bus.add_device(std::move(slow));
    bus.start();
    for (const AlState to : {AlState::boot, AlState::init, AlState::preop}) {
        int asked = 0;
        for (AlState reached = AlState::none; reached != to && asked < 20; ++asked) {
            ASSERT_TRUE(writestate(*bus.ctx, 1, to).ok());
            const auto now = statecheck(*bus.ctx, 1, to, 2ms);
            if (now) reached = now->state;
        }
        EXPECT_LE(asked, 6) << to_text(to);
        EXPECT_GE(asked, 2) << "the slave is slow";
        if (to == AlState::init) bus.idle(500ms);  // the device restarts
        if (to == AlState::boot) {
            const auto firmware = Bootloader::make_image(2, 3, 5000);
            const auto written = FOEwrite(*bus.ctx, 1, "firmware", kPassword, firmware);
            EXPECT_TRUE(written.ok()) << bus.words(written.error());
        }
    }
}

TEST_F(Boot, WithoutBootstrapMailboxesItIsRefusedInWords) {
    start({"digital_io_16"});
    constexpr std::string_view kWords =
        "slave 1: requesting a state: not supported by the slave (BOOT: its SII describes no bootstrap mailbox)";
    EXPECT_EQ(bus.words(bring(bus, AlState::boot)), kWords);
    EXPECT_EQ(bus.words(writestate(*bus.ctx, 1, AlState::boot).error()), kWords);
    EXPECT_EQ(bus.words(set_target(*bus.ctx, 1, AlState::boot).error()), kWords);
    EXPECT_EQ(state(), AlState::preop);
    std::array<char, 32> text{};
    EXPECT_TRUE(version(text).ok()) << "its mailbox stays open";
    EXPECT_EQ(set_target(*bus.ctx, 0, AlState::boot).error().code, Errc::invalid_argument);
}

TEST(BootFeature, IsLeftOutOfASmallProgram) {
    MailboxBus bus;
    bus.add_device(sim::make_device("bootloader").value());
    bus.segment.power_up(bus.osal.now());
    SimulatedNic nic(bus.segment, bus.osal);
    HostContext ctx({.slaves = 1});
    ASSERT_TRUE(init(ctx, nic, bus.osal, {}).ok());
    ASSERT_TRUE(config_init(ctx).ok());
    const Error refused = writestate(ctx, 1, AlState::boot).error();
    EXPECT_EQ(refused.code, Errc::unsupported);
    EXPECT_NE(bus.words(refused).find("kBootFeature"), std::string::npos) << bus.words(refused);
    EXPECT_EQ(ctx.slave(1).al.state, AlState::preop);
}

// ------------------------------------------------------------------ the supervision

TEST_F(Boot, TheSupervisionBringsItThereAndBack) {
    start({"bootloader", "digital_io_16"});
    ASSERT_TRUE(config_map(*bus.ctx, image).ok());
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(*bus.ctx, supervision).ok());
    ASSERT_TRUE(reach(*bus.ctx, AlState::op, 5s).ok());
    ASSERT_TRUE(set_target(*bus.ctx, 1, AlState::boot).ok());
    const auto run = [&](Duration time) {
        const Time end = bus.osal.now() + time;
        (void)run_cycle(*bus.ctx, {}, [&](const CycleInfo&) { return bus.osal.now() < end; });
    };
    run(300ms);
    EXPECT_EQ(state(), AlState::boot);
    EXPECT_TRUE(all_right(*bus.ctx)) << bus.words(what_is_wrong(*bus.ctx));
    // The request is executed during the cycle of the other slave.
    const auto old_revision = bus.ctx->slave(1).identity.revision;
    const auto firmware = Bootloader::make_image(3, 1, 8000);
    FoeWrite write;
    write.slave = 1;
    write.name = "firmware";
    write.password = kPassword;
    write.data = firmware;
    ASSERT_TRUE(submit(*bus.ctx, write).ok());
    unsigned wrong = 0;
    (void)run_cycle(*bus.ctx, {}, [&](const CycleInfo&) {
        wrong += all_right(*bus.ctx) && inputs_fresh(*bus.ctx, 2) ? 0 : 1;
        return write.busy();
    });
    EXPECT_EQ(write.error().code, Errc::none) << bus.words(write.error());
    EXPECT_EQ(wrong, 0U);
    ASSERT_TRUE(set_target(*bus.ctx, 1, AlState::op).ok());
    run(3s);
    // The new firmware has another revision, and may have other PDOs.
    EXPECT_EQ(state(), AlState::preop);
    EXPECT_EQ(what_is_wrong(*bus.ctx).code, Errc::remapping_needed);
    EXPECT_NE(bus.ctx->slave(1).identity.revision, old_revision);
    ASSERT_TRUE(config_map(*bus.ctx, image).ok());
    run(3s);
    EXPECT_EQ(state(), AlState::op);
    EXPECT_TRUE(all_right(*bus.ctx)) << bus.words(what_is_wrong(*bus.ctx));
    std::array<char, 32> text{};
    const auto read = version(text);
    ASSERT_TRUE(read.ok());
    EXPECT_EQ(std::string(text.data(), *read), "3.1");
}

// This firmware writes its revision into the EEPROM when it has reached PREOP.
TEST_F(Boot, FirmwareThatWritesItsIdentityLateIsNotDrivenByTheOldMapping) {
    start({"bootloader_open", "digital_io_16"});
    ASSERT_TRUE(config_map(*bus.ctx, image).ok());
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(*bus.ctx, supervision).ok());
    ASSERT_TRUE(set_target(*bus.ctx, 1, AlState::boot).ok());
    bus.idle(300ms);
    ASSERT_EQ(state(), AlState::boot);
    const auto firmware = Bootloader::make_image(2, 0, 4096, Bootloader::kOpenProduct);
    ASSERT_TRUE(FOEwrite(*bus.ctx, 1, "firmware", 0, Bytes(firmware)).ok());
    ASSERT_TRUE(set_target(*bus.ctx, 1, AlState::op).ok());
    EXPECT_FALSE(reach(*bus.ctx, AlState::op, 2s).ok());
    EXPECT_EQ(state(), AlState::preop);
    EXPECT_EQ(what_is_wrong(*bus.ctx).code, Errc::remapping_needed) << bus.words(what_is_wrong(*bus.ctx));
    EXPECT_EQ(bus.ctx->slave(1).identity.revision, 0x0002'0000U);
}

TEST_F(Boot, TheSupervisionDoesNotPullASlaveOutOfIt) {
    start({"bootloader", "digital_io_16"});
    ASSERT_TRUE(config_map(*bus.ctx, image).ok());
    ASSERT_EQ(bring(bus, AlState::boot).code, Errc::none);
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(*bus.ctx, supervision).ok());
    const auto wanted = reach(*bus.ctx, AlState::op, 2s);
    EXPECT_EQ(wanted.error().slave, 1U);
    EXPECT_EQ(state(), AlState::boot);
    EXPECT_EQ(state(2), AlState::op);
    ASSERT_TRUE(set_target(*bus.ctx, 0, AlState::op).ok());  // all slaves: not this one
    bus.idle(1s);
    EXPECT_EQ(state(), AlState::boot);
    ASSERT_TRUE(set_target(*bus.ctx, 1, AlState::op).ok());
    const auto op = reach(*bus.ctx, AlState::op, 5s);
    EXPECT_TRUE(op.ok()) << bus.words(op.error());
}

TEST_F(Boot, WithoutASupervisionSetTargetForAllSlavesLeavesItThere) {
    start({"bootloader"});
    ASSERT_TRUE(set_target(*bus.ctx, 1, AlState::boot).ok());
    EXPECT_EQ(state(), AlState::boot);
    const auto all = set_target(*bus.ctx, 0, AlState::preop);
    EXPECT_EQ(all.error().code, Errc::other_state);
    EXPECT_EQ(state(), AlState::boot);
    EXPECT_TRUE(set_target(*bus.ctx, 1, AlState::preop).ok());
    EXPECT_EQ(state(), AlState::preop);
}

TEST_F(Boot, AfterALossOfPowerItIsBroughtThereAgain) {
    start({"digital_io_16", "bootloader"});
    ASSERT_TRUE(config_map(*bus.ctx, image).ok());
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(*bus.ctx, supervision).ok());
    ASSERT_TRUE(set_target(*bus.ctx, 2, AlState::boot).ok());
    bus.idle(500ms);
    ASSERT_EQ(state(2), AlState::boot);
    const auto firmware = Bootloader::make_image(3, 1, 200'000);
    FoeWrite write;
    write.slave = 2;
    write.name = "firmware";
    write.password = kPassword;
    write.data = firmware;
    ASSERT_TRUE(submit(*bus.ctx, write).ok());
    bus.idle(40ms);
    ASSERT_TRUE(write.busy());
    bus.segment.set_power(1, false, bus.osal.now());
    bus.run(write);
    EXPECT_NE(write.error().code, Errc::none);
    bus.idle(100ms);
    EXPECT_EQ(state(2), AlState::none);
    bus.segment.set_power(1, true, bus.osal.now());
    bus.idle(3s);
    EXPECT_EQ(state(2), AlState::boot);
    EXPECT_TRUE(FOEwrite(*bus.ctx, 2, "firmware", kPassword, Bytes(firmware)).ok());
}

// A device whose SII alone describes its process data, with mailboxes for BOOT. It has `bits` of outputs and of inputs.
std::vector<std::byte> sii_with_boot(std::uint8_t bits) {
    namespace sii = wire::sii;
    const auto bytes = static_cast<std::uint16_t>(bits / 8);
    const std::array rx_entries{sii::PdoEntryDescription{.index = 0x7000, .subindex = 1, .bit_length = bits}};
    const std::array tx_entries{sii::PdoEntryDescription{.index = 0x6000, .subindex = 1, .bit_length = bits}};
    const std::array rx{sii::PdoDescription{.index = 0x1600, .sync_manager = 2, .entries = rx_entries}};
    const std::array tx{sii::PdoDescription{.index = 0x1A00, .sync_manager = 3, .entries = tx_entries}};
    const std::array sms{
        SmInfo{0x1000, 64, 0x26, 1, SmType::mailbox_out}, SmInfo{0x1080, 64, 0x22, 1, SmType::mailbox_in},
        SmInfo{0x1100, bytes, 0x64, 1, SmType::outputs}, SmInfo{0x1400, bytes, 0x20, 1, SmType::inputs}};
    const std::array fmmus{FmmuUse::outputs, FmmuUse::inputs};
    constexpr MailboxInfo kMailbox{.out_start = 0x1000, .out_bytes = 64, .in_start = 0x1080, .in_bytes = 64};
    std::vector<std::byte> octets(2048);
    const auto written = sii::write_image({.configuration = {.pdi_control = 0x0005},
                                           .identity = {.vendor = 0x4D47, .product = 0x0100, .revision = 1},
                                           .mailbox = kMailbox,
                                           .boot_mailbox = kMailbox,
                                           .name = "MG BOOT",
                                           .fmmus = fmmus,
                                           .sync_managers = sms,
                                           .tx_pdos = tx,
                                           .rx_pdos = rx},
                                          octets);
    EXPECT_TRUE(written.ok());
    return octets;
}

class BootWithoutCoe : public Boot {
  protected:
    SuperviseRequest supervision;
    void SetUp() override {
        bus.add_device(sim::device_from_sii(sii_with_boot(16)));
        bus.add_device(sim::make_device("digital_io_16").value());
        bus.start();
        ASSERT_TRUE(config_map(*bus.ctx, image).ok());
        ASSERT_TRUE(submit(*bus.ctx, supervision).ok());
        ASSERT_TRUE(reach(*bus.ctx, AlState::op, 5s).ok());
        ASSERT_TRUE(set_target(*bus.ctx, 1, AlState::boot).ok());
        run(300ms);
        ASSERT_EQ(state(), AlState::boot);
    }
    void run(Duration time) {
        const Time end = bus.osal.now() + time;
        (void)run_cycle(*bus.ctx, {}, [&](const CycleInfo&) { return bus.osal.now() < end; });
    }
};

TEST_F(BootWithoutCoe, WithTheSamePdosItGoesBackToOp) {
    ASSERT_TRUE(set_target(*bus.ctx, 1, AlState::op).ok());
    run(2s);
    EXPECT_EQ(state(), AlState::op);
    EXPECT_TRUE(all_right(*bus.ctx)) << bus.words(what_is_wrong(*bus.ctx));
    EXPECT_EQ(bus.ctx->slave(1).config.source, ConfigurationSource::sii);
}

// The developer of the firmware has changed its PDOs and has not changed its revision.
TEST_F(BootWithoutCoe, WithPdosOfAnotherSizeItStaysInPreop) {
    const auto newer = sii_with_boot(24);
    std::ranges::copy(newer, bus.segment.slave(0).sii().image().begin());
    ASSERT_TRUE(set_target(*bus.ctx, 1, AlState::op).ok());
    run(2s);
    EXPECT_EQ(state(), AlState::preop);
    const Error why = what_is_wrong(*bus.ctx);
    EXPECT_EQ(why.code, Errc::pdo_size) << bus.words(why);
    EXPECT_EQ(why.slave, 1U);
    EXPECT_FALSE(inputs_fresh(*bus.ctx, 1));
    (void)config_map(*bus.ctx, image);
    EXPECT_EQ(bus.ctx->slave(1).image.inputs.bits, 24U);
}

// ------------------------------------------------------------------ the registers on the wire

TEST(BootRegisters, SyncManagersAreSwitchedOffBeforeTheyAreMoved) {
    MailboxBus bus;
    bus.add_device(sim::make_device("bootloader").value());
    bus.segment.power_up(bus.osal.now());
    SimulatedNic cable(bus.segment, bus.osal);
    Watcher watcher(cable);
    SyncManagerWrites writes;
    watcher.seen = [&](const wire::DatagramView& datagram) { writes(datagram); };
    bus.ctx = std::make_unique<HostContext>(Limits{.slaves = 1});
    ASSERT_TRUE(init(*bus.ctx, watcher, bus.osal).ok());
    ASSERT_TRUE(config_init(*bus.ctx).ok());
    EXPECT_GT(writes.moved, 0U);
    for (const AlState to : {AlState::boot, AlState::preop, AlState::boot, AlState::init, AlState::preop}) {
        const unsigned before = writes.moved;
        ASSERT_EQ(bring(bus, to).code, Errc::none) << static_cast<int>(to);
        if (to != AlState::init) {
            EXPECT_GT(writes.moved, before);
        }
    }
    EXPECT_EQ(writes.moved_while_on, 0U);
}

// Each frame of the way to BOOT, of a file transfer in BOOT, and of the way back is lost on its way out, lost on its
// way back, or sent twice.
TEST(BootLostFrames, EveryFrameOfTheWayThereAndBack) {
    with_each_frame_spoilt("bootloader_open", 400, [](MailboxBus& bus) {
        const Error there = bring(bus, AlState::boot);
        EXPECT_EQ(there.code, Errc::none) << bus.words(there);
        EXPECT_EQ(bus.ctx->slave(1).al.state, AlState::boot);
        std::array<std::byte, 8192> memory{};
        const auto file = FOEread(*bus.ctx, 1, "firmware", 0, std::span(memory));
        EXPECT_TRUE(file.ok()) << bus.words(file.error());
        const Error back = bring(bus, AlState::preop);
        EXPECT_EQ(back.code, Errc::none) << bus.words(back);
        EXPECT_EQ(bus.ctx->slave(1).al.state, AlState::preop);
        const auto type = SDOread<std::uint32_t>(*bus.ctx, 1, 0x1000, 0);
        EXPECT_TRUE(type.ok()) << bus.words(type.error());
    });
}

}  // namespace
}  // namespace margay
