// Figures about the cycles of a program, as text and as a picture.
#pragma once

#include "osal/duration_histogram.hpp"

#include <cstdint>
#include <string>

namespace margay::samples {

struct CycleFigures {
    DurationHistogram lateness;    // from the deadline until the program continued
    DurationHistogram round_trip;  // from the call that sends until all frames were back
    std::uint64_t cycles = 0;
    std::uint64_t overruns = 0;   // deadlines that were skipped because a cycle lasted too long
    std::uint64_t no_frame = 0;   // cycles with missing frames
    std::uint64_t wrong_wkc = 0;  // cycles with a working counter different from the expected one
};

// A table and bars of characters, for a terminal or a log.
[[nodiscard]] std::string cycle_text(const CycleFigures& figures);

// An SVG picture: both histograms with logarithmic counts and times, and the error counters. A page that contains it
// can set the colours by the properties --cycle-ink, --cycle-bar and --cycle-grid of the class cycle-figures.
[[nodiscard]] std::string cycle_svg(const CycleFigures& figures);

}  // namespace margay::samples
