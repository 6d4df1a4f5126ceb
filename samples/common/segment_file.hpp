// Simulated segments from descriptions: files in TOML (see samples/segments/README.md), "demo", or SII images
// in a line.
#pragma once

#include "sim/segment.hpp"

#include <memory>
#include <string>
#include <vector>

namespace margay::samples {

// A segment with the names that its slaves have in the description. Everything is switched on.
struct SimulatedSegment {
    sim::Segment segment;
    std::vector<std::string> names;                        // by slave number; unique
    Duration round_trip = std::chrono::microseconds(100);  // of the master's side, as the file has it
};

class LoadedSegment {
  public:
    explicit LoadedSegment(std::unique_ptr<SimulatedSegment> segment) : segment_(std::move(segment)) {}
    explicit LoadedSegment(std::string error) : error_(std::move(error)) {}

    [[nodiscard]] explicit operator bool() const noexcept { return segment_ != nullptr; }
    // One sentence: which file, which line, what is wrong with it.
    [[nodiscard]] const std::string& error() const noexcept { return error_; }
    [[nodiscard]] SimulatedSegment* operator->() noexcept { return segment_.get(); }
    [[nodiscard]] SimulatedSegment& operator*() noexcept { return *segment_; }
    [[nodiscard]] std::unique_ptr<SimulatedSegment> take() noexcept { return std::move(segment_); }

  private:
    std::unique_ptr<SimulatedSegment> segment_;
    std::string error_;
};

// `what` is "demo" or the name of another ready-made segment, the path of a description (*.toml), or paths of SII
// images separated by commas, in a line. `now` is when the segment is switched on.
[[nodiscard]] LoadedSegment load_segment(const std::string& what, Time now = Time{});

// The same from the text of a description; `origin` is what errors call it, `folder` where its relative paths
// start.
[[nodiscard]] LoadedSegment parse_segment(const std::string& text, const std::string& origin, const std::string& folder,
                                          Time now = Time{});

}  // namespace margay::samples
