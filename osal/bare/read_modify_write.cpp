// Atomic read-modify-write operations where the processor has none. The library exchanges, compares and counts values
// that several threads or interrupts share; loads and stores of up to a word are atomic on every processor. For all
// other operations the compiler calls the functions `__atomic_…` below, which an operating system has in libatomic.
//
// - Cortex-M0, M0+ and M1 (ARMv6-M), RISC-V without the extension A: each operation blocks interrupts. This is correct
//   for one processor whose code may block interrupts.
// - RISC-V with the extension A has these operations for words only. An octet or half a word is changed by an operation
//   on its word; interrupts stay allowed, and this is also correct with several processors.
// - On all other processors this file is empty.
//
// All of them are weak: a board with several processors of the first kind (RP2040) defines its own, with a lock
// that holds for all processors.
#include <cstdint>

#if defined(__ARM_ARCH_6M__) || (defined(__riscv) && !defined(__GCC_HAVE_SYNC_COMPARE_AND_SWAP_1))

namespace margay {
namespace {

#if defined(__ARM_ARCH_6M__) || !defined(__riscv_atomic)

#ifdef __ARM_ARCH_6M__
std::uint32_t block_interrupts() {
    std::uint32_t before;
    asm volatile("mrs %0, primask\n cpsid i" : "=r"(before)::"memory");
    return before;
}
void restore_interrupts(std::uint32_t before) { asm volatile("msr primask, %0" ::"r"(before) : "memory"); }
#else
std::uint32_t block_interrupts() {
    std::uint32_t before;
    asm volatile(".option push\n .option arch, +zicsr\n csrrci %0, mstatus, 8\n .option pop"
                 : "=r"(before)::"memory");  // bit 3: MIE
    return before;
}
void restore_interrupts(std::uint32_t before) {
    asm volatile(".option push\n .option arch, +zicsr\n csrs mstatus, %0\n .option pop" ::"r"(before & 8) : "memory");
}
#endif

// Stores next(old) if wanted(old) is true, and returns old.
template <class T, class Wanted, class Next>
T modify(volatile T* at, Wanted wanted, Next next) {
    const std::uint32_t before = block_interrupts();
    const T old = *at;
    if (wanted(old)) *at = next(old);
    restore_interrupts(before);
    return old;
}

#define MARGAY_WORD(OPERATION) OPERATION(std::uint32_t, 4)

#else

template <class T, class Wanted, class Next>
T modify(volatile T* at, Wanted wanted, Next next) {
    const auto address = reinterpret_cast<std::uintptr_t>(at);
    auto* const word = reinterpret_cast<volatile std::uint32_t*>(address & ~std::uintptr_t{3});
    const unsigned shift = (address & 3) * 8;
    const std::uint32_t mask = static_cast<std::uint32_t>(static_cast<T>(~T{0})) << shift;
    std::uint32_t before = __atomic_load_n(word, __ATOMIC_RELAXED);
    for (;;) {
        const T old = static_cast<T>((before & mask) >> shift);
        if (!wanted(old)) {
            __atomic_thread_fence(__ATOMIC_ACQUIRE);
            return old;
        }
        const std::uint32_t after = (before & ~mask) | static_cast<std::uint32_t>(next(old)) << shift;
        if (__atomic_compare_exchange_n(word, &before, after, true, __ATOMIC_SEQ_CST, __ATOMIC_RELAXED)) return old;
    }
}

#define MARGAY_WORD(OPERATION)

#endif

constexpr auto kAlways = [](auto) { return true; };

}  // namespace

// The functions that the compiler calls: `__atomic_NAME_SIZE` of GCC's internals manual. Programs cannot define
// functions of such names, so these functions have other names in C++.
#define MARGAY_FETCH(NAME, OPERATOR, T, BYTES)                                                     \
    T NAME##_##BYTES(volatile T*, T, int) asm("__atomic_fetch_" #NAME "_" #BYTES);                 \
    [[gnu::weak, gnu::used]] T NAME##_##BYTES(volatile T* at, T value, int) {                      \
        return modify(at, kAlways, [value](T old) { return static_cast<T>(old OPERATOR value); }); \
    }

#define MARGAY_OPERATIONS(T, BYTES)                                                                       \
    T exchange_##BYTES(volatile T*, T, int) asm("__atomic_exchange_" #BYTES);                             \
    [[gnu::weak, gnu::used]] T exchange_##BYTES(volatile T* at, T value, int) {                           \
        return modify(at, kAlways, [value](T) { return value; });                                         \
    }                                                                                                     \
    bool compare_##BYTES(volatile T*, T*, T, bool, int, int) asm("__atomic_compare_exchange_" #BYTES);    \
    [[gnu::weak, gnu::used]] bool compare_##BYTES(volatile T* at, T* expected, T value, bool, int, int) { \
        const T wanted = *expected;                                                                       \
        *expected = modify(                                                                               \
            at, [wanted](T old) { return old == wanted; }, [value](T) { return value; });                 \
        return *expected == wanted;                                                                       \
    }                                                                                                     \
    MARGAY_FETCH(add, +, T, BYTES)                                                                        \
    MARGAY_FETCH(sub, -, T, BYTES)                                                                        \
    MARGAY_FETCH(and, &, T, BYTES)                                                                        \
    MARGAY_FETCH(or, |, T, BYTES)                                                                         \
    MARGAY_FETCH(xor, ^, T, BYTES)

MARGAY_OPERATIONS(std::uint8_t, 1)
MARGAY_OPERATIONS(std::uint16_t, 2)
MARGAY_WORD(MARGAY_OPERATIONS)

}  // namespace margay

#endif
