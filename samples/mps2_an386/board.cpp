#include "board.hpp"

namespace board {
namespace {

using Register = volatile std::uint32_t;

Register* at(std::uintptr_t address) { return reinterpret_cast<Register*>(address); }

// Arm CMSDK UART (DDI 0479, section 4.3) and timer (section 4.2).
constexpr std::uintptr_t kTimer0 = 0x40000000;
constexpr std::uintptr_t kTimer1 = 0x40001000;
constexpr std::uintptr_t kUart0 = 0x40004000;
constexpr std::uintptr_t kLan9118 = 0x40200000;
constexpr unsigned kTimer1Interrupt = 9;
constexpr unsigned kEthernetInterrupt = 13;

struct Uart {
    Register data;
    Register state;
    Register control;
    Register interrupt;
    Register divider;
};
struct Timer {
    Register control;
    Register value;  // counts down
    Register reload;
    Register interrupt;
};

Uart& uart() { return *reinterpret_cast<Uart*>(kUart0); }
Timer& timer(std::uintptr_t address) { return *reinterpret_cast<Timer*>(address); }

void put(char c) {
    while ((uart().state & 1) != 0) {  // the transmit buffer is full
    }
    uart().data = static_cast<unsigned char>(c);
}

void start_counter(Timer& timer) {
    timer.control = 0;
    timer.reload = 0xFFFFFFFF;
    timer.value = 0xFFFFFFFF;
    timer.control = 1;
}

void allow_interrupt(unsigned number, unsigned priority) {
    reinterpret_cast<volatile std::uint8_t*>(0xE000E400)[number] =
        static_cast<std::uint8_t>(priority << 5);  // NVIC_IPR
    *at(0xE000E100) = 1U << number;                // NVIC_ISER0
}

}  // namespace

void start() {
    uart().divider = kHertz / 115200;
    uart().control = 1;  // transmitter
    start_counter(timer(kTimer0));
}

void print(std::string_view line) {
    for (const char c : line) put(c);
    put('\n');
}

std::uint32_t counter() { return ~timer(kTimer0).value; }

void start_second_counter() { start_counter(timer(kTimer1)); }
std::uint32_t second_counter() { return ~timer(kTimer1).value; }

void start_tick() {
    *at(0xE000E014) = kHertz / 1000 - 1;  // SYST_RVR
    *at(0xE000E018) = 0;                  // SYST_CVR
    *at(0xE000E010) = 7;                  // SYST_CSR: processor clock, interrupt, enable
}

void stop_tick() { *at(0xE000E010) = 0; }

volatile std::uint32_t* ethernet() { return at(kLan9118); }

void allow_ethernet_interrupt(unsigned priority) { allow_interrupt(kEthernetInterrupt, priority); }

void start_cycle_timer(margay::Duration period, unsigned priority) {
    Timer& cycle = timer(kTimer1);
    cycle.control = 0;
    cycle.reload = static_cast<std::uint32_t>(period.count() / (1'000'000'000 / kHertz)) - 1;
    cycle.value = cycle.reload;
    cycle.control = 1 | 1 << 3;  // enable, interrupt
    allow_interrupt(kTimer1Interrupt, priority);
}
void clear_cycle_timer() { timer(kTimer1).interrupt = 1; }

void idle(const std::atomic<bool>& woken) {
    // With interrupts blocked, an interrupt still ends WFI. It is taken after `cpsie`.
    asm volatile("cpsid i" ::: "memory");
    if (!woken.load(std::memory_order_relaxed)) asm volatile("dsb\n wfi" ::: "memory");
    asm volatile("cpsie i\n isb" ::: "memory");
}

margay::BareBoard description() { return {.counter = counter, .hertz = kHertz, .idle = idle}; }

}  // namespace board
