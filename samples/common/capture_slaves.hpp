// What a recording tells of the slaves in it: their SII as far as it was read, their chips, and what the
// master had set up before the recording began.
#pragma once

#include "common/capture.hpp"

#include <map>
#include <optional>
#include <vector>

namespace margay::samples {

struct SeenSlave {
    std::uint16_t position = 0;  // in the ring, from 0
    std::vector<std::byte> sii;  // what was not read is 0xFF
    std::size_t sii_octets_read = 0;
    std::map<std::uint16_t, std::byte>
        registers;  // chip registers as first read: 0x0000–0x0009, 0x0140, 0x0502, 0x0E00–0x0E0F
    // Whether the registers of a clock (0x0910 and up) and those of the receive times (0x0900–0x090F) answered;
    // nothing: the master did not ask this slave. Another master's answer to the same question decides between what the
    // features promise and what is switched on.
    std::optional<bool> clock;
    std::optional<bool> receive_times;
    std::optional<bool> clock_has_64_bits;        // by the upper half of a time that was read
    std::optional<std::uint16_t> station_before;  // used before the recording assigned one
};

// Slaves by position. A slave that is only ever addressed by a station address that nobody assigned gets the
// positions behind the others, in the order of its address.
[[nodiscard]] std::vector<SeenSlave> slaves_of(const Capture& capture);

// Where slaves_of() finds none: why, in words.
[[nodiscard]] std::string why_no_slaves(const Capture& capture);

// A segment description of them, in a line; slave n's image is expected in "slaveN.bin", from 1.
[[nodiscard]] std::string describe_segment(const std::vector<SeenSlave>& slaves, const std::string& title);

}  // namespace margay::samples
