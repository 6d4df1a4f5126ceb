// Executes commands on a running simulated segment, one line each: cables, power, lost frames, clocks, process data,
// registers.
#pragma once

#include "common/segment_file.hpp"

#include <string>
#include <string_view>

namespace margay::samples {

// Executes one command and returns the text to print, or an explanation of what is wrong with the command. "help"
// lists all commands.
[[nodiscard]] std::string execute(SimulatedSegment& simulated, std::string_view command, Time now);

// "PREOP", "SAFEOP + ERROR 0x001b (sync manager watchdog)".
[[nodiscard]] std::string state_of(const sim::Esc& esc);

}  // namespace margay::samples
