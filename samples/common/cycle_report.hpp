// Figures about the cycles of a program, as text, as a picture and as JSON.
#pragma once

#include "common/frame_times.hpp"
#include "osal/duration_histogram.hpp"

#include <cstdint>
#include <string>

namespace margay::samples {

struct CycleFigures {
    DurationHistogram lateness;    // from the deadline until the program continued
    DurationHistogram period;      // from one continuation to the next
    DurationHistogram sent;        // from the deadline until the last frame was given to the NIC: the phase of sending
    DurationHistogram received;    // from the deadline until all frames were back
    DurationHistogram round_trip;  // from the call that sends until all frames were back
    WireFigures wire{};
    std::uint64_t cycles = 0;
    std::uint64_t overruns = 0;   // times that the program continued a whole period late or later
    std::uint64_t skipped = 0;    // deadlines left out after overruns
    std::uint64_t caught_up = 0;  // cycles made up for after overruns
    std::uint64_t no_frame = 0;   // cycles with missing frames
    std::uint64_t wrong_wkc = 0;  // cycles with a working counter different from the expected one
    std::uint64_t missed = 0;     // frames that did not leave at their time
};

// A table and bars of characters, for a terminal or a log.
[[nodiscard]] std::string cycle_text(const CycleFigures& figures);

// Two lines about the times on the wire.
[[nodiscard]] std::string wire_text(const WireFigures& wire);

// An SVG picture: all histograms with logarithmic counts and times, and the error counters. A page that contains it
// can set the colours by the properties --cycle-ink, --cycle-bar and --cycle-grid of the class cycle-figures.
[[nodiscard]] std::string cycle_svg(const CycleFigures& figures);

// All figures; of each histogram the quantiles and the buckets with a count, in nanoseconds.
[[nodiscard]] std::string cycle_json(const CycleFigures& figures);

}  // namespace margay::samples
