// Reads the figures of cycles that a program has written (--histogram FILE.json, see cycle_json()).
#pragma once

#include "common/cycle_report.hpp"

#include <string>
#include <string_view>

namespace margay::samples {

struct CycleLog {
    CycleFigures figures{};
    std::string fault{};  // why the text has no figures of cycles; empty: it has figures
};

// The inverse of cycle_json(): the quantiles are computed from the buckets, and are not read.
[[nodiscard]] CycleLog parse_cycle_log(std::string_view text);

}  // namespace margay::samples
