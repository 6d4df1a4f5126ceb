// The times of frames: the options --send-at and --stamps, and figures of cycles by the time stamps of the NIC.
#pragma once

#include "common/arguments.hpp"
#include "common/source.hpp"
#include "osal/duration_histogram.hpp"

#include <margay/context.hpp>
#include <margay/frame_timing.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace margay::samples {

struct FrameTimeOptions {
    unsigned send_at_us = 0;                      // after the beginning of the cycle; 0: at once
    std::optional<WantedTimes::Stamps> stamps{};  // nothing: off
};

void add_frame_time_options(Arguments& arguments, FrameTimeOptions& options);

// The value for SourceOptions::times.
[[nodiscard]] WantedTimes wanted_times(const FrameTimeOptions& options);

// The reason, as a sentence, why a cycle of this period cannot have these times; empty: it can.
[[nodiscard]] std::string refusal(const FrameTimeOptions& options, unsigned period_us);

// A sentence about frames that did not leave at their time.
[[nodiscard]] std::string missed_text(std::uint64_t frames);

// Figures from the time stamps of the NIC for the first frame of each cycle.
struct WireFigures {
    DurationHistogram period;  // from one cycle to the next
    DurationHistogram round_trip;
    std::uint64_t unstamped = 0;  // cycles that came back without both stamps
    [[nodiscard]] bool any() const { return round_trip.count() + unstamped != 0; }
};

class WireWatch {
  public:
    // Must be called after receive_processdata(). Counts nothing if `nic` lacks one or both time stamps.
    void count(Context& ctx, const FrameTiming& nic, WireFigures& into);
    // Must be called if the next cycle does not follow directly after the last cycle.
    void forget() { last_sent_ns_.reset(); }

  private:
    std::optional<std::uint64_t> last_sent_ns_{};
};

}  // namespace margay::samples
