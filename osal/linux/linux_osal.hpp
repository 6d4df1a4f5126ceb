// Linux: CLOCK_MONOTONIC, and waiting in ppoll() on the NIC's socket and an eventfd.
#pragma once

#include "osal/osal.hpp"

namespace margay {

class LinuxOsal final : public Osal {
  public:
    // Without an eventfd (out of file descriptors) everything but wake() works; waits are then cut to 1 ms so
    // that the caller looks again on its own.
    LinuxOsal() noexcept;
    ~LinuxOsal();
    LinuxOsal(const LinuxOsal&) = delete;
    LinuxOsal& operator=(const LinuxOsal&) = delete;

    [[nodiscard]] Time now() noexcept override;
    // One ppoll(), none when `until` has passed. Ends within the thread's timer slack of `until`: 50 µs
    // unless the thread has a real-time policy or asked for less with prctl(PR_SET_TIMERSLACK).
    void wait(Time until, int nic_handle) noexcept override;
    // Callable from any thread and from a signal handler. A wake() that finds nobody waiting ends the next
    // wait().
    void wake() noexcept override;
    [[nodiscard]] std::uintptr_t calling_thread() noexcept override;
    // A futex.
    void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override;
    void wake_sleepers(const void* word) noexcept override;

  private:
    int event_ = -1;
};

}  // namespace margay
