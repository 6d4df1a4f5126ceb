// config_map() refuses settings that no slave and no image can have, and the error names them.
#include "process_data/plant.hpp"

#include <functional>

namespace margay {
namespace {

using namespace std::chrono_literals;

// A line of two slaves with 8 bits of outputs and of inputs each, without mailboxes.
class Settings : public testing::Test, protected Plant {
  protected:
    SlaveSetup setup;
    StartupCommand command;

    void SetUp() override {
        ASSERT_TRUE(segment.connect_master({make({.product = 0x100}), 0}));
        ASSERT_TRUE(segment.connect({0, 1}, {make({.product = 0x101}), 0}));
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, osal);
        limits.groups = 2;
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *nic, osal).ok());
        ASSERT_TRUE(config_init(*ctx).ok());
    }
    static std::string words(const Error& error) {
        std::array<char, 400> buffer{};
        return std::string(describe(error, buffer));
    }
    // Returns the error of config_map() with a setting of slave 2 or of the group that `set` changes. The error is in
    // errors(), too.
    std::string map_with(const std::function<void(SlaveConfiguration&, GroupConfiguration&)>& set) {
        const SlaveConfiguration slave = ctx->slave(2).config;
        const GroupConfiguration group = ctx->group(0).config;
        setup = {};
        command = {};
        set(ctx->slave(2).config, ctx->group(0).config);
        while (ctx->errors().take()) {
        }
        (void)clear_error(*ctx, 0);
        const auto mapped = config_map(*ctx, image);
        const auto kept = ctx->errors().take();
        EXPECT_TRUE(kept.has_value() && *kept == mapped.error()) << words(mapped.error());
        if (mapped.error().slave == 2) {
            EXPECT_EQ(ctx->slave(2).error, mapped.error());
            EXPECT_TRUE(ctx->group(0).mapped) << "slave 1 can be exchanged";
            EXPECT_EQ(ctx->slave(1).al.state, AlState::safeop);
            EXPECT_EQ(ctx->slave(2).al.state, AlState::preop);
        }
        ctx->slave(2).config = slave;
        ctx->group(0).config = group;
        EXPECT_TRUE(config_map(*ctx, image).ok());
        return words(mapped.error());
    }
    std::string map_with_setup(const std::function<void(SlaveSetup&)>& set) {
        return map_with([&](SlaveConfiguration& slave, GroupConfiguration&) {
            set(setup);
            slave.setup = &setup;
        });
    }
    std::string map_with_command(StartupCommand wrong) {
        return map_with_setup([&, wrong](SlaveSetup& s) {
            command = wrong;
            s.startup = Borrowed<StartupCommand>(&command, 1);
        });
    }
};

constexpr auto kMapping = "slave 2: mapping process data: argument out of range: ";

TEST_F(Settings, OfASlaveThatNoSlaveCanHave) {
    const auto slave = [&](auto set) {
        return map_with([&](SlaveConfiguration& config, GroupConfiguration&) { set(config); });
    };
    const std::string at = kMapping;
    EXPECT_EQ(slave([](auto& c) {
                  c.source = ConfigurationSource::application;
                  c.add({0, static_cast<Direction>(7), 0x64, 0x1100, 8});
              }),
              at + "ProcessSm::direction is no Direction");
    EXPECT_EQ(slave([](auto& c) { c.source = static_cast<ConfigurationSource>(77); }),
              at + "SlaveConfiguration::source is no ConfigurationSource");
    for (const auto state : {AlState::init, AlState::boot, static_cast<AlState>(9)})
        EXPECT_EQ(slave([state](auto& c) { c.highest = state; }),
                  at + "SlaveConfiguration::highest must be PREOP, SAFEOP or OP");
    EXPECT_EQ(slave([](auto& c) { c.process_data_watchdog = 6554ms; }),
              at + "process_data_watchdog must be at most 65535 units of the divider");
}

// config_map() has refused the value, and reach() fails with it, too.
TEST_F(Settings, AHighestStateThatIsNoneIsRefusedByReach) {
    ASSERT_TRUE(config_map(*ctx, image).ok());
    for (const auto state : {AlState::init, AlState::boot, static_cast<AlState>(9)}) {
        ctx->slave(2).config.highest = state;
        const Time before = osal.now();
        const auto reached = reach(*ctx, AlState::op, 20s);
        EXPECT_EQ(words(reached.error()),
                  "slave 2: mapping process data: argument out of range: "
                  "SlaveConfiguration::highest must be PREOP, SAFEOP or OP");
        EXPECT_LT(osal.now() - before, 5s) << "waiting does not help";
        EXPECT_FALSE(all_right(*ctx));
    }
    ctx->slave(2).config.highest = AlState::op;
    EXPECT_TRUE(reach(*ctx, AlState::op, 2s).ok());
}

TEST_F(Settings, AListForASyncManagerThatDoesNotExistIsReportedOnce) {
    static constexpr PdoEntry kEntries[] = {{0x7000, 1, 8}};
    static constexpr Pdo kPdos[] = {{0x1600, kEntries}};
    static constexpr SmPdos kNinetyNine[] = {{99, kPdos}};
    const std::string text = map_with_setup([](SlaveSetup& s) { s.pdos = kNinetyNine; });
    EXPECT_EQ(text,
              "slave 2: configuring PDOs of SyncManager 99: the slave has no such SyncManager (needed 100, there is "
              "room for 2)");
    EXPECT_TRUE(errors().empty()) << joined(errors());
}

TEST_F(Settings, OneSyncManagerTwice) {
    SlaveConfiguration& config = ctx->slave(2).config;
    (void)config.add({.number = 2, .start = 0x1100, .bits = 8});
    (void)config.add({.number = 2, .start = 0x1200, .bits = 8});
    config.source = ConfigurationSource::application;
    EXPECT_EQ(words(config_map(*ctx, image).error()),
              "slave 2: mapping process data at SyncManager 2: argument out of range: SlaveConfiguration::sms has this "
              "SyncManager twice");
}

TEST_F(Settings, OfASetupThatNoSlaveCanHave) {
    const std::string at = kMapping;
    EXPECT_EQ(map_with_setup([](SlaveSetup& s) { s.times.pdi_watchdog = 10s; }),
              at + "SlaveTimes::pdi_watchdog must be zero to 65535 units of the divider");
    EXPECT_EQ(map_with_setup([](SlaveSetup& s) { s.times.pdi_watchdog = -1ms; }),
              at + "SlaveTimes::pdi_watchdog must be zero to 65535 units of the divider");
    for (const auto time : {&SlaveTimes::to_preop, &SlaveTimes::to_safeop, &SlaveTimes::to_op, &SlaveTimes::down})
        EXPECT_EQ(map_with_setup([time](SlaveSetup& s) { s.times.*time = -1s; }),
                  at + "the times of SlaveTimes must not be negative");
    EXPECT_EQ(map_with_setup([](SlaveSetup& s) { s.times.mailbox = -1s; }),
              at + "SlaveTimes::mailbox must not be negative");
}

TEST_F(Settings, OfACommandThatIsNeverExecuted) {
    const std::string at = kMapping;
    const StartupCommand right = write_register(Transition::preop_to_safeop, 0x0F80, std::uint8_t{1});
    EXPECT_EQ(map_with_command(StartupCommand{}),
              at + "no. 1 of the start-up commands has no transition, or an unknown one");
    EXPECT_EQ(
        map_with_command(right.within(-1ms)),
        "slave 2: command at PS (no. 1, register 0x0f80): argument out of range: the timeout of a start-up command "
        "must not be negative");
    StartupCommand empty = right;
    empty.length = 0;
    EXPECT_EQ(
        map_with_command(empty),
        "slave 2: command at PS (no. 1, register 0x0f80): argument out of range: the value of the start-up command "
        "has a size that the command cannot have");
    StartupCommand other = right;
    other.transitions = static_cast<Transition>(0x800);
    EXPECT_EQ(map_with_command(other), at + "no. 1 of the start-up commands has no transition, or an unknown one");
    const std::string command_1 = "slave 2: command at PS (no. 1, register 0x0f80): argument out of range: ";
    const std::string unknown = "the kind or the moment of a start-up command is no known one";
    other = right;
    other.moment = static_cast<Moment>(7);
    EXPECT_EQ(map_with_command(other), command_1 + unknown);
    other = right;
    other.kind = static_cast<StartupCommand::Kind>(77);
    EXPECT_NE(map_with_command(other).find(unknown), std::string::npos) << map_with_command(other);
    EXPECT_EQ(map_with_command(write_register(Transition::preop_to_safeop, 0xFFFF, std::uint16_t{1})),
              "slave 2: command at PS (no. 1, register 0xffff): argument out of range: 1 to 1486 octets, and none "
              "beyond register 0xffff");
    other = write_object(Transition::preop_to_safeop, 0x6060, 5, std::uint8_t{1});
    other.complete_access = true;
    EXPECT_EQ(map_with_command(other),
              "slave 2: command at PS (no. 1, object 0x6060:5): argument out of range: a complete access begins at "
              "subindex 0 or 1");
}

// A divider makes longer times possible.
TEST_F(Settings, LongWatchdogsNeedADivider) {
    setup.times.watchdog_divider = 24998;  // 1 ms
    setup.times.pdi_watchdog = 65s;
    ctx->slave(2).config.setup = &setup;
    ctx->slave(2).config.process_data_watchdog = 65s;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    auto& esc = segment.slave(1);
    EXPECT_EQ(esc.registers().get<std::uint16_t>(0x0410), 65000);
    EXPECT_EQ(esc.registers().get<std::uint16_t>(0x0420), 65000);
}

TEST_F(Settings, OfAGroup) {
    const auto group = [&](auto set) {
        return map_with([&](SlaveConfiguration&, GroupConfiguration& config) { set(config); });
    };
    const std::string at = "mapping process data: argument out of range: GroupConfiguration::";
    for (const std::uint8_t cycles : {std::uint8_t{0}, std::uint8_t{5}})
        EXPECT_EQ(group([cycles](auto& c) { c.cycles_in_flight = cycles; }), at + "cycles_in_flight must be 1 to 4");
    EXPECT_EQ(group([](auto& c) { c.reserve_bytes = 1490; }), at + "reserve_bytes leaves no space in the frame");
    EXPECT_EQ(group([](auto& c) { c.start = LogicalAddress{0xFFFFFFFF}; }),
              at + "start: the image overlaps another one, or ends above 0xffffffff");
    static constexpr SlaveToSlave kNothing[] = {{.from_slave = 1, .to_slave = 2, .bits = 0}};
    EXPECT_EQ(group([](auto& c) { c.copies = kNothing; }),
              "slave 1: mapping process data: argument out of range: GroupConfiguration::copies: at least 1 bit, and "
              "only bits of the slave's data in this group");
    EXPECT_EQ(group([](auto& c) { c.packing = static_cast<Packing>(9); }), at + "packing is no Packing");
    EXPECT_EQ(group([](auto& c) { c.lost_inputs = static_cast<LostInputs>(9); }), at + "lost_inputs is no LostInputs");
    static constexpr EntryHandle* kNull[] = {nullptr};
    EXPECT_EQ(group([](auto& c) { c.entries = kNull; }), at + "entries has a null pointer");
    EXPECT_EQ(words(config_map(*ctx, std::span(image).subspan(32), 1).error()),
              "mapping process data: argument out of range: no slave has group 1 in SlaveConfiguration::group");
    ctx->group(1).config.al_status = true;
    EXPECT_TRUE(config_map(*ctx, std::span(image).subspan(32), 1).ok()) << "a group for readings needs no slave";
}

TEST_F(Settings, ANegativeTimeoutDoesNotEndTheCycle) {
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    ASSERT_TRUE(send_processdata(*ctx).ok());
    EXPECT_EQ(words(receive_processdata(*ctx, -1ms).error()),
              "exchanging process data: argument out of range: the timeout must not be negative");
    EXPECT_EQ(*receive_processdata(*ctx, 500us), 6U);
}

// config_map() executes commands of IP that were set after the scan, so it reports a wrong command now and not when the
// slave comes back.
TEST_F(Settings, LateCommandsOfIpAreExecuted) {
    static constexpr StartupCommand kRight[] = {write_register(Transition::init_to_preop, 0x0F80, std::uint8_t{0x5A})};
    setup.startup = kRight;
    ctx->slave(2).config.setup = &setup;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(segment.slave(1).registers().get<std::uint8_t>(0x0F80), 0x5A);
    segment.slave(1).write(0x0F80, std::array{std::byte{0}});
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(segment.slave(1).registers().get<std::uint8_t>(0x0F80), 0) << "executed once";
    // The list is at the same address, with another value and with one more command.
    StartupCommand list[] = {kRight[0], write_register(Transition::init_to_preop, 0x0F82, std::uint8_t{0x66})};
    setup.startup = Borrowed<StartupCommand>(list, 1);
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(segment.slave(1).registers().get<std::uint8_t>(0x0F80), 0) << "the same commands in another list";
    list[0].value[0] = std::byte{0x33};
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(segment.slave(1).registers().get<std::uint8_t>(0x0F80), 0x33);
    setup.startup = list;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(segment.slave(1).registers().get<std::uint8_t>(0x0F82), 0x66);
    static constexpr StartupCommand kWrong[] = {write_object(Transition::init_to_preop, 0x5555, 1, std::uint8_t{1})};
    SlaveSetup other{.startup = kWrong};
    ctx->slave(2).config.setup = &other;
    EXPECT_EQ(words(config_map(*ctx, image).error()),
              "slave 2: command at IP (no. 1, object 0x5555:1): not supported by the slave");
}

}  // namespace
}  // namespace margay
