// Bits of the ECAT event request (0x0210), which the ESC reports to the master in the IRQ field of datagrams.
#pragma once

#include <cstdint>

namespace margay::sim {

namespace ecat_event {
inline constexpr std::uint16_t kLatch = 0x0001;
inline constexpr std::uint16_t kDlStatus = 0x0004;
inline constexpr std::uint16_t kAlStatus = 0x0008;
[[nodiscard]] constexpr std::uint16_t sync_manager(unsigned n) {
    return n < 8 ? static_cast<std::uint16_t>(0x10u << n) : std::uint16_t{0};
}
}  // namespace ecat_event

}  // namespace margay::sim
