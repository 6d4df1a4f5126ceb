// A context without memory for distributed clocks.
#include "process_data/bus.hpp"

#include <margay/clocks.hpp>

namespace margay {
namespace {

TEST(ClockLimits, WithoutClocksConfigdcSaysSoAndAllElseWorks) {
    constexpr Limits kWithout{.slaves = 8, .clocks = false};
    constexpr Limits kWith{.slaves = 8};
    EXPECT_GE(context_bytes(kWith) - context_bytes(kWithout), 8U * 240U);
    Bus bus;
    bus.add(8, 8);
    bus.add(8, 8);
    bus.start(kWithout);
    const Error refused = configdc(*bus.ctx).error();
    std::array<char, 200> text{};
    EXPECT_EQ(describe(refused, text),
              "synchronising the clocks: not enough memory: Limits::clocks is false (needed 2, there is room for 0)");
    EXPECT_EQ(slave_clock(*bus.ctx, 1).kind, ClockKind::unknown);
    std::array<std::byte, 16> image{};
    ASSERT_TRUE(config_map(*bus.ctx, image));
    EXPECT_EQ(bus.to_op().state, AlState::op);
    EXPECT_EQ(*bus.cycle(), 6U);
}

}  // namespace
}  // namespace margay
