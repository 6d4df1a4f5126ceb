// Tasks, crews, timers and their arena.
#include "util/task.hpp"
#include "engine/scripted_nic.hpp"
#include "link/engine.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <random>
#include <string>
#include <vector>

namespace margay {
namespace {

using namespace std::chrono_literals;

// A small arena searches its memory from the beginning and allocates whole blocks. A large arena allocates powers of
// two, from a list for each power.
class ArenaOfSize : public testing::TestWithParam<std::size_t> {};

TEST_P(ArenaOfSize, GivesBackWhatItGaveUntilItIsWholeAgain) {
    std::vector<std::byte> memory(Arena::memory_for(GetParam()));
    Arena arena(memory);
    const std::size_t whole = arena.capacity_bytes();
    EXPECT_GE(whole, GetParam());
    std::mt19937 random(7);
    std::vector<std::pair<std::byte*, std::size_t>> held;
    std::size_t used = 0;
    const auto taken = [&](std::size_t bytes) {
        const std::size_t blocks = (bytes + 63) / 64;
        return (whole <= 16 * 1024 ? blocks : std::bit_ceil(blocks)) * 64;
    };
    for (int step = 0; step < 20000; ++step) {
        if (random() % 2 == 0 || held.empty()) {
            const std::size_t bytes = 1 + random() % 3000;
            auto* at = static_cast<std::byte*>(arena.allocate(bytes));
            if (at == nullptr) continue;
            EXPECT_EQ(reinterpret_cast<std::uintptr_t>(at) % alignof(std::max_align_t), 0U);
            ASSERT_GE(at, memory.data());
            ASSERT_LE(at + bytes, memory.data() + memory.size());
            std::fill_n(at, bytes, static_cast<std::byte>(bytes));
            held.emplace_back(at, bytes);
            used += taken(bytes);
        } else {
            const std::size_t which = random() % held.size();
            const auto [at, bytes] = held[which];
            for (std::size_t i = 0; i < bytes; ++i) ASSERT_EQ(at[i], static_cast<std::byte>(bytes)) << "overlap";
            arena.release(at);
            held.erase(held.begin() + static_cast<std::ptrdiff_t>(which));
            used -= taken(bytes);
        }
        ASSERT_EQ(arena.used_bytes(), used);
    }
    for (const auto& [at, bytes] : held) arena.release(at);
    EXPECT_EQ(arena.used_bytes(), 0U);
    std::size_t run = 128 * 1024;
    while (run > whole) run /= 2;
    void* large = arena.allocate(run);
    EXPECT_NE(large, nullptr) << "the pieces have joined again";
    arena.release(large);
}

INSTANTIATE_TEST_SUITE_P(All, ArenaOfSize, testing::Values(5000, 16 * 1024 - 64, 17 * 1024, 256 * 1024));

// In a small arena a coroutine frame uses only its own octets, rounded up to whole blocks.
TEST(Arena, ASmallOneIsUsedToItsLastBlock) {
    std::vector<std::byte> memory(Arena::memory_for(40 * 64));
    Arena arena(memory);
    const std::size_t all = arena.capacity_bytes() / 64;
    std::vector<void*> held;
    for (std::size_t left = all; left >= 8;) {
        for (const std::size_t blocks : {5U, 3U}) {
            held.push_back(arena.allocate(blocks * 64));
            ASSERT_NE(held.back(), nullptr) << left << " blocks are free";
            left -= blocks;
        }
    }
    // Two free neighbours of 3 and 5 blocks have room for 8 blocks, although the place does not begin at a multiple of
    // 8.
    arena.release(held[1]);
    arena.release(held[2]);
    void* between = arena.allocate(8 * 64);
    EXPECT_EQ(between, held[1]);
    for (void* at : {between, held[0]}) arena.release(at);
    for (std::size_t n = 3; n < held.size(); ++n) arena.release(held[n]);
    EXPECT_EQ(arena.used_bytes(), 0U);
    EXPECT_NE(arena.allocate(all * 64), nullptr);
    EXPECT_EQ(arena.allocate(1), nullptr);
}

TEST(Arena, RefusesWhatDoesNotFit) {
    std::vector<std::byte> memory(1024);
    Arena arena(memory);
    EXPECT_EQ(arena.allocate(100'000'000), nullptr);
    EXPECT_EQ(arena.allocate(2048), nullptr);
    void* a = arena.allocate(512);
    EXPECT_NE(a, nullptr);
    EXPECT_EQ(arena.allocate(512), nullptr);
    arena.release(a);
    EXPECT_EQ(arena.used_bytes(), 0U);
    std::vector<std::byte> nothing;
    Arena empty{std::span<std::byte>(nothing)};
    EXPECT_EQ(empty.allocate(1), nullptr);
}

class TaskTest : public testing::Test {
  protected:
    Time now{1s};
    ScriptedNic nic;
    std::vector<FrameSlot> slots = std::vector<FrameSlot>(4);
    std::vector<std::byte> memory = std::vector<std::byte>(32 * 1024);
    Engine engine{nic, slots, memory};
};

Task<Result<int>> wait_and_return(Engine& engine, Duration duration, int value) {
    co_await engine.sleep_for(duration);
    co_return value;
}

Task<Result<int>> add(Engine& engine, int depth) {
    if (depth == 0) co_return 0;
    auto below = co_await add(engine, depth - 1);
    if (!below) co_return below;
    co_return *below + 1;
}

TEST_F(TaskTest, TimersFireInTheirOrderAndNotBefore) {
    engine.poll(now);
    std::vector<OwnedTask<Result<int>>> tasks;
    for (const int ms : {5, 1, 3, 3, 2}) {
        tasks.push_back(wait_and_return(engine, std::chrono::milliseconds(ms), ms));
        tasks.back().start();
    }
    EXPECT_EQ(engine.poll(now), now + 1ms);
    EXPECT_EQ(engine.poll(now + 1ms), now + 2ms);
    EXPECT_TRUE(tasks[1].done());
    EXPECT_FALSE(tasks[4].done());
    EXPECT_EQ(engine.poll(now + 4ms), now + 5ms);
    EXPECT_TRUE(tasks[2].done() && tasks[3].done() && tasks[4].done());
    EXPECT_EQ(*tasks[3].result(), 3);
    EXPECT_EQ(engine.poll(now + 5ms), kNever);
}

TEST_F(TaskTest, FullArenaIsAnErrorThatReachesTheCallerInTheNextPoll) {
    OwnedTask fits = add(engine, 10);
    fits.start();
    ASSERT_TRUE(fits.done());
    EXPECT_EQ(*fits.result(), 10);
    fits.reset();
    OwnedTask deep = add(engine, 100000);
    deep.start();
    EXPECT_FALSE(deep.done());
    EXPECT_EQ(engine.poll(now), kNever);
    ASSERT_TRUE(deep.done());
    EXPECT_EQ(deep.result().error().code, Errc::capacity);
    deep.reset();
    EXPECT_EQ(engine.arena().used_bytes(), 0U);
}

// Tries again without end. After a failed attempt the sequence continues in the next poll().
Task<Result<int>> try_again(Engine& engine, int& tries) {
    for (;;) {
        ++tries;
        auto added = co_await add(engine, 100000);
        if (added) co_return added;
    }
}

TEST_F(TaskTest, ASequenceThatFindsNoMemoryContinuesInTheNextPoll) {
    engine.poll(now);
    int tries = 0;
    OwnedTask task = try_again(engine, tries);
    task.start();
    for (int polls = 1; polls < 5; ++polls) {
        EXPECT_EQ(tries, polls);
        EXPECT_EQ(engine.poll(now), now + 1ms);
    }
    task.reset();  // while it waits
    EXPECT_EQ(engine.poll(now), kNever);
    EXPECT_EQ(engine.arena().used_bytes(), 0U);
}

Task<Result<>> count_down(Engine& engine, int& running, int& most, Duration duration, bool fails) {
    most = std::max(most, ++running);
    co_await engine.sleep_for(duration);
    --running;
    if (fails) co_return Error{.code = Errc::timeout};
    co_return Result<>();
}

Task<Result<int>> lead(Engine& engine, std::size_t limit, int members, int& most) {
    Crew crew(limit);
    int running = 0;
    for (int i = 0; i < members; ++i) {
        while (crew.full()) co_await crew.one();
        if (!crew.start(count_down(engine, running, most, std::chrono::milliseconds(1 + i % 7), i == 5)))
            co_return Error{.code = Errc::capacity};
    }
    co_await crew.all();
    if (crew.first_error().code != Errc::none) co_return crew.first_error();
    co_return running;
}

TEST_F(TaskTest, CrewRunsNoMoreThanItsLimitAndReportsTheFirstError) {
    engine.poll(now);
    int most = 0;
    OwnedTask task = lead(engine, 4, 40, most);
    task.start();
    for (int i = 0; i < 1000 && !task.done(); ++i) engine.poll(now += 1ms);
    ASSERT_TRUE(task.done());
    EXPECT_EQ(most, 4);
    EXPECT_EQ(task.result().error().code, Errc::timeout);
    task.reset();
    EXPECT_EQ(engine.arena().used_bytes(), 0U);
}

TEST_F(TaskTest, DestroyedCrewTakesItsMembersAlong) {
    engine.poll(now);
    int most = 0;
    OwnedTask task = lead(engine, 10, 10, most);
    task.start();
    EXPECT_GT(engine.arena().used_bytes(), 0U);
    task.reset();
    EXPECT_EQ(engine.arena().used_bytes(), 0U);
    EXPECT_EQ(engine.poll(now + 1s), kNever);
}

// The events in their order. The guard of a sequence adds its name when the guard is destroyed.
struct Trace {
    std::vector<std::string> entries;
    struct Guard {
        Trace& trace;
        const char* name;
        ~Guard() { trace.entries.emplace_back(name); }
    };
};

Task<Result<int>> fail_after(Engine& engine, Trace& trace, Duration duration, bool fails) {
    const Trace::Guard guard{trace, "inner"};
    co_await engine.sleep_for(duration);
    if (fails) co_return Error{.code = Errc::timeout, .slave = 7};
    co_return 5;
}

Task<Result<>> pass_on(Engine& engine, Trace& trace, Duration duration, bool fails) {
    const Trace::Guard guard{trace, "middle"};
    const auto value = co_await required(fail_after(engine, trace, duration, fails));
    trace.entries.push_back("value " + std::to_string(value));
    co_return Nothing{};
}

Task<Result<>> outermost(Engine& engine, Trace& trace, Duration duration, bool fails) {
    const Trace::Guard guard{trace, "outer"};
    co_await required(pass_on(engine, trace, duration, fails));
    trace.entries.emplace_back("behind");
    co_return Nothing{};
}

Task<Result<>> look_at_error(Engine& engine, Trace& trace, Duration duration, bool fails) {
    auto result = co_await outermost(engine, trace, duration, fails);
    trace.entries.emplace_back(result ? "success" : "error");
    co_return result;
}

TEST_F(TaskTest, RequiredReturnsTheValue) {
    engine.poll(now);
    for (const Duration duration : {Duration{0}, Duration{1ms}}) {
        Trace trace;
        OwnedTask task = look_at_error(engine, trace, duration, false);
        task.start();
        engine.poll(now += 1ms);
        ASSERT_TRUE(task.done());
        EXPECT_TRUE(task.result());
        const std::vector<std::string> wanted{"inner", "value 5", "middle", "behind", "outer", "success"};
        EXPECT_EQ(trace.entries, wanted);
        task.reset();
        EXPECT_EQ(engine.arena().used_bytes(), 0U);
    }
}

TEST_F(TaskTest, RequiredEndsTheAwaitingSequencesWithTheError) {
    engine.poll(now);
    for (const Duration duration : {Duration{0}, Duration{1ms}}) {
        Trace trace;
        OwnedTask task = look_at_error(engine, trace, duration, true);
        task.start();
        engine.poll(now += 1ms);
        ASSERT_TRUE(task.done());
        EXPECT_EQ(task.result().error(), (Error{.code = Errc::timeout, .slave = 7}));
        const std::vector<std::string> wanted{"inner", "middle", "outer", "error"};
        EXPECT_EQ(trace.entries, wanted);
        task.reset();
        EXPECT_EQ(engine.arena().used_bytes(), 0U);
    }
}

TEST_F(TaskTest, AMemberOfACrewThatIsEndedByRequiredCounts) {
    engine.poll(now);
    for (const Duration duration : {Duration{0}, Duration{1ms}}) {
        Trace trace;
        {
            Crew crew;
            ASSERT_TRUE(crew.start(outermost(engine, trace, duration, true)));
            ASSERT_TRUE(crew.start(outermost(engine, trace, 5ms, false)));
            engine.poll(now += 1ms);
            EXPECT_EQ(crew.running(), 1U);
            EXPECT_EQ(crew.first_error().code, Errc::timeout);
            trace.entries.clear();
        }
        const std::vector<std::string> wanted{"inner", "middle", "outer"};
        EXPECT_EQ(trace.entries, wanted) << "the member that had not ended, the innermost sequence first";
        EXPECT_EQ(engine.arena().used_bytes(), 0U);
    }
}

TEST_F(TaskTest, ADestroyedTaskDestroysTheInnermostSequenceFirst) {
    engine.poll(now);
    Trace trace;
    OwnedTask task = look_at_error(engine, trace, 1ms, false);
    task.start();
    task.reset();
    const std::vector<std::string> wanted{"inner", "middle", "outer"};
    EXPECT_EQ(trace.entries, wanted);
    EXPECT_EQ(engine.arena().used_bytes(), 0U);
    EXPECT_EQ(engine.poll(now + 1s), kNever);
}

Task<Result<int>> add_required(Engine& engine, int depth) {
    if (depth == 0) co_return 0;
    const int below = co_await required(add_required(engine, depth - 1));
    co_return below + 1;
}

TEST_F(TaskTest, RequiredEndsTheSequenceWhenTheArenaIsFull) {
    OwnedTask fits = add_required(engine, 10);
    fits.start();
    ASSERT_TRUE(fits.done());
    EXPECT_EQ(*fits.result(), 10);
    fits.reset();
    OwnedTask deep = add_required(engine, 100000);
    deep.start();
    EXPECT_FALSE(deep.done());
    EXPECT_EQ(engine.poll(now), kNever);
    ASSERT_TRUE(deep.done());
    EXPECT_EQ(deep.result().error().code, Errc::capacity);
    deep.reset();
    EXPECT_EQ(engine.arena().used_bytes(), 0U);
}

}  // namespace
}  // namespace margay
