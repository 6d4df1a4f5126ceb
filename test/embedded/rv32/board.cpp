// The functions that samples/mps2_an386/main.cpp needs from a board, for a RISC-V board that does not exist: the
// program is linked and never executed. CLINT and UART have the addresses of QEMU's machine `virt`. The LAN9118 has an
// address without a device.
#include "samples/mps2_an386/board.hpp"

namespace board {
namespace {

template <class T>
volatile T* at(std::uintptr_t address) {
    return reinterpret_cast<volatile T*>(address);
}

}  // namespace

void print(std::string_view line) {
    for (const char c : line) *at<char>(0x10000000) = c;
    *at<char>(0x10000000) = '\n';
}
std::uint32_t counter() { return *at<std::uint32_t>(0x0200BFF8); }
void start_tick() { *at<std::uint32_t>(0x02004000) = counter() + kHertz / 1000; }
volatile std::uint32_t* ethernet() { return at<std::uint32_t>(0x40200000); }
void allow_ethernet_interrupt(unsigned) {}
void idle(const std::atomic<bool>& woken) {
    if (!woken.load(std::memory_order_relaxed)) asm volatile("wfi" ::: "memory");
}
margay::BareBoard description() { return {.counter = counter, .hertz = kHertz, .idle = idle}; }

}  // namespace board
