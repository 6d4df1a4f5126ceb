// Runs the conformance suite for ports (test/port) on the board.
#include "mps2_an386/board.hpp"
#include "port/suite/port_suite.hpp"

#include <margay/parts/oshw/lan9118/lan9118.hpp>

using namespace margay;
using namespace std::chrono_literals;

namespace {

BareOsal osal(board::description());
Lan9118 nic(board::ethernet(), {0x00, 0x4d, 0x41, 0x52, 0x47, 0x59});

// One call after some milliseconds, in the interrupt of the tick.
struct {
    std::atomic<unsigned> milliseconds{0};
    void (*function)(void*) = nullptr;
    void* argument = nullptr;
} planned;

void call_later(void*, Duration delay, void (*function)(void*), void* argument) {
    planned.function = function;
    planned.argument = argument;
    planned.milliseconds = static_cast<unsigned>(delay / 1ms) + 1;
}

WideCounter second_clock(board::kHertz);

}  // namespace

extern "C" void systick_handler() {
    const unsigned left = planned.milliseconds.load();
    if (left == 0) return;
    planned.milliseconds.store(left - 1);
    if (left == 1) planned.function(planned.argument);
}

extern "C" void ethernet_handler() {
    nic.on_interrupt();
    osal.wake();
}

int main() {
    board::start_tick();
    board::start_second_counter();
    if (!nic.open(osal)) board::print(nic.problem());
    board::allow_ethernet_interrupt();

    port::Port port{.osal = &osal, .nic = &nic};
    port.print = [](void*, std::string_view line) { board::print(line); };
    port.call_later = call_later;
    port.second_clock = [](void*) -> Duration {
        return second_clock.extend(board::second_counter()).time_since_epoch();
    };
    // A person reads this line and moves the cable.
    port.plug = [](void*, bool in) { board::print(in ? "please connect the cable" : "please pull out the cable"); };
    port.longest_plugging = 60s;
    // QEMU executes each access to the FIFO as a call of a function, on a machine that does other work too.
    port.longest_call = 2ms;
    port.latest = 200ms;  // QEMU shares the processors of the PC; a real board keeps the default
    port.burst = 6;       // frames of full size in the receive FIFO of 10560 octets
    port.on_the_way = 6;  // QEMU has no wire: all replies may come at once
    const auto verdict = port::check_port(port);
    board::print(verdict.failed == 0 ? "the port passes" : "the port fails");
    for (;;) osal.wait(kNever, -1);
}
