// How faithfully a simulated segment answers what real hardware was asked.
#pragma once

#include "common/capture.hpp"
#include "common/segment_file.hpp"

#include <map>
#include <string>

namespace margay::samples {

struct FidelityReport {
    struct Kind {  // of a difference
        std::size_t count = 0;
        std::size_t first_frame = 0;
        std::string example;
    };

    std::size_t frames = 0;      // requests put to the segment
    std::size_t unanswered = 0;  // of them without an answer in the recording: nothing to compare
    std::size_t datagrams = 0;   // compared
    std::size_t equal_wkc = 0;
    std::size_t data_octets = 0;  // determined: what the request and the device decide, no clocks and no counters
    std::size_t equal_octets = 0;
    std::map<std::string, Kind> kinds;
};

// Puts the master's half of a recording to the segment at the times of the recording and compares the
// answers.
[[nodiscard]] FidelityReport measure_fidelity(const Capture& capture, SimulatedSegment& simulated);

// As text: shares, and every kind of difference.
[[nodiscard]] std::string to_text(const FidelityReport& report);

}  // namespace margay::samples
