#include "ethercat/session.hpp"

#include "wire/esc.hpp"

#include <array>
#include <cstddef>
#include <span>

namespace margay::ethercat {

namespace reg = wire::reg;

Answer<ErrorCounters> Session::error_counters(std::uint16_t position) {
    constexpr std::uint16_t kFirst = reg::kRxErrorCounter.address;
    constexpr std::size_t kBytes = reg::kLostLinkCounter.end() - kFirst;
    const auto read = read_registers(position, kFirst, kBytes);
    if (!read) return read.problem();
    const auto at = [&](std::size_t address) { return std::to_integer<std::uint8_t>((*read)[address - kFirst]); };
    ErrorCounters counters;
    for (std::size_t port = 0; port < 4; ++port) {
        counters.invalid_frames[port] = at(kFirst + 2 * port);
        counters.rx_errors[port] = at(kFirst + 2 * port + 1);
        counters.forwarded[port] = at(reg::kForwardedRxErrorCounter.address + port);
        counters.lost_links[port] = at(reg::kLostLinkCounter.address + port);
    }
    counters.processing_unit = at(reg::kProcessingUnitErrorCounter.address);
    counters.pdi = at(reg::kPdiErrorCounter.address);
    return counters;
}

// A write to a counter clears it, whatever the value.
Answer<> Session::reset_error_counters(std::uint16_t position) {
    constexpr std::array<std::byte, 8> kZeros{};
    for (const auto& counters : {reg::kRxErrorCounter, reg::kForwardedRxErrorCounter, reg::kProcessingUnitErrorCounter,
                                 reg::kPdiErrorCounter, reg::kLostLinkCounter}) {
        const auto done = write_registers(position, counters.address, std::span(kZeros).first(counters.length), false);
        if (!done) return done;
    }
    return {};
}

}  // namespace margay::ethercat
