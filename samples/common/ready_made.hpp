// The ready-made segment descriptions of samples/segments, by name.
#pragma once

#include <string>
#include <vector>

namespace margay::samples {

struct ReadyMadeSegment {
    std::string name{};
    std::string title{};
};

// "demo", which is built in, and the files, in the order of their names.
[[nodiscard]] std::vector<ReadyMadeSegment> ready_made_segments();
[[nodiscard]] std::vector<std::string> ready_made_names();

// Whether `text` can be such a name: no path and no file with an extension.
[[nodiscard]] bool is_plain_name(const std::string& text);
// The file of a ready-made segment; empty where there is none of this name. A file in the present folder does not
// count.
[[nodiscard]] std::string ready_made_file(const std::string& name);

}  // namespace margay::samples
