// Keeps the cycle of a program on any SOURCE, and executes the other work of the master until the next deadline. On an
// interface CyclicRunner keeps the period. In virtual time the clock moves while the program waits. Where an ENI uses
// distributed clocks, the cycle follows the reference clock.
#pragma once

#include "common/arguments.hpp"
#include "common/cycle_plan.hpp"
#include "common/cycle_report.hpp"
#include "common/frame_times.hpp"
#include "common/source.hpp"
#include "osal/linux/cyclic_runner.hpp"

#include <margay/context.hpp>
#include <margay/frame_timing.hpp>
#include <margay/master_clock.hpp>
#include <margay/result.hpp>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

namespace margay::samples {

struct PaceOptions {
    unsigned period_us = 0;  // 0: not given
    unsigned spin_us = 0;
    int priority = 0;
    unsigned runtime_us = 0;
    int cpu = -1;
    std::optional<OverrunPolicy> overrun{};  // nothing: skip
    std::string histogram;                   // file for a picture (SVG) or the figures (JSON); empty: none
    FrameTimeOptions times{};                // the SOURCE must support them (wanted_times())

    // `eni`: nullptr, or the file that the segment is brought up by.
    [[nodiscard]] CyclePlan plan(const files::EniConfiguration* eni = nullptr) const {
        return plan_cycles(eni, std::chrono::microseconds(period_us));
    }
    // The reason, as a sentence, why a cycle of this plan cannot have these times; empty: it can.
    [[nodiscard]] std::string refusal(const CyclePlan& plan) const {
        return samples::refusal(times, static_cast<unsigned>(plan.period / std::chrono::microseconds(1)));
    }
};

// --period, --spin, --priority, --runtime, --cpu. `before`: stands before the words of --help about --period.
void add_period_options(Arguments& arguments, PaceOptions& options, const std::string& before = {});
// These, --overrun, --histogram, --send-at and --stamps.
void add_pace_options(Arguments& arguments, PaceOptions& options, const std::string& before = {});
// The options of a program that brings a segment up by an ENI.
inline constexpr const char* kPeriodOfEni = "with --eni, that of the file if this is not given; otherwise the ";

class CyclePace {
  public:
    // `source` and `ctx` must outlive the object. Without a plan: group 0, with the period of the options.
    CyclePace(Source& source, Context& ctx, const PaceOptions& options);
    CyclePace(Source& source, Context& ctx, const PaceOptions& options, const CyclePlan& plan);

    // Call it in the thread that calls wait(). Reports on standard error which settings the system refused, and which
    // options have no effect in virtual time. After a reach() with clock(), the first cycle continues the phase of the
    // last cycle, and start() waits for it. A jump would make the slaves lose their synchronisation.
    void start();
    // Executes poll() until the deadline, then counts how late the cycle is, and returns it.
    Duration wait();
    // Exchanges the groups that are due and counts the cycle: sends at once, or at the time that --send-at asks for,
    // and receives. Then the next cycle follows the clock of the plan. Returns the first error, or the sum of the
    // working counters.
    [[nodiscard]] Result<std::uint32_t> exchange(Duration timeout);
    // The time that a cycle waits for its frames: nearly a period, because the frames of hundreds of slaves need much
    // time.
    [[nodiscard]] Duration reply_timeout() const;
    // For reach(), until start(); nullptr: the cycle follows no clock. Its group has the period of clock_period().
    [[nodiscard]] CycleClock* clock() { return clock_ ? &*clock_ : nullptr; }
    [[nodiscard]] bool follows_clock() const { return clock_.has_value(); }
    [[nodiscard]] Duration clock_period() const { return clock_ ? clock_->settings().phase.cycle : plan_.period; }
    // A text with the time that the cycles have waited, and with advice if this time is too short. Empty: the frames of
    // all cycles have returned in time.
    [[nodiscard]] std::string advice() const;
    // The reason why the program must end: an overrun, if the user has requested to stop at an overrun. Empty: the
    // program continues.
    [[nodiscard]] const std::string& stopped() const { return stopped_; }

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
    [[nodiscard]] Result<> send(std::uint8_t group);
    [[nodiscard]] Result<std::uint32_t> exchange_groups(Duration timeout, Times& times);
    [[nodiscard]] bool is_held() const;    // the frames leave later, as --send-at asks for
    [[nodiscard]] Time departure() const;  // of the held frames of this cycle
    void continue_phase();
    void keep_in_step(const Times& times);
    // Moves the next cycle and all after it, later or (negative) earlier.
    void adjust(Duration by);
    void count(const Times& times, const Result<std::uint32_t>& received);
    [[nodiscard]] Time deadline() const { return source_.virtual_time() ? virtual_.deadline() : runner_.deadline(); }

    Source& source_;
    Context& ctx_;
    PaceOptions options_;
    CyclePlan plan_;
    std::vector<bool> due_;    // by group, in this cycle
    std::uint64_t cycle_ = 0;  // the number of this cycle; the first is 0
    std::optional<MasterClock> clock_{};
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
