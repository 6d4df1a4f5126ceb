#include "osal/linux/linux_osal.hpp"

#include "osal/linux/monotonic_clock.hpp"

#include <linux/futex.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstdint>

namespace margay {

LinuxOsal::LinuxOsal() noexcept
    : Osal(ThreadIdentity::thread_pointer), event_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {}

LinuxOsal::~LinuxOsal() {
    if (event_ >= 0) ::close(event_);
}

Time LinuxOsal::now() noexcept { return monotonic_now(); }

void LinuxOsal::wait(Time until, WaitHandles nics) noexcept {
    constexpr Duration kWithoutEvent = std::chrono::milliseconds(1);
    const Time start = now();
    if (until <= start) return;
    if (event_ < 0 && until - start > kWithoutEvent) until = start + kWithoutEvent;

    // ppoll() ignores negative file descriptors.
    pollfd fds[] = {{event_, POLLIN, 0}, {nics.first, POLLIN, 0}, {nics.second, POLLIN, 0}};
    timespec timeout{};
    if (until != kNever) {
        const auto left = until - start;
        const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(left);
        timeout.tv_sec = static_cast<time_t>(seconds.count());
        timeout.tv_nsec = static_cast<long>((left - seconds).count());
    }
    if (::ppoll(fds, nics.second < 0 ? 2 : 3, until == kNever ? nullptr : &timeout, nullptr) <= 0)
        return;  // timeout, or a signal
    if ((fds[0].revents & POLLIN) != 0) {
        std::uint64_t wakes = 0;
        // Another waiting thread may have read the counter already; then nothing is left to clear.
        [[maybe_unused]] const auto cleared = ::read(event_, &wakes, sizeof wakes);
    }
}

std::uintptr_t LinuxOsal::calling_thread() noexcept {
    static thread_local const char tag = 0;
    return reinterpret_cast<std::uintptr_t>(&tag);
}

void LinuxOsal::wake() noexcept {
    const std::uint64_t one = 1;
    const int before = errno;  // of the code that a signal handler interrupts
    // Fails only when the counter is full. In this case the wait ends anyway.
    [[maybe_unused]] const auto written = ::write(event_, &one, sizeof one);
    errno = before;
}

void LinuxOsal::sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept {
    static_assert(sizeof word == sizeof(std::uint32_t));
    timespec timeout{};
    if (until != kNever) {
        const auto since = std::max(until.time_since_epoch(), Duration{0});
        const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(since);
        timeout.tv_sec = static_cast<time_t>(seconds.count());
        timeout.tv_nsec = static_cast<long>((since - seconds).count());
    }
    // The bitset operation uses an absolute time of CLOCK_MONOTONIC.
    (void)::syscall(SYS_futex, &word, FUTEX_WAIT_BITSET_PRIVATE, value, until == kNever ? nullptr : &timeout, nullptr,
                    FUTEX_BITSET_MATCH_ANY);
}

void LinuxOsal::wake_sleepers(const void* word) noexcept {
    (void)::syscall(SYS_futex, word, FUTEX_WAKE_PRIVATE, INT_MAX, nullptr, nullptr, 0);
}

}  // namespace margay
