// The entries of the process image by name.
#pragma once

#include "segment_report/report.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace margay::segment_report {

struct ImageEntry {
    std::uint32_t bit = 0;  // in the image of the domain
    std::uint16_t position = 0;
    std::uint8_t sync_manager = 0;
    bool input = false;
    std::uint16_t pdo = 0;
    std::uint16_t index = 0;  // 0: a gap, or what no PDO describes
    std::uint8_t subindex = 0;
    std::uint32_t bits = 0;
    std::string pdo_name{};
    std::string name{};
    std::uint16_t data_type = 0;
    std::string value{};  // of the last cycle; empty: not known
};

// In the order of the image. A part that no PDO describes is one entry without an object.
[[nodiscard]] std::vector<ImageEntry> image_entries(const Report& report, const DomainFacts& domain);

}  // namespace margay::segment_report
