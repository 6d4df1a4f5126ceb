// A lock for two threads of different priority: a thread that waits lends its priority to the thread that has the lock.
// Without contention it costs one instruction of the processor that compares and exchanges, and no system call.
#pragma once

#include <atomic>
#include <cstdint>

namespace margay::soem {

class PriorityLock {
  public:
    PriorityLock() = default;
    PriorityLock(const PriorityLock&) = delete;
    PriorityLock& operator=(const PriorityLock&) = delete;

    void lock() noexcept {
        std::uint32_t nobody = 0;
        if (!word_.compare_exchange_strong(nobody, thread(), std::memory_order_acquire)) [[unlikely]]
            wait();
    }
    void unlock() noexcept {
        std::uint32_t mine = thread();
        if (!word_.compare_exchange_strong(mine, 0, std::memory_order_release)) [[unlikely]]
            pass_on();
    }

  private:
    // The number of the calling thread in the kernel.
    static std::uint32_t thread() noexcept {
        if (thread_ == 0) [[unlikely]]
            thread_ = ask_thread();
        return thread_;
    }
    static std::uint32_t ask_thread() noexcept;
    void wait() noexcept;
    void pass_on() noexcept;

    static inline thread_local std::uint32_t thread_ [[gnu::tls_model("initial-exec")]] = 0;
    std::atomic<std::uint32_t> word_{0};
};

}  // namespace margay::soem
