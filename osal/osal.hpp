// The operating system as Margay needs it: a clock and a way to wait. Only the blocking wrappers and
// applications use it; nothing in src/ below them reads a clock.
//
// To port: derive from Osal and implement the first two functions; with several threads the other four as well. now()
// must never go backwards and must count at a steady rate (not wall-clock time). wait() returns when `until` has come,
// or earlier when the NIC behind `nic_handle` has a frame, or earlier for no reason at all: the caller always looks
// again. A port that cannot wait on a NIC may cap the wait at its tick.
#pragma once

#include <margay/time.hpp>

#include <atomic>
#include <cstdint>

namespace margay {

class Osal {
  public:
    // The time now. Callable from any thread.
    [[nodiscard]] virtual Time now() noexcept = 0;

    // Waits until `until`, a frame at the NIC, or a wake(); `nic_handle` is what Nic::wait_handle() returned.
    virtual void wait(Time until, int nic_handle) noexcept = 0;

    // Ends a wait() of another thread. A port with one thread leaves it empty.
    virtual void wake() noexcept {}

    // A number of the calling thread: the same number for the same thread, never 0 where there are several threads.
    // Compared in each cycle, thus inline: where the compiler can read the thread pointer of the processor, a port says
    // so by `thread_pointer` in its constructor; every other port answers by calling_thread().
    [[nodiscard]] std::uintptr_t this_thread() noexcept {
#if defined(__linux__) && (defined(__x86_64__) || defined(__aarch64__))
        if (identity_ == ThreadIdentity::thread_pointer)
            return reinterpret_cast<std::uintptr_t>(__builtin_thread_pointer());
#endif
        return calling_thread();
    }

    // For a thread that does not own the context and waits for a request: sleeps while `word` holds `value`, at most
    // until `until`, and may end earlier for no reason: the caller looks again. wake_sleepers() ends it, of all threads
    // that sleep on the word at this address; the word itself may be gone by then. As they are here, the two work with
    // any wait(): the sleeper looks again every millisecond.
    virtual void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept {
        if (word.load(std::memory_order_acquire) != value) return;
        const Time again = now() + std::chrono::milliseconds(1);
        wait(until < again ? until : again, -1);
    }
    virtual void wake_sleepers(const void* word) noexcept { static_cast<void>(word); }

  protected:
    // How this_thread() tells threads apart. `thread_pointer` has an effect only on Linux with x86-64 or AArch64.
    enum class ThreadIdentity : std::uint8_t { calling_thread, thread_pointer };
    explicit Osal(ThreadIdentity identity = ThreadIdentity::calling_thread) noexcept : identity_(identity) {}
    ~Osal() = default;

    // A number of the calling thread for ports without a thread pointer; a few instructions, no system call. A port
    // with one thread leaves it as it is.
    [[nodiscard]] virtual std::uintptr_t calling_thread() noexcept { return 0; }

  private:
    ThreadIdentity identity_;
};

}  // namespace margay
