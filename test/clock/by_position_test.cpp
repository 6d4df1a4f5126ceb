// The time of the reference clock, addressed by the position of its slave in the ring (ARMW).
#include "clock/clock_bus.hpp"
#include "oshw/filter_nic.hpp"
#include "wire/datagram.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

// Counts the sent datagrams for register 0x0910, by command.
class CountingNic final : public FilterNic {
  public:
    using FilterNic::FilterNic;
    [[nodiscard]] SendStatus send(std::span<const std::byte> frame) noexcept override {
        constexpr std::size_t kFirst = 16;
        for (std::size_t at = kFirst; at + 12 <= frame.size();) {
            const auto command = std::to_integer<unsigned>(frame[at]);
            const unsigned length = load_le<std::uint16_t>(frame, at + 6);
            if (load_le<std::uint16_t>(frame, at + 4) == 0x0910) {
                ++sent[command & 15U];
                adp = load_le<std::uint16_t>(frame, at + 2);
            }
            if ((length & 0x8000U) == 0) break;
            at += 12 + (length & 0x07FFU);
        }
        return FilterNic::send(frame);
    }
    std::array<int, 16> sent{};
    std::uint16_t adp = 0;
};

constexpr unsigned kArmw = 13;
constexpr unsigned kFrmw = 14;

// Slave 1 has no clock. Behind its port 3 is a branch with slave 2, which has no clock. Then follow slaves 3 to 5 with
// clocks.
struct ByPosition : testing::Test, ClockBus {
    SlaveSetup every_ms{.dc = {.source = SyncSettings::Source::application, .sync0_cycle = 1ms}};
    std::unique_ptr<CountingNic> counting;

    std::uint32_t place(const ClockOf& of, sim::PortRef at) {
        auto made = clocked(of);
        made.chip.ports = sim::junction().ports;
        const auto n = segment.add(std::move(made).assemble());
        EXPECT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect(at, {n, 0}, kCable));
        return n;
    }
    void bring_up_by_position() {
        place({.unit = sim::DcUnit::none}, {});
        place({.unit = sim::DcUnit::none}, {0, 3});
        place({.drift_ppb = 40'000, .start_ns = 5}, {0, 1});
        place({.drift_ppb = -70'000}, {2, 1});
        place({.drift_ppb = 90'000, .unit = sim::DcUnit::bits32}, {3, 1});
        segment.power_up(osal.now());
        nic = std::make_unique<SimulatedNic>(segment, osal);
        counting = std::make_unique<CountingNic>(*nic);
        ctx = std::make_unique<HostContext>(limits);
        ASSERT_TRUE(init(*ctx, *counting, osal).ok());
        ASSERT_TRUE(config_init(*ctx).ok());
        ClockSettings settings = kFewFrames;
        settings.by_position = true;
        const auto reference = configdc(*ctx, settings);
        ASSERT_TRUE(reference.ok()) << words(reference.error());
        ASSERT_EQ(*reference, 3);
        for (std::uint16_t n = 3; n <= 5; ++n) ctx->slave(n).config.setup = &every_ms;
    }
};

TEST_F(ByPosition, CarriesTheTimeFromTheBurstOn) {
    bring_up_by_position();
    EXPECT_GE(counting->sent[kArmw], 300);
    EXPECT_EQ(counting->sent[kFrmw], 0);
    EXPECT_EQ(counting->adp, 0xFFFE) << "the third slave";
    run();
    counting->sent = {};
    cycles(1000);
    EXPECT_GE(counting->sent[kArmw], 1000);
    EXPECT_EQ(counting->sent[kFrmw], 0);
    EXPECT_EQ(ctx->group(0).dc_time.slaves, 3);
    EXPECT_LE(greatest_error_ns(5), 100);
}

// The branch before the reference loses its power, so the positions of all slaves behind it change. The library uses
// the station address until the branch is back.
TEST_F(ByPosition, ByStationAddressWhileASlaveIsLost) {
    bring_up_by_position();
    run();
    cycles(1000);
    power(1, false);
    cycles(200);
    ASSERT_EQ(ctx->slave(2).al.state, AlState::none);
    counting->sent = {};
    cycles(500);
    EXPECT_GE(counting->sent[kFrmw], 500);
    EXPECT_EQ(counting->sent[kArmw], 0);
    EXPECT_EQ(ctx->group(0).dc_time.slaves, 3);
    EXPECT_EQ(reference_clock(*ctx), 3);
    EXPECT_LE(greatest_error_ns(5), 100);
    power(1, true);
    ASSERT_TRUE(until([&] { return all_in_op() && ctx->slave(2).al.state == AlState::op; }));
    cycles(100);
    counting->sent = {};
    cycles(500);
    EXPECT_GE(counting->sent[kArmw], 500);
    EXPECT_EQ(counting->sent[kFrmw], 0);
    EXPECT_EQ(counting->adp, 0xFFFE);
}

// The reference itself is lost, and all slaves behind it. No slave reads the time that the cycle sends. Later the
// clocks come back.
TEST_F(ByPosition, TheReferenceComesBack) {
    bring_up_by_position();
    run();
    cycles(500);
    power(2, false);
    cycles(300);
    power(2, true);
    ASSERT_TRUE(until([&] { return in_op(3) && in_op(4) && in_op(5); })) << joined(events());
    cycles(2000);
    EXPECT_EQ(ctx->group(0).dc_time.slaves, 3);
    EXPECT_LE(greatest_error_ns(5), 100);
    counting->sent = {};
    cycles(10);
    EXPECT_EQ(counting->sent[kArmw], 10);
}

}  // namespace
}  // namespace margay
