// Loads simulated segments from descriptions: TOML files (see samples/segments/README.md), "demo", or slaves in a line.
#pragma once

#include "sim/segment.hpp"

#include <memory>
#include <string>
#include <vector>

namespace margay::hosted {

// A segment with the names of its slaves in the description. All slaves are switched on unless the description says
// otherwise.
struct SimulatedSegment {
    sim::Segment segment;
    std::vector<std::string> names;                        // by slave number; unique
    Duration round_trip = std::chrono::microseconds(100);  // the delay on the side of the master, from the file

    // Slaves that are switched on later.
    struct Late {
        std::uint32_t slave = 0;
        Time at{};
    };
    std::vector<Late> late;
    // Switches on the slaves whose time has come. To be called before frames are processed.
    void switch_on_late(Time now) noexcept;
};

class LoadedSegment {
  public:
    explicit LoadedSegment(std::unique_ptr<SimulatedSegment> segment) : segment_(std::move(segment)) {}
    explicit LoadedSegment(std::string error) : error_(std::move(error)) {}

    [[nodiscard]] explicit operator bool() const noexcept { return segment_ != nullptr; }
    // One sentence: the file, the line, and the error.
    [[nodiscard]] const std::string& error() const noexcept { return error_; }
    [[nodiscard]] SimulatedSegment* operator->() noexcept { return segment_.get(); }
    [[nodiscard]] SimulatedSegment& operator*() noexcept { return *segment_; }
    [[nodiscard]] std::unique_ptr<SimulatedSegment> take() noexcept { return std::move(segment_); }

  private:
    std::unique_ptr<SimulatedSegment> segment_;
    std::string error_;
};

// Loads a segment. `what` is the name of a ready-made segment such as "demo", the path of a description (*.toml), or
// slaves in a line, separated by commas. Such a slave is a device of the library (sim::device_names()), the path of an
// SII image, or an ESI file (FILE.xml, FILE.xml#TYPE). A device or image may have an alias and may be switched on
// later: drive#16, drive@3s, drive#16@500ms. `now` is the time when the segment is switched on.
[[nodiscard]] LoadedSegment load_segment(const std::string& what, Time now = Time{});

// Loads a segment from the text of a description. Error texts call the description `origin`. Relative paths in it
// start at `folder`.
[[nodiscard]] LoadedSegment parse_segment(const std::string& text, const std::string& origin, const std::string& folder,
                                          Time now = Time{});

}  // namespace margay::hosted
