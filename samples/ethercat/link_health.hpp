// What the error counters at a port say about the link there. One judgement for all pictures.
#pragma once

#include "ethercat/session.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace margay::ethercat {

enum class LinkHealth : std::uint8_t { good, doubtful, bad };

// Invalid frames and physical errors belong to the link; forwarded errors have their cause before it.
[[nodiscard]] inline LinkHealth link_health(const ErrorCounters& counters, std::size_t port) {
    constexpr unsigned kBad = 10;
    const unsigned errors = std::max<unsigned>(counters.invalid_frames[port], counters.rx_errors[port]);
    if (errors >= kBad) return LinkHealth::bad;
    return errors != 0 || counters.lost_links[port] != 0 ? LinkHealth::doubtful : LinkHealth::good;
}

}  // namespace margay::ethercat
