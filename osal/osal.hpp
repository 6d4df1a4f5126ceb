// The interface to the operating system: a clock and a way to wait. Only the blocking functions and applications use
// it; the rest of src/ never reads a clock.
//
// To port: derive from Osal and implement the first two functions; with several threads, implement the other four too.
// now() must never go backwards and must count at a steady rate (not the wall clock). wait() returns at `until`, or
// earlier when a NIC behind the handles has received a frame. It may also return earlier without any reason, because
// the caller always checks again. A port that cannot wait for a NIC may limit each wait to its tick.
#pragma once

#include <margay/time.hpp>
#include <margay/wait_handles.hpp>

#include <atomic>
#include <cstdint>

namespace margay {

class Osal {
  public:
    // Returns the current time. Callable from any thread.
    [[nodiscard]] virtual Time now() noexcept = 0;

    // Waits until `until`, until one of the NICs receives a frame, or until wake(). `nics` is the result of
    // Nic::wait_handles(); a single handle converts to it.
    virtual void wait(Time until, WaitHandles nics) noexcept = 0;

    // Ends a wait() of another thread. Leave it empty when there is only one thread.
    virtual void wake() noexcept {}

    // A number of the calling thread: the same number for the same thread, never 0 where there are several threads. The
    // number is compared in each cycle, so the function is inline. If the compiler can read the thread pointer of the
    // processor, a port selects it by `thread_pointer` in its constructor; every other port implements
    // calling_thread().
    [[nodiscard]] std::uintptr_t thread_number() noexcept {
#if defined(__linux__) && (defined(__x86_64__) || defined(__aarch64__))
        if (identity_ == ThreadIdentity::thread_pointer)
            return reinterpret_cast<std::uintptr_t>(__builtin_thread_pointer());
#endif
        return calling_thread();
    }

    // For a thread that does not own the context and waits for a request: sleeps while `word` contains `value`, at most
    // until `until`. It may return earlier without any reason, because the caller checks again. wake_sleepers() ends
    // the sleep of all threads that sleep on the word at this address; the word itself may no longer exist at that
    // time. These defaults work with any wait(): the sleeping thread checks every millisecond.
    virtual void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept {
        if (word.load(std::memory_order_acquire) != value) return;
        const Time again = now() + std::chrono::milliseconds(1);
        wait(until < again ? until : again, -1);
    }
    virtual void wake_sleepers(const void* word) noexcept { static_cast<void>(word); }

  protected:
    // How thread_number() distinguishes threads. `thread_pointer` has an effect only on Linux with x86-64 or AArch64.
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
