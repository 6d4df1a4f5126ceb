// A group: slaves that share a process image and are exchanged together, at a rate of their own.
#pragma once

#include <margay/configuration.hpp>

#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

// What came of one datagram of process data in the last cycle.
struct DatagramStatus {
    std::uint16_t expected = 0;  // working counter when every slave takes part, except optional ones that are not there
    std::uint16_t got = 0;
    std::uint16_t accepted = 0;  // when all those take part that are not known to be lost, or in need of their configuration
    std::uint16_t full = 0;      // when every slave takes part, optional ones too
    bool came = false;           // its frame came back; otherwise `got` says nothing
    // All slaves took part.
    [[nodiscard]] constexpr bool right() const { return came && (got == expected || got == full); }
    // All took part that can: its inputs are in the image. Those of the others stay as they were last.
    [[nodiscard]] constexpr bool usable() const { return came && (got == accepted || got == full); }
};

struct Group {
    // How the image shall be laid out; to be set before config_map().
    GroupConfiguration config;

    // What config_map() made of it. Empty until then.
    bool mapped = false;
    std::span<std::byte> image;      // outputs, then inputs; the caller's memory
    std::uint32_t output_bytes = 0;
    std::uint32_t input_bytes = 0;
    std::uint32_t expected_wkc = 0;  // of all datagrams together
    std::uint16_t frames = 0;        // a cycle takes
    std::span<const DatagramStatus> datagrams;
};

}  // namespace margay
