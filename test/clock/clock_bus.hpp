// A supervised segment of slaves with clocks that start at any time and drift, in virtual time.
#pragma once

#include "process_data/plant.hpp"
#include "wire/sii_category.hpp"

#include <cstdlib>

namespace margay {

inline constexpr ClockSettings kFewFrames{.burst_frames = 300};

struct ClockOf {
    std::int32_t drift_ppb = 0;
    std::uint64_t start_ns = 0;
    sim::DcUnit unit = sim::DcUnit::bits64;
    std::uint16_t features = 0x01CC;  // of a clock of 64 bits
};

// The SII with a DC category (60) of these operation modes behind its other categories (ETG.2010).
inline std::vector<std::byte> with_dc_modes(std::vector<std::byte> sii, std::span<const wire::sii::DcOpMode> modes) {
    std::size_t at = 0x80;
    while (load_le<std::uint16_t>(sii, at) != 0xFFFF) at += 4 + 2 * std::size_t{load_le<std::uint16_t>(sii, at + 2)};
    store_le<std::uint16_t>(sii, at, 60);
    store_le<std::uint16_t>(sii, at + 2, static_cast<std::uint16_t>(modes.size() * 12));
    at += 4;
    for (const auto& mode : modes) {
        store_le<std::uint32_t>(sii, at, mode.sync0_cycle_time_ns);
        store_le<std::int32_t>(sii, at + 4, mode.sync0_shift_time_ns);
        store_le<std::int32_t>(sii, at + 8, mode.sync1_shift_time_ns);
        store_le<std::int16_t>(sii, at + 12, mode.sync1_cycle_factor);
        store_le<std::uint16_t>(sii, at + 14, mode.assign_activate);
        store_le<std::int16_t>(sii, at + 16, mode.sync0_cycle_factor);
        at += 24;
    }
    store_le<std::uint16_t>(sii, at, 0xFFFF);
    return sii;
}

struct ClockBus : Plant {
    static constexpr std::array kOneMode{wire::sii::DcOpMode{.assign_activate = 0x0300}};
    static constexpr Duration kCable = std::chrono::nanoseconds(500);
    // The delay from one processing unit to the next processing unit in a line: through the unit, two ports and the
    // cable.
    static constexpr std::int64_t kHop_ns = 60 + 2 * 140 + 500;

    // The program of a device with a DC category accepts SYNC signals.
    sim::Device clocked(const ClockOf& clock, std::span<const wire::sii::DcOpMode> modes = kOneMode,
                        const IoDevice& of = {}) {
        auto made = sim::device_from_sii(with_dc_modes(io_image(8, 8, of), modes));
        made.chip = sim::lan9252();
        made.chip.fmmus = 4;
        made.chip.ram_kib = 16;
        made.chip.dc = clock.unit;
        made.chip.features = clock.features;
        made.chip.clock = {clock.drift_ppb, clock.start_ns};
        return made;
    }
    // Appends a slave to the line.
    std::uint32_t add(const ClockOf& clock) {
        const auto n = segment.add(clocked(clock).assemble());
        EXPECT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}, kCable));
        return n;
    }
    void add_line(unsigned slaves) {
        for (unsigned n = 0; n < slaves; ++n) {
            const auto drift = static_cast<std::int32_t>((n * 7919 % 201) * 1000) - 100'000;  // ± 100 ppm
            add({.drift_ppb = drift, .start_ns = n * 0x3000'0001ULL});
        }
    }
    void start() {
        Plant::start(limits);
        ctx->group(0).config.acyclic_bytes = 1498;
    }
    const SlaveClock& clock(std::uint16_t slave) { return slave_clock(*ctx, slave); }
    // Returns how far the clock of a slave is ahead of another clock now, independent of the values that the master
    // reads.
    std::int64_t ahead_ns(std::uint16_t slave, std::uint16_t of = 1) {
        const Time now = osal.now();
        return static_cast<std::int64_t>(segment.slave(slave - 1U).clock().copy(now) -
                                         segment.slave(of - 1U).clock().copy(now));
    }
    std::int64_t greatest_error_ns(std::uint16_t slaves) {
        std::int64_t most = INT64_MIN;
        std::int64_t least = INT64_MAX;
        for (std::uint16_t n = 1; n <= slaves; ++n) {
            if (!is_powered(n) || clock(n).kind < ClockKind::bits32) continue;
            const std::int64_t ahead = static_cast<std::int32_t>(ahead_ns(n));  // some clocks have 32 bits
            most = std::max(most, ahead);
            least = std::min(least, ahead);
        }
        if (most < least) ADD_FAILURE() << "no slave has a clock";
        return most < least ? INT64_MAX : most - least;
    }
    bool is_powered(std::uint16_t slave) { return segment.powered(slave - 1U); }
    template <class T>
    T register_of(std::uint16_t slave, wire::Register r) {
        std::array<std::byte, sizeof(T)> raw{};
        segment.advance(osal.now());
        segment.slave(slave - 1U).read(r.address, raw);
        return load_le<T>(raw, 0);
    }
    static std::string words(const Error& error) {
        std::array<char, 400> buffer{};
        return std::string(describe(error, buffer));
    }
};

}  // namespace margay
