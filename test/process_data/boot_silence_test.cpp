// A slave in BOOT, and a silence during which another device may have taken its station address.
#include "mailbox/foe_bus.hpp"
#include "process_data/io_image.hpp"

namespace margay {
namespace {

// A coupler, a device in BOOT (slave 2), and an I/O device. The tool is a device of another product with the station
// address of slave 2, as another master could have configured it. `tool_state` is the AL state of the tool.
struct BootInASilence : testing::TestWithParam<AlState>, MailboxBus {
    std::uint32_t coupler = 0, device = 0, io = 0, tool = 0;

    std::uint32_t make_io(std::uint32_t product) {
        auto made = sim::device_from_sii(io_image(8, 8, {.product = product}));
        made.chip = sim::junction();
        return segment.add(std::move(made).assemble());
    }
    void SetUp() override {
        coupler = make_io(0x100);
        device = segment.add(sim::make_device("bootloader_open").value().assemble());
        io = make_io(0x102);
        auto other = sim::make_device("bootloader_open").value();
        store_le<std::uint32_t>(other.sii, 0x14, 0x7777U);
        tool = segment.add(std::move(other).assemble());
        ASSERT_TRUE(segment.connect_master({coupler, 0}));
        put_in(device);
        segment.power_up(osal.now());
        cable = std::make_unique<SimulatedNic>(segment, osal);
        nic = std::make_unique<LossyNic>(*cable);
        nic->keeps_mail = false;
        ctx = std::make_unique<HostContext>(Limits{.slaves = 16});
        ASSERT_TRUE(init(*ctx, *nic, osal).ok());
        ASSERT_TRUE(config_init(*ctx).ok());
        ASSERT_EQ(bring(*this, AlState::boot, 2).code, Errc::none);
        ASSERT_EQ(state_of(device), 3);
        prepare_tool(GetParam());
    }
    void set(std::uint32_t at, std::uint16_t reg, std::uint16_t value) {
        const std::array octets{static_cast<std::byte>(value & 0xFF), static_cast<std::byte>(value >> 8)};
        (void)segment.slave(at).ecat_write(reg, octets, osal.now());
        sim::FrameEnd end{};
        end.at = osal.now();
        segment.slave(at).frame_end(end);
    }
    int state_of(std::uint32_t at) { return std::to_integer<int>(segment.slave(at).peek(0x130, 1)[0]) & 0x1F; }
    // Requests the state as another master would do.
    void request(std::uint32_t at, AlState state) {
        set(at, 0x0120, static_cast<std::uint16_t>(state));
        for (int n = 0; n < 300; ++n) {
            osal.advance(1ms);
            segment.reconsider();
            segment.advance(osal.now());
        }
        ASSERT_EQ(state_of(at), static_cast<int>(state));
    }
    void prepare_tool(AlState state) {
        set(tool, 0x0010, 0x1002);
        for (std::uint16_t sm = 0x800; sm < 0x810; sm += 8)
            (void)segment.slave(tool).ecat_write(sm, segment.slave(device).peek(sm, 8), osal.now());
        request(tool, state);
    }
    void put_in(std::uint32_t which) {
        ASSERT_TRUE(segment.connect({coupler, 1}, {which, 0}));
        ASSERT_TRUE(segment.connect({which, 1}, {io, 0}));
        segment.reconsider();
    }
    // The cable of the master is unplugged for 300 ms, and meanwhile the application sends a request. Then the device
    // `which` is connected.
    void silence(std::uint32_t which) {
        segment.disconnect({device, 0});
        segment.disconnect({device, 1});
        segment.disconnect({coupler, 0});
        segment.reconsider();
        RegisterReadRequest look;
        std::array<std::byte, 2> into{};
        look.slave = 1;
        look.address = 0x130;
        look.data = into;
        for (int n = 0; n < 300; ++n) {
            if (!look.busy()) (void)submit(*ctx, look);
            step();
        }
        look.cancel();
        put_in(which);
        ASSERT_TRUE(segment.connect_master({coupler, 0}));
        segment.reconsider();
    }
    Result<> write_word() { return write_register(*ctx, 2, 0x0F80, std::array{std::byte{0x34}, std::byte{0x12}}); }
    std::byte written(std::uint32_t at) { return segment.slave(at).peek(0x0F80, 1)[0]; }
};

TEST_P(BootInASilence, NothingReachesAnotherDevice) {
    silence(tool);
    EXPECT_EQ(write_word().error().code, Errc::identity_unread);
    EXPECT_EQ(written(tool), std::byte{0});
    const std::array content{std::byte{1}, std::byte{2}};
    EXPECT_EQ(FOEwrite(*ctx, 2, "firmware", 0, content, 2s).error().code, Errc::identity_unread);
    EXPECT_EQ(readstate(*ctx).error().code, Errc::other_slave);
    EXPECT_EQ(write_word().error().code, Errc::missing_slave);
    EXPECT_EQ(written(tool), std::byte{0});
}

TEST_P(BootInASilence, TheSameDeviceIsUsableAfterAReading) {
    silence(device);
    EXPECT_EQ(write_word().error().code, Errc::identity_unread);
    const auto read = readstate(*ctx);
    ASSERT_TRUE(read.ok()) << to_text(read.error().code);
    EXPECT_EQ(ctx->slave(2).al.state, AlState::boot);
    EXPECT_TRUE(write_word().ok());
    EXPECT_EQ(written(device), std::byte{0x34});
}

// The firmware uses the EEPROM. The library leaves the EEPROM to the firmware, and the reading reports that the device
// was not compared.
TEST_P(BootInASilence, AFirmwareKeepsItsEeprom) {
    segment.slave(device).registers().set<std::uint8_t>(0x0501, 1);
    silence(device);
    const auto read = readstate(*ctx);
    EXPECT_EQ(read.error().code, Errc::identity_unread);
    EXPECT_EQ(read.error().slave, 2);
    EXPECT_EQ(std::to_integer<int>(segment.slave(device).peek(0x0501, 1)[0]) & 1, 1);
    EXPECT_TRUE(write_word().ok());  // a reading has shown that the slave is still in BOOT
}

// The firmware of the device has entered BOOT by itself. The context cannot compare a slave in BOOT.
TEST_P(BootInASilence, WithoutThePartOfBootItIsComparedWhenItHasLeftBoot) {
    const auto mailboxes = segment.slave(device).peek(0x800, 16);
    const std::vector<std::byte> kept(mailboxes.begin(), mailboxes.end());
    ctx.reset();
    ctx = std::make_unique<HostContext>(Limits{.slaves = 16});
    ASSERT_TRUE(init(*ctx, *nic, osal, {}).ok());
    ASSERT_TRUE(config_init(*ctx).ok());
    request(device, AlState::init);
    for (const std::uint16_t sm : {std::uint16_t{0x806}, std::uint16_t{0x80E}}) set(device, sm, 0);
    (void)segment.slave(device).ecat_write(0x800, kept, osal.now());
    request(device, AlState::boot);
    const bool same = GetParam() == AlState::preop;
    silence(same ? device : tool);
    for (int reading = 0; reading < 2; ++reading) {
        EXPECT_EQ(readstate(*ctx).error().code, Errc::identity_unread);
        EXPECT_EQ(write_word().error().code, Errc::identity_unread);
        EXPECT_EQ(written(same ? device : tool), std::byte{0});
    }
    EXPECT_TRUE(writestate(*ctx, 2, AlState::init).ok());
    const auto left = statecheck(*ctx, 2, AlState::init, 2s);
    EXPECT_EQ(left->state, same ? AlState::init : AlState::none);
    EXPECT_EQ(write_word().error().code, same ? Errc::none : Errc::missing_slave);
    EXPECT_EQ(written(device), same ? std::byte{0x34} : std::byte{0});
    EXPECT_EQ(written(tool), std::byte{0});
}

INSTANTIATE_TEST_SUITE_P(StatesOfTheTool, BootInASilence, testing::Values(AlState::preop, AlState::boot));

}  // namespace
}  // namespace margay
