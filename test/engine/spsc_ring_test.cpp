// The ring between two threads: order, capacity, and a writer that clears the ring while the other thread reads.
#include "util/task.hpp"

#include <margay/context.hpp>
#include <margay/detail/writable_ring.hpp>

#include <gtest/gtest.h>

#include <array>
#include <deque>
#include <random>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

namespace margay {
namespace {

// The functions of rings and tasks that an application can call.
template <class Ring>
concept CanAdd = requires(Ring& ring) {
    ring.add({});
};
template <class Ring>
concept CanClear = requires(Ring& ring) {
    ring.clear();
};
template <class Ring>
concept CanUse = requires(Ring& ring) {
    ring.use({});
};
template <class T>
concept CanDrive = requires(T& task) {
    task.start();
}
|| requires(T& task) { task.end(); }
|| requires(T& task) { (void)task.result(); };

template <class Ring>
constexpr bool kOnlyRead = !CanAdd<Ring> && !CanClear<Ring> && !CanUse<Ring>;

TEST(SpscRing, OfTheLibraryIsReadByTheApplicationAndNotWritten) {
    static_assert(kOnlyRead<ErrorLog> && kOnlyRead<EventQueue> && kOnlyRead<EmergencyRing>);
    static_assert(CanAdd<WritableRing<Error>> && CanClear<WritableRing<Error>> && CanUse<WritableRing<Error>>);
    static_assert(std::is_same_v<decltype(std::declval<Context&>().errors()), ErrorLog&>);
    static_assert(std::is_same_v<decltype(std::declval<Context&>().warnings()), ErrorLog&>);
    static_assert(std::is_same_v<decltype(std::declval<Context&>().events()), EventQueue&>);
}

TEST(Task, OfAHookIsAwaitedAndNotDriven) {
    static_assert(!CanDrive<Task<>> && !CanDrive<Task<Result<std::size_t>>> && !CanDrive<TaskReference>);
    static_assert(CanDrive<OwnedTask<>>);
}

// The ring compared with a simple queue: sizes that divide 2^32 and other sizes, and many more values than places.
TEST(SpscRing, KeepsTheOldestInOrderAndCountsWhatItDrops) {
    for (const std::uint32_t size : {1U, 2U, 3U, 5U, 7U, 8U, 64U, 65U}) {
        std::vector<std::uint32_t> memory(size);
        WritableRing<std::uint32_t> ring{std::span(memory)};
        std::deque<std::uint32_t> model;
        std::mt19937 random(size);
        std::uint32_t dropped = 0;
        std::uint32_t came = 0;
        for (std::uint32_t n = 0; n < 20000; ++n) {
            const auto what = random() % 100;
            if (what < 55) {
                ++came;
                EXPECT_EQ(ring.add(n), model.size() < size);
                if (model.size() < size)
                    model.push_back(n);
                else
                    ++dropped;
            } else if (what < 99) {
                const auto taken = ring.take();
                ASSERT_EQ(taken.has_value(), !model.empty()) << size;
                if (!taken) continue;
                ASSERT_EQ(*taken, model.front()) << size;
                model.pop_front();
            } else {
                ring.clear();
                model.clear();
                dropped = came = 0;
            }
            ASSERT_EQ(ring.dropped(), dropped);
            ASSERT_EQ(ring.count(), came);
        }
    }
}

TEST(SpscRing, WithoutMemoryIsEmptyAndFull) {
    WritableRing<int> ring;
    EXPECT_FALSE(ring.take().has_value());
    EXPECT_FALSE(ring.add(1));
    EXPECT_FALSE(ring.take().has_value());
    EXPECT_EQ(ring.dropped(), 1U);
    ring.clear();
    EXPECT_EQ(ring.dropped(), 0U);
}

TEST(SpscRing, ClearedFullRingHasAllItsRoom) {
    std::array<int, 3> memory{};
    WritableRing<int> ring{std::span(memory)};
    for (int n = 0; n < 5; ++n) (void)ring.add(n);
    ring.clear();
    EXPECT_FALSE(ring.take().has_value());
    for (int n = 10; n < 13; ++n) EXPECT_TRUE(ring.add(n));
    for (int n = 10; n < 13; ++n) EXPECT_EQ(ring.take(), n);
    EXPECT_FALSE(ring.take().has_value());
}

// One thread adds and clears, the other thread takes: values are complete, in order, never duplicated, and never more
// than were added.
TEST(SpscRing, IsClearedWhileAnotherThreadReads) {
    struct Value {
        std::uint64_t number = 0;
        std::array<std::uint64_t, 5> copies{};
    };
    constexpr std::uint64_t kValues = 200000;
    std::array<Value, 7> memory{};
    WritableRing<Value> ring{std::span(memory)};
    std::atomic<bool> over{false};
    std::uint64_t taken = 0;
    std::uint64_t wrong = 0;
    std::thread reader([&] {
        std::uint64_t last = 0;
        for (;;) {
            const bool was_over = over.load();
            const auto value = ring.take();
            if (!value && was_over) return;
            if (!value) {
                std::this_thread::yield();
                continue;
            }
            ++taken;
            if (value->number <= last) ++wrong;
            for (const std::uint64_t copy : value->copies) wrong += copy != value->number ? 1U : 0U;
            last = value->number;
        }
    });
    std::mt19937 random(1);
    for (std::uint64_t n = 1; n <= kValues; ++n) {
        Value value{.number = n};
        value.copies.fill(n);
        (void)ring.add(value);
        if (random() % 16 == 0) ring.clear();
        if (random() % 64 == 0) std::this_thread::yield();
    }
    over.store(true);
    reader.join();
    EXPECT_EQ(wrong, 0U);
    EXPECT_LE(taken, kValues);
    EXPECT_FALSE(ring.take().has_value());
}

}  // namespace
}  // namespace margay
