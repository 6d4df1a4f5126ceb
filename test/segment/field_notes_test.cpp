// Real slaves and their users: bring-up, state changes and lost slaves. test/README.md lists the field note of each
// test.
#include "segment/field_notes.hpp"
#include "facts.hpp"

#include "wire/fmmu.hpp"
#include "wire/sync_manager.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;
namespace reg = wire::reg;

// ------------------------------------------------------------------ states

TEST_F(FieldNotes, OpNeedsProcessDataFromSafeopOn) {
    plug_odd({});
    start();
    map();
    // Without cycles, the slave waits for outputs and reports this.
    ASSERT_TRUE(writestate(ctx, 1, AlState::op));
    const auto refused = statecheck(ctx, 1, AlState::op, 2s);
    ASSERT_TRUE(refused);
    EXPECT_EQ(refused->state, AlState::safeop);
    EXPECT_TRUE(refused->error);
    EXPECT_NE(refused->code, 0);
    // With cycles since SAFEOP the slave reaches OP and stays in OP.
    cycles(5);
    EXPECT_EQ(to(AlState::op), (AlStatus{AlState::op, false, 0}));
    for (int n = 0; n < 1000; ++n) ASSERT_TRUE(cycle());
    EXPECT_EQ(*readstate(ctx), (AlStatus{AlState::op, false, 0}));
    // The cycles stop: the watchdog of the outputs has its own AL status code.
    osal.advance(500ms);
    EXPECT_EQ(*readstate(ctx), (AlStatus{AlState::safeop, true, 0x001B}));
}

TEST_F(FieldNotes, StatecheckOfOneRefreshesAll) {
    plug_odd({});
    plug_odd({});
    plug_odd({});
    start();
    ASSERT_TRUE(writestate(ctx, 2, AlState::op));  // from PREOP: refused
    osal.advance(10ms);
    segment.set_power(2, false, osal.now());
    const auto first = statecheck(ctx, 1, AlState::preop, 100ms);
    EXPECT_EQ(*first, (AlStatus{AlState::preop, false, 0}));
    EXPECT_EQ(ctx.slave(2).al, (AlStatus{AlState::preop, true, 0x0011}));
    EXPECT_EQ(ctx.slave(3).al.state, AlState::none) << "lost, not its last state";
    EXPECT_EQ(readstate(ctx)->state, AlState::none);
}

// An ESC accepts no request until the processor has read the previous request. Meanwhile it answers with a working
// counter of 0. The slave is not lost.
TEST_F(FieldNotes, AProcessorThatReadsAlControlLateIsWaitedFor) {
    plug_odd({"slow_firmware"});
    start();
    ASSERT_TRUE(writestate(ctx, 1, AlState::init));
    ASSERT_EQ(statecheck(ctx, 1, AlState::init, 1s)->state, AlState::init);
    // INIT is reached at once. PREOP is requested before the processor has read the request for INIT.
    const auto again = reconfigure_slave(ctx, 1);
    EXPECT_TRUE(again.ok()) << words(again.error());
    EXPECT_EQ(ctx.slave(1).al, (AlStatus{AlState::preop, false, 0}));
    ASSERT_TRUE(writestate(ctx, 1, AlState::init));
    const auto at_once = writestate(ctx, 1, AlState::preop);
    EXPECT_TRUE(at_once.ok()) << words(at_once.error());
    // A processor that does not read any more is reported in bounded time.
    segment.slave(0).halt_firmware(osal.now());
    osal.advance(20ms);
    (void)writestate(ctx, 1, AlState::init);
    const auto begin = osal.now();
    const auto never = writestate(ctx, 1, AlState::preop);
    EXPECT_EQ(never.error().code, Errc::timeout) << words(never.error());
    EXPECT_EQ(never.error().expected, static_cast<std::uint32_t>(AlState::preop));
    EXPECT_LT(osal.now() - begin, 50ms);
    EXPECT_NE(ctx.slave(1).al.state, AlState::none);
}

TEST_F(FieldNotes, TheErrorBitIsSeenAndNotWaitedAway) {
    plug_odd({});
    start();
    ASSERT_TRUE(writestate(ctx, 1, AlState::op));
    osal.advance(10ms);
    const Time before = osal.now();
    const auto now = statecheck(ctx, 1, AlState::preop, 20ms);
    EXPECT_EQ(*now, (AlStatus{AlState::preop, true, 0x0011})) << "in PREOP, but not well";
    EXPECT_GE(osal.now() - before, 20ms);
}

TEST_F(FieldNotes, AcknowledgeWithoutAnErrorIsHarmless) {
    plug_odd({});
    plug("coupler");
    start();
    map();
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0}));
    // A request with acknowledge, for an error that the slave no longer has.
    facts(ctx.slave(1)).al.error = true;
    ASSERT_TRUE(writestate(ctx, 1, AlState::op));
    cycles(10);
    EXPECT_EQ(*readstate(ctx), (AlStatus{AlState::op, false, 0}));
    EXPECT_TRUE(cycle());
}

TEST_F(FieldNotes, AnErrorThatOnlyInitClearsIsLeftByInit) {
    plug_odd({});
    plug_odd({"ignores_acknowledge"});
    start();
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0}));
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(5);
    segment.set_cable({1, 0}, false);
    cycles(300);  // longer than its watchdog time
    segment.set_cable({1, 0}, true);
    bool right = false;
    for (int n = 0; n < 3000 && !right; ++n) right = cycle().ok() && ctx.slave(2).al == AlStatus{AlState::op, false, 0};
    EXPECT_TRUE(right) << told(2);
    EXPECT_TRUE(exchanges(2));
}

// Without a supervision the application maps its group again.
TEST_F(FieldNotes, AnErrorThatOnlyInitClearsIsLeftByAMapping) {
    plug_odd({});
    plug_odd({"ignores_acknowledge"});
    start();
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0}));
    osal.advance(300ms);  // longer than its watchdog time
    ASSERT_TRUE(readstate(ctx));
    ASSERT_TRUE(ctx.slave(2).al.error) << told(2);
    EXPECT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(2);
    cycles(5);
    EXPECT_TRUE(exchanges(2));
}

TEST_F(FieldNotes, SlowAndReluctantSlavesReachOp) {
    plug_odd({"slow_state_changes"});
    plug_odd({"refuses_op_once"});
    plug_odd({"slow_firmware"});
    start();
    map();
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    bool right = false;
    for (int n = 0; n < 5000 && !right; ++n)
        right = cycle().ok() && std::ranges::all_of(ctx.slaves(), [](const Slave& s) {
                    return s.al == AlStatus{AlState::op, false, 0};
                });
    EXPECT_TRUE(right) << told(1) << "\n" << told(2) << "\n" << told(3);
}

// ------------------------------------------------------------------ bring-up

// A master stops during operation, and another master takes over the segment without power off.
TEST_F(FieldNotes, AnotherMasterTakesOverARunningSegment) {
    plug_odd({});
    plug_odd({"old_mail"});
    plug("digital_out_8");
    start();
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0}));
    segment.slave(0).registers().set<std::uint8_t>(reg::kSyncActivation.address, 3);
    {
        // A reply to a request of the first master stays in the mailbox.
        std::array<std::byte, 4> into{};
        SdoUpload left;
        left.slave = 1;
        left.index = 0x1000;
        left.data = into;
        ASSERT_TRUE(submit(ctx, left));
        for (int n = 0; n < 200 && !full(0, 1); ++n) {
            (void)poll(ctx, osal.now());
            osal.advance(5us);
            segment.advance(osal.now());
        }
    }
    ASSERT_TRUE(full(0, 1)) << "there is something to find";
    HostContext other{Limits{.slaves = 8}};
    ASSERT_TRUE(init(other, wire, osal));
    const auto found = config_init(other);
    ASSERT_TRUE(found) << words(found.error());
    ASSERT_EQ(*found, 3);
    EXPECT_EQ(at<std::uint8_t>(0, reg::kSyncActivation.address), 0);
    for (std::uint32_t n = 0; n < 3; ++n) {
        EXPECT_EQ(other.slave(n + 1).al, (AlStatus{AlState::preop, false, 0})) << words(other.slave(n + 1).error);
        for (std::uint16_t fmmu = 0; fmmu < 3; ++fmmu)
            EXPECT_EQ(at<std::uint8_t>(n, static_cast<std::uint16_t>(0x060C + fmmu * 16)), 0);
    }
    for (const std::uint16_t activate : std::initializer_list<std::uint16_t>{0x0816, 0x081E})
        EXPECT_EQ(at<std::uint8_t>(0, activate), 0);
    for (const std::uint16_t slave : std::initializer_list<std::uint16_t>{1, 2}) {
        const auto value = SDOread<std::uint32_t>(other, slave, 0x1018, 2);
        ASSERT_TRUE(value) << words(value.error());
        EXPECT_EQ(*value, kProduct) << "and not what somebody else has asked for";
        std::array<char, 64> name{};
        EXPECT_EQ(*SDOread_text(other, slave, 0x1008, 0, name), "Device of odd manners");
    }
}

// From PREOP on, the EEPROM belongs to the slave, after each read by the master, too.
TEST_F(FieldNotes, TheEepromIsGivenBackToTheSlave) {
    plug_odd({"needs_eeprom"});
    plug_odd({"needs_eeprom"});
    start();
    expect_all_in(AlState::preop);
    std::array<std::byte, 8> identity{};
    ASSERT_TRUE(read_sii(ctx, 1, 0x08, identity));
    ASSERT_TRUE(write_sii(ctx, 2, 0x20, identity));
    for (const AlState state : {AlState::init, AlState::preop}) {
        ASSERT_TRUE(writestate(ctx, 0, state));
        EXPECT_EQ(*statecheck(ctx, 0, state, 1s), (AlStatus{state, false, 0}));
    }
    ASSERT_TRUE(config_init(ctx));
    expect_all_in(AlState::preop);
    EXPECT_EQ(to_op(), (AlStatus{AlState::op, false, 0}));
}

TEST_F(FieldNotes, BrothersOfOneIdentityMayHaveOtherPdos) {
    plug_odd({});
    plug_odd({"other_pdos"});
    plug_odd({});
    start();
    ASSERT_EQ(ctx.slave(1).identity, ctx.slave(2).identity);
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(ctx.slave(1).image.outputs.bits, 64U);
    EXPECT_EQ(ctx.slave(2).image.outputs.bits, 128U);
    EXPECT_EQ(ctx.slave(3).image.outputs.bits, 64U);
    EXPECT_TRUE(cycle());
}

// ETG.1000.4, tables of the logical commands: each slave that takes part adds 1 for LRD, 1 for LWR, and for LRW 1 for
// reading and 2 for writing.
TEST_F(FieldNotes, WorkingCountersAreCountedBySlaveAndDatagram) {
    plug_line({"coupler", "digital_in_8", "digital_out_8", "digital_in_8", "coupler"});
    plug_odd({});
    start();
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0}));
    ASSERT_EQ(ctx.group(0).datagrams.size(), 1U);
    EXPECT_EQ(ctx.group(0).datagrams[0].expected, 1U + 2U + 1U + 3U);
    EXPECT_EQ(*cycle(), 7U) << "couplers add nothing";
    ctx.group(0).config.block_lrw = true;
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0}));
    ASSERT_EQ(ctx.group(0).datagrams.size(), 2U);
    for (const auto& datagram : ctx.group(0).datagrams) {
        const bool writes = datagram.expected == 2;
        EXPECT_TRUE(writes || datagram.expected == 3U) << datagram.expected;
        EXPECT_TRUE(datagram.right());
    }
    EXPECT_EQ(*cycle(), 2U + 3U);
}

// One group has a cycle every millisecond, the other group every fourth millisecond.
TEST_F(FieldNotes, GroupsRunAtRatesOfTheirOwn) {
    plug_odd({});
    plug_odd({});
    start();
    ctx.slave(2).config.group = 1;
    std::array<std::byte, 64> slow_image{};
    map();
    ASSERT_TRUE(config_map(ctx, slow_image, 1));
    const auto run = [&](int count) {
        int wrong = 0;
        for (int n = 0; n < count; ++n) {
            wrong += cycle() ? 0 : 1;
            if (n % 4 != 0) continue;
            const auto sent = send_processdata(ctx, 1);
            const auto wkc = receive_processdata(ctx, 500us, 1);
            wrong += sent && wkc && *wkc == 3 ? 0 : 1;
        }
        return wrong;
    };
    EXPECT_EQ(run(8), 0);
    ASSERT_TRUE(writestate(ctx, 0, AlState::op));
    EXPECT_EQ(run(200), 0);
    const auto frames = ctx.statistics().frames_sent;
    ctx.slave(2).image.outputs.bytes[0] = std::byte{0x5A};
    EXPECT_EQ(run(1000), 0);
    EXPECT_EQ(ctx.statistics().frames_sent - frames, 1250U);
    EXPECT_EQ(*readstate(ctx), (AlStatus{AlState::op, false, 0}));
    EXPECT_EQ(slow_image[8], std::byte{0x5A}) << "given back by the device";
}

// ------------------------------------------------------------------ hot connect

// A hook writes a mapping by SDO. After a loss of power the hook is called again, during the cycles of the other
// slaves.
TEST_F(FieldNotes, TheWholeStartUpIsReplayedForASlaveThatWasWithoutPower) {
    plug_odd({});
    plug_odd({});
    start();
    struct Choice {
        std::array<std::byte, 4> assignment{std::byte{1}, std::byte{0}, std::byte{1}, std::byte{0x16}};
        int done = 0;
    } choice;
    ctx.slave(2).hooks.user = &choice;
    ctx.slave(2).hooks.preop_to_safeop = [](HookedSlave slave, void* user) -> Task<> {
        auto& my = *static_cast<Choice*>(user);
        auto written = co_await slave.sdo_write(0x1C12, 0, my.assignment, true);
        ++my.done;
        co_return written;
    };
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(2);
    ASSERT_EQ(ctx.slave(2).image.outputs.bits, 128U) << "0x1601 has eight words";
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(5);
    const auto sent = mailbox_statistics(ctx, 2)->sent;
    segment.set_power(1, false, osal.now());
    cycles(100);
    segment.set_power(1, true, osal.now());
    bool right = false;
    for (int n = 0; n < 3000 && !right; ++n) right = cycle().ok() && ctx.slave(2).al == AlStatus{AlState::op, false, 0};
    EXPECT_TRUE(right) << told(2);
    EXPECT_EQ(choice.done, 2);
    // The request of the replay, and the requests that read the PDOs: 0x1C00, 0x1C12, 0x1601, 0x1C13 and 0x1A00.
    EXPECT_EQ(mailbox_statistics(ctx, 2)->sent, sent + 1 + 5);
    EXPECT_EQ(beside_the_cycle(1, 0x1C12, 1), 0x1600U) << "nobody else was asked";
    EXPECT_EQ(beside_the_cycle(2, 0x1C12, 1), 0x1601U);
}

}  // namespace
}  // namespace margay
