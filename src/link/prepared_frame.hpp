// Frames of the cycle: built once, sent again and again with new data and a new index. No coroutine waits for them;
// whoever sends them asks afterwards what came. Datagrams that are queued at the link ride in the space behind their
// own.
#pragma once

#include "link/frame_table.hpp"

#include <margay/group.hpp>

#include <array>
#include <span>

namespace margay {

// One datagram that is always in its frame.
struct PreparedDatagram {
    Bytes output;        // what of the application goes out, to the first octets of the data
    MutableBytes input;  // where what comes in goes, from octet input_at of the data on: only if the working counter is
                         // as expected
    std::uint16_t input_at = 0;
    std::uint16_t offset = 0;  // of the header in the frame
    std::uint16_t bytes = 0;   // of data
    DatagramStatus* status = nullptr;
};

// One that reads a register, in its frame behind those.
struct PreparedReading {
    std::uint16_t offset = 0;
    std::uint16_t bytes = 0;  // of data, 8 at most
    RegisterReading* into = nullptr;
};

// How a frame of the cycle is, or all of them are.
enum class CycleEnd : std::uint8_t {
    missing,  // not back
    odd,      // back, and some slave did not take part in one of its datagrams
    right,    // back, and every slave did
};

struct PreparedFrame {
    std::span<PreparedDatagram> datagrams;
    std::span<const PreparedReading> readings;
    FrameSlot* slot = nullptr;  // while it is in flight (never of overlapped cycles): `own`, or one of the link's when
                                // datagrams ride along
    CycleEnd end = CycleEnd::missing;
    bool plain = false;  // one datagram, in which every slave takes part, and no reading
    // Some slave does not take part in it. Inputs go out as they are in the image, so that what nobody writes comes
    // back as it was.
    bool degraded = false;
    bool regrouped = false;   // other slaves take part than when it was filled
    bool apart = false;       // its inputs never go out: they lie on top of outputs, or another thread sends it
    bool overlapped = false;  // of a cycle that may be sent by one thread and received by another, see link/overlap.cpp
    bool refused = false;     // such a one: the NIC has not taken it
    bool parked = false;      // such a one: its reply is in `bytes`
    std::uint16_t size = wire::kFramePrefixBytes;  // without what rides along
    std::uint16_t last = 0;                        // of these, where its last datagram begins
    std::uint16_t datagram_count = 0;              // readings included
    std::uint16_t wire_bytes = 0;                  // that these are with padding and all
    // Takes over the inputs of the slaves that take part, and of no other; n counts `datagrams`. Called where a frame
    // is degraded, and `apart` or regrouped while it was in flight.
    void (*take_inputs)(void* group, const PreparedFrame& frame, std::size_t n, Bytes inputs) = nullptr;
    void* group = nullptr;
    FrameSlot own;
    std::array<std::byte, wire::kMaxFrameBytes> bytes{};  // as it was sent last

    // To be called when the working counters of its datagrams that are accepted have changed.
    void settle() {
        degraded = false;
        regrouped = true;
        for (const PreparedDatagram& d : datagrams) degraded |= d.status->accepted != d.status->full;
        plain = datagrams.size() == 1 && readings.empty() && !degraded;
    }
};

}  // namespace margay
