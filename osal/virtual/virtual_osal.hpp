// A clock that only the program advances, for tests, simulations and replays.
#pragma once

#include "osal/osal.hpp"

namespace margay {

class VirtualOsal final : public Osal {
  public:
    // The clock starts at `start`. A test of a clock overflow starts it shortly before the overflow.
    explicit VirtualOsal(Time start = Time{}) noexcept : Osal(ThreadIdentity::thread_pointer), now_(start) {}

    [[nodiscard]] Time now() noexcept override { return now_; }

    // No other thread can cause an event, so a wait sets the clock to `until`. Waiting for kNever would not end, so it
    // leaves the clock unchanged.
    void wait(Time until, WaitHandles) noexcept override {
        if (until > now_ && until != kNever) now_ = until;
    }

    // Advances the clock. A negative duration is ignored; the clock never goes backwards.
    void advance(Duration by) noexcept {
        if (by > Duration::zero()) now_ += by;
    }

  private:
    [[nodiscard]] std::uintptr_t calling_thread() noexcept override {
        static thread_local const char tag = 0;
        return reinterpret_cast<std::uintptr_t>(&tag);
    }

    Time now_;
};

}  // namespace margay
