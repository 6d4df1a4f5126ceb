// The thread that owns a context, and the calls that other threads may make. These tests use real time, because each of
// the threads would advance a shared virtual clock. No result depends on durations.
#include "api/real_line.hpp"
#include "real_osal.hpp"

#include <atomic>
#include <thread>

namespace margay {
namespace {

using namespace std::chrono_literals;

// Counts the calls of Osal functions by waiting threads.
class CountingOsal final : public Osal {
  public:
    std::atomic<int> waits_of_others{0};
    std::atomic<int> sleeps{0};
    std::atomic<int> looks{0};  // short sleeps, after which the thread checks again
    std::atomic<int> wakes{0};
    std::atomic<Duration::rep> skipped{0};  // time that passed in jumps
    bool jump = false;                      // a sleeping thread advances the time at once
    Time now() noexcept override { return real_.now() + Duration(skipped.load()); }
    void wait(Time until, WaitHandles handle) noexcept override {
        if (thread_number() != owner_) ++waits_of_others;
        real_.wait(until == kNever ? kNever : until - Duration(skipped.load()), handle);
    }
    void wake() noexcept override { real_.wake(); }
    std::uintptr_t calling_thread() noexcept override { return real_.thread_number(); }
    void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override {
        ++sleeps;
        if (until != kNever && until - now() < 100ms) ++looks;
        if (jump && until != kNever) {
            skipped += std::max(until - now(), Duration{0}).count();
            return;
        }
        real_.sleep_while(word, value, until);
    }
    void wake_sleepers(const void* word) noexcept override {
        ++wakes;
        real_.wake_sleepers(word);
    }

  private:
    RealOsal real_;
    std::uintptr_t owner_ = real_.thread_number();
};

class Ownership : public RealLine<CountingOsal> {
  protected:
    // The owner polls, while another thread executes `work`.
    template <class Work>
    void beside_the_owner(Work work) {
        std::thread other([&] {
            work();
            stop_owner();
        });
        poll_until_stopped(20ms);
        other.join();
    }
};

TEST_F(Ownership, CallsOfTheOwnerAreRefusedToOtherThreads) {
    ASSERT_TRUE(config_init(ctx));
    ASSERT_TRUE(config_map(ctx, image));
    ASSERT_TRUE(send_processdata(ctx));
    std::thread([&] {
        EXPECT_EQ(send_processdata(ctx).error().code, Errc::not_owner);
        EXPECT_EQ(receive_processdata(ctx, 1ms).error().code, Errc::not_owner);
        EXPECT_EQ(expect(ctx, {}).error().code, Errc::not_owner);
        EXPECT_EQ(poll(ctx, osal.now()), kNever);
    }).join();
    EXPECT_TRUE(receive_processdata(ctx, 100ms)) << "nothing was taken from the owner";
    while (ctx.errors().take()) {
    }
    (void)poll(ctx, osal.now());
    const auto told = ctx.errors().take();
    ASSERT_TRUE(told.has_value());
    EXPECT_EQ(told->code, Errc::not_owner) << "another thread has polled";
}

TEST_F(Ownership, AnotherThreadTakesItOver) {
    ASSERT_TRUE(config_init(ctx));
    ASSERT_TRUE(config_map(ctx, image));
    std::thread([&] {
        ASSERT_TRUE(take_ownership(ctx));
        EXPECT_TRUE(send_processdata(ctx));
        EXPECT_TRUE(receive_processdata(ctx, 100ms));
        EXPECT_TRUE(readstate(ctx));
    }).join();
    EXPECT_EQ(send_processdata(ctx).error().code, Errc::not_owner);
    ASSERT_TRUE(take_ownership(ctx));
    EXPECT_TRUE(send_processdata(ctx));
}

// Every kind of request, and the calls that wait for requests.
TEST_F(Ownership, OtherThreadsDoEverythingByRequestsWhileTheOwnerPolls) {
    beside_the_owner([&] {
        const auto count = config_init(ctx);
        ASSERT_TRUE(count) << static_cast<int>(count.error().code);
        EXPECT_EQ(*count, 2U);
        ASSERT_TRUE(config_map(ctx, image));
        EXPECT_EQ(readstate(ctx)->state, AlState::safeop);
        EXPECT_TRUE(writestate(ctx, 2, AlState::preop));
        EXPECT_EQ(statecheck(ctx, 2, AlState::preop, 2s)->state, AlState::preop);
        EXPECT_TRUE(reconfigure_slave(ctx, 2));
        EXPECT_TRUE(recover_slave(ctx, 1));
        std::array<std::byte, 16> words{};
        EXPECT_TRUE(read_sii(ctx, 1, 8, words));
        EXPECT_TRUE(write_sii(ctx, 1, 0x30, words));
        EXPECT_TRUE(read_register<std::uint16_t>(ctx, 1, 0x0130));
        EXPECT_TRUE(write_register<std::uint8_t>(ctx, 1, 0x0F80, 1));
        EXPECT_TRUE(SDOread<std::uint32_t>(ctx, 1, 0x1000, 0));
        EXPECT_TRUE(read_object_description(ctx, 1, 0x1000));
        SuperviseRequest supervision;
        ASSERT_TRUE(submit(ctx, supervision));
        EXPECT_EQ(config_init(ctx).error().code, Errc::busy);
        supervision.cancel();
        (void)wait(ctx, supervision);
        EXPECT_EQ(supervision.error().code, Errc::canceled);
    });
    EXPECT_EQ(osal.waits_of_others.load(), 0) << "a thread that waits sleeps until it is woken";
    EXPECT_EQ(osal.looks.load(), 0) << "and does not look at its request from time to time";
    EXPECT_GT(osal.wakes.load(), 0);
}

TEST_F(Ownership, AThreadThatDestroysABusyRequestWaitsForItsEnd) {
    ASSERT_TRUE(config_init(ctx));
    beside_the_owner([&] {
        for (int n = 0; n < 50; ++n) {
            SdoUpload request;
            std::array<std::byte, 64> memory{};
            request.slave = 1;
            request.index = 0x1008;
            request.data = memory;
            ASSERT_TRUE(submit(ctx, request));
            if (n % 3 == 0) request.cancel();
        }
    });
    EXPECT_TRUE(SDOread<std::uint32_t>(ctx, 1, 0x1000, 0));
}

TEST_F(Ownership, AnOwnerThatDoesNotPollIsNamed) {
    ASSERT_TRUE(config_init(ctx));
    osal.jump = true;
    std::thread([&] {
        const Time before = osal.now();
        EXPECT_EQ(readstate(ctx).error().code, Errc::not_polled);
        EXPECT_GE(osal.now() - before, 3s);
    }).join();
    osal.jump = false;
    EXPECT_TRUE(readstate(ctx)) << "nothing of the request is left";
}

}  // namespace
}  // namespace margay
