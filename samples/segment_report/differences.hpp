// Differences between alike slaves: slaves with the same vendor ID and product code.
#pragma once

#include "segment_report/report.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace margay::segment_report {

// The slaves of each product that the segment has more than once, as places in Report::slaves.
[[nodiscard]] std::vector<std::vector<std::uint16_t>> alike_slaves(const Report& report);

// One value and the slaves that have it.
struct Variant {
    std::string value{};
    std::vector<std::uint16_t> positions{};
};

struct Difference {
    enum class Kind : std::uint8_t {
        device,   // revision, firmware, ESC, EEPROM
        setting,  // an object of the dictionary
        live,     // an object that can be mapped to inputs: it changes by itself
        own,      // differs by its nature: serial number, alias, time stamps
    };
    Kind kind = Kind::setting;
    std::string what{};               // "object 0x6065:00", "revision"
    std::string name{};               // of the object
    std::vector<Variant> variants{};  // the value that most slaves have is the first
};

struct AlikeGroup {
    std::uint32_t vendor = 0;
    std::uint32_t product = 0;
    std::string name{};
    std::vector<std::uint16_t> positions{};
    std::size_t objects = 0;  // number of entries that were compared; 0: there are no dictionaries
    std::vector<Difference> differences{};
    bool partly_read = false;  // less could be read of one slave than of another one
    std::vector<std::string> remarks{};

    // Number of differences of a kind.
    [[nodiscard]] std::size_t count(Difference::Kind kind) const;
};

[[nodiscard]] std::vector<AlikeGroup> find_differences(const Report& report);

// "slave 3", "slaves 1-5, 8".
[[nodiscard]] std::string slaves_text(const std::vector<std::uint16_t>& positions);

}  // namespace margay::segment_report
