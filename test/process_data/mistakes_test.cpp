// Mistakes that new users make, and the error, warning or event that names each of them.
#include "process_data/plant.hpp"
#include "util/arena.hpp"

#include <type_traits>

namespace margay {
namespace {

using namespace std::chrono_literals;

// A line of two slaves with 8 bits of outputs and of inputs each, without mailboxes.
class Mistakes : public testing::Test, protected Plant {
  protected:
    std::vector<std::byte> second_image = std::vector<std::byte>(64);

    void SetUp() override {
        ASSERT_TRUE(segment.connect_master({make({.product = 0x100}), 0}));
        ASSERT_TRUE(segment.connect({0, 1}, {make({.product = 0x101}), 0}));
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, osal);
        limits.groups = 2;
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *nic, osal).ok());
    }
    static std::string words(const Error& error) {
        std::array<char, 400> buffer{};
        return std::string(describe(error, buffer));
    }
    std::vector<std::string> all(ErrorLog& log) {
        std::vector<std::string> texts;
        while (const auto error = log.take()) texts.push_back(words(*error));
        return texts;
    }
};

// The facts of a slave are read-only, its wishes and the octets of its image are not.
static_assert(std::is_same_v<decltype(std::declval<Context&>().slave(1)), const Slave&>);
static_assert(!std::is_assignable_v<decltype((std::declval<const Slave&>().al)), AlStatus>);
static_assert(std::is_assignable_v<decltype((std::declval<const Slave&>().config)), SlaveConfiguration>);
static_assert(std::is_assignable_v<decltype((std::declval<const Slave&>().hooks)), SlaveHooks>);

TEST_F(Mistakes, WishesWrittenBeforeTheScanAreWarnedOf) {
    ctx->slave(1).config.group = 1;
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_EQ(all(ctx->warnings()),
              std::vector<std::string>{"counting slaves: config or hooks of a slave that does not exist were written: "
                                       "write them after config_init(), to slaves 1 and up, or use expect()"});
    EXPECT_EQ(ctx->slave(1).config.group, 0);
    ctx->slave(0).config.group = 1;  // slave 0 is not the first one
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(all(ctx->warnings()).size(), 1U);
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_TRUE(all(ctx->warnings()).empty()) << "reported once";
}

// A retry of config_init() after config_map() has failed: the slaves start without their hooks and settings.
TEST_F(Mistakes, WishesThatASecondScanDeletesAreWarnedOf) {
    SlaveConfiguration listed;
    listed.highest = AlState::safeop;
    const ExpectedSlave expected[] = {{.number = 1, .config = &listed}, {.number = 2}};
    ASSERT_TRUE(expect(*ctx, expected).ok());
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_TRUE(all(ctx->warnings()).empty()) << "the list gives them again";
    ctx->slave(2).config.highest = AlState::preop;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_EQ(
        all(ctx->warnings()),
        std::vector<std::string>{"slave 2: counting slaves: the new scan has deleted its config and its hooks: set "
                                 "them again, or use expect()"});
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_TRUE(all(ctx->warnings()).empty());
}

TEST_F(Mistakes, TheTargetOfOneSlaveIsTakenBackByNone) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(set_target(*ctx, 2, AlState::preop).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    EXPECT_EQ(ctx->slave(2).al.state, AlState::preop);
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(set_target(*ctx, 2, AlState::none).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    EXPECT_EQ(ctx->slave(2).al.state, AlState::op);
    EXPECT_EQ(set_target(*ctx, 0, AlState::none).error().code, Errc::invalid_argument) << "all slaves have a target";
}

// A slave that was kept lower for a while is not left in OP when all slaves go down.
TEST_F(Mistakes, TheTargetOfOneSlaveEndsWithOpWhereAllHaveOp) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(set_target(*ctx, 2, AlState::preop).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(set_target(*ctx, 2, AlState::op).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    EXPECT_EQ(ctx->slave(2).al.state, AlState::op);
    ASSERT_TRUE(reach(*ctx, AlState::safeop, 2s).ok());
    EXPECT_EQ(ctx->slave(2).al.state, AlState::safeop);
    ASSERT_TRUE(set_target(*ctx, 2, AlState::safeop).ok()) << "to keep it lower";
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    EXPECT_EQ(ctx->slave(2).al.state, AlState::safeop);
}

// The target of all slaves is SAFEOP already, although the supervision has not read it yet.
TEST_F(Mistakes, TheTargetOfOneSlaveBesideANewTargetOfAll) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    for (const bool waiting : {true, false}) {
        supervision.cancel();
        supervision.target = waiting ? AlState::safeop : AlState::op;
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        if (!waiting) cycles(500);
        supervision.target = AlState::safeop;
        ASSERT_TRUE(set_target(*ctx, 2, AlState::op).ok());
        cycles(500);
        EXPECT_EQ(ctx->slave(2).al.state, AlState::op);
        EXPECT_EQ(ctx->slave(1).al.state, AlState::safeop);
        ASSERT_TRUE(set_target(*ctx, 2, AlState::none).ok());
    }
}

TEST_F(Mistakes, TheTargetOfOneSlaveAboveALoweredTargetOfAll) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    cycles(500);
    ASSERT_TRUE(set_target(*ctx, 0, AlState::safeop).ok());  // the supervision was submitted with OP
    ASSERT_TRUE(set_target(*ctx, 2, AlState::op).ok());
    cycles(500);
    EXPECT_EQ(ctx->slave(1).al.state, AlState::safeop);
    EXPECT_EQ(ctx->slave(2).al.state, AlState::op);
}

// reach() has ended its own supervision: nobody reads the states any more.
TEST_F(Mistakes, NothingIsRightForLongWithoutASupervision) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    cycles(500);
    EXPECT_TRUE(all_right(*ctx));
    cycles(1'500);
    EXPECT_FALSE(all_right(*ctx));
    EXPECT_EQ(
        words(what_is_wrong(*ctx)),
        "reading the state: the states of the slaves were read more than a second ago: submit a SuperviseRequest, or "
        "call readstate() again and again");
    ASSERT_TRUE(readstate(*ctx).ok());
    EXPECT_TRUE(all_right(*ctx));
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    cycles(2'500);
    EXPECT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
}

TEST_F(Mistakes, AGroupThatIsNotExchangedIsNamed) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ctx->slave(2).config.group = 1;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(config_map(*ctx, second_image, 1).ok());
    supervision.target = AlState::safeop;  // in OP the watchdogs of the slaves would name it
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(reach(*ctx, AlState::safeop, 2s).ok());
    for (int n = 0; n < 500; ++n) {
        cycles(1);  // of group 0
        EXPECT_TRUE(all_right(*ctx)) << n << words(what_is_wrong(*ctx));
    }
    cycles(1'500);
    (void)all_right(*ctx);
    cycles(1);
    EXPECT_EQ(words(what_is_wrong(*ctx)),
              "exchanging process data of group 1: the group is mapped, but its process data was not exchanged for a "
              "second");
    ASSERT_TRUE(reach(*ctx, AlState::safeop, 2s).ok());
    EXPECT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
}

// A hook that tries for ever what is refused at once, or waits for no time.
TEST_F(Mistakes, AHookThatTriesAgainAtOnceStopsNobody) {
    ASSERT_TRUE(config_init(*ctx).ok());
    const Hook<> hooks[] = {
        [](HookedSlave slave, void*) -> Task<> {
            for (;;) {
                auto value = co_await slave.sdo_read<std::uint32_t>(0x1000, 0);
                if (value) co_return Result<>();
            }
        },
        [](HookedSlave slave, void*) -> Task<> {
            std::array<std::byte, 4> into{};
            for (;;) {
                auto read = co_await slave.register_read(0xFFFF, into);
                if (read) co_return Result<>();
            }
        },
        [](HookedSlave slave, void*) -> Task<> {
            for (;;) {
                auto slept = co_await slave.sleep(Duration{-5});
                (void)slept;
            }
        },
    };
    for (const auto& hook : hooks) {
        ctx->slave(2).hooks.preop_to_safeop = hook;
        MapRequest map;
        map.image = image;
        map.timeout = 50ms;
        ASSERT_TRUE(submit(*ctx, map).ok());
        EXPECT_EQ(words(wait(*ctx, map).error()), "slave 2: the hook of the application: timed out");
    }
}

// A hook that takes its slave out of PREOP, whenever the slave is started.
TEST_F(Mistakes, AHookThatTakesItsSlaveToInitIsReportedOnce) {
    ASSERT_TRUE(config_init(*ctx).ok());
    bool wrong = false;
    ctx->slave(2).hooks.user = &wrong;
    ctx->slave(2).hooks.preop_to_safeop = [](HookedSlave slave, void* user) -> Task<> {
        if (!*static_cast<const bool*>(user)) co_return Nothing{};
        const std::array init{std::byte{1}, std::byte{0}};
        auto written = co_await slave.register_write(0x0120, init);
        if (!written) co_return written;
        auto slept = co_await slave.sleep(1s);
        co_return slept;
    };
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    wrong = true;
    (void)all(ctx->errors());
    segment.set_power(1, false, osal.now());
    cycles(100);
    segment.set_power(1, true, osal.now());
    unsigned reports = 0;
    for (int n = 0; n < 2'000; ++n) {
        cycles(1);
        while (const auto event = ctx->events().take())
            if (event->kind == EventKind::recovery_failed && event->slave == 2) ++reports;
    }
    EXPECT_EQ(reports, 1U);
    EXPECT_EQ(all(ctx->errors()),
              std::vector<std::string>{
                  "slave 2: requesting a state: the slave is not in the state that is wanted (wanted OP, is in INIT)"});
    wrong = false;
    cycles(1'500);
    EXPECT_TRUE(all_right(*ctx)) << words(what_is_wrong(*ctx));
}

// All memory of the sequences, until it is released.
struct Hoard {
    Arena* arena = nullptr;
    std::vector<void*> blocks;
    unsigned tries = 0;
    void take(Arena& from) {
        arena = &from;
        while (void* block = from.allocate(1)) blocks.push_back(block);
    }
    void release() {
        for (void* block : blocks) arena->release(block);
        blocks.clear();
    }
};

Task<> a_sequence_of_its_own(HookedSlave slave) {
    std::array<std::byte, 2> type{};
    auto read = co_await slave.register_read(0x0000, type);
    co_return read;
}

// A hook finds no memory, and tries again until another one has released some.
TEST_F(Mistakes, AHookThatTriesAgainWithoutMemoryStopsNobody) {
    ASSERT_TRUE(config_init(*ctx).ok());
    Hoard hoard;
    ctx->slave(2).hooks.user = &hoard;
    ctx->slave(2).hooks.preop_to_safeop = [](HookedSlave slave, void* user) -> Task<> {
        Hoard& all = *static_cast<Hoard*>(user);
        auto others = co_await slave.sleep(100ms);  // the other slave is mapped meanwhile
        if (!others) co_return others;
        all.take(slave.arena());
        for (;; ++all.tries) {
            auto done = co_await a_sequence_of_its_own(slave);
            if (done) co_return done;
            EXPECT_EQ(done.error().code, Errc::capacity);
            auto slept = co_await slave.sleep(10ms);
            (void)slept;
        }
    };
    MapRequest map;
    map.image = image;
    ASSERT_TRUE(submit(*ctx, map).ok());
    for (int n = 0; n < 2'000 && (hoard.blocks.empty() || hoard.tries < 5); ++n) osal.wait(poll(*ctx, osal.now()), -1);
    EXPECT_TRUE(map.busy());
    EXPECT_EQ(hoard.tries, 5U);
    hoard.release();
    const auto mapped = wait(*ctx, map);
    EXPECT_TRUE(mapped.ok()) << words(mapped.error());
    EXPECT_LE(hoard.tries, 6U);
}

TEST_F(Mistakes, ARequestThatWasNotSubmittedCannotBeWaitedFor) {
    ASSERT_TRUE(config_init(*ctx).ok());
    SdoUpload request;
    EXPECT_EQ(words(wait(*ctx, request).error()),
              "SDO upload: not possible in this state (the request was not submitted to this context: call submit())");
}

TEST_F(Mistakes, ARequestThatIsBusySaysSoWhenItIsSubmittedAgain) {
    ScanRequest scan;
    ASSERT_TRUE(submit(*ctx, scan).ok());
    EXPECT_EQ(words(submit(*ctx, scan).error()), "counting slaves: already in progress (a scan is busy)");
    EXPECT_TRUE(wait(*ctx, scan).ok());
}

// The memory that the application has set is too small for any sequence.
TEST(SmallMemory, BothLimitsOfSequencesAreNamed) {
    VirtualOsal osal;
    sim::Segment segment;
    ASSERT_TRUE(segment.connect_master({segment.add(std::move(*sim::make_device("coupler")).assemble()), 0}));
    segment.power_up(osal.now());
    SimulatedNic nic(segment, osal);
    HostContext ctx({.slaves = 2, .arena_bytes = 300});
    ASSERT_TRUE(init(ctx, nic, osal).ok());
    std::array<char, 400> text{};
    EXPECT_EQ(describe(config_init(ctx).error(), text), "not enough memory: Limits::tasks, or Limits::arena_bytes");
}

TEST_F(Mistakes, ARequestOfAnotherContextCannotBeWaitedFor) {
    sim::Segment other_segment;
    ASSERT_TRUE(
        other_segment.connect_master({other_segment.add(std::move(*sim::make_device("coupler")).assemble()), 0}));
    other_segment.power_up(osal.now());
    SimulatedNic other_nic(other_segment, osal);
    HostContext other;
    ASSERT_TRUE(init(other, other_nic, osal).ok());
    ScanRequest request;
    ASSERT_TRUE(submit(*ctx, request).ok());
    EXPECT_EQ(wait(other, request).error().code, Errc::wrong_state);
    EXPECT_TRUE(request.busy());
    EXPECT_TRUE(wait(*ctx, request).ok());
}

// The supervision leaves its scope at once: nothing watches the slaves, and the program looks right.
TEST_F(Mistakes, ASupervisionThatIsDestroyedBeforeItBeginsIsReported) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    (void)events();
    {
        SuperviseRequest gone;
        ASSERT_TRUE(submit(*ctx, gone).ok());
    }
    cycles(2);
    EXPECT_EQ(events(), std::vector<std::string>{"the supervision has ended: lost slaves are not brought back"});
}

TEST_F(Mistakes, OneImageForTwoGroupsIsRefused) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ctx->slave(2).config.group = 1;
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(
        words(config_map(*ctx, image, 1).error()),
        "mapping process data: the image overlaps that of another group: give each group octets of its own (group "
        "0)");
    EXPECT_TRUE(config_map(*ctx, std::span(image).subspan(2), 1).ok()) << "the octets behind those that are used";
    EXPECT_TRUE(config_map(*ctx, second_image, 1).ok());
    EXPECT_TRUE(config_map(*ctx, second_image, 1).ok()) << "the same group again";
}

TEST_F(Mistakes, ACycleWithinACycleIsRefused) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    Error inner_cycle;
    Error inner_reach;
    const auto nothing = [](const CycleInfo&) { return false; };
    ASSERT_TRUE(run_cycle(*ctx, {}, [&](const CycleInfo&) {
                    inner_cycle = run_cycle(*ctx, {}, nothing).error();
                    inner_reach = reach(*ctx, AlState::op, 1s).error();
                    return false;
                }).ok());
    EXPECT_EQ(inner_cycle.code, Errc::in_callback);
    EXPECT_EQ(inner_reach.code, Errc::in_callback);
    EXPECT_TRUE(run_cycle(*ctx, {}, nothing).ok()) << "afterwards it is allowed again";
}

bool end_at_once(const CycleInfo& cycle) { return cycle.number < 3; }

TEST_F(Mistakes, TheWorkOfACycleMayBeAPlainFunction) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_TRUE(run_cycle(*ctx, {}, end_at_once).ok());
    EXPECT_EQ(ctx->group(0).cycles_sent, 3U);
}

TEST_F(Mistakes, WishesWrittenBeforeASubmittedScanAreWarnedOf) {
    ctx->slave(1).config.group = 1;
    ScanRequest scan;
    ASSERT_TRUE(submit(*ctx, scan).ok());
    ASSERT_TRUE(wait(*ctx, scan).ok());
    EXPECT_EQ(all(ctx->warnings()).size(), 1U);
    ctx->slave(9).hooks.preop_to_safeop = [](HookedSlave, void*) { return Result<>(); };
    MapRequest map;
    map.image = image;
    ASSERT_TRUE(submit(*ctx, map).ok());
    ASSERT_TRUE(wait(*ctx, map).ok());
    EXPECT_EQ(all(ctx->warnings()).size(), 1U);
}

TEST_F(Mistakes, ValuesOutOfRangeAreRefused) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ReadStateRequest look;
    look.priority = 4;
    EXPECT_EQ(submit(*ctx, look).error().code, Errc::invalid_argument);
    look.priority = 3;
    look.timeout = -1ms;
    EXPECT_EQ(submit(*ctx, look).error().code, Errc::invalid_argument);
    EXPECT_EQ(look.state(), RequestState::error) << "not the success of an earlier submission";
    EXPECT_EQ(wait(*ctx, look).error().code, Errc::invalid_argument);
    look.timeout = 0ms;
    EXPECT_TRUE(submit(*ctx, look).ok());
    const auto nothing = [](const CycleInfo&) { return false; };
    EXPECT_EQ(run_cycle(*ctx, {.period = 0ms}, nothing).error().code, Errc::invalid_argument);
    EXPECT_EQ(run_cycle(*ctx, {.reply_timeout = -1ms}, nothing).error().code, Errc::invalid_argument);
    EXPECT_EQ(reach(*ctx, AlState::op, 1s, {.period = -1ms}).error().code, Errc::invalid_argument);
    ASSERT_TRUE(allow_waiting(*ctx, false).ok());
    EXPECT_EQ(run_cycle(*ctx, {.period = 0ms}, nothing).error().code, Errc::invalid_argument);
    EXPECT_TRUE(run_cycle(*ctx, {}, nothing).ok()) << "the cycle of the owner is not forbidden";
    EXPECT_EQ(reach(*ctx, AlState::op, 1s).error().code, Errc::waiting_forbidden);
    EXPECT_EQ(watch_mailboxes(*ctx, -1ms).error().code, Errc::invalid_argument);
}

TEST_F(Mistakes, AnOwnerThatExchangesAndNeverPollsIsNamed) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(submit(*ctx, supervision).ok());
    const auto exchange = [&](int cycles) {
        for (int n = 0; n < cycles; ++n) {
            (void)send_processdata(*ctx);
            (void)receive_processdata(*ctx, 1ms);
            osal.advance(1ms);
        }
    };
    exchange(500);
    EXPECT_NE(what_is_wrong(*ctx).code, Errc::not_polled) << "not for long enough";
    exchange(700);
    EXPECT_EQ(words(what_is_wrong(*ctx)),
              "exchanging process data: the thread that owns the context does not call poll()");
    (void)poll(*ctx, osal.now());
    EXPECT_NE(what_is_wrong(*ctx).code, Errc::not_polled);
}

TEST_F(Mistakes, ASupervisionThatGoesOutOfScopeIsReported) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    ASSERT_TRUE(reach(*ctx, AlState::op, 2s).ok());
    EXPECT_EQ(told(events(), "supervision"), 0) << "reach() supervises for itself";
    {
        SuperviseRequest forgotten;
        ASSERT_TRUE(submit(*ctx, forgotten).ok());
        cycles(20);
        EXPECT_EQ(told(events(), "supervision"), 0);
    }
    cycles(1);
    EXPECT_EQ(events(), std::vector<std::string>{"the supervision has ended: lost slaves are not brought back"});
}

TEST_F(Mistakes, ErrorsOfTheSegmentAreInTheLogToo) {
    power(0, false);
    const auto found = config_init(*ctx);
    ASSERT_FALSE(found.ok());
    EXPECT_EQ(all(ctx->errors()), std::vector<std::string>{words(found.error())});
    power(0, true);
    osal.advance(1s);
    ASSERT_TRUE(config_init(*ctx).ok());
    const auto mapped = config_map(*ctx, std::span(image).first(3));
    EXPECT_EQ(words(mapped.error()),
              "mapping process data: the process image is larger than the buffer (needed 4, there is room for 3)")
        << "no slave is named: the buffer is too small for all of them";
    EXPECT_EQ(all(ctx->errors()), std::vector<std::string>{words(mapped.error())});
}

TEST_F(Mistakes, AListThatNoSlaveCanHaveSaysWhy) {
    static constexpr PdoEntry kNoBits[] = {{0x7000, 1, 8}, {0x7000, 2, 0}};
    static constexpr PdoEntry kEight[] = {{0x7000, 1, 8}};
    static constexpr Pdo kEmptyEntry[] = {{0x1600, kNoBits}};
    static constexpr Pdo kObject[] = {{0x6000, kEight}};
    static constexpr Pdo kTwice[] = {{0x1600, kEight}, {0x1600, kEight}};
    static constexpr Pdo kOnce[] = {{0x1600, kEight}};
    static constexpr SmPdos kTwoLists[][2] = {
        {{0, kEmptyEntry}, {1, {}}}, {{0, kObject}, {1, {}}}, {{0, kTwice}, {1, {}}}, {{0, kOnce}, {0, kOnce}}};
    static constexpr SlaveSetup kSetups[] = {
        {.pdos = kTwoLists[0]}, {.pdos = kTwoLists[1]}, {.pdos = kTwoLists[2]}, {.pdos = kTwoLists[3]}};
    static constexpr std::string_view kSaid[] = {
        "slave 1: configuring PDOs of 0x1600:2: the list of PDOs is invalid (an entry has 0 bits)",
        "slave 1: configuring PDOs of 0x6000:0: the list of PDOs is invalid (PDOs are 0x1600 to 0x17FF and "
        "0x1A00 to 0x1BFF)",
        "slave 1: configuring PDOs of 0x1600:0: the list of PDOs is invalid (the PDO is listed twice)",
        "slave 1: configuring PDOs of SyncManager 0: the list of PDOs is invalid (two lists name this "
        "SyncManager)"};
    for (std::size_t n = 0; n < std::size(kSetups); ++n) {
        ASSERT_TRUE(config_init(*ctx).ok());
        ctx->slave(1).config.setup = &kSetups[n];
        EXPECT_EQ(words(config_map(*ctx, image).error()), kSaid[n]);
    }
}

TEST_F(Mistakes, AnEntryOfTheExpectedSlavesIsNamed) {
    const ExpectedSlave unknown[] = {{.number = 1}, {.product = 0x101}};
    EXPECT_EQ(
        words(expect(*ctx, unknown).error()),
        "comparing with what is expected: argument out of range (entry 2 of the list: without number, alias or "
        "device id, with the number or station address of another entry, with a reserved station address, or apart "
        "from its hot connect group)");
}

TEST_F(Mistakes, AnEntryOfASlaveThatDoesNotExistIsNamed) {
    Output<std::uint8_t> lamp{9, 0x7000, 1};
    EntryHandle* const entries[] = {&lamp};
    ctx->group(0).config.entries = entries;
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_EQ(words(config_map(*ctx, image).error()),
              "slave 9: mapping process data of 0x7000:1: there is no such slave (there are 2)");
}

TEST_F(Mistakes, LimitsOutOfTheirRangeAreNamed) {
    const auto said = [&](const Limits& wrong) {
        HostContext other(wrong);
        return words(init(other, *nic, osal).error());
    };
    const std::string before = "opening the network interface: argument out of range: ";
    EXPECT_EQ(said({.slaves = 0}), before + "Limits::slaves is 0, it must be 1 to 65535");
    EXPECT_EQ(said({.frames = 0}), before + "Limits::frames is 0, it must be 1 to 128");
    EXPECT_EQ(said({.frames = 129}), before + "Limits::frames is 129, it must be 1 to 128");
    EXPECT_EQ(said({.groups = 0}), before + "Limits::groups is 0, it must be 1 to 256");
    EXPECT_EQ(said({.groups = 257}), before + "Limits::groups is 257, it must be 1 to 256");
    EXPECT_EQ(said({.process_frames = 0}), before + "Limits::process_frames is 0, it must be 1 to 65535");
    HostContext least(Limits{.slaves = 1, .frames = 1, .groups = 1, .process_frames = 1, .emergencies = 0});
    EXPECT_TRUE(init(least, *nic, osal).ok());
}

TEST_F(Mistakes, LinkSettingsOutOfTheirRangeAreNamed) {
    const auto said = [&](const LinkSettings& wrong) {
        HostContext other(limits);
        other.link_settings() = wrong;
        return words(init(other, *nic, osal).error());
    };
    const std::string before = "opening the network interface: argument out of range: ";
    EXPECT_EQ(said({.frame_timeout = 0ms}), before + "LinkSettings::frame_timeout must be above zero");
    EXPECT_EQ(said({.frame_timeout = -1ms}), before + "LinkSettings::frame_timeout must be above zero");
    EXPECT_EQ(said({.queue_timeout = 0ms}), before + "LinkSettings::queue_timeout must be above zero");
    EXPECT_EQ(said({.sendings = 0}), before + "LinkSettings::sendings must be at least 1");
    // After init() the defaults are used in the place of such values.
    ctx->link_settings() = {.frame_timeout = 0ms, .queue_timeout = -1ms, .sendings = 0};
    EXPECT_TRUE(config_init(*ctx).ok());
}

TEST_F(Mistakes, ASharedImageThatIsTooSmallSaysHowMuchItNeeds) {
    std::array<std::byte, 8> little{};
    SharedImage shared(little);
    ctx->group(0).config.shared = &shared;
    ASSERT_TRUE(config_init(*ctx).ok());
    EXPECT_EQ(words(config_map(*ctx, image).error()),
              "mapping process data: not enough memory: SharedImage (needed 12, there is room for 8)");
}

TEST_F(Mistakes, ASlaveWithoutPowerExistsAndDoesNotAnswer) {
    ASSERT_TRUE(config_init(*ctx).ok());
    power(1, false);
    EXPECT_EQ(words(recover_slave(*ctx, 2).error()),
              "slave 2: recovering the slave: the slave does not answer: check its power and its cable");
    EXPECT_EQ(words(recover_slave(*ctx, 3).error()),
              "slave 3: recovering the slave: there is no such slave (there are 2)");
}

TEST_F(Mistakes, ARefusedRequestNamesNoOtherObject) {
    ASSERT_TRUE(config_init(*ctx).ok());
    SdoUpload request;
    request.slave = 1;
    request.index = 0x606C;
    request.priority = 9;
    const auto refused = words(submit(*ctx, request).error());
    EXPECT_EQ(refused.find("0x0000"), std::string::npos) << refused;
}

TEST_F(Mistakes, ASlaveOnItsWayIsNotSaidToHaveTimedOut) {
    ASSERT_TRUE(config_init(*ctx).ok());
    ASSERT_TRUE(config_map(*ctx, image).ok());
    EXPECT_EQ(words(what_is_wrong(*ctx)),
              "slave 1: requesting a state: the slave is not in the state that is wanted (wanted OP, is in SAFEOP)");
}

}  // namespace
}  // namespace margay
