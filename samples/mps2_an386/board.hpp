// The board: MPS2 with the FPGA image AN386 (Cortex-M4 at 25 MHz, LAN9118), or its model in QEMU (`mps2-an386`).
// For another board, rewrite board.cpp and the linker script.
#pragma once

#include <margay/parts/osal/bare/bare_osal.hpp>

#include <cstdint>
#include <string_view>

namespace board {

inline constexpr std::uint32_t kHertz = 25'000'000;

// Starts the UART and the counter. Called before the constructors of static objects.
void start();

// Writes a line to UART 0.
void print(std::string_view line);

// A free-running counter that counts up at kHertz.
[[nodiscard]] std::uint32_t counter();
// A second counter, for the conformance suite.
[[nodiscard]] std::uint32_t second_counter();
void start_second_counter();

// Uses the second counter as a timer that calls timer1_handler() once a period; the handler calls
// clear_cycle_timer(). `priority` as below.
void start_cycle_timer(margay::Duration period, unsigned priority);
void clear_cycle_timer();

// Interrupts 1000 times a second: systick_handler().
void start_tick();
void stop_tick();

// The registers of the LAN9118; its interrupt calls ethernet_handler().
[[nodiscard]] volatile std::uint32_t* ethernet();
// `priority`: 0 is the most urgent, 7 the least.
void allow_ethernet_interrupt(unsigned priority = 0);

// Sleeps until the next interrupt, unless `woken` is set.
void idle(const std::atomic<bool>& woken);

// All of it for a BareOsal.
[[nodiscard]] margay::BareBoard description();

}  // namespace board
