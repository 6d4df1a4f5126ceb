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
    // When all those take part that are not known to be lost, or in need of their configuration.
    std::uint16_t accepted = 0;
    std::uint16_t full = 0;  // when every slave takes part, optional ones too
    bool came = false;       // its frame came back; otherwise `got` says nothing
    // All slaves took part.
    [[nodiscard]] constexpr bool right() const { return came && (got == expected || got == full); }
    // All took part that can: its inputs are in the image. Those of the others stay as they were last.
    [[nodiscard]] constexpr bool usable() const { return came && (got == accepted || got == full); }
};

// What a datagram that reads a register with each cycle has brought with the last one.
struct RegisterReading {
    bool came = false;         // its frame came back
    std::uint16_t slaves = 0;  // how many took part: its working counter. When nobody did the value stays as it was
    std::uint64_t value = 0;
};

struct Group {
    // How the image shall be laid out; to be set before config_map().
    GroupConfiguration config;

    // What config_map() made of it. Empty until then.
    bool mapped = false;
    std::uint32_t mappings = 0;  // how often config_map() has laid it out; never 0 again
    std::span<std::byte> image;  // outputs, then inputs; the caller's memory
    std::uint32_t output_bytes = 0;
    std::uint32_t input_bytes = 0;
    std::uint32_t expected_wkc = 0;  // of all datagrams together
    std::uint16_t frames = 0;        // a cycle takes
    std::span<const DatagramStatus> datagrams;

    // Cycles are counted from 1 on, since config_map(): how many were sent, and which one the last
    // receive_processdata() has ended. Each is for the thread that calls the one or the other.
    std::uint32_t cycles_sent = 0;
    std::uint32_t cycle_received = 0;

    // By GroupConfiguration::al_status: AL status (ESC register 0x0130) of all slaves of the segment, each bit set that
    // any of them has set. `slaves`: how many there are.
    RegisterReading al_status;
    // By GroupConfiguration::dc_reference: the system time (ESC register 0x0910) of that slave when the frame passed
    // it, in ns. `slaves`: it and those that took the time over.
    RegisterReading dc_time;
};

}  // namespace margay
