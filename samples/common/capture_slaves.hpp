// Collects what a recording shows of its slaves: the SII words that were read, the chip registers, and the settings
// that a master made before the recording began.
#pragma once

#include "common/capture.hpp"

#include <map>
#include <optional>
#include <vector>

namespace margay::samples {

struct SeenSlave {
    std::uint16_t position = 0;  // in the ring, from 0
    std::vector<std::byte> sii;  // words that were not read are 0xFF
    std::size_t sii_octets_read = 0;
    std::map<std::uint16_t, std::byte>
        registers;  // chip registers as first read: 0x0000–0x0009, 0x0140, 0x0502, 0x0E00–0x0E0F
    // True when the registers of a clock (0x0910 and up) or the receive times (0x0900–0x090F) answered, false when
    // they did not; nothing when the master did not read them from this slave. A second recording, of another master,
    // shows whether a clock that the features register announces is switched on.
    std::optional<bool> clock;
    std::optional<bool> receive_times;
    std::optional<bool> clock_has_64_bits;  // true when a time with a non-zero upper half was read
    // A station address that the master used before the recording assigned one.
    std::optional<std::uint16_t> station_before;
};

// The slaves in ring order. A slave with a station address that the recording never assigns has no known position.
// Such slaves are placed behind all others, in the order of their station addresses.
[[nodiscard]] std::vector<SeenSlave> slaves_of(const Capture& capture);

// The reason why slaves_of() finds no slaves.
[[nodiscard]] std::string no_slaves_reason(const Capture& capture);

// Writes a segment description with the slaves in a line. The image of slave n is expected in "slaveN.bin"; n starts
// at 1.
[[nodiscard]] std::string describe_segment(const std::vector<SeenSlave>& slaves, const std::string& title);

}  // namespace margay::samples
