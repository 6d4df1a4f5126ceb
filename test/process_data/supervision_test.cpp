// The supervision detects, reports and repairs the faults of a segment, while the other slaves continue.
#include "process_data/supervised.hpp"

namespace margay {

using namespace std::chrono_literals;

namespace {

class SupervisionTest : public testing::Test, protected Run {
  protected:
    using Run = ::margay::Run;
};

TEST_F(SupervisionTest, LostPowerIsNoticedWithinTwoCyclesAndTheOthersGoOn) {
    start(4);
    to_op();
    bus.segment.set_power(1, false, bus.osal.now());
    // The slaves behind the lost slave are lost, too.
    int stale = 0;
    int cycles_to_word = -1;
    std::vector<std::string> words;
    do {
        EXPECT_FALSE(cycle().ok());
        ++stale;
        for (auto& word : events()) words.push_back(std::move(word));
        if (cycles_to_word < 0 && has(words, "slave 4: lost")) cycles_to_word = stale - 1;
    } while (stale < 10 && !fresh(1));
    EXPECT_LE(stale, 3) << "two cycles without inputs of slave 1";
    for (int n = 0; n < 20; ++n) {
        EXPECT_FALSE(cycle().ok());
        EXPECT_TRUE(fresh(1)) << n;
    }
    EXPECT_EQ(ctx().slave(1).al.state, AlState::op);
    for (std::size_t n = 2; n <= 4; ++n) EXPECT_EQ(ctx().slave(n).al.state, AlState::none);
    EXPECT_LE(cycles_to_word, 2) << "of all four, by name, within two cycles of the first that is short";
    auto told = words;
    EXPECT_TRUE(has(told, "group 0: working counter fell short (expected 12, got 3)")) << joined(told);
    EXPECT_TRUE(has(told, "slave 2: lost, it was in OP")) << joined(told);
    EXPECT_TRUE(has(told, "slave 4: lost, it was in OP")) << joined(told);
    EXPECT_TRUE(has(told, "1 slave answers, it was 4")) << joined(told);

    bus.segment.set_power(1, true, bus.osal.now());
    EXPECT_LE(cycles_until_right(), 500);
    told = events();
    EXPECT_TRUE(has(told, "slave 2: found again, in INIT, as after a loss of power")) << joined(told);
    EXPECT_TRUE(has(told, "slave 2: recovered, in OP")) << joined(told);
    EXPECT_TRUE(has(told, "slave 4: found again, in OP")) << joined(told);
    EXPECT_TRUE(has(told, "group 0: working counter right again")) << joined(told);
    ASSERT_TRUE(cycle().ok());
    for (std::size_t n = 1; n <= 4; ++n) EXPECT_TRUE(fresh(n)) << n;
}

// The slave takes part in the cycle, because process data has logical addresses. So the working counter has the value
// for all slaves.
TEST_F(SupervisionTest, ASlaveWithoutItsStationAddressIsLostAndTheCounterIsNotCalledShort) {
    start(4);
    to_op();
    const std::array address{std::byte{7}, std::byte{0}};
    (void)bus.segment.slave(0).ecat_write(0x0010, address, bus.osal.now());
    sim::FrameEnd end{};
    end.at = bus.osal.now();
    bus.segment.slave(0).frame_end(end);
    bus.segment.set_noise({.lost = 1});  // after a silence the supervision reads all slaves
    for (int n = 0; n < 30; ++n) (void)cycle();
    bus.segment.set_noise({});
    std::vector<std::string> told;
    for (int n = 0; n < 200; ++n) {
        (void)cycle();
        for (auto& word : events()) told.push_back(std::move(word));
    }
    EXPECT_TRUE(has(told, "slave 1: lost, it was in OP")) << joined(told);
    EXPECT_FALSE(has(told, "fell short (expected 12, got 12)")) << joined(told);
    EXPECT_LE(cycles_until_right(), 500);
}

// A slave that was never lost is not reported as recovered.
TEST_F(SupervisionTest, TheFirstWayUpIsNoRecovery) {
    Run run(3);
    ASSERT_TRUE(run.mapped);
    ASSERT_LE(run.cycles_until_right(), 500);
    const auto told = run.events();
    EXPECT_TRUE(has(told, "slave 3: SAFEOP to OP")) << joined(told);
    EXPECT_FALSE(has(told, "recovered")) << joined(told);
}

// While a slave comes back, the other slaves lose only the cycles in which the slave is found to be lost or present.
TEST_F(SupervisionTest, AReturningSlaveTakesPartFromOneCycleToTheNext) {
    start(3);
    to_op();
    bus.segment.set_power(2, false, bus.osal.now());
    for (int n = 0; n < 50; ++n) (void)cycle();
    bus.segment.set_power(2, true, bus.osal.now());
    int stale = 0;
    for (int n = 0; n < 1000 && !cycle().ok(); ++n)
        if (!fresh(1) || !fresh(2)) ++stale;
    EXPECT_EQ(stale, 0);
    EXPECT_TRUE(fresh(3));
}

// Any slave loses its power, at any cycle of the bring-up and in OP.
TEST_F(SupervisionTest, PowerLossOfAnySlaveAtAnyCycle) {
    for (std::uint32_t slave = 0; slave < 4; ++slave) {
        for (int at = 0; at < 60; ++at) {
            SCOPED_TRACE("slave " + std::to_string(slave + 1) + " at " + std::to_string(at));
            Run run(4);
            ASSERT_TRUE(run.mapped);
            // The supervision brings the slaves to OP.
            for (int n = 0; n < at; ++n) (void)run.cycle();
            run.bus.segment.set_power(slave, false, run.bus.osal.now());
            for (int n = 0; n < at % 17; ++n) (void)run.cycle();
            run.bus.segment.set_power(slave, true, run.bus.osal.now());
            ASSERT_LE(run.cycles_until_right(4000), 4000) << joined(run.events());
            ASSERT_EQ(run.wrong, 0);
        }
    }
}

TEST_F(SupervisionTest, WireBreakAndHeal) {
    start(6);
    to_op();
    for (int round = 0; round < 20; ++round) {
        const auto at = static_cast<std::uint32_t>(round % 6);
        bus.segment.set_cable({at, 0}, false);
        for (int n = 0; n < 5 + round * 20; ++n) (void)cycle();  // in later rounds longer than the watchdogs
        if (at > 0 && round > 2) {
            EXPECT_TRUE(fresh(1));
        }
        bus.segment.set_cable({at, 0}, true);
        ASSERT_LE(cycles_until_right(), 2000) << round << "\n" << joined(events());
        const auto told = events();
        if (at > 0) {
            EXPECT_TRUE(has(told, "slave " + std::to_string(at + 1) + ": lost, it was in OP")) << joined(told);
        }
    }
    EXPECT_TRUE(cycle().ok());
}

TEST_F(SupervisionTest, SegmentThatIsSilentIsToldOnce) {
    start(2);
    to_op();
    bus.segment.set_cable({0, 0}, false);
    for (int n = 0; n < 25; ++n) EXPECT_FALSE(cycle().ok());
    EXPECT_TRUE(bus.ctx->slave(1).al.state == AlState::op) << "of a slave nothing is known then";
    auto told = events();
    EXPECT_EQ(told, std::vector<std::string>{"no frame comes back from the segment"});
    for (int n = 0; n < 300; ++n) EXPECT_FALSE(cycle().ok());
    told.push_back(joined(events()));
    EXPECT_EQ(std::ranges::count(told, "no frame comes back from the segment"), 1) << joined(told);
    bus.segment.set_cable({0, 0}, true);
    for (int n = 0; n < 20; ++n) (void)cycle();
    ASSERT_LE(cycles_until_right(), 2000) << joined(events());
    told = events();
    EXPECT_TRUE(has(told, "frames come back from the segment again")) << joined(told);
}

// The link is up, but no frame returns. The supervision reports this only after several frames, so that single losses
// cause no report.
TEST_F(SupervisionTest, AllFramesLostIsTold) {
    start(2);
    to_op();
    bus.segment.set_noise({.lost = 1});
    int needed = 0;
    while (needed < 100 && events().empty()) (void)cycle(), ++needed;
    EXPECT_GE(needed, 9);
    EXPECT_LE(needed, 21) << "a roll is waited for for 10 ms";
    bus.segment.set_noise({});
    ASSERT_LE(cycles_until_right(), 100);
    EXPECT_TRUE(has(events(), "frames come back from the segment again"));
}

// The outputs of a slave stop for longer than its watchdog time. The slave reports it, and the supervision
// acknowledges it and brings the slave back to OP.
TEST_F(SupervisionTest, SafeopWithErrorIsToldInWordsAcknowledgedAndLeft) {
    start(3);
    to_op();
    bus.segment.set_cable({2, 0}, false);
    for (int n = 0; n < 300; ++n) (void)cycle();
    (void)events();
    bus.segment.set_cable({2, 0}, true);
    ASSERT_LE(cycles_until_right(), 500);
    const auto told = events();
    EXPECT_TRUE(has(told, "slave 3: found again, in SAFEOP+ERROR (0x001b: sync manager watchdog)")) << joined(told);
    EXPECT_TRUE(has(told, "slave 3: SAFEOP+ERROR to SAFEOP")) << joined(told);
    EXPECT_TRUE(has(told, "slave 3: recovered, in OP")) << joined(told);
    EXPECT_FALSE(has(told, "INIT")) << "its configuration was there: no need to go through all of it\n" << joined(told);
}

TEST_F(SupervisionTest, AnotherSlaveInItsPlaceIsToldAndLeftAlone) {
    start(3);
    to_op();
    bus.segment.set_power(2, false, bus.osal.now());
    for (int n = 0; n < 20; ++n) (void)cycle();
    // Another device is at the same port. Its SII is different.
    bus.segment.slave(2).sii().image()[0x0A * 2] ^= std::byte{0x22};
    bus.segment.set_power(2, true, bus.osal.now());
    for (int n = 0; n < 2000; ++n) {
        EXPECT_FALSE(cycle().ok());
    }
    EXPECT_TRUE(fresh(1) && fresh(2));
    const auto told = events();
    EXPECT_TRUE(has(
        told, "slave 3: another slave in its place (expected product 0x00000100, got 0x00000122 of vendor 0x00004d47)"))
        << joined(told);
    EXPECT_FALSE(has(told, "slave 3: found")) << joined(told);
    EXPECT_EQ(std::ranges::count_if(
                  told, [](const std::string& one) { return one.find("another slave") != std::string::npos; }),
              1);
    EXPECT_EQ(bus.segment.slave(2).station() & 0xFF00, 0x0F00) << "it was given no address of ours";
    EXPECT_EQ(ctx().slave(3).al.state, AlState::none);
    const auto recovered = recover_slave(ctx(), 3);
    EXPECT_EQ(recovered.error().code, Errc::other_slave);
    // Then the right device is there again.
    bus.segment.set_power(2, false, bus.osal.now());
    bus.segment.slave(2).sii().image()[0x0A * 2] ^= std::byte{0x22};
    bus.segment.set_power(2, true, bus.osal.now());
    EXPECT_LE(cycles_until_right(), 3000) << joined(events());
}

// Registers differ from the values that the master wrote, and the slave does not report this.
TEST_F(SupervisionTest, LostMappingIsFoundByDoubt) {
    start(3);
    to_op();
    bus.segment.slave(1).registers().set<std::uint8_t>(0x060C, 0);
    std::array<std::byte, 1> off{};
    (void)bus.segment.slave(1).ecat_write(0x060C, off, bus.osal.now());
    bus.segment.slave(1).frame_end({.at = bus.osal.now()});
    bus.segment.reconsider();
    EXPECT_FALSE(cycle().ok());
    EXPECT_LE(cycles_until_right(), 500) << joined(events());
}

TEST_F(SupervisionTest, StartupListsAndTheHookAreReplayed) {
    start(2);
    static constexpr StartupCommand kList[] = {
        write_register(Transition::init_to_preop, 0x0F80, std::uint8_t{0x11}),
        write_register(Transition::preop_to_safeop, 0x0F81, std::uint16_t{0x3322}),
        write_register(Transition::safeop_to_op, 0x0F83, std::uint8_t{0x44}),
    };
    static constexpr SlaveSetup kSetup{.startup = kList};
    ctx().slave(2).config.setup = &kSetup;
    int calls = 0;
    ctx().slave(2).hooks.user = &calls;
    ctx().slave(2).hooks.preop_to_safeop = [](HookedSlave, void* user) -> Result<> {
        if (++*static_cast<int*>(user) % 2 == 0) return Error{.code = Errc::busy};
        return Result<>();
    };
    to_op();
    EXPECT_EQ(calls, 1);
    EXPECT_EQ(bus.segment.slave(1).peek(0x0F81, 3), (std::vector{std::byte{0x22}, std::byte{0x33}, std::byte{0x44}}));
    bus.segment.set_power(1, false, bus.osal.now());
    for (int n = 0; n < 20; ++n) (void)cycle();
    bus.segment.set_power(1, true, bus.osal.now());
    const std::array<std::byte, 4> zeros{};
    bus.segment.slave(1).write(0x0F80, zeros);
    ASSERT_LE(cycles_until_right(), 1000) << joined(events());
    EXPECT_EQ(bus.segment.slave(1).peek(0x0F80, 4),
              (std::vector{std::byte{0x11}, std::byte{0x22}, std::byte{0x33}, std::byte{0x44}}));
    EXPECT_EQ(calls, 3) << "busy, then done";
}

// Damaged frames are counted at the port where they arrive, and the event names the cable of this port.
TEST_F(SupervisionTest, LineErrorsNameTheCable) {
    start(6);
    std::array<LineErrors, 6> lines{};
    supervision.line_interval = 20ms;
    supervision.line_errors = lines;
    to_op();
    for (int n = 0; n < 50; ++n) (void)cycle();
    EXPECT_EQ(events(), std::vector<std::string>());
    for (int n = 0; n < 3; ++n) {
        bus.segment.corrupt_next({4, 0});
        (void)cycle();
        (void)cycle();
    }
    for (int n = 0; n < 100; ++n) (void)cycle();
    const auto told = events();
    EXPECT_TRUE(has(told, "CRC errors between slave 4 port 1 and slave 5: ")) << joined(told);
    EXPECT_EQ(lines[4].ports[0].invalid_frames, 3U);
    EXPECT_EQ(lines[3].ports[0].invalid_frames, 0U);
    EXPECT_EQ(lines[5].ports[0].forwarded, 3U) << "the slave behind knows that somebody has seen it already";
    // The sums continue above 255, the limit of the counters.
    for (int n = 0; n < 600; ++n) {
        bus.segment.corrupt_next({4, 0});
        (void)cycle();
        (void)cycle();
    }
    for (int n = 0; n < 100; ++n) (void)cycle();
    EXPECT_EQ(lines[4].ports[0].invalid_frames, 603U);
}

// 1 % and 10 % of all frames are lost on any cable, for 100 000 cycles. No input is wrong, and no slave is reported
// lost without reason.
TEST_F(SupervisionTest, FrameLossNeverGivesWrongInputsAndAllAreInOpAgain) {
    for (const double share : {0.01, 0.10}) {
        SCOPED_TRACE(share);
        Run run(3);
        ASSERT_TRUE(run.mapped);
        ASSERT_LE(run.cycles_until_right(), 2000);
        run.bus.segment.set_noise({.lost = share, .corrupted = 0, .seed = 7});
        unsigned good = 0;
        (void)run.events();
        for (int n = 0; n < 100'000; ++n) {
            if (run.cycle().ok()) ++good;
            const auto told = run.events();
            ASSERT_FALSE(has(told, "lost") || has(told, "no frame") || has(told, "found") || has(told, "answer"))
                << n << "\n"
                << joined(told);
        }
        EXPECT_EQ(run.wrong, 0);
        const LinkStatistics& link = run.ctx().statistics();
        EXPECT_NEAR(static_cast<double>(link.lost) / static_cast<double>(link.frames_sent), share, share / 5);
        // A lost slave is reported, although some of the frames that check it are lost.
        run.bus.segment.set_power(2, false, run.bus.osal.now());
        int until_told = 0;
        while (until_told < 100 && !has(run.events(), "slave 3: lost")) (void)run.cycle(), ++until_told;
        EXPECT_LE(until_told, 30);
        run.bus.segment.set_power(2, true, run.bus.osal.now());
        EXPECT_GT(good, 80'000U);
        EXPECT_LT(good, 99'990U) << "frames were lost indeed";
        run.bus.segment.set_noise({});
        EXPECT_LE(run.cycles_until_right(), 2000) << joined(run.events());
    }
}

TEST_F(SupervisionTest, AFailedRecoveryIsToldOnceAndTriedAgain) {
    start(2);
    bool refuses = false;
    ctx().slave(2).hooks.user = &refuses;
    ctx().slave(2).hooks.preop_to_safeop = [](HookedSlave slave, void* user) -> Result<> {
        if (*static_cast<bool*>(user))
            return Error{.code = Errc::sdo_abort,
                         .step = Step::sdo_download,
                         .slave = slave.number(),
                         .index = 0x8000,
                         .detail = 0x08000000};
        return Result<>();
    };
    to_op();
    refuses = true;
    bus.segment.set_power(1, false, bus.osal.now());
    for (int n = 0; n < 20; ++n) (void)cycle();
    bus.segment.set_power(1, true, bus.osal.now());
    for (int n = 0; n < 3000; ++n) (void)cycle();
    const auto told = events();
    EXPECT_EQ(std::ranges::count(told,
                                 "recovery failed: slave 2: SDO download of 0x8000:0: the slave aborted the transfer "
                                 "(abort code 0x08000000: general error)"),
              1)
        << joined(told);
    EXPECT_TRUE(fresh(1));
    refuses = false;
    ASSERT_LE(cycles_until_right(), 1000);
    EXPECT_TRUE(has(events(), "slave 2: recovered, in OP"));
}

TEST_F(SupervisionTest, AnInterruptedCableIsNamed) {
    start(4);
    std::array<LineErrors, 4> lines{};
    supervision.line_interval = 20ms;
    supervision.line_errors = lines;
    to_op();
    for (int n = 0; n < 50; ++n) (void)cycle();
    bus.segment.set_cable({2, 0}, false);
    for (int n = 0; n < 100; ++n) (void)cycle();
    auto told = events();
    EXPECT_EQ(std::ranges::count(told, "link interrupted between slave 2 port 1 and slave 3: 1 time"), 1)
        << joined(told);
    EXPECT_EQ(lines[1].ports[1].lost_links, 1U);
    EXPECT_EQ(ctx().slave(3).ring_position, 0);
    bus.segment.set_cable({2, 0}, true);
    ASSERT_LE(cycles_until_right(), 1000);
    EXPECT_EQ(ctx().slave(3).ring_position, 3);
    // The port at the other end of the cable has counted the interruption, too.
    for (int n = 0; n < 100; ++n) (void)cycle();
    EXPECT_EQ(lines[2].ports[0].lost_links, 1U);
    const auto back = events();
    EXPECT_EQ(std::ranges::count_if(back, [](const auto& e) { return e.starts_with("link interrupted"); }), 0)
        << joined(back);
}

// Slave 3 loses its power. While slave 3 has no address yet, the library knows the slaves around it, but no cable
// connects these two slaves.
TEST_F(SupervisionTest, AnEventNamesOnlyCablesThatExist) {
    for (int phase = 0; phase < 20; ++phase) {
        Run run;
        run.start(5);
        std::array<LineErrors, 5> lines{};
        run.supervision.line_interval = 7ms;
        run.supervision.line_errors = lines;
        run.to_op();
        for (int n = 0; n < 50 + phase; ++n) (void)run.cycle();
        run.bus.segment.set_power(2, false, run.bus.osal.now());
        for (int n = 0; n < 3; ++n) (void)run.cycle();
        run.bus.segment.set_power(2, true, run.bus.osal.now());
        ASSERT_LE(run.cycles_until_right(), 2000);
        for (int n = 0; n < 50; ++n) (void)run.cycle();
        const auto told = run.events();
        EXPECT_FALSE(has(told, "slave 2 port 1 and slave 4")) << joined(told);
        EXPECT_LE(std::ranges::count_if(told, [](const auto& e) { return e.starts_with("link interrupted"); }), 2)
            << joined(told);
    }
}

TEST_F(SupervisionTest, AThousandSlaves) {
    Run run(1000, {.slaves = 1000, .tasks = 100, .process_frames = 8});
    ASSERT_TRUE(run.mapped);
    run.bus.reply_timeout = 4ms;  // a frame needs a millisecond on the wire
    const int needed = run.cycles_until_right();
    ASSERT_LE(needed, 500);
    EXPECT_EQ(run.bus.ctx->group(0).expected_wkc, 3000U);
    run.bus.segment.set_power(700, false, run.bus.osal.now());
    for (int n = 0; n < 100; ++n) (void)run.cycle();
    EXPECT_EQ(run.bus.ctx->slave(700).al.state, AlState::op);
    EXPECT_EQ(run.bus.ctx->slave(701).al.state, AlState::none);
    run.bus.segment.set_power(700, true, run.bus.osal.now());
    ASSERT_LE(run.cycles_until_right(), 1000);
    EXPECT_EQ(run.wrong, 0);
}

TEST_F(SupervisionTest, TwoRunsAreTheSame) {
    const auto story = [] {
        Run run(5);
        std::string text;
        run.bus.segment.set_noise({.lost = 0.01, .corrupted = 0.01, .seed = 11});
        for (int n = 0; n < 3000; ++n) {
            if (n % 500 == 100)
                run.bus.segment.set_power(static_cast<std::uint32_t>(n / 500 % 5), false, run.bus.osal.now());
            if (n % 500 == 200)
                run.bus.segment.set_power(static_cast<std::uint32_t>(n / 500 % 5), true, run.bus.osal.now());
            (void)run.cycle();
            for (const auto& event : run.events()) text += std::to_string(n) + " " + event + "\n";
        }
        return text;
    };
    const auto first = story();
    EXPECT_GT(first.size(), 1000U);
    EXPECT_EQ(first, story());
}

TEST_F(SupervisionTest, CallbackHasEveryEventAndTheQueueCountsWhatItDrops) {
    start(2);
    to_op();
    int calls = 0;
    ctx().events().user = &calls;
    ctx().events().callback = [](const Event&, void* user) { ++*static_cast<int*>(user); };
    for (int round = 0; round < 20; ++round) {
        bus.segment.set_power(1, false, bus.osal.now());
        for (int n = 0; n < 20; ++n) (void)cycle();
        bus.segment.set_power(1, true, bus.osal.now());
        ASSERT_LE(cycles_until_right(), 1000);
    }
    const auto taken = static_cast<int>(events().size());
    EXPECT_EQ(taken, int{Limits{}.events});
    EXPECT_EQ(taken + static_cast<int>(ctx().events().dropped()), calls);
}

// Without the supervision, the application finds, names and restarts the slave.
TEST_F(SupervisionTest, RecoverAndReconfigureByHand) {
    start(3);
    ASSERT_TRUE(config_map(ctx(), image).ok());
    ASSERT_EQ(bus.to_op().state, AlState::op);
    bus.segment.set_power(2, false, bus.osal.now());
    EXPECT_EQ(recover_slave(ctx(), 3).error().code, Errc::missing_slave);
    bus.segment.set_power(2, true, bus.osal.now());
    EXPECT_TRUE(recover_slave(ctx(), 3).ok());
    EXPECT_EQ(ctx().slave(3).al.state, AlState::init);
    EXPECT_TRUE(reconfigure_slave(ctx(), 3).ok());
    EXPECT_EQ(ctx().slave(3).al.state, AlState::safeop);
    EXPECT_EQ(bus.to_op().state, AlState::op);
    EXPECT_TRUE(cycle().ok());
}

TEST_F(SupervisionTest, WrongCallsAreRefused) {
    HostContext fresh;
    EXPECT_EQ(submit(fresh, supervision).error().code, Errc::wrong_state);
    EXPECT_EQ(reconfigure_slave(fresh, 1).error().code, Errc::wrong_state);
    EXPECT_EQ(recover_slave(fresh, 1).error().code, Errc::wrong_state);
    start(2);
    EXPECT_EQ(reconfigure_slave(ctx(), 3).error().code, Errc::unknown_slave);
    EXPECT_EQ(recover_slave(ctx(), 3).error().code, Errc::unknown_slave);
    supervision.target = AlState::boot;
    EXPECT_EQ(submit(ctx(), supervision).error().code, Errc::invalid_argument);
    supervision.target = AlState::op;
    ASSERT_TRUE(submit(ctx(), supervision).ok());
    SuperviseRequest second;
    ASSERT_TRUE(submit(ctx(), second).ok());
    EXPECT_EQ(wait(ctx(), second).error().code, Errc::busy);
    std::array<char, 256> text{};
    EXPECT_EQ(describe(config_init(ctx()).error(), text),
              "counting slaves: already in progress (a supervision is busy)");
    EXPECT_EQ(submit(ctx(), second).error().code, Errc::busy);
    supervision.cancel();
    EXPECT_EQ(*config_init(ctx()), 2U);
}

}  // namespace
}  // namespace margay
