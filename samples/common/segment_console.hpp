// Commands to a running simulated segment, one line each: cables, power, losses, clocks, process data,
// registers.
#pragma once

#include "common/segment_file.hpp"

#include <string>
#include <string_view>

namespace margay::samples {

// Carries out one command and returns what there is to print, an explanation where it makes no sense. "help"
// tells all of them.
[[nodiscard]] std::string execute(SimulatedSegment& simulated, std::string_view command, Time now);

// "PREOP", "SAFEOP + ERROR 0x001b (sync manager watchdog)".
[[nodiscard]] std::string state_of(const sim::Esc& esc);

}  // namespace margay::samples
