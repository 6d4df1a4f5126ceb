// Osal for FreeRTOS 10 and 11: a counter of the board as the clock, semaphores for waiting. Compile it together with
// the application, which has the FreeRTOSConfig.h. It needs configSUPPORT_STATIC_ALLOCATION and uses no heap.
//
// Only the task that owns the context waits in wait(); all other tasks sleep in sleep_while(). Use it in tasks, after
// the scheduler has started.
#pragma once

#include "osal/osal.hpp"
#include "osal/wide_counter.hpp"

#include <FreeRTOS.h>
#include <semphr.h>

namespace margay {

class FreertosOsal final : public Osal {
  public:
    // `counter`: a counter of 32 bits that counts up at `hertz` without a pause, 1 MHz or faster for distributed
    // clocks. See WideCounter for how often now() must be called.
    FreertosOsal(std::uint32_t (*counter)(), std::uint32_t hertz) noexcept;
    ~FreertosOsal();
    FreertosOsal(const FreertosOsal&) = delete;
    FreertosOsal& operator=(const FreertosOsal&) = delete;

    // Callable from any task, not from an interrupt.
    [[nodiscard]] Time now() noexcept override;
    // Waits in whole ticks and returns up to one tick early; when less than a tick is left, it returns at once.
    // `nics` has no meaning: the interrupt of the NIC calls wake_from_interrupt().
    void wait(Time until, WaitHandles nics) noexcept override;
    // For tasks.
    void wake() noexcept override;
    // For interrupts with a priority that may call functions of FreeRTOS (configMAX_SYSCALL_INTERRUPT_PRIORITY).
    void wake_from_interrupt() noexcept;
    void sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept override;
    void wake_sleepers(const void* word) noexcept override;

  private:
    // A task in sleep_while(), on the stack of this task.
    struct Sleeper {
        const void* word = nullptr;
        SemaphoreHandle_t woken = nullptr;
        Sleeper* next = nullptr;
    };
    [[nodiscard]] std::uintptr_t calling_thread() noexcept override;
    [[nodiscard]] TickType_t ticks_until(Time until) noexcept;
    void remove(const Sleeper& sleeper) noexcept;

    std::uint32_t (*counter_)();
    WideCounter wide_;
    StaticSemaphore_t memory_;
    SemaphoreHandle_t woken_;
    Sleeper* sleepers_ = nullptr;  // changed with the scheduler suspended
};

}  // namespace margay
