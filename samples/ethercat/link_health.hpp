// The state of a link by the error counters at its port. All pictures use this function.
#pragma once

#include "ethercat/session.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace margay::ethercat {

enum class LinkHealth : std::uint8_t { good, doubtful, bad };

// Invalid frames and physical errors occur on this link. Forwarded errors have occurred on an earlier link.
[[nodiscard]] inline LinkHealth link_health(const ErrorCounters& counters, std::size_t port) {
    constexpr unsigned kBad = 10;
    const unsigned errors = std::max<unsigned>(counters.invalid_frames[port], counters.rx_errors[port]);
    if (errors >= kBad) return LinkHealth::bad;
    return errors != 0 || counters.lost_links[port] != 0 ? LinkHealth::doubtful : LinkHealth::good;
}

}  // namespace margay::ethercat
