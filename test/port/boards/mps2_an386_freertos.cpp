// Runs the conformance suite for ports (test/port) in a task of FreeRTOS.
#include "mps2_an386/freertos/tasks.hpp"
#include "port/suite/port_suite.hpp"

#include <margay/parts/osal/freertos/freertos_osal.hpp>
#include <margay/parts/oshw/lan9118/lan9118.hpp>

using namespace margay;
using namespace std::chrono_literals;

namespace {

FreertosOsal osal(board::counter, board::kHertz);
Lan9118 nic(board::ethernet(), {0x00, 0x4d, 0x41, 0x52, 0x47, 0x59});
WideCounter second_clock(board::kHertz);

// The suite runs in one task; calls from outside it come from the two others, with the higher priority.
StaticTask<4096> suite_task;
struct Caller {
    StaticTask<512> task;
    TickType_t delay = 0;
    void (*function)(void*) = nullptr;
    void* argument = nullptr;
    std::atomic<bool> busy{false};
} callers[2];

void call_later(void*, Duration delay, void (*function)(void*), void* argument) {
    Caller& caller = callers[callers[0].busy ? 1 : 0];
    caller.busy = true;
    caller.delay = static_cast<TickType_t>(delay / 1ms);
    caller.function = function;
    caller.argument = argument;
    xTaskNotifyGive(caller.task.handle);
}

void call(void* self) {
    Caller& caller = *static_cast<Caller*>(self);
    for (;;) {
        (void)ulTaskNotifyTake(pdTRUE, portMAX_DELAY);
        vTaskDelay(caller.delay);
        caller.function(caller.argument);
        caller.busy = false;
    }
}

void check(void*) {
    board::start_second_counter();
    if (!nic.open(osal)) print(nic.problem());
    board::allow_ethernet_interrupt(6);

    port::Port port{.osal = &osal, .nic = &nic};
    port.print = [](void*, std::string_view line) { print(line); };
    port.call_later = call_later;
    port.several_threads = true;
    port.calls_at_once = 2;
    port.second_clock = [](void*) { return second_clock.extend(board::second_counter()).time_since_epoch(); };
    // A person reads this line and moves the cable.
    port.plug = [](void*, bool in) { print(in ? "please connect the cable" : "please pull out the cable"); };
    port.longest_plugging = 60s;
    // QEMU executes each access to the FIFO as a call of a function, on a machine that does other work too.
    port.longest_call = 2ms;
    port.latest = 200ms;  // QEMU shares the processors of the PC; a real board keeps the default
    port.burst = 6;       // frames of full size in the receive FIFO of 10560 octets
    port.on_the_way = 6;  // QEMU has no wire: all replies may come at once
    const auto verdict = port::check_port(port);
    print(verdict.failed == 0 ? "the port passes" : "the port fails");
    vTaskSuspend(nullptr);
}

}  // namespace

extern "C" void ethernet_handler() {
    nic.on_interrupt();
    osal.wake_from_interrupt();
}

int main() {
    suite_task.start("suite", 2, check);
    for (Caller& caller : callers) caller.task.start("caller", 3, call, &caller);
    vTaskStartScheduler();
}
