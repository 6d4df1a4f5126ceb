// Keeps the cycle of a program on any SOURCE, and executes the other work of the master until the next deadline. On an
// interface CyclicRunner keeps the period. In virtual time the clock moves while the program waits.
#pragma once

#include "common/arguments.hpp"
#include "common/cycle_report.hpp"
#include "common/source.hpp"
#include "osal/linux/cyclic_runner.hpp"

#include <margay/context.hpp>

#include <string>

namespace margay::samples {

struct PaceOptions {
    unsigned period_us = 1000;
    unsigned spin_us = 0;
    int priority = 0;
    int cpu = -1;
    std::string histogram;  // file for an SVG picture of the times; empty: none
};

// --period, --spin, --priority, --cpu, --histogram.
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
    // Counts a cycle. `round_trip` is the time from sending until all frames were back; `received` is the result of
    // the cycle.
    void count(Duration round_trip, const Result<std::uint32_t>& received);

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
};

}  // namespace margay::samples
