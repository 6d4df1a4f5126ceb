// The handles for which Osal::wait() waits: the handle of one NIC, or the handles of two NICs at the ends of a ring.
#pragma once

namespace margay {

// A negative number means no handle. The Osal of the same system defines the meaning of a handle (on Linux: a file
// descriptor).
struct WaitHandles {
    constexpr WaitHandles(int one) noexcept : first(one) {}  // not explicit: most programs have one NIC
    constexpr WaitHandles(int one, int two) noexcept : first(one), second(two) {}
    int first = -1;
    int second = -1;
};

}  // namespace margay
