// Keeps the cycle of a program on any SOURCE, and executes the other work of the master until the next deadline. On an
// interface CyclicRunner keeps the period. In virtual time the clock moves while the program waits.
#pragma once

#include "common/arguments.hpp"
#include "common/cycle_report.hpp"
#include "common/source.hpp"
#include "osal/linux/cyclic_runner.hpp"

#include <margay/context.hpp>

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
};

// When the frames of a cycle went and came.
struct CycleTimes {
    Time start{};  // before the call that sends
    Time sent{};   // after the call that sends
    Time back{};   // after the call that receives
};

// --period, --spin, --priority, --runtime, --cpu.
void add_period_options(Arguments& arguments, PaceOptions& options);
// These, --overrun and --histogram.
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
    // Counts a cycle. `received` is its result.
    void count(const CycleTimes& times, const Result<std::uint32_t>& received);
    // Why the program must end: an overrun, and the user wants to stop then. Empty: it continues.
    [[nodiscard]] const std::string& stopped() const { return stopped_; }

    // Moves the next cycle and all after it, later or (negative) earlier: MasterClock::update() says by how much.
    void shift(Duration by);

    // Clears all figures.
    void clear() { figures_ = {}; }

    [[nodiscard]] const CycleFigures& figures() const { return figures_; }
    // Prints the figures and writes the picture if --histogram asks for it. Returns an error text; empty when there is
    // none.
    [[nodiscard]] std::string report() const;

  private:
    [[nodiscard]] Time deadline() const { return source_.virtual_time() ? virtual_.deadline() : runner_.deadline(); }

    Source& source_;
    Context& ctx_;
    PaceOptions options_;
    CyclicRunner runner_;
    CyclicSchedule virtual_;
    CycleFigures figures_;
    CyclicTick tick_{};  // the deadline of the present cycle
    bool ticked_ = false;
    OverrunCounters counted_{};  // those that the figures contain, or had before clear()
    std::string stopped_;
};

}  // namespace margay::samples
