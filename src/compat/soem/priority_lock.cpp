#include "compat/soem/priority_lock.hpp"

#include <linux/futex.h>
#include <pthread.h>
#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

// GCC says by a macro that ThreadSanitizer is on, clang by a feature.
#if defined(__SANITIZE_THREAD__)
#define MARGAY_SOEM_TSAN
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define MARGAY_SOEM_TSAN
#endif
#endif
#if defined(MARGAY_SOEM_TSAN)
#include <sanitizer/tsan_interface.h>
#endif

namespace margay::soem {
namespace {

// ThreadSanitizer does not see that the kernel passes the lock on.
void tell_taken([[maybe_unused]] void* lock) noexcept {
#if defined(MARGAY_SOEM_TSAN)
    __tsan_acquire(lock);
#endif
}
void tell_given([[maybe_unused]] void* lock) noexcept {
#if defined(MARGAY_SOEM_TSAN)
    __tsan_release(lock);
#endif
}

long futex(std::atomic<std::uint32_t>& word, int operation) noexcept {
    static_assert(sizeof(std::atomic<std::uint32_t>) == sizeof(std::uint32_t));
    return syscall(SYS_futex, reinterpret_cast<std::uint32_t*>(&word), operation | FUTEX_PRIVATE_FLAG, 0, nullptr,
                   nullptr, 0);
}

}  // namespace

std::uint32_t PriorityLock::ask_thread() noexcept {
    // After a fork() the thread of the child has another number.
    static const int registered = pthread_atfork(nullptr, nullptr, [] { thread_ = 0; });
    static_cast<void>(registered);
    return static_cast<std::uint32_t>(syscall(SYS_gettid));
}

void PriorityLock::wait() noexcept {
    // The kernel writes the number of the thread into the word. A signal ends the call early.
    while (futex(word_, FUTEX_LOCK_PI) != 0) {
        std::uint32_t nobody = 0;
        if (word_.compare_exchange_strong(nobody, thread(), std::memory_order_acquire)) return;
        sched_yield();
    }
    static_cast<void>(word_.load(std::memory_order_acquire));
    tell_taken(&word_);
}

void PriorityLock::pass_on() noexcept {
    tell_given(&word_);
    futex(word_, FUTEX_UNLOCK_PI);
}

}  // namespace margay::soem
