// A ring with two NICs. One thread sends overlapped cycles while the owner receives, and old copies of frames come back
// late.
#include "oshw/filter_nic.hpp"
#include "redundancy/clock_ring.hpp"

#include <atomic>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace margay {
namespace {

// Both NICs and the clock, for use by two threads.
struct SharedWorld {
    std::recursive_mutex mutex;
    VirtualOsal& osal;
};

class SharedClock final : public Osal {
  public:
    explicit SharedClock(SharedWorld& world) : world_(world) {}
    Time now() noexcept override {
        const std::lock_guard lock(world_.mutex);
        return world_.osal.now();
    }
    void wait(Time until, WaitHandles handles) noexcept override {
        {
            const std::lock_guard lock(world_.mutex);
            world_.osal.wait(until, handles);
        }
        std::this_thread::yield();
    }

  private:
    SharedWorld& world_;
};

// Each frame that comes back is received a second time, after `lag` other frames.
class LateNic final : public Nic {
  public:
    LateNic(Nic& nic, SharedWorld& world, std::size_t lag) : nic_(nic), world_(world), lag_(lag) {}
    std::atomic<bool> repeats{false};
    std::uint32_t repeated = 0;

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        const std::lock_guard lock(world_.mutex);
        return nic_.send(frame);
    }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        const std::lock_guard lock(world_.mutex);
        if (late_.size() > lag_) {
            const auto again = std::move(late_.front());
            late_.pop_front();
            std::ranges::copy(again, into.begin());
            ++repeated;
            return again.size();
        }
        const std::size_t length = nic_.receive(into);
        if (length != 0 && repeats)
            late_.emplace_back(into.begin(), into.begin() + static_cast<std::ptrdiff_t>(length));
        return length;
    }
    LinkState link_state() noexcept override {
        const std::lock_guard lock(world_.mutex);
        return nic_.link_state();
    }
    MacAddress source_mac() const noexcept override { return nic_.source_mac(); }
    Time next_arrival() const noexcept override {
        const std::lock_guard lock(world_.mutex);
        return nic_.next_arrival();
    }

  private:
    Nic& nic_;
    SharedWorld& world_;
    std::size_t lag_;
    std::deque<std::vector<std::byte>> late_;
};

// The sending thread opens a pair of frames again while the other thread examines a late copy of the previous frame.
TEST(RingThreads, LateCopiesWhileAnotherThreadSends) {
    constexpr std::uint32_t kSharedCycles = 1000;
    RingBus bus;
    bus.build_line(3);
    bus.plug();
    SharedWorld world{.mutex = {}, .osal = bus.osal};
    SharedClock clock(world);
    LateNic first(*bus.wires[0], world, 2);
    LateNic second(*bus.wires[1], world, 5);
    bus.ctx = std::make_unique<HostContext>(RingBus::limits());
    Context& ctx = *bus.ctx;
    ASSERT_TRUE(init_redundant(ctx, first, second, clock).ok());
    ASSERT_TRUE(config_init(ctx).ok());
    ctx.group(0).config.cycles_in_flight = 3;
    const auto mapped = config_map(ctx, bus.image);
    ASSERT_TRUE(mapped.ok()) << RingBus::words(mapped.error());
    const std::uint32_t late_before = bus.status().cables[0].late + bus.status().cables[1].late;
    first.repeats = second.repeats = true;
    std::thread sender([&ctx] {
        for (std::uint32_t sent = 0; sent < kSharedCycles;) {
            if (send_processdata(ctx))
                ++sent;
            else
                std::this_thread::yield();  // all cycles are on the wire
        }
    });
    for (std::uint32_t received = 0; received < kSharedCycles;) {
        const auto wkc = receive_processdata(ctx, 1ms);
        (void)poll(ctx, clock.now());
        if (wkc.error().code == Errc::timeout) continue;  // the other thread has not sent yet
        ++received;
        EXPECT_TRUE(wkc.ok()) << received << ": " << RingBus::words(wkc.error());
        EXPECT_EQ(ctx.group(0).cycle_received, received);
    }
    sender.join();
    const RedundancyStatus status = bus.status();
    EXPECT_EQ(status.fault, CablingFault::none);
    EXPECT_EQ(status.ring, RingState::whole);
    EXPECT_EQ(status.breaks, 0U);
    EXPECT_GT(first.repeated + second.repeated, kSharedCycles);
    // Resting copies in a whole ring are late only while the other copy is awaited.
    const std::uint32_t late = status.cables[0].late + status.cables[1].late - late_before;
    EXPECT_GE(late, second.repeated);
    EXPECT_LE(late, first.repeated + second.repeated);
    EXPECT_EQ(ctx.statistics().lost, 0U);
}

// The receiving thread gets the first copy of a frame while the sending thread sends the second copy. The NICs are
// swapped, and the copies have other positions and other times.
TEST(RingThreads, TheFirstCopyIsBackBeforeTheSecondIsSent) {
    for (const bool broken : {false, true}) {
        SCOPED_TRACE(broken);
        ClockRingBus bus;
        for (unsigned n = 0; n < 5; ++n) (void)bus.add_to_ring(ClockRingBus::nth(n));
        bus.segment.disconnect({0, 0});
        ASSERT_TRUE(bus.segment.connect_master({0, 0}, 1));
        ASSERT_TRUE(bus.segment.connect_master({4, 1}, 0));
        bus.ring_cables.push_back({4, 1});
        bus.start();
        const auto reference = configdc(*bus.ctx, {.burst_frames = 200, .by_position = true});
        ASSERT_TRUE(reference.ok()) << bus.words(reference.error());
        bus.ctx->group(0).config.cycles_in_flight = 2;
        bus.run();
        if (broken) bus.cable(bus.ring_cables[2], false);
        for (unsigned n = 0; n < 50; ++n) (void)bus.cycle();
        ASSERT_EQ(bus.status().ring, broken ? RingState::broken : RingState::whole);
        bus.supervision.cancel();
        const auto slaves = [&bus] { return std::array{bus.status().cables[0].slaves, bus.status().cables[1].slaves}; };
        const auto before = slaves();
        EXPECT_EQ(before, broken ? (std::array<std::uint16_t, 2>{3, 2}) : (std::array<std::uint16_t, 2>{0, 5}));
        unsigned copies = 0;
        bus.on_frame = [&](std::uint64_t) {
            if (++copies % 2 != 0) return;
            bus.osal.advance(200us);
            (void)poll(*bus.ctx, bus.osal.now());
        };
        for (unsigned n = 0; n < 20; ++n) {
            bus.osal.advance(1ms);
            ASSERT_TRUE(send_processdata(*bus.ctx).ok());
            const auto wkc = receive_processdata(*bus.ctx, 500us);
            EXPECT_TRUE(wkc.ok()) << RingBus::words(wkc.error());
            EXPECT_EQ(slaves(), before) << n;
            EXPECT_EQ(bus.ctx->group(0).dc_time.slaves, broken ? 2 : 5);
        }
        EXPECT_EQ(copies, 40U);
        bus.on_frame = nullptr;
    }
}

// Refuses a frame on request. Compares the frame that it sends with the frame that it was given, after `meanwhile`.
class SlowNic final : public FilterNic {
  public:
    using FilterNic::FilterNic;
    bool busy = false;
    std::function<void()> meanwhile;
    unsigned sent = 0;
    unsigned changed = 0;

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (std::exchange(busy, false)) return SendStatus::busy;
        const std::vector<std::byte> given(frame.begin(), frame.end());
        if (meanwhile) meanwhile();
        if (!std::ranges::equal(given, frame)) ++changed;
        ++sent;
        return inner().send(frame);
    }
};

// The first NIC was busy, so it sends its copy after the second NIC, whose copy is already back. The reply is written
// into the frame of the cycle before the first NIC has sent this frame.
TEST(RingThreads, TheReplyIsNotSentByTheOtherNic) {
    RingBus bus;
    bus.build_line(3);
    bus.segment.disconnect({0, 0});
    bus.segment.disconnect({2, 1});
    ASSERT_TRUE(bus.segment.connect_master({0, 0}, 1));
    ASSERT_TRUE(bus.segment.connect_master({2, 1}, 0));
    bus.plug();
    SlowNic first(*bus.wires[0]);
    bus.ctx = std::make_unique<HostContext>(RingBus::limits());
    ASSERT_TRUE(init_redundant(*bus.ctx, first, *bus.wires[1], bus.osal).ok());
    ASSERT_TRUE(config_init(*bus.ctx).ok());
    bus.ctx->group(0).config.cycles_in_flight = 2;
    bus.run();
    bus.supervision.cancel();
    first.meanwhile = [&bus] {
        bus.osal.advance(200us);
        (void)poll(*bus.ctx, bus.osal.now());
    };
    first.sent = 0;
    for (unsigned n = 0; n < 30; ++n) {
        bus.osal.advance(1ms);
        first.busy = n % 3 == 0;
        bus.show_values();
        (void)send_processdata(*bus.ctx);
        (void)receive_processdata(*bus.ctx, 500us);
    }
    EXPECT_EQ(first.sent, 20U);
    EXPECT_EQ(first.changed, 0U);
}

}  // namespace
}  // namespace margay
