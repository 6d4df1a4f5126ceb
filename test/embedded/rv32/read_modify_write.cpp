// Checks osal/bare/read_modify_write.cpp on RISC-V: operations on octets and half words. On this processor they are
// operations on the word that contains them. QEMU's user-mode emulation executes the program. It ends with 0, or with
// the line number of the failed check.
#include <atomic>
#include <cstdint>

namespace {

[[noreturn]] void end(long code) {
    register long a0 asm("a0") = code;
    register long a7 asm("a7") = 93;  // exit of Linux
    for (;;) asm volatile("ecall" ::"r"(a0), "r"(a7) : "memory");
}

// Executes every operation at each place of a word. The other octets of the word must keep their values.
template <class T>
void check() {
    constexpr auto kCount = 4 / sizeof(T);
    alignas(4) static std::atomic<T> values[kCount];
    for (unsigned n = 0; n < kCount; ++n) {
        for (auto& value : values) value.store(static_cast<T>(0xA5A5));
        auto& value = values[n];
        if (value.exchange(7) != static_cast<T>(0xA5A5)) end(__LINE__);
        if (value.fetch_add(static_cast<T>(-3)) != 7) end(__LINE__);
        if (value.fetch_sub(1) != 4) end(__LINE__);
        if (value.fetch_or(0x58) != 3) end(__LINE__);
        if (value.fetch_and(0x0F) != 0x5B) end(__LINE__);
        if (value.fetch_xor(0xFF) != 0x0B) end(__LINE__);
        T expected = 1;
        if (value.compare_exchange_strong(expected, 2)) end(__LINE__);
        if (expected != 0xF4) end(__LINE__);
        if (!value.compare_exchange_strong(expected, 2)) end(__LINE__);
        if (value.fetch_sub(3) != 2) end(__LINE__);  // below 0
        if (value.load() != static_cast<T>(-1)) end(__LINE__);
        for (unsigned other = 0; other < kCount; ++other)
            if (other != n && values[other].load() != static_cast<T>(0xA5A5)) end(__LINE__);
    }
}

}  // namespace

extern "C" [[noreturn]] void _start() {
    check<std::uint8_t>();
    check<std::uint16_t>();
    end(0);
}
