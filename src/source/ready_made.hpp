// Finds the ready-made segment descriptions of samples/segments by name.
#pragma once

#include <string>
#include <vector>

namespace margay::hosted {

struct ReadyMadeSegment {
    std::string name{};
    std::string title{};
};

// "demo", which is built into the program, and the files, sorted by name.
[[nodiscard]] std::vector<ReadyMadeSegment> ready_made_segments();
[[nodiscard]] std::vector<std::string> ready_made_names();

// Whether `text` can be the name of a ready-made segment: it has no path and no file extension.
[[nodiscard]] bool is_plain_name(const std::string& text);
// The file of a ready-made segment; empty when there is none with this name. Files in the current folder are not
// searched.
[[nodiscard]] std::string ready_made_file(const std::string& name);

}  // namespace margay::hosted
