#include "osal/bare/bare_osal.hpp"

namespace margay {

void BareOsal::wait(Time until, WaitHandles) noexcept {
    const Time start = now();
    if (until <= start) return;
    const bool sleeps = board_.idle != nullptr && until - start > board_.tick;
    if (sleeps && !woken_.load(std::memory_order_acquire)) board_.idle(woken_);
    // A wake() between this statement and the return is not lost, because the caller checks for its reason after each
    // wait.
    woken_.store(false, std::memory_order_release);
}

}  // namespace margay
