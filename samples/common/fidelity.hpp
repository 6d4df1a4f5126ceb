// Compares the answers of a simulated segment with the recorded answers of real hardware.
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

    std::size_t frames = 0;      // requests sent to the simulated segment
    std::size_t unanswered = 0;  // requests without an answer in the recording; they are not compared
    std::size_t datagrams = 0;   // compared datagrams
    std::size_t equal_wkc = 0;
    // Compared octets: only octets that the request and the device determine, not clocks and counters.
    std::size_t data_octets = 0;
    std::size_t equal_octets = 0;
    std::map<std::string, Kind> kinds;
};

// Sends the requests of a recording to the simulated segment at the recorded times and compares the answers.
[[nodiscard]] FidelityReport measure_fidelity(const Capture& capture, SimulatedSegment& simulated);

// A report as text: shares, and every kind of difference.
[[nodiscard]] std::string to_text(const FidelityReport& report);

}  // namespace margay::samples
