// The indices of frames.
#include "link/frame_table.hpp"

#include <gtest/gtest.h>

#include <array>

namespace margay {
namespace {

using namespace std::chrono_literals;

// The frame of each cycle is lost, and a datagram beside the cycle is answered each time. The reply of a lost frame may
// arrive in the next cycle or later. So the next frames must not have the index of the lost frame.
TEST(FrameTable, TheIndexOfALostFrameRestsAlthoughFramesBesideItComeBack) {
    std::array<FrameSlot, 8> slots;
    FrameTable table(slots);
    FrameSlot own;
    FrameSlot* asked = nullptr;
    Time now{1s};
    std::array<int, 256> used{};
    used.fill(-1000);
    for (int cycle = 0; cycle < 5000; ++cycle, now += 500us) {
        ASSERT_TRUE(table.claim(own, now));
        EXPECT_GE(cycle - used[own.index], 63) << "index " << int{own.index} << " again, cycle " << cycle;
        used[own.index] = cycle;
        if (asked != nullptr) table.close(*asked, false, now);
        table.close(own, true, now);
        asked = table.open(now);
    }
}

}  // namespace
}  // namespace margay
