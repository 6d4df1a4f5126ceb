// Lifetimes of contexts, requests and handles: each of them may end at any moment. A time may be as long as a Duration
// can be.
#include "api/real_line.hpp"
#include "real_osal.hpp"

#include <margay/hooked_slave.hpp>

#include <algorithm>
#include <atomic>
#include <memory>
#include <random>
#include <thread>

namespace margay {
namespace {

using namespace std::chrono_literals;

// Counts the hooks that exist: a hook that is destroyed before its end counts down too.
struct LiveHooks {
    int count = 0;

    class Alive {
      public:
        explicit Alive(LiveHooks& hooks) : hooks_(hooks) { ++hooks_.count; }
        Alive(const Alive&) = delete;
        Alive& operator=(const Alive&) = delete;
        ~Alive() { --hooks_.count; }

      private:
        LiveHooks& hooks_;
    };
    static Task<> hook(HookedSlave slave, void* user) {
        const Alive alive(*static_cast<LiveHooks*>(user));
        std::array<std::byte, 64> data{};
        for (int n = 0; n < 4; ++n) {
            (void)co_await slave.sdo_read(0x1008, 0, data);
            (void)co_await slave.register_read(0x0130, std::span(data).first(2));
            (void)co_await slave.sleep(2ms);
        }
        co_return Result<>();
    }
    static Task<> transition(HookedSlave slave, Transition, Moment, void* user) {
        const Alive alive(*static_cast<LiveHooks*>(user));
        std::array<std::byte, 64> data{};
        (void)co_await slave.sdo_read(0x1008, 0, data);
        (void)co_await slave.sleep(3ms);
        co_return Result<>();
    }
};

// One request of each kind that needs several polls.
struct ManyRequests {
    std::array<std::byte, 256> image{};
    std::array<std::byte, 64> memory{};
    ScanRequest scan;
    MapRequest map;
    StateRequest state;
    SuperviseRequest supervision;
    TargetRequest target;
    ReconfigRequest reconfiguration;
    SdoUpload upload;
    WriteStateRequest write;
    RecoverRequest recovery;
    std::array<Request*, 9> all{&scan,   &map,   &state,   &supervision, &target, &reconfiguration,
                                &upload, &write, &recovery};

    ManyRequests() {
        map.image = image;
        state.slave = 1;
        reconfiguration.slave = 2;
        upload.slave = 3;
        upload.index = 0x1008;
        upload.data = memory;
        state.wanted = target.wanted = write.wanted = AlState::safeop;
        supervision.interval = 1ms;
        supervision.retry = 3ms;
    }
    [[nodiscard]] bool any_busy() const {
        return std::ranges::any_of(all, [](const Request* request) { return request->busy(); });
    }
};

// A segment of three slaves, without a context.
class Lifetime : public testing::Test {
  protected:
    VirtualOsal osal;
    sim::Segment segment;
    SimulatedNic wire{segment, osal};
    LiveHooks hooks;

    void SetUp() override {
        plug_line(segment, 3);
        segment.power_up(osal.now());
        osal.advance(1ms);
    }
    void step(Context& ctx) {
        const Time next = poll(ctx, osal.now());
        osal.wait(std::min(next, osal.now() + 100us), -1);
        segment.advance(osal.now());
    }
    // Submits and cancels the requests at random.
    template <class Below>
    void use_at_random(Context& ctx, ManyRequests& requests, Below below) {
        for (unsigned n = below(12); n > 0; --n) {
            (void)submit(ctx, *requests.all.at(below(9)));
            for (unsigned k = below(40); k > 0; --k) step(ctx);
            if (below(3) == 0) requests.all.at(below(9))->cancel();
            if (below(6) != 0) continue;
            (void)send_processdata(ctx);
            (void)receive_processdata(ctx, 1ms);
        }
    }
};

TEST_F(Lifetime, AContextMayEndAtAnyMomentAndItsRequestsEndWithIt) {
    std::minstd_rand numbers(1);
    const auto below = [&numbers](unsigned end) { return static_cast<unsigned>(numbers() % end); };
    for (int round = 0; round < 60; ++round) {
        SCOPED_TRACE(round);
        ManyRequests requests;
        for (Request* request : requests.all) request->priority = static_cast<std::uint8_t>(below(4));
        {
            Limits limits{.slaves = 8};
            if (below(2) == 0) limits.tasks = static_cast<std::uint16_t>(1 + below(2));
            HostContext ctx{limits};
            ASSERT_TRUE(init(ctx, wire, osal));
            if (!config_init(ctx)) continue;  // the interrupted hooks have left a slave between two states
            if (below(2) == 0) (void)config_map(ctx, requests.image);
            for (const Slave& slave : ctx.slaves()) {
                slave.hooks.user = &hooks;
                slave.hooks.preop_to_safeop = LiveHooks::hook;
                slave.hooks.transition = LiveHooks::transition;
            }
            use_at_random(ctx, requests, below);
            if (below(2) == 0) {
                requests.supervision.cancel();
                for (int n = 0; n < 500'000 && requests.any_busy(); ++n) step(ctx);
                ASSERT_FALSE(requests.any_busy());
            }
        }
        EXPECT_FALSE(requests.any_busy());
        EXPECT_EQ(hooks.count, 0);
    }
}

TEST_F(Lifetime, ARequestMayBeDestroyedBeforeItBegins) {
    HostContext ctx{Limits{.slaves = 8}};
    ASSERT_TRUE(init(ctx, wire, osal));
    ASSERT_TRUE(config_init(ctx));
    ReadStateRequest before;
    ReadStateRequest after;
    ASSERT_TRUE(submit(ctx, before));
    {
        std::array<ReadStateRequest, 3> destroyed;
        ScanRequest scan;
        for (auto& request : destroyed) ASSERT_TRUE(submit(ctx, request));
        ASSERT_TRUE(submit(ctx, scan));
        ASSERT_TRUE(submit(ctx, after));
        destroyed[1].cancel();
        EXPECT_EQ(destroyed[1].error().code, Errc::canceled);
    }
    EXPECT_TRUE(wait(ctx, after));
    EXPECT_EQ(before.state(), RequestState::success);
    EXPECT_TRUE(config_init(ctx));
}

// ------------------------------------------------------------------ threads that wait

// Counts the threads that have begun to sleep.
class SleeperOsal final : public Osal {
  public:
    std::atomic<int> sleepers{0};
    Time now() noexcept override { return real_.now(); }
    void wait(Time until, WaitHandles handle) noexcept override { real_.wait(until, handle); }
    void wake() noexcept override { real_.wake(); }
    std::uintptr_t calling_thread() noexcept override { return real_.thread_number(); }
    void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override {
        ++sleepers;
        real_.sleep_while(word, value, until);
    }
    void wake_sleepers(const void* word) noexcept override { real_.wake_sleepers(word); }

  private:
    RealOsal real_;
};

TEST(LifetimeThreads, AThreadThatSleepsReturnsWhenTheContextGoesAway) {
    for (const bool accepted : {false, true, false, true, false, true}) {
        SCOPED_TRACE(accepted);
        SleeperOsal osal;
        sim::Segment segment;
        SimulatedNic wire{segment, osal};
        plug_line(segment, 1);
        segment.power_up(osal.now());
        auto context = std::make_unique<HostContext>(Limits{.slaves = 8});
        ASSERT_TRUE(init(*context, wire, osal));
        ScanRequest scan;  // the requests of the threads wait for this scan
        ASSERT_TRUE(submit(*context, scan));
        (void)poll(*context, osal.now());
        std::array<ScanRequest, 2> requests;
        std::array<Errc, 2> ended{};
        const auto waits = [&requests, &ended, &ctx = *context](std::size_t n) {
            ASSERT_TRUE(submit(ctx, requests.at(n)));
            ended.at(n) = wait(ctx, requests.at(n)).error().code;
        };
        std::thread first(waits, 0);
        std::thread second(waits, 1);
        while (osal.sleepers < 2) std::this_thread::yield();
        if (accepted) (void)poll(*context, osal.now());
        context.reset();
        first.join();
        second.join();
        EXPECT_EQ(ended[0], Errc::canceled);
        EXPECT_EQ(ended[1], Errc::canceled);
        EXPECT_EQ(scan.error().code, Errc::canceled);
    }
}

// ------------------------------------------------------------------ the longest times

class LongTimes : public SegmentTest {
  protected:
    std::array<std::byte, 256> image{};
    std::array<std::byte, 64> memory{};

    void SetUp() override {
        plug("odd_device");
        plug("odd_device");
        switch_on();
        osal.advance(1h);  // the clock is not zero, so its sum with the longest Duration overflows
        ASSERT_TRUE(bring_up());
    }
    void expect_success(Request& request) {
        request.timeout = Duration::max();
        ASSERT_TRUE(submit(ctx, request));
        const auto done = wait(ctx, request);
        EXPECT_TRUE(done) << words(done.error());
    }
};

TEST_F(LongTimes, ARequestMayHaveTheLongestTimeout) {
    ReadStateRequest read;
    expect_success(read);
    ScanRequest first;
    ASSERT_TRUE(submit(ctx, first));
    ScanRequest second;
    expect_success(second);
    EXPECT_EQ(first.state(), RequestState::success);
    StateRequest state;
    state.slave = 1;
    state.wanted = AlState::init;
    expect_success(state);
    EXPECT_TRUE(reconfigure_slave(ctx, 1));
    SdoUpload upload;
    upload.slave = 1;
    upload.index = 0x1008;
    upload.data = memory;
    expect_success(upload);
}

TEST_F(LongTimes, AFunctionMayHaveTheLongestTimeout) {
    ASSERT_TRUE(config_map(ctx, image));
    EXPECT_TRUE(statecheck(ctx, 1, AlState::safeop, Duration::max()));
    ASSERT_TRUE(send_processdata(ctx));
    EXPECT_TRUE(receive_processdata(ctx, Duration::max()));
    const auto reached = reach(ctx, AlState::op, Duration::max());
    EXPECT_TRUE(reached) << words(reached.error());
}

TEST_F(LongTimes, ASupervisionMayHaveTheLongestIntervals) {
    ASSERT_TRUE(config_map(ctx, image));
    SuperviseRequest supervision;
    supervision.interval = supervision.line_interval = Duration::max();
    ASSERT_TRUE(submit(ctx, supervision));
    for (int n = 0; n < 2'000; ++n) {
        (void)send_processdata(ctx);
        (void)receive_processdata(ctx, 500us);
        osal.wait(std::min(poll(ctx, osal.now()), osal.now() + 1ms), -1);
        segment.advance(osal.now());
    }
    expect_all_in(AlState::op);
    EXPECT_TRUE(supervision.busy());
}

// ------------------------------------------------------------------ callbacks

class Callbacks : public SegmentTest {
  protected:
    std::array<std::byte, 256> image{};

    void SetUp() override {
        plug("odd_device");
        plug("odd_device");
        switch_on();
        ASSERT_TRUE(bring_up());
    }
};

// The calls that the application makes while a callback wants to cancel the supervision.
TEST_F(Callbacks, ACallbackMayCancelTheSupervisionWhateverTheOwnerCalls) {
    ASSERT_TRUE(config_map(ctx, image));
    std::unique_ptr<SuperviseRequest> supervision;
    ctx.events().user = &supervision;
    ctx.events().callback = [](const Event&, void* user) {
        if (auto& request = *static_cast<std::unique_ptr<SuperviseRequest>*>(user)) request->cancel();
    };
    const auto poll_once = [&] {
        osal.wait(std::min(poll(ctx, osal.now()), osal.now() + 100us), -1);
        segment.advance(osal.now());
    };
    int ended = 0;
    for (int round = 0; round < 200; ++round) {
        supervision = std::make_unique<SuperviseRequest>();
        supervision->interval = 1ms;
        ASSERT_TRUE(submit(ctx, *supervision));
        for (int n = round % 17; n > 0; --n) poll_once();
        switch (round % 4) {
            case 0: (void)set_target(ctx, 0, round % 8 == 0 ? AlState::op : AlState::preop); break;
            case 1: (void)tolerate(ctx, {}); break;
            case 2: (void)reach(ctx, round % 8 == 2 ? AlState::op : AlState::safeop, 20ms); break;
            default:
                (void)run_cycle(ctx, {}, [&](const CycleInfo& cycle) {
                    (void)set_target(ctx, 1, cycle.number % 2 == 0 ? AlState::safeop : AlState::op);
                    osal.advance(3ms);
                    return cycle.number < 9;
                });
        }
        ended += supervision->busy() ? 0 : 1;
        supervision.reset();
        poll_once();
    }
    EXPECT_GT(ended, 20);
    ctx.events().callback = nullptr;
    const auto reached = reach(ctx, AlState::op, 2s);
    EXPECT_TRUE(reached) << words(reached.error());
}

}  // namespace
}  // namespace margay
