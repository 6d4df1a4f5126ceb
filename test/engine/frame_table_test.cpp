// The indices of frames.
#include "link/frame_table.hpp"

#include <gtest/gtest.h>

#include <array>

namespace margay {
namespace {

using namespace std::chrono_literals;

// All cycles are lost, and a datagram beside them is answered each time. The reply of a cycle may come in the next
// cycle, or later: it must not have the index of another one.
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
