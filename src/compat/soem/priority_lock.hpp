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
        if (!try_unlock(thread_)) [[unlikely]]
            pass_on();
    }

    // The parts of lock() and unlock() that need no function of the system, for the number of the calling thread.
    // False: the rest is needed.
    [[gnu::always_inline]] inline bool try_lock(std::uint32_t me) noexcept {
        if (me == 0) [[unlikely]]
            return false;
        std::uint32_t nobody = 0;
        return word_.compare_exchange_strong(nobody, me, std::memory_order_acquire);
    }
    bool try_unlock(std::uint32_t me) noexcept {
        return word_.compare_exchange_strong(me, 0, std::memory_order_release);
    }
    // After a try_unlock() that returned false.
    void pass_on() noexcept;

    // The number of the calling thread in the kernel; 0: it was not asked yet.
    static std::uint32_t known_thread() noexcept { return thread_; }
    static std::uint32_t thread() noexcept {
        if (thread_ == 0) [[unlikely]]
            thread_ = ask_thread();
        return thread_;
    }

  private:
    static std::uint32_t ask_thread() noexcept;
    void wait() noexcept;

    static inline thread_local std::uint32_t thread_ [[gnu::tls_model("initial-exec")]] = 0;
    std::atomic<std::uint32_t> word_{0};
};

// The same for a thread that may have the lock already. A thread that waits gets it next.
class RecursivePriorityLock {
  public:
    void lock() noexcept {
        const std::uint32_t me = PriorityLock::thread();
        if (owner_.load(std::memory_order_relaxed) != me) {
            lock_.lock();
            owner_.store(me, std::memory_order_relaxed);
        }
        ++depth_;
    }
    void unlock() noexcept {
        if (--depth_ != 0) return;
        owner_.store(0, std::memory_order_relaxed);
        lock_.unlock();
    }

  private:
    PriorityLock lock_;
    std::atomic<std::uint32_t> owner_{0};  // written by the thread that has the lock
    unsigned depth_ = 0;
};

}  // namespace margay::soem
