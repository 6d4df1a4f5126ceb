// The second NIC of a whole ring sends, and receives nothing although its link is up.
#include "redundancy/ring_bus.hpp"

namespace margay {
namespace {

// No slave's inputs arrive: they are in the frames of the first NIC. The counters of the NICs show which NIC receives
// nothing.
TEST(DeafNic, IsShownByTheCounters) {
    RingBus bus;
    bus.build_line(5);
    bus.start();
    bus.run();
    EXPECT_EQ(bus.stale_cycles(200), 0U);
    (void)bus.events();
    const auto before = bus.status().cables;
    bus.nics[1]->deaf = true;
    EXPECT_EQ(bus.stale_cycles(1000), 1000U);
    const auto now = bus.status().cables;
    EXPECT_EQ(bus.joined(bus.events()), "no frame comes back from the segment\n");
    EXPECT_EQ(now[1].link, LinkState::up);
    EXPECT_EQ(now[1].received, before[1].received);
    EXPECT_GE(now[0].received, before[0].received + 1000);
    EXPECT_EQ(now[0].lost, before[0].lost + 1000);
    EXPECT_EQ(now[1].lost, before[1].lost);
    EXPECT_FALSE(inputs_fresh(*bus.ctx, 1));
    bus.nics[1]->deaf = false;
    EXPECT_LE(bus.stale_cycles(1000), 20U);
}

}  // namespace
}  // namespace margay
