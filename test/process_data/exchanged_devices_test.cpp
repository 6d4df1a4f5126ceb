// Devices that are exchanged while nothing reads the states, while a mapping is executed, or for another revision.
// Also: the freshness of inputs after very many cycles, and slaves whose state falls during a mapping.
#include "mailbox/mailbox_bus.hpp"
#include "process_data/identities.hpp"
#include "sim/library/library.hpp"

#include <margay/hooked_slave.hpp>

namespace margay {
namespace {

// Each test calls build(), because some tests need other settings.
struct ExchangedDevices : Identities {
    void SetUp() override {}
};

// The application lowers all slaves for a change of tools, and raises them again. Each call returns success.
struct TakenDown : ExchangedDevices, testing::WithParamInterface<AlState> {};
TEST_P(TakenDown, AToolThatWasChangedWhileTheSlavesWereDownGetsNoOutputs) {
    build();
    const AlState down = GetParam();
    ASSERT_TRUE(writestate(*ctx, 0, down).ok());
    ASSERT_EQ(statecheck(*ctx, 0, down, 1s)->state, down);
    take_out(line[1]);
    osal.advance(1s);
    set(tool, 0x0010, 0x1002);  // the tool was in this place before, and has its own power supply
    if (down == AlState::preop) set(tool, 0x0120, 2);
    settle_devices();
    ASSERT_EQ(state_of(tool), static_cast<int>(down));
    put_in(tool);
    osal.advance(1s);
    bool refused = false;
    const auto check = [&](const char*, const Error& error) {
        if (error.code == Errc::none) return;
        refused = true;
    };
    check("writestate PREOP", writestate(*ctx, 0, AlState::preop).error());
    const auto preop = statecheck(*ctx, 0, AlState::preop, 1s);
    check("statecheck PREOP", preop.error());
    check("config_map", config_map(*ctx, image).error());
    cycles(5);
    check("writestate OP", writestate(*ctx, 0, AlState::op).error());
    for (int n = 0; n < 200; ++n) (void)cycle();
    const auto op = statecheck(*ctx, 0, AlState::op, 0s);
    check("statecheck OP", op.error());
    const auto wkc = cycle();
    check("cycle", wkc.error());
    EXPECT_TRUE(refused) << "every call says success";
    EXPECT_FALSE(gets_outputs(tool)) << "another product than the expected one is driven";
}
INSTANTIATE_TEST_SUITE_P(States, TakenDown, testing::Values(AlState::init, AlState::preop));

// Without a list, the library wants the slaves that the scan has found. A slave comes back with another revision.
// Before it is mapped again, a device of another product takes its place.
TEST_F(ExchangedDevices, AfterAnotherRevisionAnotherProductIsStillAnotherSlave) {
    listed = false;
    build();
    const auto revised = make_of_revision(0x101, 2);
    take_out(line[1]);
    cycles(10);
    segment.set_power(revised, true, osal.now());
    put_in(revised);
    cycles(10);
    ASSERT_TRUE(recover_slave(*ctx, 2).ok());
    EXPECT_EQ(ctx->slave(2).identity.revision, 2U);
    take_out(revised);
    cycles(10);
    segment.set_power(tool, true, osal.now());
    put_in(tool);
    cycles(10);
    const auto again = recover_slave(*ctx, 2);
    EXPECT_EQ(again.error().code, Errc::other_slave) << "product 0x200 is taken for slave 2, of product 0x101";
    const auto mapped = config_map(*ctx, image);
    EXPECT_FALSE(mapped.ok());
    (void)reach(*ctx, AlState::op, 2s);
    EXPECT_FALSE(gets_outputs(tool));
}
// The same with the supervision.
TEST_F(ExchangedDevices, AfterAnotherRevisionTheSupervisionKnowsAnotherProduct) {
    listed = false;
    build();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    cycles(10);
    const auto revised = make_of_revision(0x101, 2);
    take_out(line[1]);
    cycles(500);
    segment.set_power(revised, true, osal.now());
    put_in(revised);
    ASSERT_TRUE(until([&] { return ctx->slave(2).identity.revision == 2U; }));
    take_out(revised);
    cycles(500);
    segment.set_power(tool, true, osal.now());
    put_in(tool);
    cycles(2000);
    (void)config_map(*ctx, image);
    cycles(2000);
    EXPECT_FALSE(gets_outputs(tool));
    EXPECT_FALSE(all_right(*ctx));
}

// 2^31 cycles after a slave has joined: 25 days at 1 ms, 2.5 days at 100 us.
TEST_F(ExchangedDevices, InputsStayFreshAfterManyCycles) {
    build();
    cycles(5);
    ASSERT_TRUE(inputs_fresh(*ctx, 2));
    const_cast<Group&>(ctx->group(0)).cycles_sent += 0x7FFF'FFF0;  // the time passes
    for (int n = 0; n < 40; ++n) {
        ASSERT_TRUE(cycle().ok());
        ASSERT_TRUE(inputs_fresh(*ctx, 2)) << "cycle " << ctx->group(0).cycle_received;
    }
}
TEST_F(ExchangedDevices, InputsAreFreshInTheCycleOfTheWrap) {
    build();
    cycles(5);
    ASSERT_TRUE(inputs_fresh(*ctx, 2));
    // A slave joins late, so that only the wrap to 0 is tested.
    for (auto n : {0x7000'0000U, 0x7000'0000U, 0x1FFF'FFF0U - 10U}) {
        const_cast<Group&>(ctx->group(0)).cycles_sent += n;
        (void)reconfigure_slave(*ctx, 2);
        (void)writestate(*ctx, 2, AlState::op);
        cycles(3);
    }
    for (int n = 0; n < 40; ++n) {
        (void)cycle();
        ASSERT_TRUE(inputs_fresh(*ctx, 2)) << "cycle " << ctx->group(0).cycle_received;
    }
}

// A slave falls to INIT while config_map() is executed, and a reading of the states finds this.
TEST_F(ExchangedDevices, AMappingNamesASlaveThatHasFallenMeanwhile) {
    build();
    ASSERT_TRUE(writestate(*ctx, 0, AlState::preop).ok());
    ASSERT_EQ(statecheck(*ctx, 0, AlState::preop, 1s)->state, AlState::preop);
    ctx->slave(1).hooks.preop_to_safeop = [](HookedSlave slave, void*) -> Task<> {
        co_return co_await slave.sleep(100ms);
    };
    MapRequest map;
    map.image = image;
    ASSERT_TRUE(submit(*ctx, map).ok());
    for (int n = 0; n < 20; ++n) {
        osal.advance(1ms);
        (void)poll(*ctx, osal.now());
    }
    ASSERT_TRUE(map.busy());
    set(line[1], 0x0120, 1);  // without a request: a reset of its program
    for (int n = 0; n < 5; ++n) {
        osal.advance(1ms);
        segment.reconsider();
        segment.advance(osal.now());
        (void)poll(*ctx, osal.now());
    }
    ASSERT_EQ(state_of(line[1]), 1);
    ReadStateRequest look;
    ASSERT_TRUE(submit(*ctx, look).ok());
    for (int n = 0; n < 2000 && map.busy(); ++n) {
        osal.advance(1ms);
        (void)poll(*ctx, osal.now());
    }
    ASSERT_FALSE(map.busy());
    EXPECT_TRUE(map.error().code != Errc::none || state_of(line[1]) == 4) << "success, but slave 2 was left out";
}

// The cable is moved to a second machine with the same program: same addresses, same FMMUs, other products. The first
// attempt to read the identity fails because the EEPROM is busy. A lost frame has the same effect.
TEST_F(ExchangedDevices, ASlaveThatCouldNotBeProvedIsNotBroughtToOp) {
    build();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    std::vector<std::uint32_t> other;
    for (unsigned n = 0; n < 3; ++n) other.push_back(make({.product = 0x300 + n}));
    for (const auto d : other) segment.set_power(d, true, osal.now());
    ASSERT_TRUE(segment.connect({other[0], 1}, {other[1], 0}));
    ASSERT_TRUE(segment.connect({other[1], 1}, {other[2], 0}));
    osal.advance(10ms);
    for (unsigned n = 0; n < 3; ++n) {
        auto& there = segment.slave(other[n]);
        (void)there.ecat_write(0x0600, segment.slave(line[n]).peek(0x0600, 0x30), osal.now());
        for (std::uint16_t sm = 0x0800; sm < 0x0820; sm += 8)
            (void)there.ecat_write(sm, segment.slave(line[n]).peek(sm, 8), osal.now());
        set(other[n], 0x0010, static_cast<std::uint16_t>(0x1001 + n));
        for (const std::uint16_t state : {std::uint16_t{2}, std::uint16_t{4}}) {
            set(other[n], 0x0120, state);
            settle_devices();
        }
        there.sii().fail_next(1000);
    }
    (void)events();
    segment.disconnect({line[0], 0});
    cycles(1'000);
    for (unsigned n = 0; n < 3; ++n) ASSERT_EQ(state_of(other[n]), 4) << n;
    ASSERT_TRUE(segment.connect_master({other[0], 0}));
    segment.disconnect({other[2], 1});  // so that the segment updates its ports after the change of cables
    int op = 0;
    bool outputs = false;
    int said_right = 0;
    for (int n = 0; n < 2'000; ++n) {
        for (const Slave& slave : ctx->slaves())
            std::ranges::fill(slave.image.outputs.bytes, static_cast<std::byte>(0xA0 + slave.number));
        (void)cycle();
        op += state_of(other[1]) == 8 ? 1 : 0;
        outputs |= program(other[1]).outputs()[0] == std::byte{0xA2};
        said_right += all_right(*ctx) ? 1 : 0;
    }
    EXPECT_EQ(op, 0) << "cycles in which product 0x301 was in OP in place of product 0x101";
    EXPECT_EQ(said_right, 0) << "cycles in which all_right() was true";
    EXPECT_FALSE(outputs) << "product 0x301 got the outputs of slave 2";
}

// The application has ended its supervision and brings slaves back with requests.
TEST_F(ExchangedDevices, RecoverSaysOtherSlaveAlsoAfterASupervision) {
    build();
    for (const bool before : {false, true}) {
        if (before) {
            ASSERT_TRUE(submit(*ctx, supervision).ok());
            cycles(100);
            supervision.cancel();
        }
        take_out(line[1]);
        cycles(10);
        segment.set_power(tool, false, osal.now());
        segment.set_power(tool, true, osal.now());
        put_in(tool);
        cycles(10);
        EXPECT_EQ(recover_slave(*ctx, 2).error().code, Errc::other_slave) << "supervised before: " << before;
        take_out(tool);
        put_in(line[1]);
        cycles(10);
        EXPECT_TRUE(recover_slave(*ctx, 2).ok());
        EXPECT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    }
}

// The library does not read the identity of a slave in BOOT, because its firmware may use the EEPROM.
TEST(ExchangedDevicesInBoot, RecoverDoesNotUseTheEepromOfASlaveInBoot) {
    MailboxBus bus;
    bus.add_device(sim::make_device("digital_io_16").value());
    bus.add_device(sim::make_device("bootloader").value());
    bus.start();
    ASSERT_TRUE(writestate(*bus.ctx, 2, AlState::boot).ok());
    ASSERT_EQ(statecheck(*bus.ctx, 2, AlState::boot, 2s)->state, AlState::boot);
    bus.segment.disconnect({1, 0});
    bus.osal.advance(10ms);
    (void)readstate(*bus.ctx);
    ASSERT_EQ(bus.ctx->slave(2).al.state, AlState::none);
    ASSERT_TRUE(bus.segment.connect({0, 1}, {1, 0}));
    bus.osal.advance(10ms);
    (void)readstate(*bus.ctx);
    ASSERT_EQ(bus.ctx->slave(2).al.state, AlState::boot);
    bus.segment.slave(1).sii().fail_next(100'000);  // shows which request uses the EEPROM
    const auto done = recover_slave(*bus.ctx, 0);
    EXPECT_NE(done.error().step, Step::read_sii) << "the EEPROM was taken from the firmware";
}

// While a mapping waits for the hook of slave 1, the tool of slave 2 is exchanged. A supervision is active.
TEST_F(ExchangedDevices, AToolThatWasChangedDuringAMappingGetsNoOutputs) {
    build();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(reach(*ctx, AlState::preop, 2s).ok());
    ASSERT_TRUE(supervision.busy());
    ctx->slave(1).hooks.preop_to_safeop = [](HookedSlave slave, void*) -> Task<> {
        co_return co_await slave.sleep(8s);
    };
    set(tool, 0x0010, 0x1002);
    set(tool, 0x0120, 2);
    settle_devices();
    ASSERT_EQ(state_of(tool), 2);
    (void)events();
    MapRequest map;
    map.image = image;
    ASSERT_TRUE(submit(*ctx, map).ok());
    const auto go = [&](int ms) {
        for (int n = 0; n < ms; ++n) {
            osal.advance(1ms);
            (void)poll(*ctx, osal.now());
        }
    };
    go(500);
    take_out(line[1]);
    go(3'000);
    put_in(tool);
    for (int n = 0; n < 20 && map.busy(); ++n) go(1'000);
    ASSERT_FALSE(map.busy());
    const auto reached = reach(*ctx, AlState::op, 20s);
    EXPECT_FALSE(map.error().code == Errc::none && reached.ok()) << "all_right: " << all_right(*ctx);
    EXPECT_FALSE(gets_outputs(tool));
}

// A device of the kind of slave 3 is at a free port and is reported as a stranger. Slave 3 is unplugged, and the
// stranger does not get the outputs of slave 3. At the port of slave 3 the device is a spare part.
TEST_F(ExchangedDevices, AStrangerIsNotTakenForASlaveThatIsLostLater) {
    build();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    const auto stranger = make({.product = 0x102});
    segment.set_power(stranger, true, osal.now());
    ASSERT_TRUE(segment.connect({line[1], 2}, {stranger, 0}));
    cycles(2'000);
    EXPECT_EQ(told(events(), "product 0x00000102"), 1);
    take_out(line[2]);
    EXPECT_FALSE(gets_outputs(stranger));
    expect_no_outputs(stranger);
    segment.disconnect({stranger, 0});
    cycles(100);
    ASSERT_TRUE(segment.connect({line[1], 1}, {stranger, 0}));
    EXPECT_TRUE(until([&] { return in_op(3); })) << joined(events());
}

// A long time passes between the scan and the mapping. The mapping compares the slaves and does not start them again.
TEST_F(ExchangedDevices, HealthySlavesAreNotStartedAgainByALateMapping) {
    build();
    ASSERT_TRUE(config_init(*ctx).ok());
    int starts = 0;
    for (std::size_t n = 1; n <= 3; ++n) {
        ctx->slave(n).hooks.user = &starts;
        ctx->slave(n).hooks.transition = [](HookedSlave, Transition which, Moment, void* user) -> Result<> {
            *static_cast<int*>(user) += which == Transition::init_to_preop ? 1 : 0;
            return {};
        };
    }
    osal.advance(3s);
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(starts, 0);
    EXPECT_TRUE(reach(*ctx, AlState::op, 5s).ok());
}

// Nothing has read the slaves for two seconds. Then the tool is in the place of slave 2, with the station address of
// slave 2 and in OP.
struct AfterAPause : ExchangedDevices {
    void SetUp() override {
        build();
        take_out(line[1]);
        osal.advance(1s);
        set(tool, 0x0010, 0x1002);
        for (const std::uint16_t state : {std::uint16_t{1}, std::uint16_t{2}}) {
            set(tool, 0x0120, state);
            settle_devices();
        }
        put_in(tool);
        osal.advance(1s);
    }
};
TEST_F(AfterAPause, RecoverSlaveComparesItsIdentity) {
    EXPECT_EQ(recover_slave(*ctx, 2).error().code, Errc::other_slave);
    EXPECT_FALSE(gets_outputs(tool));
}
TEST_F(AfterAPause, RecoverSlaveSaysThatTheSiiCannotBeRead) {
    segment.slave(tool).sii().fail_next(1'000'000);
    const auto recovered = recover_slave(*ctx, 2);
    EXPECT_FALSE(recovered.ok());
    EXPECT_FALSE(gets_outputs(tool));
}
TEST_F(AfterAPause, TheSupervisionReportsThatTheSiiCannotBeRead) {
    segment.slave(tool).sii().fail_next(1'000'000);
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    cycles(500);
    EXPECT_EQ(what_is_wrong(*ctx).slave, 2U) << in_words(what_is_wrong(*ctx));
    const auto said = events();
    EXPECT_EQ(told(said, "recovery failed: slave 2"), 1) << joined(said) << joined(errors());
}

// A register that the application writes must not reach the device that now has the address of a lost slave.
TEST_F(ExchangedDevices, NoRegisterOfASlaveThatWasAwayIsWritten) {
    build();
    take_out(line[1]);
    for (int n = 0; n < 20; ++n) {
        (void)cycle();
        (void)readstate(*ctx);
    }
    set(tool, 0x0010, 0x1002);
    put_in(tool);
    segment.slave(tool).sii().fail_next(1'000'000);
    EXPECT_FALSE(readstate(*ctx).ok()) << "its identity cannot be read";
    const auto unread = write_register(*ctx, 2, 0x0F80, std::uint16_t{0x1234});
    EXPECT_EQ(unread.error().code, Errc::identity_unread) << in_words(unread.error());
    segment.slave(tool).sii().fail_next(0);
    EXPECT_EQ(readstate(*ctx).error().code, Errc::other_slave);
    const auto written = write_register(*ctx, 2, 0x0F80, std::uint16_t{0x1234});
    EXPECT_EQ(written.error().code, Errc::missing_slave) << in_words(written.error());
    EXPECT_EQ(segment.slave(tool).peek(0x0F80, 2)[0], std::byte{0});
}

TEST_F(ExchangedDevices, ATargetOfTheSupervisionThatDoesNotExistIsAnError) {
    build();
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    cycles(100);
    (void)errors();
    supervision.target = static_cast<AlState>(6);
    cycles(100);
    const auto said = errors();
    EXPECT_EQ(told(said, "supervising"), 1) << joined(said);
    EXPECT_TRUE(all_right(*ctx)) << in_words(what_is_wrong(*ctx));
    supervision.target = AlState::preop;
    EXPECT_TRUE(until([&] { return ctx->slave(1).al.state == AlState::preop; }));
}

// Three slaves are expected, and a tool is connected behind them. When the tool is removed, the segment agrees with the
// list.
struct TheToolIsTakenOut : ExchangedDevices, testing::WithParamInterface<bool> {};
TEST_P(TheToolIsTakenOut, AndNothingIsMissing) {
    build();
    power(tool, true);
    ASSERT_TRUE(segment.connect({line[2], 1}, {tool, 0}));
    EXPECT_EQ(bring_up(wanted).size(), 1U);
    EXPECT_EQ(config_map(*ctx, image).error().code, Errc::unexpected_slave);
    if (GetParam()) {
        ASSERT_TRUE(submit(*ctx, supervision).ok());
    }
    cycles(1000);
    segment.disconnect({tool, 0});
    for (int n = 0; n < 100; ++n) {
        cycles(10);
        if (!GetParam()) (void)readstate(*ctx);
    }
    const auto mapped = config_map(*ctx, image);
    EXPECT_TRUE(mapped.ok()) << in_words(mapped.error());
    const auto reached = reach(*ctx, AlState::op, 5s);
    EXPECT_TRUE(reached.ok()) << in_words(reached.error());
    cycles(5);
    (void)readstate(*ctx);
    EXPECT_TRUE(all_right(*ctx)) << in_words(what_is_wrong(*ctx));
}
INSTANTIATE_TEST_SUITE_P(Supervised, TheToolIsTakenOut, testing::Bool());

// Another slave that stays in PREOP hides in the OR of all states that a slave falls to PREOP. `retry` does not matter.
TEST_F(ExchangedDevices, AFallIsSeenBesideASlaveThatStaysInTheSameState) {
    build();
    ctx->slave(3).config.highest = AlState::preop;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    supervision.retry = 20s;
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(until([&] { return all_right(*ctx); })) << in_words(what_is_wrong(*ctx));
    cycles(700);
    set(line[1], 0x0120, 2);
    int right = 0;
    for (int n = 0; n < 1000; ++n) {
        (void)cycle();
        right += state_of(line[1]) == 2 && all_right(*ctx) ? 1 : 0;
    }
    EXPECT_LT(right, 20);
    EXPECT_TRUE(all_right(*ctx)) << in_words(what_is_wrong(*ctx));
}

// The list has no slave 3. A device that later comes to this place is not a slave of the list.
struct LeftOutNumber : ExchangedDevices, testing::WithParamInterface<bool> {};
TEST_P(LeftOutNumber, IsNobodyAndIsNotDriven) {
    for (unsigned n = 0; n < 3; ++n) line.push_back(make({.product = 0x100 + n}));
    tool = make({.product = 0x103});
    ASSERT_TRUE(segment.connect_master({line[0], 0}));
    ASSERT_TRUE(segment.connect({line[0], 1}, {line[1], 0}));
    ASSERT_TRUE(segment.connect({line[1], 1}, {tool, 0}));
    ASSERT_TRUE(segment.connect({tool, 1}, {line[2], 0}));
    segment.power_up(osal.now());
    for (const auto device : {line[1], tool, line[2]}) power(device, false);
    const std::vector<ExpectedSlave> list{
        {.number = 1, .product = 0x100}, {.number = 2, .product = 0x101}, {.number = 4, .product = 0x102}};
    nic = std::make_unique<SimulatedNic>(segment, osal);
    ctx = std::make_unique<HostContext>(limits);
    ASSERT_TRUE(init(*ctx, *nic, osal).ok());
    ASSERT_TRUE(expect(*ctx, Borrowed<ExpectedSlave>(std::span<const ExpectedSlave>(list))).ok());
    EXPECT_EQ(config_init(*ctx).error().code, Errc::missing_slave);
    (void)config_map(*ctx, image);
    if (GetParam()) {
        ASSERT_TRUE(submit(*ctx, supervision).ok());
    }
    for (const auto device : {line[1], tool, line[2]}) power(device, true);
    for (int n = 0; n < 2000; ++n) {
        osal.advance(1ms);
        (void)poll(*ctx, osal.now());
    }
    if (!GetParam()) {
        (void)recover_slave(*ctx, 0);
        for (std::uint16_t n = 1; n <= 4; ++n) (void)reconfigure_slave(*ctx, n);
    }
    EXPECT_FALSE(config_map(*ctx, image).ok());
    EXPECT_FALSE(reach(*ctx, AlState::op, 5s).ok());
    EXPECT_FALSE(gets_outputs(tool));
    EXPECT_FALSE(all_right(*ctx));
}
INSTANTIATE_TEST_SUITE_P(Supervised, LeftOutNumber, testing::Bool());

// The EEPROM of a device has a configuration area and a blank identity. The scan and the comparison read the same
// identity.
TEST(BlankIdentity, IsMappedAndDriven) {
    Plant plant;
    auto octets = io_image(8, 8, {.product = 0x100});
    std::fill_n(octets.begin() + 16, 16, std::byte{0xFF});
    auto made = sim::device_from_sii(octets);
    made.chip = sim::junction();
    const auto device = plant.segment.add(std::move(made).assemble());
    ASSERT_TRUE(plant.segment.connect_master({device, 0}));
    (void)plant.bring_up({});
    const auto mapped = config_map(*plant.ctx, plant.image);
    EXPECT_TRUE(mapped.ok()) << in_words(mapped.error());
    EXPECT_TRUE(reach(*plant.ctx, AlState::op, 5s).ok());
}

}  // namespace
}  // namespace margay
