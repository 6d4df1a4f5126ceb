#include "osal/posix/posix_osal.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/select.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstdint>

namespace margay {
namespace {

timespec timespec_of(Duration d) noexcept {
    d = std::max(d, Duration{0});
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(d);
    timespec t{};
    t.tv_sec = static_cast<time_t>(seconds.count());
    t.tv_nsec = static_cast<long>((d - seconds).count());
    return t;
}

bool set_up(int end) noexcept {
    return ::fcntl(end, F_SETFL, O_NONBLOCK) == 0 && ::fcntl(end, F_SETFD, FD_CLOEXEC) == 0;
}

// Waits with pselect(). Returns true when `first` can be read.
bool select_any(int first, WaitHandles others, const timespec* limit) noexcept {
    fd_set set;
    FD_ZERO(&set);
    for (const int one : {first, others.first, others.second})
        if (one >= 0) FD_SET(one, &set);
    return ::pselect(std::max({first, others.first, others.second}) + 1, &set, nullptr, nullptr, limit, nullptr) > 0 &&
           first >= 0 && FD_ISSET(first, &set);
}

bool poll_any(int first, WaitHandles others, int milliseconds) noexcept {
    // poll() ignores negative file descriptors.
    pollfd all[] = {{first, POLLIN, 0}, {others.first, POLLIN, 0}, {others.second, POLLIN, 0}};
    return ::poll(all, 3, milliseconds) > 0 && (all[0].revents & POLLIN) != 0;
}

}  // namespace

PosixOsal::PosixOsal() noexcept {
    if (::pipe(pipe_) != 0) pipe_[0] = pipe_[1] = -1;
    if (pipe_[0] >= 0 && (!set_up(pipe_[0]) || !set_up(pipe_[1]))) {
        ::close(pipe_[0]);
        ::close(pipe_[1]);
        pipe_[0] = pipe_[1] = -1;
    }
    (void)::pthread_mutex_init(&mutex_, nullptr);
    pthread_condattr_t attributes;
    (void)::pthread_condattr_init(&attributes);
    (void)::pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    (void)::pthread_cond_init(&condition_, &attributes);
    (void)::pthread_condattr_destroy(&attributes);
}

PosixOsal::~PosixOsal() {
    (void)::pthread_cond_destroy(&condition_);
    (void)::pthread_mutex_destroy(&mutex_);
    for (const int end : pipe_)
        if (end >= 0) ::close(end);
}

Time PosixOsal::now() noexcept {
    timespec t{};
    (void)::clock_gettime(CLOCK_MONOTONIC, &t);
    return Time(std::chrono::seconds(t.tv_sec) + std::chrono::nanoseconds(t.tv_nsec));
}

void PosixOsal::wait(Time until, WaitHandles nics) noexcept {
    constexpr Duration kWithoutPipe = std::chrono::milliseconds(1);
    constexpr Duration kSlice = std::chrono::microseconds(100);
    const Time start = now();
    if (until <= start) return;
    if (pipe_[0] < 0 && until - start > kWithoutPipe) until = start + kWithoutPipe;

    bool woken = false;
    if (std::max({pipe_[0], nics.first, nics.second}) < int{FD_SETSIZE}) {
        const auto left = timespec_of(until == kNever ? Duration{0} : until - start);
        woken = select_any(pipe_[0], nics, until == kNever ? nullptr : &left);
    } else {
        const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - start).count();
        woken =
            poll_any(pipe_[0], nics, until == kNever ? -1 : static_cast<int>(std::min<std::int64_t>(left, INT_MAX)));
        if (left == 0 && !woken) {
            const auto slice = timespec_of(std::min<Duration>(until - start, kSlice));
            (void)::nanosleep(&slice, nullptr);
        }
    }
    if (woken) clear_wakes();
}

void PosixOsal::clear_wakes() noexcept {
    char wakes[64];
    // Another waiting thread may have read the octets already; then nothing is left to clear.
    while (::read(pipe_[0], wakes, sizeof wakes) == static_cast<ssize_t>(sizeof wakes)) {
    }
}

void PosixOsal::wake() noexcept {
    const char one = 1;
    const int before = errno;  // of the code that a signal handler interrupts
    // Fails only when the pipe is full. In this case the wait ends anyway.
    [[maybe_unused]] const auto written = ::write(pipe_[1], &one, sizeof one);
    errno = before;
}

void PosixOsal::sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept {
    const auto limit = timespec_of(until.time_since_epoch());
    (void)::pthread_mutex_lock(&mutex_);
    // wake_sleepers() needs the mutex, so a change of the word after this comparison is not missed.
    if (word.load(std::memory_order_acquire) == value) {
        if (until == kNever)
            (void)::pthread_cond_wait(&condition_, &mutex_);
        else
            (void)::pthread_cond_timedwait(&condition_, &mutex_, &limit);
    }
    (void)::pthread_mutex_unlock(&mutex_);
}

void PosixOsal::wake_sleepers(const void*) noexcept {
    (void)::pthread_mutex_lock(&mutex_);
    (void)::pthread_cond_broadcast(&condition_);
    (void)::pthread_mutex_unlock(&mutex_);
}

std::uintptr_t PosixOsal::calling_thread() noexcept {
    static thread_local const char tag = 0;
    return reinterpret_cast<std::uintptr_t>(&tag);
}

}  // namespace margay
