// PDOs of the application are written to slaves with the complete stack. A list that the slave refuses is reported,
// and the other slaves continue.
#include "segment/field_notes.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

class PdoConfiguration : public FieldNotes {
  protected:
    std::vector<std::string> errors() {
        std::vector<std::string> all;
        while (const auto error = ctx.errors().take()) all.push_back(words(*error));
        return all;
    }
    std::uint32_t object(std::size_t slave, std::uint16_t index, std::uint8_t subindex) {
        std::array<std::byte, 4> value{};
        EXPECT_TRUE(SDOread(ctx, static_cast<std::uint16_t>(slave), index, subindex, false, value, 1s));
        return load_le<std::uint32_t>(value);
    }
    std::uint32_t bits(std::size_t slave, std::uint8_t sync_manager) {
        const auto& config = ctx.slave(slave).config;
        for (std::size_t n = 0; n < config.sm_count; ++n)
            if (config.sms[n].number == sync_manager) return config.sms[n].bits;
        return 0xFFFF'FFFF;
    }
    // Maps an odd device with these lists. Returns its error text, "" when there is none. A second device is never
    // affected.
    std::string wrong_with(std::span<const SmPdos> lists) {
        const SlaveSetup setup{.pdos = lists};
        ctx.slave(1).config.setup = &setup;
        EXPECT_TRUE(clear_error(ctx, 1));
        map();
        EXPECT_EQ(ctx.slave(2).al, (AlStatus{AlState::safeop, false, 0}));
        EXPECT_EQ(ctx.slave(1).al.state, ctx.slave(1).error.code == Errc::none ? AlState::safeop : AlState::preop)
            << told(1);
        ctx.slave(1).config.setup = nullptr;
        return ctx.slave(1).error.code == Errc::none ? "" : told(1);
    }
};

constexpr PdoEntry kGapped[] = {{0x7000, 9, 16}, {0, 0, 8}, {0x7000, 1, 16}};
constexpr PdoEntry kTwo[] = {{0x6000, 31, 16}, {0x6000, 32, 16}};
constexpr Pdo kOutputs[] = {{0x1601, kGapped}};
constexpr Pdo kInputs[] = {{0x1A01}, {0x1A00, kTwo}};
constexpr SmPdos kPdos[] = {{2, kOutputs}, {3, kInputs}};
constexpr SlaveSetup kSetup{.pdos = kPdos};

TEST_F(PdoConfiguration, AssignmentAndMappingBecomeWhatTheApplicationWants) {
    const std::initializer_list<Names> manners{{}, {"refuses_complete_access"}, {"slow_replies"}};
    for (const auto& names : manners) plug_odd(names);
    start();
    for (std::size_t n = 1; n <= manners.size(); ++n) ctx.slave(n).config.setup = &kSetup;
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1) << told(2) << told(3);
    EXPECT_EQ(errors(), std::vector<std::string>());
    for (std::size_t n = 1; n <= manners.size(); ++n) {
        EXPECT_EQ(bits(n, 2), 40U) << n;
        EXPECT_EQ(bits(n, 3), 8U * 16 + 32) << n << ": 0x1A01 as the slave has it, and two words";
    }
    for (const std::size_t n : {1U, 2U}) {
        EXPECT_EQ(beside_the_cycle(static_cast<std::uint16_t>(n), 0x1601, 0), 3U);
        EXPECT_EQ(beside_the_cycle(static_cast<std::uint16_t>(n), 0x1601, 2), 0x00000008U);
        EXPECT_EQ(beside_the_cycle(static_cast<std::uint16_t>(n), 0x1601, 3), 0x70000110U);
        EXPECT_EQ(beside_the_cycle(static_cast<std::uint16_t>(n), 0x1C13, 0), 2U);
        EXPECT_EQ(beside_the_cycle(static_cast<std::uint16_t>(n), 0x1C13, 1), 0x1A01U);
        EXPECT_EQ(beside_the_cycle(static_cast<std::uint16_t>(n), 0x1C13, 2), 0x1A00U);
    }
    // Word 9 is the first output, and the device returns it as word 9 of the inputs, the fifth entry of 0x1A01.
    ctx.slave(1).image.outputs.bytes[0] = std::byte{0xA5};
    cycles(5);
    EXPECT_EQ(ctx.slave(1).image.inputs.bytes[8], std::byte{0xA5});
}

TEST_F(PdoConfiguration, WhatIsThereIsNotWrittenAgain) {
    plug_odd({});
    start();
    ctx.slave(1).config.setup = &kSetup;
    map();
    const auto first = mailbox_statistics(ctx, 1)->sent;
    map();
    const auto second = mailbox_statistics(ctx, 1)->sent - first;
    EXPECT_LE(second + 5, first) << "it is only looked at: an empty list, a mapping, another, and an assignment less";
    EXPECT_EQ(ctx.slave(1).al.state, AlState::safeop) << told(1);
    EXPECT_EQ(errors(), std::vector<std::string>());
}

TEST_F(PdoConfiguration, ReplayedForASlaveThatComesBack) {
    plug_odd({});
    plug_odd({});
    start();
    ctx.slave(2).config.setup = &kSetup;
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(2);
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(5);
    segment.set_power(1, false, osal.now());
    cycles(100);
    segment.set_power(1, true, osal.now());
    bool right = false;
    for (int n = 0; n < 3000 && !right; ++n) right = cycle().ok() && ctx.slave(2).al == AlStatus{AlState::op, false, 0};
    EXPECT_TRUE(right) << told(2);
    EXPECT_EQ(beside_the_cycle(2, 0x1601, 0), 3U) << "by itself it has eight";
    EXPECT_EQ(beside_the_cycle(1, 0x1601, 0), 8U);
}

// PDOs that cannot be changed are no error when they are already equal to the requested PDOs.
TEST_F(PdoConfiguration, FixedPdosAreToleratedAsTheyAre) {
    plug("digital_io_16");
    plug("digital_io_16");
    start();
    const auto count = object(1, 0x1600, 0);
    ASSERT_GE(count, 1U);
    std::vector<PdoEntry> entries;
    for (std::uint32_t n = 1; n <= count; ++n) {
        const auto word = object(1, 0x1600, static_cast<std::uint8_t>(n));
        entries.push_back({static_cast<std::uint16_t>(word >> 16), static_cast<std::uint8_t>(word >> 8),
                           static_cast<std::uint8_t>(word)});
    }
    const auto try_out = [&](std::span<const PdoEntry> list) {
        const Pdo pdos[] = {{0x1600, list}};
        const SmPdos lists[] = {{2, pdos}};
        return wrong_with(lists);
    };
    EXPECT_EQ(try_out(entries), "");
    const std::string fewer = try_out(std::span(entries).first(entries.size() - 1));
    EXPECT_EQ(fewer.substr(0, fewer.find(" (")),
              "slave 1: configuring PDOs of 0x1600:0: the slave aborted the transfer");
    EXPECT_NE(fewer.find("; wanted 0x"), std::string::npos) << fewer;
    EXPECT_EQ(try_out(entries), "") << "and on it goes";
    entries.back() = {0x7063, 1, 1};
    const std::string other = try_out(entries);
    const std::string place = "slave 1: configuring PDOs of 0x1600:" + std::to_string(count) + ": the slave aborted";
    EXPECT_EQ(other.substr(0, place.size()), place) << other;
    EXPECT_NE(other.find("; wanted 0x70630101, it has 0x70"), std::string::npos) << other;
}

TEST_F(PdoConfiguration, ACapOnEntriesNamesTheFirstThatIsTooMuch) {
    plug_odd({"few_mapping_entries"});
    plug_odd({});
    plug_odd({"few_mapping_entries", "refuses_complete_access"});
    start();
    static constexpr PdoEntry kTen[] = {{0x7000, 1, 16}, {0x7000, 2, 16}, {0x7000, 3, 16}, {0x7000, 4, 16},
                                        {0x7000, 5, 16}, {0x7000, 6, 16}, {0x7000, 7, 16}, {0x7000, 8, 16},
                                        {0x7000, 9, 16}, {0x7000, 10, 16}};
    static constexpr Pdo kLong[] = {{0x1600, kTen}};
    static constexpr SmPdos kLists[] = {{2, kLong}};
    static constexpr SlaveSetup kLongSetup{.pdos = kLists};
    ctx.slave(3).config.setup = &kLongSetup;
    const std::string refused = wrong_with(kLists);
    if (refused.empty()) {
        EXPECT_EQ(bits(1, 2), 160U) << "complete access knows no cap in this device";
    } else {
        EXPECT_NE(refused.find(
                      "slave 1: configuring PDOs of 0x1600:9: the slave aborted the transfer (abort code 0x06040042"),
                  std::string::npos);
    }
    EXPECT_NE(
        told(3).find("slave 3: configuring PDOs of 0x1600:9: the slave aborted the transfer (abort code 0x06040042"),
        std::string::npos)
        << told(3);
    EXPECT_EQ(ctx.slave(3).al.state, AlState::preop);
    // A shorter list is accepted, and the error is cleared.
    static constexpr Pdo kShort[] = {{0x1600, std::span(kTen).first<8>()}};
    static constexpr SmPdos kShortLists[] = {{2, kShort}};
    EXPECT_EQ(wrong_with(kShortLists), "");
    EXPECT_EQ(bits(1, 2), 128U);
}

// A slave without assignment objects: the application may still describe its PDOs, which are then not written.
TEST_F(PdoConfiguration, SizesFollowFromTheListsWhereTheDictionaryCannotBeRead) {
    plug_odd({"no_assignment"});
    plug_odd({});
    start();
    static constexpr PdoEntry kFour[] = {{0x7000, 1, 16}, {0x7000, 2, 16}, {0x7000, 3, 16}, {0x7000, 4, 16}};
    static constexpr Pdo kListed[] = {{0x1600, kFour}};
    static constexpr Pdo kOpen[] = {{0x1A00}};
    static constexpr SmPdos kLists[] = {{2, kListed}, {3, kOpen}};
    const std::string refused = wrong_with(kLists);
    EXPECT_EQ(refused.substr(0, refused.find(" (")),
              "slave 1: configuring PDOs of 0x1c12:0: the slave aborted the transfer")
        << refused;
    ctx.slave(1).config.fixed_pdos = true;
    EXPECT_EQ(wrong_with(kLists), "");
    EXPECT_EQ(bits(1, 2), 64U);
    EXPECT_EQ(bits(1, 3), 64U) << "by the PDO that its SII has";
    static constexpr Pdo kUnknown[] = {{0x1A05}};
    static constexpr SmPdos kNobody[] = {{3, kUnknown}};
    EXPECT_EQ(wrong_with(kNobody),
              "slave 1: configuring PDOs of 0x1a05:0: neither the list nor the slave says which entries the PDO has");
}

TEST_F(PdoConfiguration, NothingIsAssignedWhereTheListIsEmpty) {
    plug_odd({});
    plug_odd({});
    start();
    static constexpr SmPdos kNone[] = {{2, {}}};
    EXPECT_EQ(wrong_with(kNone), "");
    EXPECT_EQ(object(1, 0x1C12, 0), 0U);
    EXPECT_EQ(bits(1, 2), 0U);
    EXPECT_EQ(ctx.slave(1).image.outputs.bits, 0U);
    EXPECT_EQ(ctx.slave(1).image.inputs.bits, 64U);
}

// Impossible lists are reported before anything is written, with a text. The other slave continues, and a right list
// works for this slave.
TEST_F(PdoConfiguration, ListsThatCannotBeAreNamed) {
    plug_odd({});
    plug_odd({});
    start();
    static constexpr PdoEntry kZero[] = {{0x7000, 1, 16}, {0x7000, 2, 0}};
    static constexpr Pdo kOut[] = {{0x1600}};
    static constexpr Pdo kIn[] = {{0x1A00}};
    static constexpr Pdo kTwice[] = {{0x1600}, {0x1600}};
    static constexpr Pdo kNoPdo[] = {{0x7000}};
    static constexpr Pdo kEmptyEntry[] = {{0x1600, kZero}};
    static const std::vector<PdoEntry> many(255, PdoEntry{0x7000, 1, 16});
    static const Pdo kMany[] = {{0x1600, many}};
    struct Case {
        std::vector<SmPdos> lists;
        std::string_view says;
    };
    const Case cases[] = {
        {{{0, kOut}}, "slave 1: configuring PDOs of SyncManager 0: a list of PDOs for a SyncManager of a mailbox"},
        {{{7, kOut}},
         "slave 1: configuring PDOs of SyncManager 7: the slave has no such SyncManager (needed 8, there is room for "
         "4)"},
        {{{2, kOut}, {2, kOut}},
         "slave 1: configuring PDOs of SyncManager 2: the list of PDOs is invalid (two lists name "
         "this SyncManager)"},
        {{{2, kTwice}}, "slave 1: configuring PDOs of 0x1600:0: the list of PDOs is invalid (the PDO is listed twice)"},
        {{{2, kNoPdo}},
         "slave 1: configuring PDOs of 0x7000:0: the list of PDOs is invalid (PDOs are 0x1600 to 0x17FF and "
         "0x1A00 to 0x1BFF)"},
        {{{2, kIn}},
         "slave 1: configuring PDOs of 0x1a00:0: the direction of the PDO differs from the direction of its "
         "SyncManager"},
        {{{3, kOut}},
         "slave 1: configuring PDOs of 0x1600:0: the direction of the PDO differs from the direction of its "
         "SyncManager"},
        {{{2, kEmptyEntry}},
         "slave 1: configuring PDOs of 0x1600:2: the list of PDOs is invalid (an entry has 0 bits)"},
        {{{2, kMany}},
         "slave 1: configuring PDOs of 0x1600:0: the list of PDOs is invalid (a PDO has room for 254 entries)"},
    };
    for (const Case& c : cases) {
        EXPECT_EQ(wrong_with(c.lists), c.says);
        EXPECT_EQ(ctx.slave(1).image.outputs.bits, 0U) << c.says;
    }
    const SmPdos right[] = {{2, kOut}};
    EXPECT_EQ(wrong_with(right), "");
    EXPECT_EQ(bits(1, 2), 64U);
}

TEST_F(PdoConfiguration, SizesThatTheApplicationContradictsAreNamed) {
    plug_odd({});
    plug_odd({});
    start();
    ctx.slave(1).config.source = ConfigurationSource::file;
    ctx.slave(1).config.add({2, Direction::outputs, 0x64, 0x1800, 24});
    ctx.slave(1).config.add({3, Direction::inputs, 0x20, 0x1A00, 64});
    EXPECT_EQ(
        wrong_with(kPdos),
        "slave 1: configuring PDOs of SyncManager 2: the size of the PDOs differs from the size of the SyncManager "
        "(the SyncManager 24, the PDOs 40)");
    ctx.slave(1).config.sms[0].bits = 40;
    ctx.slave(1).config.sms[1].bits = 160;
    EXPECT_EQ(wrong_with(kPdos), "");
    EXPECT_EQ(ctx.slave(1).image.inputs.bits, 160U);
}

// A service tool assigns other PDOs of the same size: the image and the handles still belong to the mapping.
TEST_F(PdoConfiguration, PdosThatAnSdoHasWrittenNeedAMapping) {
    plug_odd({});
    plug_odd({});
    start();
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1) << told(2);
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    ASSERT_TRUE(set_target(ctx, 1, AlState::preop));
    ASSERT_TRUE(reach(ctx, AlState::op, 5s).ok());
    const auto assigned = SDOread<std::uint16_t>(ctx, 1, 0x1C12, 1);
    ASSERT_TRUE(assigned.ok());
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x1C12, 0, std::uint8_t{0}));
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x1C12, 1, *assigned));
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x1C12, 0, std::uint8_t{1}));
    ASSERT_TRUE(set_target(ctx, 1, AlState::none));
    EXPECT_EQ(words(reach(ctx, AlState::op, 5s).error()),
              "slave 1: mapping process data: its revision, SyncManagers or PDOs have changed since config_map(): call "
              "config_map() again");
    EXPECT_EQ(ctx.slave(1).al.state, AlState::preop);
    map();
    EXPECT_TRUE(reach(ctx, AlState::op, 5s).ok());
    // Without a supervision, by requests for states; and the slave refuses the value.
    supervision.cancel();
    EXPECT_FALSE(SDOwrite(ctx, 1, 0x1C12, 0, std::uint8_t{1})) << "in OP";
    StateRequest down;
    down.slave = 1;
    down.wanted = AlState::preop;
    ASSERT_TRUE(submit(ctx, down));
    ASSERT_TRUE(wait(ctx, down));
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x1C12, 0, std::uint8_t{0}));
    StateRequest up;
    up.slave = 1;
    up.wanted = AlState::safeop;
    ASSERT_TRUE(submit(ctx, up));
    EXPECT_EQ(wait(ctx, up).error().code, Errc::remapping_needed);
    EXPECT_EQ(writestate(ctx, 1, AlState::safeop).error().code, Errc::remapping_needed);
}

}  // namespace
}  // namespace margay
