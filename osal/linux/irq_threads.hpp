// The kernel threads that handle the interrupts of a network interface ("irq/24-eth0"), and their priorities. A kernel
// has them with PREEMPT_RT, or with the option `threadirqs`. A reply reaches the program only after such a thread has
// run: where a real-time thread with a higher priority uses the processor meanwhile, the reply waits.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>

namespace margay {

struct IrqThread {
    int id = 0;
    unsigned irq = 0;
    int policy = 0;    // SCHED_FIFO, in general
    int priority = 0;  // 1 to 99; 0: the policy has none
    std::array<char, 16> name{};
};

// One sentence that compares the priority of the thread with the priority of the cycle (SCHED_FIFO; 0: the cycle has no
// real-time policy), and contains the command that changes it. `memory`: 256 octets are enough; the result is in this
// memory.
[[nodiscard]] std::string_view describe(const IrqThread& thread, int cycle_priority, std::span<char> memory) noexcept;
// Whether the priority of the thread is above the priority of the cycle.
[[nodiscard]] bool is_above(const IrqThread& thread, int cycle_priority) noexcept;

// Not callable from the cycle.
class IrqThreads {
  public:
    // Folders of the system; tests set other ones.
    struct Places {
        const char* proc = "/proc";
        const char* sys = "/sys";
    };

    // Finds the IRQ threads of the interface, by the name of the thread, or by the interrupts of its device (MSI) in
    // /sys. At most kMost are kept. False: there is none. Needs no privilege.
    bool find(std::string_view interface, const Places& places) noexcept;
    bool find(std::string_view interface) noexcept { return find(interface, Places{}); }
    [[nodiscard]] std::span<const IrqThread> all() const noexcept { return std::span(threads_).first(count_); }

    // Sets SCHED_FIFO with this priority, 1 to 99, for all of these threads. Returns 0, or errno of the first refusal
    // (EPERM: CAP_SYS_NICE is needed); the other threads are set nevertheless.
    [[nodiscard]] int set_priority(int priority) noexcept;
    // Restores the earlier policy and priority of these threads. A thread that another program has changed since is not
    // changed. Returns 0, or errno of the first refusal.
    int restore() noexcept;

  private:
    static constexpr std::size_t kMost = 64;

    std::array<IrqThread, kMost> threads_{};
    std::array<bool, kMost> changed_{};
    std::array<int, kMost> set_to_{};  // the priority that set_priority() has set last
    std::size_t count_ = 0;
};

}  // namespace margay
