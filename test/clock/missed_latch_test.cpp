// The receive times of a slave that a frame has not reached are old. They may not be used for a delay or a clock.
#include "clock/clock_bus.hpp"
#include "oshw/filter_nic.hpp"
#include "wire/datagram.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

// Cuts a cable before a frame that latches the receive times is sent, and connects it again behind the frame.
class CuttingNic final : public FilterNic {
  public:
    CuttingNic(Nic& inner, sim::Segment& segment) : FilterNic(inner), segment_(segment) {}
    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override {
        const bool cuts = latches(frame) && (seen++ >= first && cut < most);
        if (cuts) ++cut;
        if (cuts) segment_.disconnect({1, 1});
        const auto sent = FilterNic::send(frame);
        if (cuts && !stays) (void)segment_.connect({1, 1}, {2, 0}, ClockBus::kCable);
        return sent;
    }
    unsigned first = 0;  // how many latching frames come first
    unsigned most = 0;   // how many are cut
    unsigned seen = 0;
    unsigned cut = 0;
    bool stays = false;  // the cable stays away

  private:
    static bool latches(std::span<const std::byte> frame) {
        constexpr std::size_t kFirst = 16;
        constexpr unsigned kBwr = 8;
        for (std::size_t at = kFirst; at + 12 <= frame.size();) {
            const unsigned length = load_le<std::uint16_t>(frame, at + 6);
            if (frame[at] == std::byte{kBwr} && load_le<std::uint16_t>(frame, at + 4) == 0x0900) return true;
            if ((length & 0x8000U) == 0) break;
            at += 12 + (length & 0x07FFU);
        }
        return false;
    }
    sim::Segment& segment_;
};

struct MissedLatchBus : ClockBus {
    SlaveSetup every_ms{.dc = {.source = SyncSettings::Source::application, .sync0_cycle = 1ms}};
    std::unique_ptr<CuttingNic> cutting;

    void begin() {
        add({.drift_ppb = 40'000, .start_ns = 5});
        add({.drift_ppb = -70'000, .start_ns = 0x1234'5678});
        add({.drift_ppb = 90'000, .start_ns = 0x7777'7777'7777});
        add({.drift_ppb = 10'000, .start_ns = 0x1'0000'0000});
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, osal);
        cutting = std::make_unique<CuttingNic>(*nic, segment);
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *cutting, osal).ok());
        ASSERT_TRUE(config_init(*ctx).ok());
        ctx->group(0).config.acyclic_bytes = 1498;
        for (std::uint16_t n = 1; n <= 4; ++n) ctx->slave(n).config.setup = &every_ms;
    }
};

struct MissedLatch : testing::Test, MissedLatchBus {};

TEST(MissedLatchOf, AMeasurementIsRepeated) {
    for (const unsigned first : {0U, 1U, 7U, 16U, 20U}) {
        SCOPED_TRACE(first);
        MissedLatchBus bus;
        bus.begin();
        bus.cutting->first = first;
        bus.cutting->most = 2;
        const auto done = configdc(*bus.ctx, kFewFrames);
        EXPECT_TRUE(done.ok()) << bus.words(done.error());
        EXPECT_EQ(bus.cutting->cut, 2U);
        for (std::uint16_t n = 2; n <= 4; ++n)
            EXPECT_NEAR(static_cast<double>(bus.clock(n).delay_ns), static_cast<double>((n - 1) * ClockBus::kHop_ns),
                        10)
                << n;
        EXPECT_LE(bus.greatest_error_ns(4), 200);
    }
}

TEST_F(MissedLatch, ByTheClockThatIsSetIsRepeated) {
    begin();
    ASSERT_TRUE(configdc(*ctx, kFewFrames).ok());
    run();
    cycles(500);
    power(2, false);
    ASSERT_TRUE(until([&] { return ctx->slave(3).al.state == AlState::none; }));
    power(2, true);
    cutting->seen = 0;
    cutting->most = 2;
    std::int64_t most = 0;
    ASSERT_TRUE(until([&] {
        if (clock(3).in_sync) most = std::max(most, std::abs(ahead_ns(3)));
        return in_op(3) && in_op(4) && clock(3).in_sync;
    })) << joined(events());
    EXPECT_EQ(cutting->cut, 2U);
    EXPECT_LE(most, 300);
    const auto all = events();
    EXPECT_EQ(told(all, "failed"), 0) << joined(all);
}

TEST_F(MissedLatch, OfEachFrameIsAnError) {
    begin();
    cutting->most = UINT32_MAX;
    const auto done = configdc(*ctx, kFewFrames);
    EXPECT_EQ(words(done.error()),
              "synchronising the clocks: the slaves, or their connections, have changed meanwhile (expected 4, got 2)");
    EXPECT_LE(cutting->cut, 5U);
}

TEST_F(MissedLatch, OfASlaveThatIsGoneNamesTheSlave) {
    begin();
    cutting->most = 1;
    cutting->stays = true;
    const auto done = configdc(*ctx, kFewFrames);
    EXPECT_EQ(
        words(done.error()),
        "slave 3: synchronising the clocks: the slaves, or their connections, have changed meanwhile (expected 4, "
        "got 2) (it was lost, or came back, during the measurement, or its receive times make no sense)");
}

}  // namespace
}  // namespace margay
