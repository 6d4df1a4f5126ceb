// A group: slaves that share a process image and are exchanged together, in a cycle of their own.
#pragma once

#include <margay/configuration.hpp>

#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

// The result of one datagram of process data in the last received cycle.
struct DatagramStatus {
    std::uint16_t expected = 0;  // working counter if all slaves take part, except missing optional slaves
    std::uint16_t got = 0;       // working counter of the received datagram
    // Working counter if all slaves take part except slaves that are known to be lost or to need their configuration.
    std::uint16_t accepted = 0;
    std::uint16_t full = 0;  // working counter if all slaves take part, optional ones included
    bool came = false;       // its frame came back; otherwise `got` has no meaning
    // Its inputs were copied into the image: all slaves that are not known to be lost took part. Nothing is copied of a
    // slave that was away and was not compared yet: inputs_fresh() distinguishes the slaves.
    bool fresh = false;
    // All slaves that can take part have taken part: their inputs are in the image, except the inputs that the comment
    // of `fresh` names. The inputs of all other slaves are unchanged, also if another device answers at the place of
    // such a slave.
    [[nodiscard]] constexpr bool usable() const { return fresh && (got == accepted || got == full); }
    // The same, and no slave is missing.
    [[nodiscard]] constexpr bool right() const { return usable() && accepted == expected; }
};

// A datagram of process data as config_map() has planned it: see process_datagram().
struct PlannedDatagram {
    std::uint8_t command = 0;  // EtherCAT command: 10 LRD, 11 LWR, 12 LRW; 0: there is no such datagram
    LogicalAddress address;
    std::uint16_t bytes = 0;
    std::uint16_t frame = 0;  // number of its frame in the cycle, the first is 0
};

// The result of a datagram that reads a register in each cycle.
struct RegisterReading {
    bool came = false;         // its frame came back
    std::uint16_t slaves = 0;  // working counter: how many slaves took part. If it is 0, `value` is unchanged
    std::uint64_t value = 0;
};

// One group: its configuration, and its state after config_map(). A context returns a const Group: the application
// reads the facts and writes `config` alone. For the thread that owns the context.
struct Group {
    // The layout of the image; set it before config_map().
    mutable GroupConfiguration config;

    // The results of config_map(). Empty before it.
    bool mapped = false;
    std::uint32_t mappings = 0;  // how often config_map() has mapped the group; never 0 after the first time
    std::span<std::byte> image;  // outputs, then inputs; the caller's memory
    std::uint32_t output_bytes = 0;
    std::uint32_t input_bytes = 0;
    std::uint32_t expected_wkc = 0;  // sum of the datagrams
    std::uint16_t frames = 0;        // frames in a cycle
    std::span<const DatagramStatus> datagrams;

    // cycles_sent: the number of the last cycle that was sent; for the thread that sends. cycle_received: the number of
    // the cycle that the last receive_processdata() has ended; for the thread that receives. The first cycle since
    // config_map() is 1.
    std::uint32_t cycles_sent = 0;
    std::uint32_t cycle_received = 0;

    // For GroupConfiguration::al_status: the AL status (ESC register 0x0130) of all slaves of the segment, combined by
    // OR. `slaves`: the number of slaves in the ring.
    RegisterReading al_status;
    // For GroupConfiguration::dc_reference: the system time (ESC register 0x0910) of the reference slave when the frame
    // passed it, in ns. `slaves`: the reference slave and the slaves that copied the time. After a cycle that was lost
    // (`slaves` is 0), the next cycles only read the time (`slaves` is 1), because the reference slave may have been
    // lost with that cycle.
    RegisterReading dc_time;
};

}  // namespace margay
