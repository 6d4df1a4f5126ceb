// Requests that exclude each other. Two operations never work on one slave at the same time, no matter when the second
// operation is submitted. Each operation returns what it has reserved.
#include "segment/bench.hpp"

#include <margay/hooked_slave.hpp>

#include <algorithm>
#include <memory>
#include <random>

namespace margay {
namespace {

using namespace std::chrono_literals;

// Counts the hooks of a slave that exist at the same time.
struct HookCount {
    std::array<int, 3> now{};
    int most = 0;
    int calls = 0;
    Duration duration = 5ms;

    class Inside {
      public:
        Inside(HookCount& count, std::uint16_t slave) : now_(count.now.at(slave)) {
            ++count.calls;
            count.most = std::max(count.most, ++now_);
        }
        Inside(const Inside&) = delete;
        Inside& operator=(const Inside&) = delete;
        ~Inside() { --now_; }

      private:
        int& now_;
    };
    static Task<> hook(HookedSlave slave, void* user) {
        auto& my = *static_cast<HookCount*>(user);
        const Inside inside(my, slave.number());
        std::array<std::byte, 64> name{};
        auto read = co_await slave.sdo_read(0x1008, 0, name);
        if (!read) co_return read.error();
        auto paused = co_await slave.sleep(my.duration);
        co_return paused;
    }
    static Task<> transition(HookedSlave slave, Transition, Moment, void* user) {
        auto& my = *static_cast<HookCount*>(user);
        const Inside inside(my, slave.number());
        auto paused = co_await slave.sleep(my.duration);
        co_return paused;
    }
};

class Exclusion : public SegmentTest {
  protected:
    std::array<std::byte, 512> image{};
    std::array<std::byte, 64> memory{};
    HookCount hooks;

    void SetUp() override {
        plug("odd_device");
        plug("odd_device");
        switch_on();
        ASSERT_TRUE(bring_up());
    }
    void TearDown() override { EXPECT_LE(hooks.most, 1) << "a hook of one slave ran twice at the same time"; }
    void use_hooks() {
        for (const Slave& slave : ctx.slaves()) {
            slave.hooks.user = &hooks;
            slave.hooks.preop_to_safeop = HookCount::hook;
        }
    }
    void step() {
        const Time next = poll(ctx, osal.now());
        osal.wait(std::min(next, osal.now() + 100us), -1);
        segment.advance(osal.now());
    }
    void steps(int count) {
        while (count-- > 0) step();
    }
    // The hook of slave 1 lasts 100 ms.
    void reconfigure_with_a_long_hook(ReconfigRequest& request) {
        use_hooks();
        hooks.duration = 100ms;
        request.slave = 1;
        ASSERT_TRUE(submit(ctx, request));
        for (int n = 0; n < 1'000 && hooks.now[1] == 0; ++n) step();
        ASSERT_EQ(hooks.now[1], 1);
    }
    void cycles(int count) {
        while (count-- > 0) {
            (void)send_processdata(ctx);
            (void)receive_processdata(ctx, 500us);
            step();
        }
    }
    [[nodiscard]] bool ends(const Request& request) {
        for (int n = 0; n < 500'000 && request.busy(); ++n) step();
        return !request.busy();
    }
    void expect_success(const Request& request) {
        ASSERT_TRUE(ends(request));
        EXPECT_EQ(request.state(), RequestState::success) << words(request.error());
    }
    int count_events(EventKind kind) {
        int count = 0;
        while (const auto event = ctx.events().take()) count += event->kind == kind ? 1 : 0;
        return count;
    }
};

// ------------------------------------------------------------------ the supervision beside other requests

TEST_F(Exclusion, ASupervisionDoesNotBeginDuringAScan) {
    int together = 0;
    for (int delay = 0; delay < 4'000; delay += 7) {
        ScanRequest scan;
        ASSERT_TRUE(submit(ctx, scan));
        for (int n = 0; n < delay && scan.busy(); ++n) step();
        if (!scan.busy()) break;
        SuperviseRequest supervision;
        if (submit(ctx, supervision)) {
            ++together;
            steps(5);
            if (scan.busy()) {
                SuperviseRequest second;
                const Errc refused = submit(ctx, second).error().code;  // busy if the first request has begun
                EXPECT_NE(refused, Errc::busy) << "it had begun during the scan, after " << delay << " steps";
            }
            if (delay % 2 == 0) supervision.cancel();
            step();
        }
        expect_success(scan);
        if (!supervision.busy()) expect_all_in(AlState::preop);
        supervision.cancel();
        step();
        (void)count_events(EventKind::unsupervised);
    }
    EXPECT_GT(together, 10);
}

TEST_F(Exclusion, ASupervisionLeavesASlaveAloneThatATargetRequestBringsToItsTarget) {
    ASSERT_TRUE(config_map(ctx, image));
    use_hooks();
    hooks.duration = 20ms;
    int together = 0;
    for (int delay = 0; delay < 400; delay += 10) {
        (void)set_target(ctx, 0, AlState::preop);
        TargetRequest target;
        target.wanted = AlState::safeop;
        SuperviseRequest supervision;
        supervision.target = AlState::safeop;
        supervision.interval = 1ms;
        ASSERT_TRUE(submit(ctx, target));
        for (int n = 0; n < delay && target.busy(); ++n) step();
        if (!target.busy()) break;
        ASSERT_TRUE(submit(ctx, supervision));
        ++together;
        expect_success(target);
        steps(1'000);
        expect_all_in(AlState::safeop);
        EXPECT_EQ(count_events(EventKind::recovery_failed), 0) << delay;
    }
    EXPECT_GT(together, 10);
}

TEST_F(Exclusion, AMappingWaitsForTheSlavesThatTheSupervisionBringsBack) {
    ASSERT_TRUE(config_map(ctx, image));
    use_hooks();
    SuperviseRequest supervision;
    supervision.interval = 1ms;
    supervision.retry = 5ms;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(1'000);
    for (int delay = 0; delay < 300; delay += 23) {
        segment.set_power(1, false, osal.now());
        cycles(100);
        segment.set_power(1, true, osal.now());
        steps(delay);
        MapRequest map;
        map.image = image;
        ASSERT_TRUE(submit(ctx, map));
        ASSERT_TRUE(ends(map));
        cycles(3'000);
        EXPECT_EQ(what_is_wrong(ctx).code, Errc::none) << delay << " " << words(what_is_wrong(ctx));
    }
}

// ------------------------------------------------------------------ two requests for one slave

TEST_F(Exclusion, WritingAStateWaitsForTheChangeOfStateOfTheSameSlave) {
    use_hooks();
    ctx.slave(1).hooks.transition = HookCount::transition;
    StateRequest change;
    change.slave = 1;
    change.wanted = AlState::safeop;
    WriteStateRequest write;
    write.slave = 1;
    write.wanted = AlState::safeop;
    ASSERT_TRUE(submit(ctx, change));
    steps(20);
    ASSERT_TRUE(submit(ctx, write));
    ASSERT_TRUE(ends(change));
    EXPECT_TRUE(write.busy());
    ASSERT_TRUE(ends(write));
}

TEST_F(Exclusion, WritingAStateWaitsForAMapping) {
    use_hooks();
    MapRequest map;
    map.image = image;
    WriteStateRequest write;
    write.slave = 1;
    write.wanted = AlState::safeop;
    ASSERT_TRUE(submit(ctx, map));
    steps(20);
    ASSERT_TRUE(submit(ctx, write));
    expect_success(map);
    EXPECT_TRUE(write.busy());
    expect_success(write);
    EXPECT_EQ(hooks.calls, 2) << "once for each slave";
}

TEST_F(Exclusion, TheGroupOfASlaveMayChangeWhileAnEntryIsLookedFor) {
    ASSERT_TRUE(config_map(ctx, image));
    EntryRequest request;
    request.address = EntryAddress::object(1, 0x7000, 1);
    ASSERT_TRUE(submit(ctx, request));
    steps(3);
    ASSERT_TRUE(request.busy());
    ctx.slave(1).config.group = 200;
    ASSERT_TRUE(ends(request));
    EXPECT_EQ(request.state(), RequestState::success) << words(request.error());
    EXPECT_EQ(request.place.group, 0) << "the group changes with the next mapping";
}

TEST_F(Exclusion, APlaceThatWasFoundBesideAScanIsStale) {
    for (int delay = 0; delay < 60; ++delay) {
        (void)config_map(ctx, image);
        EntryRequest request;
        request.address = EntryAddress::object(1, 0x7000, 1);
        ASSERT_TRUE(submit(ctx, request));
        steps(delay);
        ScanRequest scan;
        ASSERT_TRUE(submit(ctx, scan));
        ASSERT_TRUE(ends(request));
        expect_success(scan);
        if (request.state() != RequestState::success) continue;
        EXPECT_EQ(read_entry<std::uint16_t>(ctx, request.place).error().code, Errc::entry_stale) << delay;
    }
}

// ------------------------------------------------------------------ targets and turns

TEST_F(Exclusion, ASlaveWithoutItsOwnTargetFollowsTheTargetOfAllAtWhateverMomentItEnds) {
    ASSERT_TRUE(config_map(ctx, image));
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(1'000);
    for (int delay = 0; delay < 40; ++delay) {
        ASSERT_TRUE(set_target(ctx, 1, AlState::preop));
        cycles(delay);
        ASSERT_TRUE(set_target(ctx, 1, AlState::none));
        cycles(300);
        EXPECT_EQ(ctx.slave(1).al.state, AlState::op) << delay << " " << words(what_is_wrong(ctx));
    }
    supervision.cancel();
    ASSERT_TRUE(set_target(ctx, 0, AlState::safeop));
    ASSERT_TRUE(set_target(ctx, 1, AlState::preop));
    EXPECT_EQ(ctx.slave(1).al.state, AlState::preop);
    EXPECT_TRUE(set_target(ctx, 1, AlState::none)) << "without a supervision the call itself changes the state";
    EXPECT_EQ(ctx.slave(1).al.state, AlState::safeop);
    EXPECT_EQ(set_target(ctx, 0, AlState::none).error().code, Errc::invalid_argument);
    EXPECT_EQ(set_target(ctx, 9, AlState::none).error().code, Errc::unknown_slave);
}

// Twelve requests of the highest priority are submitted again as soon as they are over.
TEST_F(Exclusion, RequestsOfTheHighestPriorityDoNotBlockOneOfTheLowestForEver) {
    std::array<SiiReadRequest, 12> urgent;
    std::array<std::byte, 32> words_of_sii{};
    for (auto& request : urgent) {
        request.slave = 1;
        request.priority = 3;
        request.data = words_of_sii;
        ASSERT_TRUE(submit(ctx, request));
    }
    SiiReadRequest low;
    low.slave = 1;
    low.data = std::span(memory).first(32);
    ASSERT_TRUE(submit(ctx, low));
    int passed = 0;
    for (int n = 0; n < 200'000 && low.busy(); ++n) {
        for (auto& request : urgent)
            if (!request.busy()) {
                ASSERT_TRUE(submit(ctx, request));
                ++passed;
            }
        step();
    }
    EXPECT_EQ(low.state(), RequestState::success);
    EXPECT_GT(passed, 4) << "the others have a higher priority";
    EXPECT_LT(passed, 40);
}

// ------------------------------------------------------------------ random moments

// A request of each kind, with valid parameters.
using AnyRequest = std::unique_ptr<Request, void (*)(Request*)>;  // the destructor of Request is protected
template <class T>
AnyRequest request_of(T* request) {
    return {request, [](Request* r) { delete static_cast<T*>(r); }};
}
template <class T>
T* for_slave(std::uint16_t slave) {
    T* request = new T;
    request->slave = slave;
    return request;
}
template <class T>
T* to_safeop(std::uint16_t slave) {
    T* request = for_slave<T>(slave);
    request->wanted = AlState::safeop;
    return request;
}
constexpr unsigned kSupervise = 11;

AnyRequest make(unsigned kind, std::span<std::byte> image, std::span<std::byte> data) {
    switch (kind) {
        case 0: return request_of(new ScanRequest);
        case 1: {
            auto* map = new MapRequest;
            map->image = image;
            return request_of(map);
        }
        case 2: return request_of(to_safeop<StateRequest>(1));
        case 3: return request_of(to_safeop<WriteStateRequest>(0));
        case 4: return request_of(to_safeop<StateCheckRequest>(2));
        case 5: return request_of(to_safeop<TargetRequest>(0));
        case 6: return request_of(for_slave<ReconfigRequest>(2));
        case 7: return request_of(new RecoverRequest);
        case 8: {
            auto* upload = for_slave<SdoUpload>(2);
            upload->index = 0x1008;
            upload->data = data;
            return request_of(upload);
        }
        case 9: {
            auto* read = for_slave<SiiReadRequest>(2);
            read->data = data;
            return request_of(read);
        }
        case 10: return request_of(new ReadStateRequest);
        default: {
            auto* supervision = new SuperviseRequest;
            supervision->interval = 1ms;
            supervision->retry = 5ms;
            return request_of(supervision);
        }
    }
}

// The second request is submitted at a random moment, and one of the two requests is cancelled or destroyed at a random
// moment. Then a scan and a mapping succeed.
TEST_F(Exclusion, EachPairOfRequestsEndsAndReturnsWhatItHasReserved) {
    std::minstd_rand numbers(1);
    const auto below = [&numbers](unsigned end) { return static_cast<unsigned>(numbers() % end); };
    const auto moment = [&below] { return static_cast<int>(below(250)); };
    (void)config_map(ctx, image);
    for (int round = 0; round < 1'500; ++round) {
        const unsigned first_kind = below(kSupervise + 1);
        const unsigned second_kind = below(kSupervise + 1);
        SCOPED_TRACE(testing::Message() << "round " << round << ": " << first_kind << " and " << second_kind);
        auto first = make(first_kind, image, memory);
        auto second = make(second_kind, image, memory);
        if (below(4) == 0) use_hooks();
        if (submit(ctx, *first)) {
            steps(moment());
            if (submit(ctx, *second)) steps(moment());
        }
        if (below(2) == 0 || first_kind == kSupervise) first->cancel();
        if (below(4) == 0 || second_kind == kSupervise) second.reset();
        ASSERT_TRUE(second == nullptr || ends(*second));
        ASSERT_TRUE(ends(*first));
        if (round % 10 != 9) continue;
        const auto scanned = config_init(ctx);
        ASSERT_TRUE(scanned) << words(scanned.error());
        const auto mapped = config_map(ctx, image);
        ASSERT_TRUE(mapped) << words(mapped.error());
    }
}

// ------------------------------------------------------------------ requests for all slaves

// Slave 0 means all slaves, so such a request waits for each operation on any slave.
TEST_F(Exclusion, RequestsForAllSlavesWaitForTheHookOfOneSlave) {
    ASSERT_TRUE(config_map(ctx, image));
    for (const Slave& slave : ctx.slaves()) {
        slave.hooks.user = &hooks;
        slave.hooks.transition = HookCount::transition;
    }
    hooks.duration = 50ms;
    SuperviseRequest supervision;
    supervision.target = AlState::safeop;
    ASSERT_TRUE(submit(ctx, supervision));
    for (int round = 0; round < 3; ++round) {
        steps(3'000);
        expect_all_in(AlState::safeop);
        segment.set_power(1, false, osal.now());
        steps(300);
        segment.set_power(1, true, osal.now());
        for (int n = 0; n < 20'000 && hooks.now[2] == 0; ++n) step();
        ASSERT_EQ(hooks.now[2], 1) << "the supervision is in the hook of slave 2";
        WriteStateRequest write;
        write.wanted = AlState::safeop;
        RecoverRequest recovery;
        MapRequest map;
        map.image = image;
        const std::array<Request*, 3> all{&write, &recovery, &map};
        Request& request = *all[static_cast<std::size_t>(round)];
        ASSERT_TRUE(submit(ctx, request));
        steps(20);
        EXPECT_TRUE(request.busy()) << "it waits, round " << round;
        ASSERT_TRUE(ends(request));
    }
}

// The supervision does not use this slave. The request waits because of the mapping, which waits for another slave.
TEST_F(Exclusion, WhatWaitsBehindAWaitingMappingNamesTheMapping) {
    ASSERT_TRUE(config_map(ctx, image));
    SuperviseRequest supervision;
    supervision.target = AlState::safeop;
    ASSERT_TRUE(submit(ctx, supervision));
    steps(200);
    ReconfigRequest first;
    ASSERT_NO_FATAL_FAILURE(reconfigure_with_a_long_hook(first));
    MapRequest map;
    map.image = image;
    ASSERT_TRUE(submit(ctx, map));
    StateRequest state;
    state.slave = 2;
    state.wanted = AlState::safeop;
    state.timeout = 1ms;
    ASSERT_TRUE(submit(ctx, state));
    ASSERT_TRUE(ends(state));
    EXPECT_TRUE(first.busy() && map.busy());
    EXPECT_EQ(words(state.error()),
              "slave 2: requesting a state: timed out (it has not begun: a mapping of process data is busy)");
    expect_success(first);
    expect_success(map);
}

// Recovering one slave needs the whole segment.
TEST_F(Exclusion, ARecoveryOfASlaveNamesTheReconfigurationOfAnother) {
    ASSERT_TRUE(config_map(ctx, image));
    ReconfigRequest first;
    ASSERT_NO_FATAL_FAILURE(reconfigure_with_a_long_hook(first));
    RecoverRequest recovery;
    recovery.slave = 2;
    recovery.timeout = 1ms;
    ASSERT_TRUE(submit(ctx, recovery));
    ASSERT_TRUE(ends(recovery));
    EXPECT_TRUE(first.busy());
    EXPECT_EQ(words(recovery.error()),
              "slave 2: recovering the slave: timed out (it has not begun: a reconfiguration is busy)");
    expect_success(first);
}

TEST_F(Exclusion, AScanWaitsForTheHookThatAReadingOfTheStatesExecutes) {
    ASSERT_TRUE(config_map(ctx, image));
    ASSERT_TRUE(writestate(ctx, 2, AlState::preop));
    ctx.slave(2).hooks.user = &hooks;
    ctx.slave(2).hooks.transition = HookCount::transition;
    hooks.duration = 50ms;
    ReadStateRequest look;
    ASSERT_TRUE(submit(ctx, look));
    for (int n = 0; n < 1'000 && hooks.now[2] == 0; ++n) step();
    ASSERT_EQ(hooks.now[2], 1);
    ScanRequest scan;
    ASSERT_TRUE(submit(ctx, scan));
    steps(100);
    EXPECT_EQ(hooks.now[2], 1);
    EXPECT_EQ(ctx.slaves().size(), 2U) << "the scan has not begun";
    expect_success(scan);
    EXPECT_TRUE(ends(look));
}

// A reading that began before a scan does not count as a reading of the slaves that the scan has found.
TEST_F(Exclusion, AReadingOfTheStatesBesideAScanIsNoSuccess) {
    int beside = 0;
    for (int delay = 0; delay < 40; ++delay) {
        ScanRequest scan;
        StateCheckRequest check;
        check.wanted = AlState::safeop;
        check.timeout = 500ms;
        ASSERT_TRUE(submit(ctx, check));
        steps(delay);
        ASSERT_TRUE(submit(ctx, scan));
        ASSERT_TRUE(ends(check) && ends(scan));
        beside += check.state() == RequestState::error ? 1 : 0;
        EXPECT_TRUE(check.state() == RequestState::error || check.reached.state != AlState::none);
    }
    EXPECT_GT(beside, 0);
}

}  // namespace
}  // namespace margay
