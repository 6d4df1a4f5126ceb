// How long the link waits, and how often it tries.
#pragma once

#include <margay/time.hpp>

#include <cstdint>

namespace margay {

// Of one context: Context::link_settings(). May be changed before init() and at any time afterwards by the thread that
// polls; a new value holds from the next frame on. Frames of process data have their own time, the `timeout` of
// receive_processdata().
struct LinkSettings {
    // From sending a frame to giving it up as lost: longer than the slowest round trip. Above zero.
    Duration frame_timeout = std::chrono::milliseconds(10);
    // How long datagrams wait while the NIC takes none of them, because it stays busy or has no link: then all that
    // wait end with Errc::nic_busy. A NIC that takes any datagram in between begins a new wait. Above zero.
    Duration queue_timeout = std::chrono::seconds(1);
    // How often a datagram that may be repeated is sent when its frame is lost, the first time included.
    std::uint8_t sendings = 6;
};

}  // namespace margay
