// Slaves in a line by their names: "coupler,drive#16@3s,a.bin".
#pragma once

#include <string>

namespace margay::hosted {

struct LineDescription {
    std::string description{};  // as the text of a segment description
    std::string error{};        // a sentence; empty: none
};

// See load_segment(). Relative paths start at the current folder.
[[nodiscard]] LineDescription describe_line(const std::string& line);

}  // namespace margay::hosted
