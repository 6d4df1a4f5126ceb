#include "ethercat/session.hpp"

#include "wire/esc.hpp"
#include "wire/fmmu.hpp"

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

// A write of any value to a counter clears it.
Answer<> Session::reset_error_counters(std::uint16_t position) {
    constexpr std::array<std::byte, 8> kZeros{};
    for (const auto& counters : {reg::kRxErrorCounter, reg::kForwardedRxErrorCounter, reg::kProcessingUnitErrorCounter,
                                 reg::kPdiErrorCounter, reg::kLostLinkCounter}) {
        const auto done = write_registers(position, counters.address, std::span(kZeros).first(counters.length), false);
        if (!done) return done;
    }
    return {};
}

std::uint32_t dropped_frames(const EoeStatistics& counted) {
    return counted.refused + counted.not_sent + counted.overrun + counted.incomplete + counted.malformed +
           counted.too_long;
}

std::vector<FmmuFacts> mapped_fmmus(std::uint16_t position, std::span<const std::byte> fmmus,
                                    std::span<const std::byte> sync_managers) {
    std::vector<FmmuFacts> all;
    for (std::size_t at = 0; at + reg::kFmmuStride <= fmmus.size(); at += reg::kFmmuStride) {
        const auto fmmu = wire::load_fmmu(fmmus.subspan(at));
        if (!fmmu.active || fmmu.length_bytes == 0) continue;
        for (std::size_t n = 0; (n + 1) * reg::kSyncManagerStride <= sync_managers.size(); ++n) {
            const auto start = load_le<std::uint16_t>(sync_managers, n * reg::kSyncManagerStride);
            const auto length = load_le<std::uint16_t>(sync_managers, n * reg::kSyncManagerStride + 2);
            if (length == 0 || fmmu.physical_start < start || fmmu.physical_start >= start + length) continue;
            const std::uint32_t end = (fmmu.length_bytes - 1U) * 8U + fmmu.logical_end_bit + 1U;
            all.push_back({.position = position,
                           .sync_manager = static_cast<std::uint8_t>(n),
                           .input = fmmu.read,
                           .logical = fmmu.logical_start.value,
                           .bytes = fmmu.length_bytes,
                           .start_bit = fmmu.logical_start_bit,
                           .bits = end > fmmu.logical_start_bit ? end - fmmu.logical_start_bit : 0,
                           .offset_bits = (fmmu.physical_start - start) * 8U + fmmu.physical_start_bit});
        }
    }
    return all;
}

}  // namespace margay::ethercat
