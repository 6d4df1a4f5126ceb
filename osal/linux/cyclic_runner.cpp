#include "osal/linux/cyclic_runner.hpp"

#include "osal/linux/monotonic_clock.hpp"
#include "util/text_writer.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <span>

namespace margay {
namespace {

// The spin may use at most 80 % of the processor time that real-time threads may use; the rest is for the task itself.
constexpr int kSpinPercentOfShare = 80;

// Reads a number from a file in /proc; returns `otherwise` when that fails.
long read_number(const char* path, long otherwise) noexcept {
    const int file = ::open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0) return otherwise;
    std::array<char, 32> text{};
    const auto length = ::read(file, text.data(), text.size());
    ::close(file);
    long number = otherwise;
    if (length > 0) std::from_chars(text.data(), text.data() + length, number);
    return number;
}

// The argument of sched_setattr(), as the kernel has defined it first. Not every C library declares it.
struct SchedulingAttributes {
    std::uint32_t size = sizeof(SchedulingAttributes);
    std::uint32_t policy = 0;
    std::uint64_t flags = 0;
    std::int32_t nice = 0;
    std::uint32_t priority = 0;
    std::uint64_t runtime_ns = 0;
    std::uint64_t deadline_ns = 0;
    std::uint64_t period_ns = 0;
};
static_assert(sizeof(SchedulingAttributes) == 48, "SCHED_ATTR_SIZE_VER0");
constexpr std::uint32_t kSchedDeadline = 6;
constexpr std::uint64_t kResetOnFork = 1;  // without it, the thread can start no other threads

const char* why_no_deadline(int error) noexcept {
    switch (error) {
        case EPERM:
            return "no SCHED_DEADLINE (needs CAP_SYS_NICE, and a thread that may run on every processor of its domain: "
                   "without `cpu`)";
        case EBUSY:
            return "no SCHED_DEADLINE (other threads have reserved the processors already, or it asks for more than "
                   "sched_rt_runtime_us leaves)";
        case EINVAL:
            return "no SCHED_DEADLINE (the runtime is longer than the period or shorter than 1.024 µs, or the period "
                   "is "
                   "outside of sched_deadline_period_min_us to sched_deadline_period_max_us)";
        default: return "no SCHED_DEADLINE (the kernel does not have it)";
    }
}

const char* find_wrong_option(const CyclicOptions& options) noexcept {
    if (options.period <= Duration::zero()) return "no cycle: `period` is not more than 0";
    if (options.spin < Duration::zero()) return "no cycle: `spin` is negative";
    if (options.runtime < Duration::zero()) return "no cycle: `runtime` is negative";
    if (options.cpu < -1) return "no cycle: `cpu` is negative (-1: any processor)";
    return nullptr;
}

// Whether the system has interfaces, and none of this name.
bool is_no_interface(const char* name, const IrqThreads::Places& places) noexcept {
    std::array<char, 256> all{};
    std::array<char, 256> path{};
    TextWriter(std::span<char>(all.data(), all.size() - 1)) << places.sys << "/class/net";
    TextWriter(std::span<char>(path.data(), path.size() - 1)) << all.data() << "/" << name;
    return ::access(all.data(), F_OK) == 0 && (*name == 0 || ::access(path.data(), F_OK) != 0);
}

// Writes each page of the stack that the cycle may use once, at most a quarter of the free stack.
constexpr std::size_t kTouchedStack = 256 * 1024;
constexpr std::size_t kTouchedAtOnce = 4096;
[[gnu::noinline]] void touch_stack(std::size_t octets) noexcept {
    std::array<std::byte, kTouchedAtOnce> page;
    // The compiler must neither remove the write nor convert the calls into a loop.
    __asm__ volatile("" : : "r"(page.data()) : "memory");
    page.fill(std::byte{0});
    if (octets > page.size()) touch_stack(octets - page.size());
    __asm__ volatile("" : : "r"(page.data()) : "memory");
}

void touch_stack() noexcept {
    pthread_attr_t attributes;
    if (::pthread_getattr_np(::pthread_self(), &attributes) != 0) return;
    void* lowest = nullptr;
    std::size_t size = 0;
    (void)::pthread_attr_getstack(&attributes, &lowest, &size);
    (void)::pthread_attr_destroy(&attributes);
    const std::byte here{};
    const auto left = static_cast<std::size_t>(&here - static_cast<const std::byte*>(lowest));
    touch_stack(std::min(left / 4, kTouchedStack));
}

void pause_processor() noexcept {
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#elif defined(__aarch64__) || defined(__arm__)
    __asm__ volatile("yield");
#endif
}

}  // namespace

CyclicRunner::CyclicRunner(const CyclicOptions& options) noexcept
    : options_(options),
      wrong_option_(find_wrong_option(options)),
      schedule_(wrong_option_ == nullptr ? options.period : CyclicOptions{}.period,
                phase_off_the_tick(options.period)) {
    if (wrong_option_ != nullptr) {
        schedule_.stop();
        return;
    }
    options_.spin = std::min(options_.spin, options_.period);
    schedule_.set_policy(options_.overrun, options_.catch_up_limit);
}

CyclicRunner::~CyclicRunner() {
    (void)finish();
    if (latency_ >= 0) ::close(latency_);
}

std::span<const CyclicRefusal> CyclicRunner::prepare() noexcept {
    (void)finish();
    refused_ = 0;
    if (wrong_option_ != nullptr) {
        refuse(wrong_option_, EINVAL);
        return std::span(refusals_).first(refused_);
    }
    if (options_.lock_memory && ::mlockall(MCL_CURRENT | MCL_FUTURE) != 0)
        refuse("memory is not locked (mlockall; needs CAP_IPC_LOCK or a larger RLIMIT_MEMLOCK)", errno);
    if (options_.lock_memory) touch_stack();
    if (options_.cpu >= 0) stay_on_cpu();
    if (options_.hold_latency) hold_latency();
    if (options_.interface != nullptr || options_.irq_priority != 0) raise_interrupts();
    if (options_.runtime <= Duration::zero() || !take_runtime())
        if (options_.priority != 0) take_priority();
    return std::span(refusals_).first(refused_);
}

bool CyclicRunner::take_runtime() noexcept {
    const auto period = static_cast<std::uint64_t>(options_.period.count());
    const SchedulingAttributes wanted{.policy = kSchedDeadline,
                                      .flags = kResetOnFork,
                                      .runtime_ns = static_cast<std::uint64_t>(options_.runtime.count()),
                                      .deadline_ns = period,
                                      .period_ns = period};
    if (::syscall(SYS_sched_setattr, 0, &wanted, 0U) != 0) {
        refuse(why_no_deadline(errno), errno);
        return false;
    }
    options_.spin = std::min(options_.spin, options_.runtime / 2);
    return true;
}

void CyclicRunner::take_priority() noexcept {
    const sched_param wanted{.sched_priority = options_.priority};
    if (::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &wanted) != 0) {
        refuse(errno == EINVAL ? "no real-time policy (SCHED_FIFO: `priority` is not 1 to 99)"
                               : "no real-time policy (SCHED_FIFO; needs CAP_SYS_NICE or RLIMIT_RTPRIO)",
               errno);
        return;
    }
    const long runtime_us = read_number("/proc/sys/kernel/sched_rt_runtime_us", 950'000);
    const long period_us = read_number("/proc/sys/kernel/sched_rt_period_us", 1'000'000);
    if (runtime_us < 0 || period_us <= 0) return;  // there is no limit
    const Duration most = options_.period * runtime_us / period_us * kSpinPercentOfShare / 100;
    options_.spin = std::min(options_.spin, most);
}

void CyclicRunner::stay_on_cpu() noexcept {
    cpu_set_t only;
    CPU_ZERO(&only);
    if (options_.cpu >= CPU_SETSIZE) return refuse("not kept on its processor (there is none of that number)", EINVAL);
    CPU_SET(options_.cpu, &only);
    if (::sched_setaffinity(0, sizeof only, &only) != 0) refuse("not kept on its processor (sched_setaffinity)", errno);
}

void CyclicRunner::hold_latency() noexcept {
    if (latency_ >= 0) return;
    latency_ = ::open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);
    const std::int32_t none_us = 0;
    if (latency_ < 0 || ::write(latency_, &none_us, sizeof none_us) != sizeof none_us)
        refuse("processors may go into deep sleep (/dev/cpu_dma_latency cannot be written)", errno);
}

void CyclicRunner::raise_interrupts() noexcept {
    if (options_.interface == nullptr)
        return refuse("no priority for the interrupts of the NIC (`irq_priority` needs `interface`)", EINVAL);
    const bool found = irq_threads_.find(options_.interface, options_.places);
    if (!found && is_no_interface(options_.interface, options_.places))
        return refuse("no interrupts of the NIC are found (`interface`: there is no network interface of this name)",
                      ENODEV);
    if (options_.irq_priority == 0) return;
    if (!found)
        return refuse(
            "no priority for the interrupts of the NIC (this kernel handles them without threads: it needs "
            "PREEMPT_RT or the option threadirqs; or the interface has no interrupts)",
            ENOENT);
    if (const int error = irq_threads_.set_priority(options_.irq_priority); error != 0)
        refuse(error == EINVAL ? "the interrupts of the NIC keep their priority (irq_priority is not 1 to 99)"
                               : "the interrupts of the NIC keep their priority (needs CAP_SYS_NICE)",
               error);
}

std::span<const CyclicRefusal> CyclicRunner::finish() noexcept {
    const std::size_t before = refused_;
    if (const int error = irq_threads_.restore(); error != 0)
        refuse("the interrupts of the NIC do not have their priority back (needs CAP_SYS_NICE)", error);
    return std::span(refusals_).subspan(before, refused_ - before);
}

void CyclicRunner::refuse(const char* what, int error) noexcept {
    if (refused_ < refusals_.size()) refusals_[refused_++] = {what, error};
}

Time CyclicRunner::now() noexcept { return monotonic_now(); }

void CyclicRunner::start() noexcept {
    if (wrong_option_ == nullptr) schedule_.start(now());
}

CyclicTick CyclicRunner::wait() noexcept {
    Time time = now();
    if (schedule_.stopped()) return schedule_.wake(time);
    const Time sleep_until = schedule_.deadline() - options_.spin;
    if (time < sleep_until) {
        const auto since = sleep_until.time_since_epoch();
        const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(since);
        const timespec until{static_cast<time_t>(seconds.count()), static_cast<long>((since - seconds).count())};
        while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
        }
        time = now();
    }
    for (; time < schedule_.deadline(); time = now()) pause_processor();
    return schedule_.wake(time);
}

}  // namespace margay
