// A slave was absent at the mapping, which has reserved a place for it. The slave comes late, and the reserved place,
// FMMUs and bits are used for nothing else.
#include "process_data/plant.hpp"

#include "wire/esc.hpp"

#include <margay/entry.hpp>
#include <margay/hooked_slave.hpp>
#include <margay/run.hpp>

namespace margay {
namespace {

using namespace std::chrono_literals;

constexpr PdoEntry kOut[] = {{0x7000, 1, 8}};
constexpr PdoEntry kIn[] = {{0x6000, 1, 8}};
constexpr Pdo kOuts[] = {{0x1600, kOut}};
constexpr Pdo kIns[] = {{0x1A00, kIn}};
constexpr SmPdos kLists[] = {{0, kOuts}, {1, kIns}};
constexpr SlaveSetup kKnown{.pdos = kLists};

// A line of three slaves. The last slave has no power and a known setup.
class LateSlave : public testing::Test, protected Plant {
  protected:
    std::array<std::uint32_t, 3> line{};
    SlaveConfiguration config;
    const std::array<ExpectedSlave, 3> expected{{{.number = 1}, {.number = 2}, {.number = 3, .config = &config}}};

    // Switches the first two slaves on and scans.
    void begin() {
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, osal);
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *nic, osal).ok());
        power(line[2], false);
        (void)bring_up(expected);
    }
    void build(sim::EscDescription last = sim::junction()) {
        for (std::uint32_t n = 0; n < line.size(); ++n) {
            auto made = sim::device_from_sii(io_image(8, 8, {.product = 0x100 + n}));
            made.chip = n + 1 == line.size() ? last : sim::junction();
            line[n] = segment.add(std::move(made).assemble());
            ASSERT_TRUE(n == 0 ? segment.connect_master({line[n], 0})
                               : segment.connect({line[n - 1], 1}, {line[n], 0}));
        }
        config.setup = &kKnown;
        begin();
    }
    // Maps, supervises, and switches the slave on.
    void map_and_switch_on() {
        EXPECT_EQ(config_map(*ctx, image).error().slave, 3);
        (void)errors();
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        cycles(500);
        (void)events();
        power(line[2], true);
    }
    static std::string words(const Error& error) {
        std::array<char, 400> buffer{};
        return std::string(describe(error, buffer));
    }
    std::string wrong() { return words(what_is_wrong(*ctx)); }
    // The slave does not leave PREOP for this reason, however often the supervision tries.
    void expect_refused(const std::string& why) {
        for (int n = 0; n < 10; ++n) {
            cycles(500);
            EXPECT_LE(ctx->slave(3).al.state, AlState::preop) << "each attempt begins in INIT";
            EXPECT_FALSE(ctx->slave(3).takes_part);
            EXPECT_EQ(wrong(), why);
        }
    }
};

TEST_F(LateSlave, IsWaitedForByReachWhileItIsAskedForItsPdos) {
    build();
    map_and_switch_on();
    const auto reached = reach(*ctx, AlState::op, 20s);
    EXPECT_TRUE(reached.ok()) << words(reached.error());
    EXPECT_TRUE(in_op(3));
}

TEST_F(LateSlave, IsNeverToldToNeedAMappingWhileItIsAsked) {
    build();
    map_and_switch_on();
    for (int n = 0; n < 20'000 && !all_right(*ctx); ++n) {
        if (n % 10 == 0) {
            (void)send_processdata(*ctx);
            (void)receive_processdata(*ctx, 500us);
        }
        (void)poll(*ctx, osal.now());
        osal.advance(100us);
        ASSERT_NE(what_is_wrong(*ctx).code, Errc::remapping_needed) << n;
    }
    EXPECT_TRUE(all_right(*ctx)) << wrong();
}

TEST_F(LateSlave, WithoutAnEntryThatIsListedStaysInPreopHoweverOftenItIsTried) {
    build();
    Output<std::uint8_t> missing{3, 0x7777, 1};
    EntryHandle* const entries[] = {&missing};
    ctx->group(0).config.entries = entries;
    map_and_switch_on();
    expect_refused("slave 3: mapping process data of 0x7777:1: no PDO that the slave exchanges has this entry");
    EXPECT_FALSE(missing.mapped());
    ctx->group(0).config.entries = {};
}

TEST_F(LateSlave, WithoutLrwStaysInPreopHoweverOftenItIsTried) {
    auto chip = sim::junction();
    chip.features |= wire::features::kLrwNotSupported;
    build(chip);
    map_and_switch_on();
    expect_refused("slave 3: mapping process data: not supported by the slave");
}

// Without this check, the inputs of the neighbour would reach the outputs of the slave.
TEST_F(LateSlave, WithoutFmmusOfSingleBitsStaysInPreopHoweverOftenItIsTried) {
    static constexpr PdoEntry kFour[] = {{0x7000, 1, 4}};
    static constexpr PdoEntry kFourIn[] = {{0x6000, 1, 4}};
    static constexpr Pdo kFourOuts[] = {{0x1600, kFour}};
    static constexpr Pdo kFourIns[] = {{0x1A00, kFourIn}};
    static constexpr SmPdos kFourLists[] = {{0, kFourOuts}, {1, kFourIns}};
    static constexpr SlaveSetup kFourSetup{.pdos = kFourLists};
    auto chip = sim::junction();
    chip.features |= wire::features::kFmmuBitOperationNotSupported;
    for (std::uint32_t n = 0; n < line.size(); ++n) {
        auto made = sim::device_from_sii(io_image(4, 4, {.product = 0x100 + n}));
        made.chip = n == 2 ? chip : sim::junction();
        line[n] = segment.add(std::move(made).assemble());
        ASSERT_TRUE(n == 0 ? segment.connect_master({line[n], 0}) : segment.connect({line[n - 1], 1}, {line[n], 0}));
    }
    config.setup = &kFourSetup;
    begin();
    ctx->group(0).config.packing = Packing::bits;
    map_and_switch_on();
    expect_refused("slave 3: mapping process data: not supported by the slave");
}

// ------------------------------------------------------------------ found, and mapped before it was read

TEST_F(LateSlave, ThatWasFoundByHandIsReadByTheMapping) {
    build();
    config.setup = nullptr;
    ctx->slave(3).config.setup = nullptr;
    EXPECT_EQ(config_map(*ctx, image).error().slave, 3);
    power(line[2], true);
    osal.advance(50ms);
    ASSERT_TRUE(recover_slave(*ctx, 3).ok());
    const auto mapped = config_map(*ctx, image);
    EXPECT_TRUE(mapped.ok()) << words(mapped.error());
    const auto reached = reach(*ctx, AlState::op, 5s);
    EXPECT_TRUE(reached.ok()) << words(reached.error());
    EXPECT_EQ(ctx->slave(3).image.outputs.bits, 8U);
    expect_exchanged(3, line[2]);
}

// The mapping is requested at each moment between power-on and the end of the start-up.
TEST_F(LateSlave, IsMappedWheneverTheMappingIsRequested) {
    build();
    ctx->slave(3).config.setup = nullptr;
    EXPECT_EQ(config_map(*ctx, image).error().slave, 3);
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    for (int at = 0; at < 300; at += 7) {
        power(line[2], false);
        cycles(100);
        power(line[2], true);
        for (int n = 0; n < at; ++n) {
            (void)poll(*ctx, osal.now());
            osal.advance(100us);
        }
        for (int tries = 0; tries < 2; ++tries) {  // the first attempt may come before the slave was found
            MapRequest map;
            map.image = image;
            ASSERT_TRUE(submit(*ctx, map).ok());
            for (int n = 0; n < 5'000 && map.busy(); ++n) cycles(1);
            if (until([&] { return all_right(*ctx); })) break;
            EXPECT_EQ(what_is_wrong(*ctx).code, Errc::no_place) << at << ": " << wrong();
        }
        ASSERT_TRUE(all_right(*ctx)) << at << ": " << wrong();
        EXPECT_TRUE(in_op(3)) << at;
        // The slave has no place again.
        power(line[2], false);
        ctx->slave(3).config.sm_count = 0;
        ctx->slave(3).config.source = ConfigurationSource::none;
        ASSERT_TRUE(until([&] { return ctx->slave(3).al.state == AlState::none; }));
    }
}

// ------------------------------------------------------------------ its hook

ProcessSm first_sm;
ProcessSm second_sm;
int found_sms = 0;

Result<> say_sms(HookedSlave slave, void*) {
    SlaveConfiguration& own = slave.slave().config;
    found_sms += own.sm_count;
    own.source = ConfigurationSource::application;
    own.sm_count = 0;
    (void)own.add(first_sm);
    (void)own.add(second_sm);
    return Result<>();
}

// A hook that fills in the SyncManagers finds an empty configuration, as at the first start-up. The values of the hook
// are used.
TEST_F(LateSlave, IsAsItsHookSays) {
    build();
    first_sm = {0, Direction::outputs, 0x64, 0x1100, 8};
    second_sm = {1, Direction::inputs, 0x20, 0x2000, 8};
    found_sms = 0;
    ctx->slave(3).hooks.preop_to_safeop = say_sms;
    map_and_switch_on();
    ASSERT_TRUE(until([&] { return in_op(3); })) << joined(events());
    EXPECT_EQ(found_sms, 0);
    EXPECT_EQ(ctx->slave(3).config.source, ConfigurationSource::application);
    EXPECT_EQ(ctx->slave(3).config.used_sms().size(), 2U);
    expect_exchanged(3, line[2]);
    power(line[2], false);
    cycles(300);
    power(line[2], true);
    ASSERT_TRUE(until([&] { return in_op(3); })) << "the hook sets sm_count to 0";
}

TEST_F(LateSlave, WithMemoryThatCannotBeStaysInPreopHoweverOftenItIsTried) {
    build();
    first_sm = {0, Direction::outputs, 0x64, 0x1100, 8};
    second_sm = {1, Direction::inputs, 0x20, 0x1100, 8};
    ctx->slave(3).hooks.preop_to_safeop = say_sms;
    map_and_switch_on();
    expect_refused(
        "slave 3: mapping process data at SyncManager 1: outside the slave's process data memory, or on top of another "
        "SyncManager");
}

// The application prepares its next mapping while the hook waits. The hook fails.
TEST_F(LateSlave, WhatTheApplicationSetsMeanwhileIsKept) {
    build();
    ctx->slave(3).hooks.preop_to_safeop = [](HookedSlave slave, void*) -> Task<> {
        auto slept = co_await slave.sleep(100ms);
        (void)slept;
        co_return Error{.code = Errc::check_failed};
    };
    map_and_switch_on();
    ASSERT_TRUE(until([&] { return ctx->slave(3).al.state == AlState::preop; }));
    cycles(20);
    SlaveConfiguration& next = ctx->slave(3).config;
    next.source = ConfigurationSource::application;
    next.sm_count = 0;
    next.add({0, Direction::outputs, 0x64, 0x1100, 16});
    cycles(1'000);
    EXPECT_EQ(next.source, ConfigurationSource::application);
    EXPECT_EQ(next.sm_count, 1);
    EXPECT_EQ(next.sms[0].bits, 16U);
}

TEST_F(LateSlave, IsNotBroughtAboveTheHighestStateThatItsHookSets) {
    build();
    ctx->slave(3).hooks.preop_to_safeop = [](HookedSlave slave, void*) -> Result<> {
        slave.slave().config.highest = AlState::preop;
        return Result<>();
    };
    map_and_switch_on();
    cycles(2'000);
    const auto story = joined(events());
    EXPECT_EQ(story.find("PREOP to SAFEOP"), std::string::npos) << story;
    EXPECT_EQ(ctx->slave(3).al.state, AlState::preop);
}

// ------------------------------------------------------------------ lists that change

// The place in the image and the handles belong to the mapping. Other PDOs of the same size would have another meaning.
TEST_F(LateSlave, WithOtherListsOfTheSameSizeNeedsAMapping) {
    static constexpr PdoEntry kOther[] = {{0x7010, 1, 8}};
    static constexpr Pdo kOthers[] = {{0x1600, kOther}};
    static constexpr SmPdos kOtherLists[] = {{0, kOthers}, {1, kIns}};
    static constexpr SlaveSetup kOtherSetup{.pdos = kOtherLists};
    build();
    map_and_switch_on();
    ASSERT_TRUE(until([&] { return in_op(3); })) << joined(events());
    ctx->slave(3).config.setup = &kOtherSetup;
    cycles(100);
    EXPECT_TRUE(all_right(*ctx)) << "exchanged as it was mapped: " << wrong();
    power(line[2], false);
    cycles(300);
    power(line[2], true);
    expect_refused(
        "slave 3: mapping process data: its revision, SyncManagers or PDOs have changed since config_map(): call "
        "config_map() again");
    EXPECT_EQ(reconfigure_slave(*ctx, 3).error().code, Errc::remapping_needed);
    ctx->slave(3).config.setup = &kKnown;
    ASSERT_TRUE(until([&] { return in_op(3); })) << joined(events());
}

}  // namespace
}  // namespace margay
