// Runs a periodic task on Linux and wakes it up as exactly as the system permits: absolute deadlines that avoid the
// kernel's tick, an optional spin before each deadline, and the real-time settings that a thread can request.
//
//     CyclicRunner runner(
//         {.period = std::chrono::milliseconds(1), .spin = std::chrono::microseconds(50), .priority = 80});
//     for (const auto& refusal : runner.prepare()) …;      // report what the system did not grant
//     if (runner.wrong_option() != nullptr) return …;
//     runner.start();
//     for (;;) {
//         const CyclicTick tick = runner.wait();
//         …send and receive…
//     }
#pragma once

#include "osal/cyclic_schedule.hpp"
#include "osal/linux/irq_threads.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

struct CyclicOptions {
    Duration period = std::chrono::milliseconds(1);  // more than 0
    // Time before a deadline at which the thread stops sleeping and polls the clock instead, 0 or more. The spin uses
    // this share of a processor and hides the wake-up latency of the kernel; 50 to 100 µs cover most of it.
    Duration spin{};
    int priority = 0;  // priority of SCHED_FIFO, 1 to 99; 0: the thread keeps its policy
    // Processor time that SCHED_DEADLINE reserves for the thread in each period; 0: another policy. It must cover the
    // spin, the exchange and the work: a thread that has used it is stopped until the next period. The kernel refuses
    // it to a thread that is bound to a processor (`cpu`), unless a cpuset has made that processor a domain of its own.
    // Where the kernel refuses it, `priority` is used if it is given.
    Duration runtime{};
    int cpu = -1;              // the processor for the thread; -1: any
    bool lock_memory = true;   // mlockall(), and touches the stack of the thread: prevents later page faults
    bool hold_latency = true;  // sets /dev/cpu_dma_latency to 0, so that processors do not enter deep sleep states
    // The network interface of the cycle: prepare() finds the threads of its interrupts (irq_threads()), and does not
    // change them. nullptr: they are not searched. The text must outlive the runner.
    const char* interface = nullptr;
    // Priority of SCHED_FIFO for these threads, 1 to 99, until finish() or the end of the runner; 0: not changed. It
    // should be above `priority`, so that replies do not wait while the cycle uses the processor.
    int irq_priority = 0;
    IrqThreads::Places places{};  // the folders in which these threads are searched; tests set other ones
    OverrunPolicy overrun = OverrunPolicy::skip;
    std::uint64_t catch_up_limit = CyclicSchedule::kCatchUpLimit;  // of OverrunPolicy::catch_up
};

// A setting that the system did not grant. The task runs anyway, with more jitter.
struct CyclicRefusal {
    const char* what = "";  // the setting, and a hint how to get it
    int error = 0;          // errno
};

class CyclicRunner {
  public:
    explicit CyclicRunner(const CyclicOptions& options) noexcept;
    ~CyclicRunner();
    CyclicRunner(const CyclicRunner&) = delete;
    CyclicRunner& operator=(const CyclicRunner&) = delete;

    // The text of the option that makes a cycle impossible; nullptr: there is none. A period that is not more than 0, a
    // negative spin or runtime, a `cpu` below -1. Then prepare() applies nothing and returns this text alone (EINVAL),
    // and wait() returns at once with CyclicTick::stopped.
    [[nodiscard]] const char* wrong_option() const noexcept { return wrong_option_; }

    // Applies the settings to the calling thread, which must also call wait(). The returned span is valid as long as
    // the runner. The policy stays for the life of the thread, the latency setting until the runner is destroyed.
    std::span<const CyclicRefusal> prepare() noexcept;

    // The threads of the interrupts of CyclicOptions::interface, as they were before prepare() has changed them; empty
    // where the kernel has none. describe() reports the effect of their priority on the cycle.
    [[nodiscard]] std::span<const IrqThread> irq_threads() const noexcept { return irq_threads_.all(); }
    // Restores the earlier priority of these threads, as the destructor does. Returns the refused settings, as
    // prepare(). Not callable from the cycle.
    std::span<const CyclicRefusal> finish() noexcept;

    // Sets the first deadline, half a period to one and a half periods from now.
    void start() noexcept;

    // Call start() before. Sleeps until the next deadline; returns at once when it has passed, and when
    // OverrunPolicy::stop has ended the task (CyclicTick::stopped), or an option is wrong. One system call, none when
    // late.
    CyclicTick wait() noexcept;

    // Moves the next deadline and all after it, later or (negative) earlier: for a cycle that follows the reference
    // clock of distributed clocks (margay/master_clock.hpp).
    void adjust(Duration by) noexcept { schedule_.adjust(by); }

    [[nodiscard]] Time deadline() const { return schedule_.deadline(); }
    [[nodiscard]] static Time now() noexcept;  // CLOCK_MONOTONIC, as LinuxOsal
    // The spin that is used. It may be shorter than requested: the kernel stops a SCHED_FIFO thread that has used its
    // share of a second (sched_rt_runtime_us) until the second is over, and a SCHED_DEADLINE thread that has used its
    // runtime until the next period, so the spin is at most half of the runtime.
    [[nodiscard]] Duration spin() const { return options_.spin; }
    [[nodiscard]] const OverrunCounters& overruns() const { return schedule_.counters(); }

  private:
    void refuse(const char* what, int error) noexcept;
    // False: the kernel has refused it.
    [[nodiscard]] bool take_runtime() noexcept;
    void take_priority() noexcept;
    void stay_on_cpu() noexcept;
    void hold_latency() noexcept;
    void raise_interrupts() noexcept;

    CyclicOptions options_;
    const char* wrong_option_;
    CyclicSchedule schedule_;
    std::array<CyclicRefusal, 8> refusals_{};
    std::size_t refused_ = 0;
    int latency_ = -1;
    IrqThreads irq_threads_;
};

}  // namespace margay
