// What became of the cycles of a program: figures, and how to show them as text and as a picture.
#pragma once

#include "osal/duration_histogram.hpp"

#include <cstdint>
#include <string>

namespace margay::samples {

struct CycleFigures {
    DurationHistogram lateness;    // from the deadline until the program went on
    DurationHistogram round_trip;  // from the call that sends until all frames were back
    std::uint64_t cycles = 0;
    std::uint64_t overruns = 0;   // deadlines passed over because a cycle took too long
    std::uint64_t no_frame = 0;   // cycles without all their frames
    std::uint64_t wrong_wkc = 0;  // cycles with a working counter that was not the expected one
};

// A table and bars of characters, for a terminal or a log.
[[nodiscard]] std::string cycle_text(const CycleFigures& figures);

// An SVG picture: both histograms, counts and time to logarithmic scale, and the counts of what went wrong.
[[nodiscard]] std::string cycle_svg(const CycleFigures& figures);

}  // namespace margay::samples
