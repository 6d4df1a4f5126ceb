// Requests: which requests exclude each other, how cancelling affects other requests, and what callbacks may do.
#include "segment/bench.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

class Requests : public SegmentTest {
  protected:
    std::array<std::byte, 512> image{};
    std::array<std::byte, 64> memory{};

    void SetUp() override {
        plug("odd_device");
        plug("odd_device");
        switch_on();
        ASSERT_TRUE(bring_up());
    }
    void step() {
        const Time next = poll(ctx, osal.now());
        osal.wait(std::min(next, osal.now() + 1ms), -1);
        segment.advance(osal.now());
    }
    void run(const Request& request) {
        for (int n = 0; n < 20'000 && request.busy(); ++n) step();
        ASSERT_FALSE(request.busy());
    }
    SdoUpload& name_of(SdoUpload& request, std::uint16_t slave) {
        request.slave = slave;
        request.index = 0x1008;
        request.data = memory;
        return request;
    }
};

TEST_F(Requests, TwoScansFollowEachOther) {
    ScanRequest first;
    ScanRequest second;
    ASSERT_TRUE(submit(ctx, first));
    ASSERT_TRUE(submit(ctx, second));
    run(first);
    EXPECT_TRUE(second.busy()) << "the second one begins when the first one is over";
    run(second);
    EXPECT_EQ(first.slaves, 2);
    EXPECT_EQ(second.slaves, 2);
}

TEST_F(Requests, WhatHasNotBegunNamesItsSlaveAndTheOperationInItsWay) {
    MapRequest map;
    map.image = image;
    ASSERT_TRUE(submit(ctx, map));
    (void)poll(ctx, osal.now());
    StateRequest state;
    SiiReadRequest read;
    ReconfigRequest again;
    StateRequest cancelled;
    state.slave = read.slave = again.slave = cancelled.slave = 2;
    state.wanted = cancelled.wanted = AlState::preop;
    read.data = memory;
    state.timeout = read.timeout = again.timeout = 1us;
    for (Request* request : {static_cast<Request*>(&state), static_cast<Request*>(&read), static_cast<Request*>(&again),
                             static_cast<Request*>(&cancelled)})
        ASSERT_TRUE(submit(ctx, *request));
    cancelled.cancel();
    run(again);
    ASSERT_TRUE(map.busy());
    ASSERT_FALSE(state.busy() || read.busy() || cancelled.busy());
    const std::string why = ": timed out (it has not begun: a mapping of process data is busy)";
    EXPECT_EQ(words(state.error()), "slave 2: requesting a state" + why);
    EXPECT_EQ(words(again.error()), "slave 2: recovering the slave" + why);
    EXPECT_EQ(read.error().slave, 2);
    EXPECT_TRUE(words(read.error()).ends_with(why)) << words(read.error());
    EXPECT_EQ(words(cancelled.error()), "slave 2: requesting a state: the request was canceled");
    run(map);
}

TEST_F(Requests, AMappingWaitsForAScanAndAScanForAMapping) {
    ScanRequest scan;
    MapRequest map;
    map.image = image;
    ASSERT_TRUE(submit(ctx, scan));
    ASSERT_TRUE(submit(ctx, map));
    ScanRequest again;
    ASSERT_TRUE(submit(ctx, again));
    run(map);
    EXPECT_FALSE(scan.busy());
    EXPECT_TRUE(again.busy());
    EXPECT_EQ(map.state(), RequestState::success) << words(map.error());
    run(again);
    EXPECT_EQ(again.state(), RequestState::success);
}

TEST_F(Requests, TwoThatNeedTheSameSlaveFollowEachOtherAndOthersDoNotWait) {
    ASSERT_TRUE(config_map(ctx, image));
    ReconfigRequest first;
    StateRequest second;
    ReconfigRequest other;
    first.slave = second.slave = 1;
    other.slave = 2;
    second.wanted = AlState::preop;
    ASSERT_TRUE(submit(ctx, first));
    ASSERT_TRUE(submit(ctx, second));
    ASSERT_TRUE(submit(ctx, other));
    run(first);
    EXPECT_EQ(first.state(), RequestState::success) << words(first.error());
    EXPECT_FALSE(other.busy()) << "the other slave went its way beside the first one";
    EXPECT_TRUE(second.busy());
    run(second);
    run(other);
    EXPECT_EQ(ctx.slave(1).al.state, AlState::preop) << "in the order of submission";
    EXPECT_EQ(ctx.slave(2).al.state, AlState::safeop);
}

// Requests for single slaves that are submitted later do not overtake a request for the whole segment.
TEST_F(Requests, AScanIsNotPassedByRequestsForSlavesForEver) {
    std::array<SiiReadRequest, 4> reads;
    for (auto& read : reads) {
        read.slave = 1;
        read.data = std::span(memory).first(32);
        ASSERT_TRUE(submit(ctx, read));
    }
    ScanRequest scan;
    ASSERT_TRUE(submit(ctx, scan));
    for (int n = 0; n < 20'000 && scan.busy(); ++n) {
        for (auto& read : reads)
            if (!read.busy()) (void)submit(ctx, read);
        step();
    }
    EXPECT_EQ(scan.state(), RequestState::success) << words(scan.error());
    for (auto& read : reads) run(read);
}

TEST_F(Requests, CancellingOneLeavesTheOthersAlone) {
    std::array<SdoUpload, 6> requests;
    for (auto& request : requests) {
        request.timeout = 5s;
        ASSERT_TRUE(submit(ctx, name_of(request, 1)));
    }
    requests[2].cancel();  // poll() has not accepted the request yet
    EXPECT_EQ(requests[2].error().code, Errc::canceled);
    step();
    requests[0].cancel();
    EXPECT_EQ(requests[0].error().code, Errc::canceled);
    for (const std::size_t n : {1U, 3U, 4U, 5U}) {
        run(requests[n]);
        EXPECT_EQ(requests[n].state(), RequestState::success) << n << " " << words(requests[n].error());
    }
}

// ------------------------------------------------------------------ callbacks

struct FromCallback {
    Context* ctx = nullptr;
    Request* cancel = nullptr;
    Errc waiting = Errc::none;
    bool busy_after_cancel = false;
    SdoUpload* submits = nullptr;
    bool submitted = false;
    int calls = 0;

    void act() {
        ++calls;
        waiting = readstate(*ctx).error().code;
        if (submits != nullptr && !submitted) submitted = submit(*ctx, *submits).ok();
        if (cancel == nullptr) return;
        cancel->cancel();
        busy_after_cancel = cancel->busy();
        cancel = nullptr;
    }
    static void event(const Event&, void* user) { static_cast<FromCallback*>(user)->act(); }
    static Result<> hook(HookedSlave, Transition, Moment, void* user) {
        static_cast<FromCallback*>(user)->act();
        return Result<>();
    }
};

TEST_F(Requests, TheSupervisionCanBeCancelledByItsOwnCallback) {
    ASSERT_TRUE(config_map(ctx, image));
    SuperviseRequest supervision;
    SdoUpload upload;
    FromCallback my{.ctx = &ctx, .cancel = &supervision, .submits = &name_of(upload, 1)};
    ctx.events().callback = FromCallback::event;
    ctx.events().user = &my;
    ASSERT_TRUE(submit(ctx, supervision));
    for (int n = 0; n < 200; ++n) step();
    segment.set_power(1, false, osal.now());
    for (int n = 0; n < 200; ++n) step();
    ASSERT_GT(my.calls, 0);
    EXPECT_TRUE(my.busy_after_cancel) << "it is over when poll() has returned";
    EXPECT_EQ(supervision.error().code, Errc::canceled);
    EXPECT_EQ(my.waiting, Errc::in_callback);
    EXPECT_TRUE(my.submitted) << "a callback may submit";
    run(upload);
    EXPECT_EQ(upload.state(), RequestState::success) << words(upload.error());
    ctx.events().callback = nullptr;
}

TEST_F(Requests, TheSupervisionCanBeCancelledByATransitionHook) {
    ASSERT_TRUE(config_map(ctx, image));
    SuperviseRequest supervision;
    FromCallback my{.ctx = &ctx, .cancel = &supervision};
    ctx.slave(1).hooks.user = &my;
    ctx.slave(1).hooks.transition = FromCallback::hook;
    ASSERT_TRUE(submit(ctx, supervision));
    for (int n = 0; n < 500; ++n) {
        (void)send_processdata(ctx);
        (void)receive_processdata(ctx, 500us);
        step();
    }
    EXPECT_GT(my.calls, 0);
    EXPECT_EQ(supervision.error().code, Errc::canceled);
    ctx.slave(1).hooks = {};
    EXPECT_TRUE(readstate(ctx));
}

// ------------------------------------------------------------------ hooks

struct Mode {
    int calls = 0;
    std::int32_t seen = 0;
    static Task<> choose(HookedSlave slave, void* user) {
        auto& my = *static_cast<Mode*>(user);
        ++my.calls;
        auto before = co_await slave.sdo_read<std::uint32_t>(0x1018, 1);
        if (!before) co_return before.error();
        my.seen = static_cast<std::int32_t>(*before);
        auto paused = co_await slave.sleep(2ms);
        if (!paused) co_return paused;
        std::array<std::byte, 1> octet{std::byte{0x5A}};
        co_return co_await slave.register_write(0x0F80, octet);
    }
};

TEST_F(Requests, AHookThatWaitsMeansTheSameAtTheStartAndInRecovery) {
    Mode mode;
    ctx.slave(2).hooks.user = &mode;
    ctx.slave(2).hooks.preop_to_safeop = Mode::choose;
    ASSERT_TRUE(config_map(ctx, image));
    EXPECT_EQ(mode.calls, 1);
    EXPECT_NE(mode.seen, 0);
    EXPECT_EQ(segment.slave(1).peek(0x0F80, 1), std::vector{std::byte{0x5A}});
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    const auto cycles = [&](int count) {
        for (int n = 0; n < count; ++n) {
            (void)send_processdata(ctx);
            (void)receive_processdata(ctx, 500us);
            step();
        }
    };
    cycles(500);
    EXPECT_EQ(ctx.slave(2).al.state, AlState::op);
    segment.set_power(1, false, osal.now());
    cycles(50);
    segment.set_power(1, true, osal.now());
    cycles(2000);
    EXPECT_EQ(ctx.slave(2).al.state, AlState::op) << words(ctx.slave(2).error);
    EXPECT_GE(mode.calls, 2);
    EXPECT_EQ(segment.slave(1).peek(0x0F80, 1), std::vector{std::byte{0x5A}});
}

TEST_F(Requests, WhatAHookMustNotIsRefusedInWords) {
    struct Wrong {
        Context& ctx;
        std::string waiting;
        std::string object;
        std::string address;
        static Task<> hook(HookedSlave slave, void* user) {
            auto& my = *static_cast<Wrong*>(user);
            my.waiting = words(SDOread<std::uint32_t>(my.ctx, 1, 0x1000, 0).error());
            auto parameter = co_await slave.soe_write(0, Idn{1}, {});
            my.object = words(parameter.error());
            auto read = co_await slave.register_read(0x0130, {});
            my.address = words(read.error());
            co_return Result<>();
        }
    } wrong{ctx, {}, {}, {}};
    ctx.slave(1).hooks.user = &wrong;
    ctx.slave(1).hooks.preop_to_safeop = Wrong::hook;
    ASSERT_TRUE(config_map(ctx, image));
    EXPECT_NE(wrong.waiting.find("not possible in a callback, a hook or the work function"), std::string::npos)
        << wrong.waiting;
    EXPECT_NE(wrong.object.find("slave 1: SoE write of"), std::string::npos) << wrong.object;
    EXPECT_NE(wrong.address.find("slave 1: reading at register 0x0130"), std::string::npos) << wrong.address;
}

// A lambda without captures can be a hook.
TEST_F(Requests, ALambdaMayBeASequence) {
    ctx.slave(1).hooks.preop_to_safeop = [](HookedSlave slave, void*) -> Task<> {
        const std::array<std::byte, 1> octet{std::byte{0x77}};
        auto written = co_await slave.register_write(0x0F80, octet);
        co_return written;
    };
    ASSERT_TRUE(config_map(ctx, image));
    EXPECT_EQ(segment.slave(0).peek(0x0F80, 1), std::vector{std::byte{0x77}});
}

}  // namespace
}  // namespace margay
