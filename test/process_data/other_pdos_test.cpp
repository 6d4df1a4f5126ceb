// A drive that comes back with other PDOs in its dictionary than those that the image was laid out for: all sizes are
// the same, and the objects are others.
#include "process_data/identities.hpp"
#include "sim/library/library.hpp"

#include <margay/hooked_slave.hpp>
#include <margay/soe.hpp>

namespace margay {
namespace {

using namespace std::chrono_literals;

constexpr std::uint16_t kOutputs = 0x1600;
// In another order than by default: the target velocity is in the place of the target position.
constexpr std::array<std::uint32_t, 6> kSwapped{0x60400010, 0x60FF0020, 0x607A0020, 0x60710010, 0x60600008, 0x00000008};

struct OtherPdos : testing::Test, Bus {
    std::vector<std::byte> image = std::vector<std::byte>(1024);
    Output<std::int32_t> position{2, 0x607A};
    Output<std::int32_t> velocity{2, 0x60FF};
    std::array<EntryHandle*, 2> entries{&position, &velocity};
    SuperviseRequest supervision;
    std::uint32_t coupler = 0;
    std::uint32_t drive = 0;

    std::uint32_t make(const char* name) { return segment.add(std::move(*sim::make_device(name)).assemble()); }
    void begin(const char* name = "drive") {
        coupler = make("coupler");
        drive = make(name);
        ASSERT_TRUE(segment.connect_master({coupler, 0}));
        ASSERT_TRUE(segment.connect({coupler, 1}, {drive, 0}));
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, osal);
        ctx = std::make_unique<HostContext>(Limits{.slaves = 4});
        ASSERT_TRUE(init(*ctx, *nic, osal).ok());
        ASSERT_TRUE(config_init(*ctx).ok());
    }
    // As an application does that knows no lists of PDOs.
    bool write_mapping() {
        bool good = SDOwrite<std::uint8_t>(*ctx, 2, 0x1C12, 0, 0).ok();
        good &= SDOwrite<std::uint8_t>(*ctx, 2, kOutputs, 0, 0).ok();
        for (std::uint8_t n = 0; n < kSwapped.size(); ++n)
            good &= SDOwrite<std::uint32_t>(*ctx, 2, kOutputs, static_cast<std::uint8_t>(n + 1), kSwapped[n]).ok();
        good &= SDOwrite<std::uint8_t>(*ctx, 2, kOutputs, 0, kSwapped.size()).ok();
        good &= SDOwrite<std::uint16_t>(*ctx, 2, 0x1C12, 1, kOutputs).ok();
        return good && SDOwrite<std::uint8_t>(*ctx, 2, 0x1C12, 0, 1).ok();
    }
    void map() {
        ctx->group(0).config.entries = entries;
        ASSERT_TRUE(config_map(*ctx, image).ok());
        ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    }
    void cycles(int count) {
        for (int n = 0; n < count; ++n) {
            position.write(0x1111);
            velocity.write(0x2222);
            (void)cycle();
        }
    }
    std::int32_t object(std::uint16_t index) {
        const auto value = SDOread<std::int32_t>(*ctx, 2, index, 0);
        EXPECT_TRUE(value.ok());
        return value ? *value : -1;
    }
    void expect_right_objects() {
        cycles(5);
        EXPECT_EQ(object(0x607A), 0x1111);
        EXPECT_EQ(object(0x60FF), 0x2222);
    }
    bool reports(const char* words) {
        bool found = false;
        while (const auto event = ctx->events().take()) {
            std::array<char, 256> text{};
            found |= std::string(describe(*event, text)).find(words) != std::string::npos;
        }
        return found;
    }
    void power_off_and_on() {
        segment.set_power(drive, false, osal.now());
        cycles(50);
        segment.set_power(drive, true, osal.now());
        cycles(3000);
    }
    void expect_not_driven() {
        EXPECT_LT(ctx->slave(2).al.state, AlState::op);
        EXPECT_FALSE(all_right(*ctx));
        EXPECT_EQ(what_is_wrong(*ctx).code, Errc::remapping_needed);
        EXPECT_NE(object(0x60FF), 0x1111);
        EXPECT_NE(object(0x607A), 0x2222);
    }
};

// What the application has written by SDO is lost with the power of the drive.
TEST_F(OtherPdos, ThoseOfAnSdoAreLostWithThePower) {
    begin();
    ASSERT_TRUE(write_mapping());
    map();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    expect_right_objects();
    power_off_and_on();
    EXPECT_TRUE(reports("its revision, SyncManagers or PDOs have changed since config_map()"));
    expect_not_driven();
    ASSERT_TRUE(write_mapping());
    map();
    expect_right_objects();
    EXPECT_TRUE(all_right(*ctx));
}

TEST_F(OtherPdos, WithoutASupervisionReachSaysSo) {
    begin();
    ASSERT_TRUE(write_mapping());
    map();
    expect_right_objects();
    power_off_and_on();
    const auto again = reach(*ctx, AlState::op, 2s);
    EXPECT_EQ(again.error().code, Errc::remapping_needed);
    EXPECT_EQ(again.error().slave, 2);
    EXPECT_LT(ctx->slave(2).al.state, AlState::op);
}

// A spare part that has its own power and is in PREOP already: it was in another machine before.
TEST_F(OtherPdos, OfASparePartThatWaitsInPreop) {
    begin();
    ASSERT_TRUE(write_mapping());
    const auto spare = drive;
    segment.disconnect({spare, 0});
    const std::array<std::byte, 2> none{};
    (void)segment.slave(spare).ecat_write(0x0010, none, osal.now());
    drive = make("drive");
    segment.set_power(drive, true, osal.now());
    ASSERT_TRUE(segment.connect({coupler, 1}, {drive, 0}));
    segment.reconsider();
    ASSERT_TRUE(config_init(*ctx).ok());
    map();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    expect_right_objects();
    segment.disconnect({drive, 0});
    segment.reconsider();
    cycles(100);
    ASSERT_TRUE(segment.connect({coupler, 1}, {spare, 0}));
    segment.reconsider();
    cycles(3000);
    expect_not_driven();
}

// A coupler with four slots keeps its power, and two of its modules of the same size change places.
struct OtherModules : OtherPdos {
    void begin_with_modules() {
        begin("modular_io");
        ASSERT_TRUE(config_map(*ctx, image).ok());
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
        ctx->slave(2).image.outputs.bytes[0] = std::byte{0x5A};
    }
    void exchange_modules() {
        constexpr std::array kOther{std::byte{4}, std::byte{2}, std::byte{3}, std::byte{1}};
        std::ranges::copy(kOther, segment.slave(drive).process_data()->inputs().begin());
        segment.slave(drive).process_data()->poke();
        cycles(100);
    }
    // The counter is in slot 1 now. The octet of the lamps must not reach its preset value.
    void expect_remapping() {
        const auto again = reach(*ctx, AlState::op, 2s);
        EXPECT_EQ(again.error().code, Errc::remapping_needed) << in_words(again.error());
        EXPECT_FALSE(all_right(*ctx));
        const auto preset = SDOread<std::uint32_t>(*ctx, 2, 0x7000, 1);
        ASSERT_TRUE(preset.ok()) << in_words(preset.error());
        EXPECT_EQ(*preset, 0U);
    }
};

TEST_F(OtherModules, ChangedInPreop) {
    begin_with_modules();
    ASSERT_TRUE(set_target(*ctx, 2, AlState::preop).ok());
    cycles(500);
    exchange_modules();
    ASSERT_TRUE(set_target(*ctx, 2, AlState::op).ok());
    expect_remapping();
}

TEST_F(OtherModules, ChangedBeforeAStartUpIsRepeated) {
    begin_with_modules();
    exchange_modules();
    (void)reconfigure_slave(*ctx, 2);
    expect_remapping();
}

// Lists that name the PDOs only: their entries are those that the slave has.
TEST_F(OtherPdos, OfListsWithoutEntries) {
    static constexpr std::array<Pdo, 1> kOut{Pdo{.index = 0x1600}};
    static constexpr std::array<Pdo, 1> kIn{Pdo{.index = 0x1A00}};
    static constexpr std::array<SmPdos, 2> kLists{SmPdos{2, kOut}, SmPdos{3, kIn}};
    static constexpr SlaveSetup kSetup{.pdos = kLists};
    begin();
    ctx->slave(2).config.setup = &kSetup;
    ASSERT_TRUE(write_mapping());
    map();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    expect_right_objects();
    power_off_and_on();
    expect_not_driven();
}

// The application says the sizes, and the dictionary where the objects are.
TEST_F(OtherPdos, BesideSizesOfTheApplication) {
    begin();
    ASSERT_TRUE(write_mapping());
    map();
    ctx->slave(2).config.source = ConfigurationSource::application;
    map();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    expect_right_objects();
    power_off_and_on();
    expect_not_driven();
}

// The list of the configurable telegram has the velocity command in the place of the position command.
TEST_F(OtherPdos, OfADriveWithSoe) {
    begin("soe_drive");
    const std::array list{std::byte{2}, std::byte{0}, std::byte{16}, std::byte{0}, std::byte{36}, std::byte{0}};
    ASSERT_TRUE(SoEwrite(*ctx, 2, 0, Idn::standard(24), soe_element::kValue, list).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    const auto drive_on = [&](int count) {
        const MutableBytes outputs = ctx->slave(2).image.outputs.bytes;
        for (int n = 0; n < count; ++n) {
            store_le<std::uint32_t>(outputs, 2, 0x1234);
            (void)cycle();
        }
    };
    const auto value = [&](std::uint16_t idn) { return SoEread<std::int32_t>(*ctx, 2, 0, Idn::standard(idn)); };
    drive_on(300);
    EXPECT_EQ(*value(36), 0x1234);
    segment.set_power(drive, false, osal.now());
    drive_on(50);
    segment.set_power(drive, true, osal.now());
    drive_on(3000);
    EXPECT_EQ(what_is_wrong(*ctx).code, Errc::remapping_needed);
    EXPECT_NE(*value(47), 0x1234) << "the position command";
}

// INIT keeps the PDOs, and so does a drive whose hook writes them each time.
TEST_F(OtherPdos, ADriveThatStillHasThemComesBack) {
    begin();
    ASSERT_TRUE(write_mapping());
    map();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(set_target(*ctx, 2, AlState::init).ok());
    cycles(500);
    ASSERT_EQ(ctx->slave(2).al.state, AlState::init);
    ASSERT_TRUE(set_target(*ctx, 2, AlState::op).ok());
    cycles(500);
    EXPECT_TRUE(all_right(*ctx));
    expect_right_objects();
}
TEST_F(OtherPdos, AHookThatWritesThemEachTimeBringsTheDriveBack) {
    begin();
    ctx->slave(2).hooks.preop_to_safeop = [](HookedSlave slave, void*) -> Task<> {
        co_await required(slave.sdo_write(0x1C12, 0, std::uint8_t{0}));
        co_await required(slave.sdo_write(kOutputs, 0, std::uint8_t{0}));
        for (std::uint8_t n = 0; n < kSwapped.size(); ++n)
            co_await required(slave.sdo_write(kOutputs, static_cast<std::uint8_t>(n + 1), kSwapped[n]));
        co_await required(slave.sdo_write(kOutputs, 0, std::uint8_t{kSwapped.size()}));
        co_await required(slave.sdo_write(0x1C12, 1, std::uint16_t{kOutputs}));
        co_return co_await slave.sdo_write(0x1C12, 0, std::uint8_t{1});
    };
    map();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    expect_right_objects();
    power_off_and_on();
    EXPECT_TRUE(all_right(*ctx));
    expect_right_objects();
}

}  // namespace
}  // namespace margay
