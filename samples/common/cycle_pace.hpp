// The cycle of a program on any SOURCE: until the next deadline the master's other work goes on. On an interface it is
// kept by CyclicRunner, in virtual time by the clock that moves with the waiting.
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
    std::string histogram;  // file for the picture of the times; empty: none
};

// --period, --spin, --priority, --cpu, --histogram.
void add_pace_options(Arguments& arguments, PaceOptions& options);

class CyclePace {
  public:
    // All outlive the pace.
    CyclePace(Source& source, Context& ctx, const PaceOptions& options);

    // In the thread that will wait(). Tells on standard error what the system did not grant, and which options have no
    // effect in virtual time.
    void start();
    // Lets poll() do its work until the deadline has come, and counts how late that was.
    void wait();
    // Counts a cycle: how long it took from sending until all was back, or what was wrong.
    void count(Duration round_trip, const Result<std::uint32_t>& received);

    // Begins counting anew.
    void clear() { figures_ = {}; }

    [[nodiscard]] const CycleFigures& figures() const { return figures_; }
    // Prints the figures and writes the picture where asked for. Empty, or why it could not be written.
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
