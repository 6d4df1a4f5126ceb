// The addresses of EtherCAT. Each kind has a type of its own, so that the compiler finds a wrong kind.
#pragma once

#include <compare>
#include <cstdint>

namespace margay {

// Configured station address (ESC register 0x0010), used by FPRD, FPWR, FPRW and FRMW.
struct StationAddress {
    std::uint16_t value = 0;
    friend constexpr auto operator<=>(StationAddress, StationAddress) = default;
};

// Position of a slave in the order in which a frame passes the processing units. The first slave has position 0, as in
// the standard; Slave::ring_position counts from 1. On the wire (APRD, APWR, …) the address is the negative of the
// position: each slave adds one, and the slave that reads zero is addressed.
struct RingPosition {
    std::uint16_t value = 0;
    [[nodiscard]] constexpr std::uint16_t on_wire() const { return static_cast<std::uint16_t>(-value); }
    friend constexpr auto operator<=>(RingPosition, RingPosition) = default;
};

// Byte address in the 4 GiB logical space that FMMUs map, used by LRD, LWR and LRW.
struct LogicalAddress {
    std::uint32_t value = 0;
    friend constexpr auto operator<=>(LogicalAddress, LogicalAddress) = default;
};

}  // namespace margay
