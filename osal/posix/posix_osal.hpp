// Osal for systems with POSIX clocks, poll(), pselect() and threads: NuttX, Zephyr, QNX, the BSDs, Linux. It uses no
// function of a single system, so a port to such a system can begin with it. On Linux, LinuxOsal needs fewer calls.
#pragma once

#include "osal/osal.hpp"

#include <pthread.h>

namespace margay {

class PosixOsal final : public Osal {
  public:
    // If no pipe can be created (no free file descriptor), everything except wake() works. Each wait is then limited to
    // 1 ms, so that the caller checks again without a wake().
    PosixOsal() noexcept;
    ~PosixOsal();
    PosixOsal(const PosixOsal&) = delete;
    PosixOsal& operator=(const PosixOsal&) = delete;

    // CLOCK_MONOTONIC.
    [[nodiscard]] Time now() noexcept override;
    // `nics` are file descriptors that poll() accepts, or -1. One call of pselect(), none when `until` has
    // passed. A file descriptor that pselect() does not accept (FD_SETSIZE or more) is waited for with poll(), in whole
    // milliseconds, and in the last millisecond in slices of 100 µs, at the end of which a frame is noticed.
    void wait(Time until, WaitHandles nics) noexcept override;
    // Callable from any thread and from a signal handler. When no thread is waiting, wake() ends the next wait().
    void wake() noexcept override;
    // Implemented with one mutex and one condition variable for all words.
    void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override;
    void wake_sleepers(const void* word) noexcept override;

  private:
    [[nodiscard]] std::uintptr_t calling_thread() noexcept override;
    void clear_wakes() noexcept;

    int pipe_[2] = {-1, -1};  // wake() writes to the second, wait() reads from the first
    pthread_mutex_t mutex_;
    pthread_cond_t condition_;
};

}  // namespace margay
