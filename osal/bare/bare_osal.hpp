// Osal without an operating system: a counter of the board, and sleeping until the next interrupt.
//
// There is one thread. Interrupts call wake(), and nothing else of the library.
#pragma once

#include "osal/osal.hpp"
#include "osal/wide_counter.hpp"

namespace margay {

// The functions that the board provides.
struct BareBoard {
    // A counter of 32 bits that counts up without a pause, 1 MHz or faster for distributed clocks. See WideCounter for
    // how often now() must be called.
    std::uint32_t (*counter)() = nullptr;
    std::uint32_t hertz = 0;
    // Stops the processor until the next interrupt, but not if `woken` is true. An interrupt between the comparison and
    // the instruction that sleeps must not be missed: block interrupts, compare, sleep (WFI of an Arm processor returns
    // for a blocked interrupt too), and allow interrupts. nullptr: wait() returns at once.
    void (*idle)(const std::atomic<bool>& woken) = nullptr;
    // The longest time between two interrupts, for example of a periodic timer. If less than this time is left, wait()
    // does not sleep and the processor polls, so that wait() is never late.
    Duration tick = std::chrono::milliseconds(1);
};

class BareOsal final : public Osal {
  public:
    explicit BareOsal(const BareBoard& board) noexcept : board_(board), counter_(board.hertz) {}

    // Not callable from an interrupt.
    [[nodiscard]] Time now() noexcept override { return counter_.extend(board_.counter()); }

    // Returns after one interrupt at the latest. `nics` has no meaning: the interrupt of the NIC calls wake().
    void wait(Time until, WaitHandles nics) noexcept override;

    // For interrupts.
    void wake() noexcept override { woken_.store(true, std::memory_order_release); }

  private:
    BareBoard board_;
    WideCounter counter_;
    std::atomic<bool> woken_{false};
};

}  // namespace margay
