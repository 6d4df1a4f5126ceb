// What Osal::wait() waits for: the handles of one NIC, or of two NICs at the ends of a ring.
#pragma once

namespace margay {

// A negative handle is none. A handle is what the Osal of the same system needs (a file descriptor on Linux).
struct WaitHandles {
    constexpr WaitHandles(int one) noexcept : first(one) {}  // not explicit: most programs have one NIC
    constexpr WaitHandles(int one, int two) noexcept : first(one), second(two) {}
    int first = -1;
    int second = -1;
};

}  // namespace margay
