// Start-up commands and hooks at all state transitions, up and down, the first time and each later time. The error
// texts name what failed.
#include "facts.hpp"
#include "segment/field_notes.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;
using enum Transition;

class Startup : public FieldNotes {
  protected:
    std::vector<std::string> errors() { return taken(ctx.errors()); }
    std::vector<std::string> warnings() { return taken(ctx.warnings()); }
    std::vector<std::string> taken(ErrorLog& log) {
        std::vector<std::string> all;
        while (const auto error = log.take()) all.push_back(words(*error));
        return all;
    }
    std::uint8_t ram(std::uint32_t number, unsigned n) {
        return std::to_integer<std::uint8_t>(segment.slave(number).peek(0x0F80, 32)[n]);
    }
    // Changes the state with cycles.
    void go(AlState state) { ASSERT_EQ(to(state), (AlStatus{state, false, 0})) << told(1); }
    // Maps slave 1 with these commands and returns its error text. Slave 2 is never affected.
    std::string wrong_with(std::span<const StartupCommand> commands) {
        const SlaveSetup setup{.startup = commands};
        ctx.slave(1).config.setup = &setup;
        EXPECT_TRUE(clear_error(ctx, 1));
        map();
        EXPECT_EQ(ctx.slave(2).al, (AlStatus{AlState::safeop, false, 0}));
        EXPECT_EQ(ctx.slave(1).al.state, ctx.slave(1).error.code == Errc::none ? AlState::safeop : AlState::preop);
        ctx.slave(1).config.setup = nullptr;
        return ctx.slave(1).error.code == Errc::none ? "" : told(1);
    }
    void power_comes_back(std::uint32_t number) {
        segment.set_power(number, false, osal.now());
        cycles(100);
        segment.set_power(number, true, osal.now());
        bool right = false;
        for (int n = 0; n < 3000 && !right; ++n)
            right = cycle().ok() && ctx.slave(number + 1).al == AlStatus{AlState::op, false, 0};
        EXPECT_TRUE(right) << told(number + 1);
    }
};

TEST_F(Startup, CommandsRunInTheirOrderAtTheirTransitions) {
    plug_odd({});
    plug_odd({});
    static constexpr std::array kLong{std::byte{0x61}, std::byte{0x62}, std::byte{0x63}, std::byte{0x64},
                                      std::byte{0x65}, std::byte{0x66}, std::byte{0x67}, std::byte{0x68},
                                      std::byte{0x69}, std::byte{0x6A}};
    static constexpr StartupCommand kList[] = {
        write_object(init_to_preop, 0x7000, 20, std::uint16_t{1}),
        write_register(init_to_preop, 0x0F80, std::uint8_t{0x11}),
        write_object(preop_to_safeop | safeop_to_op, 0x7000, 21, std::uint16_t{2}),
        write_object(preop_to_safeop, 0x7000, 21, std::uint16_t{3}),
        write_register(preop_to_safeop, 0x0F82, kLong),
        write_register(safeop_to_op, 0x0F80, std::uint16_t{0x2211}),
        check_register(safeop_to_op, 0x0F80, std::uint16_t{0x2200}, std::uint16_t{0xFF00}),
        check_register(safeop_to_op, 0x0130, std::uint8_t{8}, std::uint8_t{0x1F}).afterwards(),
        write_register(safeop_to_op, 0x0F8F, std::uint8_t{0x33}).afterwards(),
        write_register(op_to_safeop | op_to_preop, 0x0F90, std::uint8_t{0x44}),
        write_register(safeop_to_preop, 0x0F91, std::uint8_t{0x55}),
        write_register(preop_to_init, 0x0F92, std::uint8_t{0x66}),
    };
    static constexpr SlaveSetup kSetup{.startup = kList};
    static constexpr SlaveConfiguration kConfig{.setup = &kSetup};
    const ExpectedSlave expected[] = {{.number = 1}, {.number = 2, .config = &kConfig}};
    switch_on();
    ASSERT_TRUE(init(ctx, wire, osal));
    ASSERT_TRUE(expect(ctx, expected));
    ASSERT_TRUE(config_init(ctx)) << told(2);
    EXPECT_EQ(ram(1, 0), 0x11);
    EXPECT_EQ(*SDOread<std::uint16_t>(ctx, 2, 0x7000, 20), 1) << "as soon as there is a mailbox";
    map();
    EXPECT_EQ(*SDOread<std::uint16_t>(ctx, 2, 0x7000, 21), 3) << "the later one stands";
    EXPECT_EQ(ram(1, 11), 0x6A);
    EXPECT_EQ(ram(1, 15), 0) << "not yet";
    cycles(5);
    go(AlState::op);
    cycles(5);
    EXPECT_EQ(ram(1, 1), 0x22);
    EXPECT_EQ(ram(1, 15), 0x33);
    EXPECT_EQ(beside_the_cycle(2, 0x7000, 21), 2U);
    EXPECT_EQ(ram(1, 16), 0);
    go(AlState::safeop);
    EXPECT_EQ(ram(1, 16), 0x44);
    EXPECT_EQ(ram(1, 17), 0);
    go(AlState::preop);
    EXPECT_EQ(ram(1, 17), 0x55);
    go(AlState::init);
    EXPECT_EQ(ram(1, 18), 0x66);
    EXPECT_EQ(errors(), std::vector<std::string>());
}

TEST_F(Startup, ReplayedForASlaveThatComesBack) {
    plug_odd({});
    plug_odd({});
    start();
    static constexpr StartupCommand kList[] = {
        write_object(init_to_preop, 0x7000, 20, std::uint16_t{1}),
        write_object(preop_to_safeop, 0x7000, 21, std::uint16_t{2}),
        write_object(safeop_to_op, 0x7000, 22, std::uint16_t{3}),
        write_register(safeop_to_op, 0x0F80, std::uint8_t{4}).afterwards(),
    };
    static constexpr SlaveSetup kSetup{.startup = kList};
    ctx.slave(2).config.setup = &kSetup;
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(2);
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(5);
    const std::array<std::byte, 4> zeros{};
    segment.slave(1).write(0x0F80, zeros);
    power_comes_back(1);
    cycles(5);
    for (const unsigned n : {0U, 1U, 2U})
        EXPECT_EQ(beside_the_cycle(2, 0x7000, static_cast<std::uint8_t>(20 + n)), n + 1U);
    EXPECT_EQ(ram(1, 0), 4);
}

TEST_F(Startup, WhatFailsIsNamedWithItsPlaceAndCause) {
    plug_odd({});
    plug_odd({});
    start();
    struct Case {
        StartupCommand command;
        std::string_view says;
    };
    const Case cases[] = {
        {write_object(preop_to_safeop, 0x5555, 3, std::uint16_t{1}),
         "slave 1: command at PS (no. 2, object 0x5555:3): the slave aborted the transfer (abort code 0x06020000"},
        {write_object(preop_to_safeop, 0x7000, 1, std::uint32_t{1}),
         "slave 1: command at PS (no. 2, object 0x7000:1): the slave aborted the transfer"},
        {write_register(preop_to_safeop, 0x5000, std::uint8_t{1}),
         "slave 1: command at PS (no. 2, register 0x5000): wrong working counter (expected 1, got 0): the slave does "
         "not answer, or has no such register"},
        {check_register(preop_to_safeop, 0x0010, std::uint16_t{0x2222}, std::uint16_t{0x0FFF}),
         "slave 1: command at PS (no. 2, register 0x0010): the value is not the required one (wanted "
         "0x00000222, is 0x00000001)"},
        {check_register(preop_to_safeop, 0x0F90, std::uint64_t{0x0000'0005'0000'0000}, ~std::uint64_t{0}),
         "slave 1: command at PS (no. 2, register 0x0f90): the value is not the required one (wanted "
         "0x00000005, is 0x00000000, from octet 4 on)"},
        {StartupCommand{.transitions = preop_to_safeop, .index = 0x0F80},
         "slave 1: command at PS (no. 2, register 0x0f80): argument out of range: the value of the start-up command "
         "has "
         "a size that the command cannot have"},
        {StartupCommand{.transitions = preop_to_safeop, .index = 0x0F80, .length = 9},
         "slave 1: command at PS (no. 2, register 0x0f80): argument out of range: the value"},
    };
    for (const Case& c : cases) {
        const StartupCommand list[] = {write_register(preop_to_safeop, 0x0F80, std::uint8_t{1}), c.command};
        const std::string wrong = wrong_with(list);
        EXPECT_EQ(wrong.substr(0, c.says.size()), c.says) << wrong;
        const StartupCommand tolerant[] = {c.command.that_may_fail(),
                                           write_register(preop_to_safeop, 0x0F81, std::uint8_t{0x77})};
        (void)errors();
        segment.slave(0).write(0x0F81, std::array{std::byte{0}});
        EXPECT_EQ(wrong_with(tolerant), "");
        EXPECT_EQ(ram(0, 1), 0x77) << "the next one is done";
        EXPECT_EQ(errors().size(), 1U) << "told all the same";
    }
    EXPECT_EQ(wrong_with({}), "");
}

// The detail of the code and the kind of the command are one number.
TEST(StartupErrors, TheKindOfTheCommandIsNoDetailOfTheCode) {
    const auto words = [](Errc code, std::uint16_t index, std::uint32_t detail) {
        std::array<char, 512> text{};
        return std::string(describe(
            {.code = code, .step = Step::command_ip, .slave = 1, .index = index, .place = 1, .detail = detail}, text));
    };
    const std::string at_register = "slave 1: command at IP (no. 1, register 0x0f80): the frame did not come back";
    EXPECT_EQ(words(Errc::no_frame, 0x0F80, Error::kRegisterCommand), at_register);
    EXPECT_EQ(words(Errc::no_frame, 0x0F80, Error::kRegisterCommand | Error::kUnmarked).find(at_register + " (frames"),
              0U);
    EXPECT_EQ(words(Errc::no_frame, 0x6060, Error::kUnmarked).find("slave 1: command at IP (no. 1, object 0x6060:0): "),
              0U);
    const std::string unsupported = "mailbox error reply (detail 0x0002: the mailbox protocol is not supported)";
    EXPECT_EQ(words(Errc::mailbox_error, 0x6060, 2), "slave 1: command at IP (no. 1, object 0x6060:0): " + unsupported);
    EXPECT_EQ(words(Errc::mailbox_error, 1, Error::kParameterCommand | 2),
              "slave 1: command at IP (no. 1, S-0-0001, drive 0): " + unsupported);
    EXPECT_NE(words(Errc::sdo_abort, 0x6060, 0x0602'0000).find("(no. 1, object 0x6060:0)"), std::string::npos);
}

TEST_F(Startup, ARegisterIsLookedAtUntilItIsRightOrTheTimeIsOver) {
    plug_odd({});
    plug_odd({});
    start();
    const StartupCommand never[] = {check_register(preop_to_safeop, 0x0F88, std::uint8_t{1}, std::uint8_t{1}, 20ms)};
    const Time before = osal.now();
    EXPECT_NE(wrong_with(never), "");
    EXPECT_GE(osal.now() - before, 20ms);
    EXPECT_LE(osal.now() - before, 60ms);
    // Later the register has the right value, because a hook of the other slave's transition writes it.
    ctx.slave(2).hooks.user = &segment;
    ctx.slave(2).hooks.transition = [](HookedSlave, Transition, Moment moment, void* user) -> Result<> {
        auto& all = *static_cast<sim::Segment*>(user);
        if (moment == Moment::after) all.slave(0).write(0x0F88, std::array{std::byte{1}});
        return Result<>();
    };
    const StartupCommand late[] = {check_register(preop_to_safeop, 0x0F88, std::uint8_t{1}, std::uint8_t{1}, 100ms)};
    EXPECT_EQ(wrong_with(late), "");
}

// ------------------------------------------------------------------ hooks

struct Record {
    std::vector<std::string> calls{};
    std::string fail_at{};
    int busy = 0;
    static Result<> hook(HookedSlave slave, Transition which, Moment moment, void* user) {
        auto& my = *static_cast<Record*>(user);
        if (my.busy > 0) {
            --my.busy;
            return Error{.code = Errc::busy};
        }
        const std::string call = (moment == Moment::before ? "before " : "after ") + std::string(initials(which));
        my.calls.push_back(call + " in " + std::string(to_text(slave.slave().al.state)));
        if (call == my.fail_at) return Error{.code = Errc::unsupported, .slave = slave.number()};
        return Result<>();
    }
};

TEST_F(Startup, HooksAreCalledAroundEveryTransition) {
    plug_odd({});
    start();
    Record record;
    record.busy = 7;
    ctx.slave(1).hooks.user = &record;
    ctx.slave(1).hooks.transition = Record::hook;
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    EXPECT_EQ(record.busy, 0);
    go(AlState::safeop);
    go(AlState::preop);
    go(AlState::init);
    go(AlState::preop);
    EXPECT_EQ(record.calls, (std::vector<std::string>{"before PS in PREOP", "after PS in SAFEOP", "before SO in SAFEOP",
                                                      "after SO in OP", "before OS in OP", "after OS in SAFEOP",
                                                      "before SP in SAFEOP", "after SP in PREOP", "before PI in PREOP",
                                                      "after PI in INIT", "before IP in INIT", "after IP in PREOP"}));
    record.calls.clear();
    StateRequest state;
    state.slave = 1;
    state.wanted = AlState::init;
    ASSERT_TRUE(submit(ctx, state));
    ASSERT_TRUE(wait(ctx, state));
    EXPECT_EQ(record.calls, (std::vector<std::string>{"before PI in PREOP", "after PI in INIT"}));
}

TEST_F(Startup, HooksOfASlaveThatComesBackAreAskedAgainWhileBusy) {
    plug_odd({});
    plug_odd({});
    start();
    Record record;
    ctx.slave(2).hooks.user = &record;
    ctx.slave(2).hooks.transition = Record::hook;
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(2);
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(5);
    record.calls.clear();
    record.busy = 20;
    power_comes_back(1);
    EXPECT_EQ(record.busy, 0);
    const std::vector<std::string> last(record.calls.end() - std::min<std::ptrdiff_t>(6, std::ssize(record.calls)),
                                        record.calls.end());
    EXPECT_EQ(last, (std::vector<std::string>{"before IP in INIT", "after IP in PREOP", "before PS in PREOP",
                                              "after PS in SAFEOP", "before SO in SAFEOP", "after SO in OP"}));
}

TEST_F(Startup, AHookThatFailsKeepsTheSlaveOnItsWayUpAndNotOnItsWayDown) {
    plug_odd({});
    plug_odd({});
    start();
    Record record;
    record.fail_at = "before PS";
    ctx.slave(1).hooks.user = &record;
    ctx.slave(1).hooks.transition = Record::hook;
    map();
    EXPECT_EQ(ctx.slave(1).al.state, AlState::preop);
    EXPECT_EQ(ctx.slave(1).error.code, Errc::unsupported);
    EXPECT_EQ(ctx.slave(2).al.state, AlState::safeop);
    record.fail_at = "before SO";
    EXPECT_TRUE(clear_error(ctx, 1));
    map();
    cycles(5);
    EXPECT_FALSE(writestate(ctx, 1, AlState::op));
    EXPECT_EQ(statecheck(ctx, 1, AlState::op, 10ms)->state, AlState::safeop);
    record.fail_at = "before SP";
    EXPECT_TRUE(clear_error(ctx, 1));
    EXPECT_TRUE(writestate(ctx, 1, AlState::preop));
    EXPECT_EQ(statecheck(ctx, 1, AlState::preop, 1s)->state, AlState::preop);
    EXPECT_EQ(ctx.slave(1).error.code, Errc::unsupported) << "told";
}

// The hook before the mapping chooses PDOs, which is possible only in PREOP. Therefore the slave is in PREOP again
// when the group is mapped again.
TEST_F(Startup, TheHookBeforeMappingFindsItsSlaveInPreop) {
    plug_odd({});
    start();
    std::vector<AlState> states;
    ctx.slave(1).hooks.user = &states;
    ctx.slave(1).hooks.preop_to_safeop = [](HookedSlave slave, void* user) -> Task<> {
        std::array<std::byte, 2> status{};
        auto read = co_await slave.register_read(0x0130, status);
        if (!read) co_return read;
        static_cast<std::vector<AlState>*>(user)->push_back(static_cast<AlState>(status[0]));
        co_return Result<>();
    };
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0}));
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(states, (std::vector{AlState::preop, AlState::preop}));
}

// ------------------------------------------------------------------ times and flags

TEST_F(Startup, TimesAndWatchdogsAreTheSlavesOwn) {
    plug_odd({"slow_state_changes"});
    plug_odd({});
    start();
    static constexpr SlaveSetup kShort{.times = {.to_op = 20ms}};
    static constexpr SlaveSetup kDogs{.times = {.watchdog_divider = 4998, .pdi_watchdog = 10ms}};
    ctx.slave(1).config.setup = &kShort;
    ctx.slave(2).config.setup = &kDogs;
    ctx.slave(2).config.process_data_watchdog = 50ms;
    map();
    EXPECT_EQ(at<std::uint16_t>(1, 0x0400), 4998U);
    EXPECT_EQ(at<std::uint16_t>(1, 0x0410), 50U) << "200 µs each";
    EXPECT_EQ(at<std::uint16_t>(1, 0x0420), 250U);
    EXPECT_NE(at<std::uint16_t>(0, 0x0400), 4998U) << "its own";
    cycles(5);
    StateRequest state;
    state.slave = 1;
    state.wanted = AlState::op;
    const Time before = osal.now();
    ASSERT_TRUE(submit(ctx, state));
    EXPECT_EQ(wait(ctx, state).error().code, Errc::timeout) << words(state.error());
    EXPECT_LT(osal.now() - before, 30ms);
}

TEST_F(Startup, ASlaveGoesNoHigherThanItIsAllowed) {
    for (int n = 0; n < 3; ++n) plug_odd({});
    start();
    ctx.slave(1).config.highest = AlState::preop;
    ctx.slave(2).config.highest = AlState::safeop;
    EXPECT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << "all that are to be there";
    EXPECT_EQ(ctx.slave(1).al.state, AlState::preop);
    EXPECT_EQ(ctx.slave(1).image.outputs.bits, 0U) << "it has no place in the image";
    EXPECT_EQ(ctx.slave(2).al.state, AlState::safeop);
    EXPECT_EQ(ctx.slave(3).al.state, AlState::op);
    EXPECT_TRUE(cycle()) << "working counters are right";
    EXPECT_EQ(words(writestate(ctx, 2, AlState::op).error()),
              "slave 2: requesting a state: the slave's configuration allows no such state (OP is above SAFEOP)");
    StateRequest state;
    state.slave = 1;
    state.wanted = AlState::safeop;
    ASSERT_TRUE(submit(ctx, state));
    EXPECT_EQ(wait(ctx, state).error().code, Errc::above_highest);
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(100);
    EXPECT_EQ(ctx.slave(1).al.state, AlState::preop) << "the supervision leaves it there";
    EXPECT_EQ(ctx.slave(2).al.state, AlState::safeop);
    EXPECT_EQ(errors(), std::vector<std::string>());
}

TEST_F(Startup, AMailboxOrCompleteAccessIsLeftAloneWhereTheApplicationSaysSo) {
    plug_odd({});
    plug_odd({});
    static constexpr SlaveConfiguration kNoMailbox{.no_mailbox = true};
    static constexpr SlaveConfiguration kSingly{.no_complete_access = true};
    const ExpectedSlave expected[] = {{.number = 1, .config = &kNoMailbox}, {.number = 2, .config = &kSingly}};
    switch_on();
    ASSERT_TRUE(init(ctx, wire, osal));
    ASSERT_TRUE(expect(ctx, expected));
    expect_kept(config_init(ctx).error(), AlState::preop);
    EXPECT_EQ(at<std::uint16_t>(0, 0x0802), 0U) << "SyncManager 0 has no length";
    EXPECT_FALSE(product(1));
    EXPECT_EQ(*product(2), kProduct);
    std::array<std::byte, 32> whole{};
    const auto before = mailbox_statistics(ctx, 2)->sent;
    const auto read = SDOread(ctx, 2, 0x1018, 0, true, whole, 1s);
    ASSERT_TRUE(read) << words(read.error());
    EXPECT_EQ(*read, 18U);
    EXPECT_EQ(mailbox_statistics(ctx, 2)->sent - before, 5U) << "the count and four values";
}

// ------------------------------------------------------------------ sources that differ

class SourcesDiffer : public Startup {
  protected:
    // The odd device with another SyncManager type in its SII.
    void plug_with_type(unsigned sync_manager, SmType type) {
        auto made = sim::make_device("odd_device").value();
        for (std::size_t at = 0x80; at + 4 <= made.sii.size();) {
            const auto category = load_le<std::uint16_t>(made.sii, at);
            if (category == 41) made.sii[at + 4 + sync_manager * 8 + 7] = static_cast<std::byte>(type);
            if (category == 41 || category == 0xFFFF) break;
            at += 4 + std::size_t{load_le<std::uint16_t>(made.sii, at + 2)} * 2;
        }
        plug(std::move(made));
    }
};

TEST_F(SourcesDiffer, BetweenDictionaryAndSiiIsToldInBitsAndHarmsNobody) {
    plug_odd({"coe_disagrees"});
    plug_odd({});
    start();
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    const auto said = warnings();
    ASSERT_FALSE(said.empty());
    EXPECT_EQ(said[0],
              "slave 1: finding the PDOs at SyncManager 2: sources differ by 64 bits (used: the object dictionary, "
              "128 bits; the SII has 64 bits)");
    for (const auto& line : said) EXPECT_EQ(line.substr(0, 8), "slave 1:") << line;
    EXPECT_EQ(ctx.slave(1).error.code, Errc::none);
    EXPECT_TRUE(is_warning(Errc::sizes_differ));
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(warnings(), std::vector<std::string>()) << "once";
    EXPECT_EQ(errors(), std::vector<std::string>());
}

// Two warnings for each slave overflow the ring of warnings. Errors are still reported.
TEST_F(SourcesDiffer, WarningsTakeNoRoomOfErrors) {
    constexpr std::size_t kSlaves = 40;
    for (std::size_t n = 0; n < kSlaves; ++n) plug_odd({"coe_disagrees"});
    start();
    static constexpr StartupCommand kCommands[] = {write_object(preop_to_safeop, 0x5FFF, 0, std::uint8_t{1})};
    static constexpr SlaveSetup kSetup{.startup = kCommands};
    ctx.slave(kSlaves).config.setup = &kSetup;
    (void)config_map(ctx, image);
    EXPECT_GT(ctx.warnings().count(), 64U);
    EXPECT_EQ(ctx.errors().dropped(), 0U);
    const auto wrong = errors();
    ASSERT_EQ(wrong.size(), 1U);
    EXPECT_EQ(wrong[0].substr(0, 9), "slave 40:") << wrong[0];
}

TEST_F(SourcesDiffer, WhatTheApplicationOrItsFileSaysStandsAndIsCompared) {
    plug_odd({});
    plug_odd({});
    start();
    for (const std::size_t n : {1U, 2U}) {
        ctx.slave(n).config.source = n == 1 ? ConfigurationSource::application : ConfigurationSource::file;
        ctx.slave(n).config.add({2, Direction::outputs, 0x64, 0x1800, 16});
        ctx.slave(n).config.add({3, Direction::inputs, 0x20, 0x1A00, 64});
    }
    map();
    EXPECT_EQ(ctx.slave(1).image.outputs.bits, 16U);
    EXPECT_EQ(ctx.slave(2).image.outputs.bits, 16U);
    const auto said = warnings();
    const std::string told_one =
        "slave 1: finding the PDOs at SyncManager 2: sources differ by 48 bits (used: the application, 16 bits; the "
        "object dictionary has 64 bits)";
    const std::string told_two =
        "slave 2: finding the PDOs at SyncManager 2: sources differ by 48 bits (used: the configuration file, 16 "
        "bits; the object dictionary has 64 bits)";
    EXPECT_EQ(std::ranges::count(said, told_one), 1);
    EXPECT_EQ(std::ranges::count(said, told_two), 1);
}

TEST_F(SourcesDiffer, TypesOfSyncManagersAreCompared) {
    plug_with_type(3, SmType::outputs);
    start();
    map();
    const auto said = warnings();
    ASSERT_FALSE(said.empty());
    EXPECT_EQ(said[0],
              "slave 1: finding the PDOs at SyncManager 3: object 0x1C00 and the SII differ (used: inputs; the other: "
              "outputs)");
    EXPECT_EQ(ctx.slave(1).error.code, Errc::none) << told(1);
    EXPECT_EQ(ctx.slave(1).image.inputs.bits, 64U);
}

TEST_F(SourcesDiffer, AnApplicationThatChoosesByAHookIsNotTold) {
    plug_odd({"coe_disagrees"});
    start();
    ctx.slave(1).hooks.preop_to_safeop = [](HookedSlave, void*) -> Result<> { return Result<>(); };
    map();
    EXPECT_EQ(errors(), std::vector<std::string>());
    EXPECT_EQ(warnings(), std::vector<std::string>());
}

// SoE parameters: written at IP, so that the mapping uses the new telegram, at the other transitions, and again after
// a loss of power.
TEST_F(Startup, ParametersOfDrivesDecideOnTheirTelegramsAndAreReplayed) {
    plug("soe_drive");
    static constexpr std::array kList{std::byte{4},  std::byte{0}, std::byte{4},  std::byte{0},
                                      std::byte{51}, std::byte{0}, std::byte{84}, std::byte{0}};
    static constexpr StartupCommand kCommands[] = {
        write_parameter(init_to_preop, 0, Idn::standard(15), std::uint16_t{2}),
        write_parameter(init_to_preop, 1, Idn::standard(16), kList),
        write_parameter(preop_to_safeop, 1, Idn::standard(32), std::uint16_t{2}),
        execute_parameter(preop_to_safeop, 1, Idn::standard(99)),
        write_parameter(safeop_to_op, 0, Idn::standard(92), std::uint16_t{500}),
    };
    static constexpr SlaveSetup kSetup{.startup = kCommands};
    static constexpr SlaveConfiguration kConfig{.setup = &kSetup};
    const ExpectedSlave expected[] = {{.number = 1, .config = &kConfig}};
    switch_on();
    ASSERT_TRUE(init(ctx, wire, osal));
    ASSERT_TRUE(expect(ctx, expected));
    ASSERT_TRUE(config_init(ctx)) << told(1);
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    EXPECT_EQ(ctx.slave(1).image.inputs.bits, 16U + 32 + 16 + 32 + 16);
    const auto limit = [&] {
        SoeRead request;
        std::array<std::byte, 2> value{};
        request.slave = 1;
        request.idn = Idn::standard(92);
        request.data = value;
        EXPECT_TRUE(submit(ctx, request));
        while (request.busy()) (void)cycle();
        return load_le<std::uint16_t>(value);
    };
    EXPECT_EQ(limit(), 500);
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(5);
    power_comes_back(0);
    EXPECT_EQ(limit(), 500);
}

TEST_F(Startup, WhatADriveRefusesIsNamed) {
    plug("soe_drive");
    plug_odd({});
    start();
    const auto says = [&](const StartupCommand& command) {
        const StartupCommand list[] = {command};
        return wrong_with(list);
    };
    EXPECT_EQ(
        says(write_parameter(preop_to_safeop, 1, Idn::standard(32), std::uint16_t{9})),
        "slave 1: command at PS (no. 1, S-0-0032, drive 1): the drive refused (error code 0x7007: value above the "
        "maximum)");
    EXPECT_EQ(says(execute_parameter(preop_to_safeop, 0, Idn::standard(148))),
              "slave 1: command at PS (no. 1, S-0-0148, drive 0): the drive refused (error code 0x7012: the command "
              "cannot be executed at this time)");
    EXPECT_EQ(says(write_parameter(preop_to_safeop, 8, Idn::product(1), std::uint32_t{9})),
              "slave 1: command at PS (no. 1, P-0-0001, drive 8): argument out of range: a slave has drives 0 to 7");
    facts(ctx.slave(1)).mailbox.protocols = 0;
    EXPECT_EQ(says(write_parameter(preop_to_safeop, 0, Idn::product(1), std::uint32_t{9})),
              "slave 1: command at PS (no. 1, P-0-0001, drive 0): not supported by the slave");
}

}  // namespace
}  // namespace margay
