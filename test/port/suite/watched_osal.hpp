// The Osal of the port, with a check of each returned time: it records a time that is earlier than the previous time.
//
// The suite itself then continues with a time that does not go back, so that no loop waits for a time that the faulty
// clock never reaches. Only the thread of the suite may use it.
#pragma once

#include <margay/parts/osal/osal.hpp>

#include <algorithm>

namespace margay::port {

class WatchedOsal final : public Osal {
  public:
    explicit WatchedOsal(Osal& inner) noexcept : inner_(inner), last_(inner.now()) {}

    [[nodiscard]] Time now() noexcept override {
        const Time read = inner_.now();
        if (read < last_) {
            longest_step_back_ = std::max(longest_step_back_, last_ - read);
            lost_ += last_ - read;
        }
        last_ = read;
        return read + lost_;
    }
    void wait(Time until, WaitHandles nics) noexcept override { inner_.wait(by_inner(until), nics); }
    void wake() noexcept override { inner_.wake(); }
    void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override {
        inner_.sleep_while(word, value, by_inner(until));
    }
    void wake_sleepers(const void* word) noexcept override { inner_.wake_sleepers(word); }

    // Zero if the clock never went back.
    [[nodiscard]] Duration longest_step_back() const noexcept { return longest_step_back_; }

  private:
    [[nodiscard]] std::uintptr_t calling_thread() noexcept override { return inner_.thread_number(); }
    [[nodiscard]] Time by_inner(Time until) const noexcept { return until == kNever ? until : until - lost_; }

    Osal& inner_;
    Time last_;
    Duration lost_{};  // by steps back
    Duration longest_step_back_{};
};

}  // namespace margay::port
