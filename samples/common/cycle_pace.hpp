// Keeps the cycle of a program on any SOURCE, and executes the other work of the master until the next deadline. On an
// interface CyclicRunner keeps the period. In virtual time the clock moves while the program waits.
#pragma once

#include "common/arguments.hpp"
#include "common/cycle_report.hpp"
#include "common/frame_times.hpp"
#include "common/source.hpp"
#include "osal/linux/cyclic_runner.hpp"

#include <margay/context.hpp>
#include <margay/frame_timing.hpp>
#include <margay/result.hpp>

#include <algorithm>
#include <optional>
#include <string>

namespace margay::samples {

struct PaceOptions {
    unsigned period_us = 1000;
    unsigned spin_us = 0;
    int priority = 0;
    unsigned runtime_us = 0;
    int cpu = -1;
    std::optional<OverrunPolicy> overrun{};  // nothing: skip
    std::string histogram;                   // file for a picture (SVG) or the figures (JSON); empty: none
    FrameTimeOptions times{};                // the SOURCE must have them (wanted_times())

    // How long a cycle waits for its frames: nearly a period, because the frames of hundreds of slaves need long.
    [[nodiscard]] Duration reply_timeout() const {
        return std::max<Duration>(std::chrono::microseconds(500), std::chrono::microseconds(period_us) * 9 / 10);
    }
};

// --period, --spin, --priority, --runtime, --cpu.
void add_period_options(Arguments& arguments, PaceOptions& options);
// These, --overrun, --histogram, --send-at and --stamps.
void add_pace_options(Arguments& arguments, PaceOptions& options);

class CyclePace {
  public:
    // All arguments must outlive the object.
    CyclePace(Source& source, Context& ctx, const PaceOptions& options);

    // Call it in the thread that calls wait(). Reports on standard error which settings the system refused, and which
    // options have no effect in virtual time.
    void start();
    // Executes poll() until the deadline, then counts how late the cycle is, and returns it.
    Duration wait();
    // Exchanges process data and counts the cycle: sends at once, or at the time that --send-at asks for, and receives.
    // Returns the error of sending, or the result of receive_processdata().
    [[nodiscard]] Result<std::uint32_t> exchange(Duration timeout);
    // How long the cycles have waited, and what to do if that is too short. Empty: all cycles had their frames.
    [[nodiscard]] std::string advice() const;
    // Why the program must end: an overrun, and the user wants to stop then. Empty: it continues.
    [[nodiscard]] const std::string& stopped() const { return stopped_; }

    // Moves the next cycle and all after it, later or (negative) earlier: MasterClock::update() says by how much.
    void adjust(Duration by);

    // Clears all figures.
    void clear();

    [[nodiscard]] const CycleFigures& figures() const { return figures_; }
    // Prints the figures and writes the picture if --histogram asks for it, and says how many frames did not leave at
    // their time. Returns an error text; empty when there is none.
    [[nodiscard]] std::string report();

  private:
    struct Times {
        Time start{};  // before the call that sends
        Time sent{};   // after the call that sends
        Time back{};   // after the call that receives
    };
    [[nodiscard]] Result<> send();
    void count(const Times& times, const Result<std::uint32_t>& received);
    [[nodiscard]] Time deadline() const { return source_.virtual_time() ? virtual_.deadline() : runner_.deadline(); }

    Source& source_;
    Context& ctx_;
    PaceOptions options_;
    CyclicRunner runner_;
    CyclicSchedule virtual_;
    CycleFigures figures_;
    CyclicTick tick_{};  // the deadline of the present cycle
    bool ticked_ = false;
    OverrunCounters counted_{};  // counters that the figures contain, or had before clear()
    FrameTiming timing_{};
    std::uint64_t missed_before_ = 0;  // frames before clear()
    std::uint64_t unexpected_before_ = 0;
    WireWatch wire_;
    std::string stopped_;
};

}  // namespace margay::samples
