// Runs the conformance suite for ports (test/port) in a task of FreeRTOS.
#include "port/suite/port_suite.hpp"

#include "mps2_an386/freertos/tasks.hpp"
#include "osal/freertos/freertos_osal.hpp"
#include "oshw/lan9118/lan9118.hpp"

using namespace margay;
using namespace std::chrono_literals;

namespace {

FreertosOsal osal(board::counter, board::kHertz);
Lan9118 nic(board::ethernet(), {0x00, 0x4d, 0x41, 0x52, 0x47, 0x59});
WideCounter second_clock(board::kHertz);

// The suite runs in one task; calls from outside it come from the other, with the higher priority.
StaticTask<4096> suite_task;
StaticTask<512> caller_task;
struct {
    TickType_t delay = 0;
    void (*function)(void*) = nullptr;
    void* argument = nullptr;
} planned;

void call_later(void*, Duration delay, void (*function)(void*), void* argument) {
    planned = {static_cast<TickType_t>(delay / 1ms), function, argument};
    xTaskNotifyGive(caller_task.handle);
}

void call(void*) {
    for (;;) {
        (void)ulTaskNotifyTake(pdTRUE, portMAX_DELAY);
        vTaskDelay(planned.delay);
        planned.function(planned.argument);
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
    port.second_clock = [](void*) { return second_clock.extend(board::second_counter()).time_since_epoch(); };
    // Somebody reads this line and does it.
    port.plug = [](void*, bool in) { print(in ? "please connect the cable" : "please pull out the cable"); };
    port.longest_plugging = 60s;
    // QEMU executes each access to the FIFO as a call of a function, on a machine that does other work too.
    port.longest_call = 2ms;
    port.latest = 200ms;  // QEMU shares the processors of the PC; a real board keeps the default
    port.burst = 6;       // frames of full size in the receive FIFO of 10560 octets
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
    caller_task.start("caller", 3, call);
    vTaskStartScheduler();
}
