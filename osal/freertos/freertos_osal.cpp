#include "osal/freertos/freertos_osal.hpp"

#include <task.h>

#include <algorithm>

namespace margay {

FreertosOsal::FreertosOsal(std::uint32_t (*counter)(), std::uint32_t hertz) noexcept
    : counter_(counter), wide_(hertz), woken_(xSemaphoreCreateBinaryStatic(&memory_)) {}

FreertosOsal::~FreertosOsal() { vSemaphoreDelete(woken_); }

Time FreertosOsal::now() noexcept {
    // The counter and its extension belong together, so no other task may come between them.
    taskENTER_CRITICAL();
    const Time now = wide_.extend(counter_());
    taskEXIT_CRITICAL();
    return now;
}

TickType_t FreertosOsal::ticks_until(Time until) noexcept {
    if (until == kNever) return portMAX_DELAY;
    const auto left = (until - now()).count() / (1'000'000'000 / configTICK_RATE_HZ);
    // Ticks have 16, 32 or 64 bits, without a sign.
    const auto ticks = static_cast<std::uint64_t>(std::max<std::int64_t>(left, 0));
    return static_cast<TickType_t>(std::min<std::uint64_t>(ticks, portMAX_DELAY - 1));
}

void FreertosOsal::wait(Time until, WaitHandles) noexcept {
    if (until <= now()) return;
    (void)xSemaphoreTake(woken_, ticks_until(until));
}

void FreertosOsal::wake() noexcept { (void)xSemaphoreGive(woken_); }

void FreertosOsal::wake_from_interrupt() noexcept {
    BaseType_t other_task = pdFALSE;
    (void)xSemaphoreGiveFromISR(woken_, &other_task);
    portYIELD_FROM_ISR(other_task);
}

void FreertosOsal::sleep_while(const std::atomic<std::uint32_t>& word, std::uint32_t value, Time until) noexcept {
    const TickType_t ticks = ticks_until(until);
    StaticSemaphore_t memory;
    Sleeper self{.word = &word, .woken = xSemaphoreCreateBinaryStatic(&memory)};
    vTaskSuspendAll();
    // wake_sleepers() suspends the scheduler too, so a change of the word after this comparison is not missed.
    const bool sleeps = word.load(std::memory_order_acquire) == value;
    if (sleeps) {
        self.next = sleepers_;
        sleepers_ = &self;
    }
    (void)xTaskResumeAll();
    if (sleeps) {
        (void)xSemaphoreTake(self.woken, ticks);
        vTaskSuspendAll();
        remove(self);
        (void)xTaskResumeAll();
    }
    vSemaphoreDelete(self.woken);
}

void FreertosOsal::remove(const Sleeper& sleeper) noexcept {
    for (Sleeper** at = &sleepers_; *at != nullptr; at = &(*at)->next)
        if (*at == &sleeper) {
            *at = sleeper.next;
            return;
        }
}

void FreertosOsal::wake_sleepers(const void* word) noexcept {
    vTaskSuspendAll();
    for (const Sleeper* sleeper = sleepers_; sleeper != nullptr; sleeper = sleeper->next)
        if (sleeper->word == word) (void)xSemaphoreGive(sleeper->woken);
    (void)xTaskResumeAll();
}

std::uintptr_t FreertosOsal::calling_thread() noexcept {
    return reinterpret_cast<std::uintptr_t>(xTaskGetCurrentTaskHandle());
}

}  // namespace margay
