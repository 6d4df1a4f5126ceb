// Osal for Linux: CLOCK_MONOTONIC, and waiting with ppoll() for the NIC's socket and an eventfd.
#pragma once

#include "osal/osal.hpp"

namespace margay {

class LinuxOsal final : public Osal {
  public:
    // If no eventfd can be created (no free file descriptor), everything except wake() works. Each wait is then limited
    // to 1 ms, so that the caller checks again without a wake().
    LinuxOsal() noexcept;
    ~LinuxOsal();
    LinuxOsal(const LinuxOsal&) = delete;
    LinuxOsal& operator=(const LinuxOsal&) = delete;

    [[nodiscard]] Time now() noexcept override;
    // One ppoll() call, none when `until` has passed. Returns at most the timer slack of the thread after `until`: 50
    // µs, unless the thread has a real-time policy or a smaller slack by prctl(PR_SET_TIMERSLACK).
    void wait(Time until, WaitHandles nics) noexcept override;
    // Callable from any thread and from a signal handler. When no thread is waiting, wake() ends the next wait().
    void wake() noexcept override;
    [[nodiscard]] std::uintptr_t calling_thread() noexcept override;
    // Implemented with a futex.
    void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override;
    void wake_sleepers(const void* word) noexcept override;

  private:
    int event_ = -1;
};

}  // namespace margay
