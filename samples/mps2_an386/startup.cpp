// The first code of the image: the vector table of the Cortex-M4, and what must happen before main().
#include "board.hpp"

#include <cstddef>
#include <cstdint>

extern "C" {

// C++ forbids a program to call main(), so it is called by another name for the same symbol.
int program() asm("main");

// Addresses from the linker script.
extern std::uint32_t stack_top, data_begin, data_end, data_source, bss_begin, bss_end;
extern void (*__init_array_start[])();
extern void (*__init_array_end[])();

void reset_handler() {
    const std::uint32_t* from = &data_source;
    for (std::uint32_t* to = &data_begin; to < &data_end; ++to) *to = *from++;
    for (std::uint32_t* to = &bss_begin; to < &bss_end; ++to) *to = 0;
    board::start();
    for (auto* constructor = __init_array_start; constructor < __init_array_end; ++constructor) (*constructor)();
    program();
    for (;;) {
    }
}

void fault_handler() {
    board::print("the processor has stopped at a fault");
    for (;;) {
    }
}
void unused_handler() {}

// A program defines the functions that it needs.
[[gnu::weak, gnu::alias("unused_handler")]] void svcall_handler();
[[gnu::weak, gnu::alias("unused_handler")]] void pendsv_handler();
[[gnu::weak, gnu::alias("unused_handler")]] void systick_handler();
[[gnu::weak, gnu::alias("unused_handler")]] void timer1_handler();
[[gnu::weak, gnu::alias("unused_handler")]] void ethernet_handler();

// main() never ends, so the destructors of static objects are never called and need not be registered.
void* __dso_handle = nullptr;
int __aeabi_atexit(void*, void (*)(void*), void*) { return 0; }

}  // extern "C"

namespace {

using Handler = void (*)();
struct Vectors {
    std::uint32_t* stack = &stack_top;
    Handler exceptions[15] = {reset_handler,  fault_handler,  fault_handler,  fault_handler,  fault_handler,
                              fault_handler,  unused_handler, unused_handler, unused_handler, unused_handler,
                              svcall_handler, unused_handler, unused_handler, pendsv_handler, systick_handler};
    Handler interrupts[16] = {unused_handler, unused_handler,   unused_handler, unused_handler,
                              unused_handler, unused_handler,   unused_handler, unused_handler,
                              unused_handler, timer1_handler,   unused_handler, unused_handler,
                              unused_handler, ethernet_handler, unused_handler, unused_handler};
};

[[gnu::section(".vectors"), gnu::used]] constexpr Vectors kVectors{};

}  // namespace
