// A periodic task on Linux that is woken as punctually as the system lets it: absolute deadlines off the kernel's tick,
// an optional spin before each, and what a thread can ask of the system for it.
//
//     CyclicRunner runner(
//         {.period = std::chrono::milliseconds(1), .spin = std::chrono::microseconds(50), .priority = 80});
//     for (const auto& refusal : runner.prepare()) …;      // tell the user what was not granted
//     runner.start();
//     for (;;) {
//         const CyclicTick tick = runner.wait();
//         …send and receive…
//     }
#pragma once

#include "osal/cyclic_schedule.hpp"

#include <array>
#include <cstddef>
#include <span>

namespace margay {

struct CyclicOptions {
    Duration period = std::chrono::milliseconds(1);
    // How long before a deadline sleeping ends and watching the clock begins. It costs that share of a processor and
    // hides how late the kernel wakes threads; 50 to 100 µs cover most of it.
    Duration spin{};
    int priority = 0;          // of SCHED_FIFO, 1 to 99; 0: the thread keeps its policy
    int cpu = -1;              // the processor to stay on; -1: any
    bool lock_memory = true;   // mlockall(): no page fault later
    bool hold_latency = true;  // /dev/cpu_dma_latency at 0: processors do not go into deep sleep
};

// What the system did not grant. The task runs nevertheless, less punctually.
struct CyclicRefusal {
    const char* what = "";  // and what would help
    int error = 0;          // errno
};

class CyclicRunner {
  public:
    explicit CyclicRunner(const CyclicOptions& options) noexcept;
    ~CyclicRunner();
    CyclicRunner(const CyclicRunner&) = delete;
    CyclicRunner& operator=(const CyclicRunner&) = delete;

    // For the calling thread, which is the one that will wait(). The span stays valid as long as the runner. What was
    // granted lasts: the policy for the thread's life, the latency until the runner is destroyed.
    std::span<const CyclicRefusal> prepare() noexcept;

    // The first deadline comes half a period to one and a half from now.
    void start() noexcept;

    // Sleeps until the next deadline, or not at all where it has passed. One system call, none when late.
    CyclicTick wait() noexcept;

    [[nodiscard]] Time deadline() const { return schedule_.deadline(); }
    [[nodiscard]] static Time now() noexcept;  // CLOCK_MONOTONIC, as LinuxOsal
    // As asked for, or less: a thread of SCHED_FIFO that used up its share of a second (sched_rt_runtime_us) would be
    // stopped until the second is over.
    [[nodiscard]] Duration spin() const { return options_.spin; }

  private:
    void refuse(const char* what, int error) noexcept;
    void take_priority() noexcept;
    void stay_on_cpu() noexcept;
    void hold_latency() noexcept;

    CyclicOptions options_;
    CyclicSchedule schedule_;
    std::array<CyclicRefusal, 5> refusals_{};
    std::size_t refused_ = 0;
    int latency_ = -1;
};

}  // namespace margay
