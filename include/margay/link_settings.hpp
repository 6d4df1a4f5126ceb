// Timeouts of the link, and the number of its repetitions.
#pragma once

#include <margay/time.hpp>

#include <cstdint>

namespace margay {

// The settings of one context: Context::link_settings(). They may be changed before init(), and later at any time by
// the thread that polls; a new value applies from the next frame on. Process data has a timeout of its own, the
// argument of receive_processdata(). init() refuses values that are out of range (Errc::invalid_argument; detail: the
// Argument). After init(), a timeout of zero or less counts as the default, and 0 sendings count as 1.
struct LinkSettings {
    // Time after which a sent frame is lost: longer than the slowest round trip. Must be above zero.
    Duration frame_timeout = std::chrono::milliseconds(10);
    // How long datagrams wait while the NIC accepts none of them because it is busy or has no link; then all waiting
    // datagrams end with Errc::nic_busy. The time starts again whenever the NIC accepts a datagram. Must be above zero.
    Duration queue_timeout = std::chrono::seconds(1);
    // How often a repeatable datagram is sent at most while its frames are lost, the first sending included. At least
    // 1.
    std::uint8_t sendings = 6;
};

}  // namespace margay
