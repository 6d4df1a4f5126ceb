// The times of the frames of a cycle in a ring with two NICs: a NIC whose cable is out notes no new frames.
#include "redundancy/ring_bus.hpp"

#include <margay/cycle_stamps.hpp>

namespace margay {
namespace {

using namespace std::chrono_literals;

struct RingStamps : testing::TestWithParam<unsigned> {
    RingBus bus;

    void bring_up() {
        bus.build_line(4);
        bus.plug({.round_trip = 20us, .time_stamps = true});
        bus.start();
        bus.run();
    }
    // How old a time of the cycle is, by the clock of the NIC.
    Duration age(std::uint64_t time_ns) {
        return Duration(static_cast<std::int64_t>(bus.wires[0]->clock_ns(bus.osal.now()) - time_ns));
    }
};

// The index of a frame is the same after 256 frames.
TEST_P(RingStamps, AreOfThisCycleAlsoWhileACableIsOut) {
    bring_up();
    const auto first = bus.wires[0]->timing();
    const auto second = bus.wires[1]->timing();
    bus.cable(GetParam() == 0 ? bus.ring_cables.front() : bus.ring_cables.back(), false);
    unsigned with_time = 0;
    for (unsigned n = 0; n < 1200; ++n) {
        (void)bus.cycle();
        for (const FrameTiming& nics : {first, second, FrameTiming{.sent = first.sent, .received = second.received}}) {
            const CycleStamps stamps = cycle_stamps(*bus.ctx, nics);
            EXPECT_TRUE(!stamps.sent_ns || age(*stamps.sent_ns) <= 2ms) << n;
            EXPECT_TRUE(!stamps.sent_ns || !stamps.received_ns || age(*stamps.received_ns) <= 2ms) << n;
            if (const auto trip = stamps.round_trip()) {
                EXPECT_TRUE(*trip > 0us && *trip < 1ms) << n << ": " << trip->count();
                ++with_time;
            }
        }
    }
    EXPECT_EQ(with_time, GetParam() == 0 ? 0U : 1200U) << "of the copy that the first NIC has sent";
}

INSTANTIATE_TEST_SUITE_P(CablesOfBothNics, RingStamps, testing::Values(0, 1));

}  // namespace
}  // namespace margay
