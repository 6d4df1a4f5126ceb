// A drive comes back, and its dictionary has other PDOs than the image: all sizes are the same, and the objects are
// different.
#include "process_data/identities.hpp"
#include "sim/library/library.hpp"

#include <margay/hooked_slave.hpp>
#include <margay/soe.hpp>

namespace margay {
namespace {

using namespace std::chrono_literals;

constexpr std::uint16_t kOutputs = 0x1600;
// The order differs from the default: the target velocity is in the place of the target position.
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
    // Writes the mapping as an application does that has no lists of PDOs.
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
    using Words = std::vector<std::string>;
    Words taken_events() {
        Words all;
        while (const auto event = ctx->events().take()) {
            std::array<char, 256> text{};
            all.emplace_back(describe(*event, text));
        }
        return all;
    }
    static Words of_slave_2(const Words& all) {
        Words some;
        std::ranges::copy_if(all, std::back_inserter(some),
                             [](const std::string& one) { return one.find("slave 2:") != std::string::npos; });
        return some;
    }
    bool reports(const char* words) {
        return std::ranges::any_of(taken_events(),
                                   [&](const std::string& one) { return one.find(words) != std::string::npos; });
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

// The values that the application has written by SDO are lost with the power of the drive.
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

// A spare part that has its own power and is already in PREOP, because it was in another machine before.
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

// A coupler with four slots keeps its power, and two of its modules of the same size are swapped.
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
    // The counter is now in slot 1. The octet of the lamps must not become its preset value.
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

// Modules are exchanged in OP. The slave refuses SAFEOP until it has been in INIT.
TEST_F(OtherModules, AreFoundByTheMappingBehindInit) {
    begin_with_modules();
    supervision.cancel();
    exchange_modules();
    const auto refused = config_map(*ctx, image);
    EXPECT_EQ(refused.error().code, Errc::remapping_needed) << in_words(refused.error());
    EXPECT_EQ(ctx->slave(2).error, refused.error());
    const auto mapped = config_map(*ctx, image);
    EXPECT_TRUE(mapped.ok()) << in_words(mapped.error());
    EXPECT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    EXPECT_TRUE(all_right(*ctx)) << in_words(what_is_wrong(*ctx));
}

// The slave has already refused SAFEOP with the AL status code "needs INIT".
TEST_F(OtherModules, AreMappedWhereTheSlaveAsksForInit) {
    begin_with_modules();
    supervision.cancel();
    exchange_modules();
    for (const AlState state : {AlState::preop, AlState::safeop}) {
        ASSERT_TRUE(writestate(*ctx, 2, state).ok());
        (void)statecheck(*ctx, 2, state, 1s);
    }
    ASSERT_EQ(ctx->slave(2).al, (AlStatus{AlState::preop, true, 0x0021}));
    const auto mapped = config_map(*ctx, image);
    EXPECT_TRUE(mapped.ok()) << in_words(mapped.error());
    EXPECT_TRUE(reach(*ctx, AlState::op, 2s).ok());
}

// The mapping has failed for one cause, and the supervision fails for another cause.
TEST_F(OtherModules, AreTheCauseInPlaceOfAnEarlierOne) {
    begin_with_modules();
    supervision.cancel();
    ASSERT_TRUE(writestate(*ctx, 2, AlState::preop).ok());
    ASSERT_EQ(statecheck(*ctx, 2, AlState::preop, 1s)->state, AlState::preop);
    const auto list_modules = [this](std::uint8_t count) {
        constexpr std::array<std::uint32_t, 4> kExchanged{0x401, 0x208, 0x302, 0x104};
        EXPECT_TRUE(SDOwrite(*ctx, 2, 0xF030, 0, std::uint8_t{0}).ok());
        for (std::uint8_t n = 0; n < count; ++n)
            EXPECT_TRUE(SDOwrite(*ctx, 2, 0xF030, static_cast<std::uint8_t>(n + 1), kExchanged[n]).ok());
        EXPECT_TRUE(SDOwrite(*ctx, 2, 0xF030, 0, count).ok());
    };
    list_modules(4);
    EXPECT_EQ(config_map(*ctx, image).error().detail, 0x0070U);
    exchange_modules();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    cycles(1'500);
    EXPECT_EQ(what_is_wrong(*ctx).code, Errc::remapping_needed) << in_words(what_is_wrong(*ctx));
    const auto again = config_map(*ctx, image);
    EXPECT_TRUE(again.ok()) << in_words(again.error());
    EXPECT_TRUE(reach(*ctx, AlState::op, 2s).ok());
}

// A start-up that the supervision tries in vain is reported when it begins, when its cause changes, and when it ends.
TEST_F(OtherModules, AreReportedOnceWhileTheSupervisionTriesAgain) {
    begin_with_modules();
    const auto change_to = [this](std::array<int, 4> modules) {
        for (std::size_t slot = 0; slot < modules.size(); ++slot)
            segment.slave(drive).process_data()->inputs()[slot] = static_cast<std::byte>(modules[slot]);
        segment.slave(drive).process_data()->poke();
    };
    (void)taken_events();
    (void)errors();
    ASSERT_TRUE(set_target(*ctx, 2, AlState::preop).ok());
    cycles(500);
    change_to({4, 2, 3, 1});
    ASSERT_TRUE(set_target(*ctx, 2, AlState::op).ok());
    cycles(20'000);
    const auto remap = std::string("slave 2: mapping process data: its revision, SyncManagers or PDOs have changed ") +
                       "since config_map(): call config_map() again";
    EXPECT_EQ(of_slave_2(taken_events()),
              (Words{"slave 2: OP to PREOP", "slave 2: PREOP to PREOP+ERROR (0x0021: slave needs INIT)",
                     "slave 2: PREOP+ERROR to INIT", "slave 2: INIT to PREOP", "recovery failed: " + remap}));
    EXPECT_EQ(errors(), Words{remap});
    EXPECT_EQ(what_is_wrong(*ctx).code, Errc::remapping_needed);
    change_to({0, 2, 3, 1});
    cycles(20'000);
    EXPECT_EQ(what_is_wrong(*ctx).code, Errc::pdo_size) << in_words(what_is_wrong(*ctx));
    EXPECT_EQ(of_slave_2(taken_events()), Words{"recovery failed: " + in_words(what_is_wrong(*ctx))});
    EXPECT_EQ(errors(), Words{in_words(what_is_wrong(*ctx))});
    change_to({1, 2, 3, 4});
    cycles(2'000);
    EXPECT_TRUE(all_right(*ctx)) << in_words(what_is_wrong(*ctx));
    EXPECT_EQ(of_slave_2(taken_events()), (Words{"slave 2: PREOP to OP", "slave 2: recovered, in OP"}));
    EXPECT_EQ(errors(), Words());
}

// The lists name only the PDOs. The entries of the PDOs come from the slave.
TEST_F(OtherPdos, OfListsWithoutEntries) {
    static constexpr std::array<Pdo, 1> kNamedOut{Pdo{.index = 0x1600}};
    static constexpr std::array<Pdo, 1> kNamedIn{Pdo{.index = 0x1A00}};
    static constexpr std::array<SmPdos, 2> kNamed{SmPdos{2, kNamedOut}, SmPdos{3, kNamedIn}};
    static constexpr SlaveSetup kSetup{.pdos = kNamed};
    begin();
    ctx->slave(2).config.setup = &kSetup;
    ASSERT_TRUE(write_mapping());
    map();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    expect_right_objects();
    power_off_and_on();
    expect_not_driven();
}

// The application gives the sizes, and the dictionary gives the places of the objects.
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

// The application declares that it writes the PDOs itself at each start-up, but it does not write them here.
TEST_F(OtherPdos, AreNotComparedWhereTheApplicationSaysSo) {
    begin();
    ASSERT_TRUE(write_mapping());
    ctx->slave(2).config.unchecked_pdos = true;
    map();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    expect_right_objects();
    power_off_and_on();
    EXPECT_EQ(ctx->slave(2).al.state, AlState::op);
    EXPECT_TRUE(all_right(*ctx));
    EXPECT_EQ(object(0x60FF), 0x1111) << "the drive has its own PDOs again";
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

// A drive keeps its PDOs in INIT. A drive whose hook writes the PDOs each time has the same PDOs, too.
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
