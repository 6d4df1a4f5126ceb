// A clock that only moves when told: for tests, simulations and replays.
#pragma once

#include "osal/osal.hpp"

namespace margay {

class VirtualOsal final : public Osal {
  public:
    // The clock starts at `start`; a test that wants to see a wrap starts it close before.
    explicit VirtualOsal(Time start = Time{}) noexcept : Osal(ThreadIdentity::thread_pointer), now_(start) {}

    [[nodiscard]] Time now() noexcept override { return now_; }

    // Nobody else is there to make something happen, so waiting is jumping. Waiting for kNever would never
    // end and leaves the clock alone.
    void wait(Time until, int) noexcept override {
        if (until > now_ && until != kNever) now_ = until;
    }

    // Lets time pass; a negative duration is ignored, the clock never goes backwards.
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
