// A ring with two NICs whose slaves have clocks that drift, in virtual time.
#pragma once

#include "clock/clock_bus.hpp"
#include "redundancy/ring_bus.hpp"

namespace margay {

struct ClockRingBus : RingBus {
    SlaveSetup every_ms{.dc = {.source = SyncSettings::Source::application, .sync0_cycle = 1ms}};
    std::vector<std::uint32_t> at;  // of the segment, by slave number

    static sim::Device clocked(std::int32_t drift, std::uint64_t start, sim::DcUnit unit = sim::DcUnit::bits64) {
        const std::array modes{wire::sii::DcOpMode{.assign_activate = 0x0300}};
        auto made = sim::device_from_sii(with_dc_modes(io_image(16, 16), modes));
        made.chip = sim::junction();
        made.chip.ram_kib = 16;
        made.chip.dc = unit;
        made.chip.clock = {drift, start};
        return made;
    }
    static sim::Device nth(unsigned n) {
        return clocked(static_cast<std::int32_t>((n * 7919 % 201) * 1000) - 100'000, n * 0x3000'0001ULL);
    }
    // A ring of `slaves` slaves, with a branch of two slaves behind the third slave if it exists.
    void build(unsigned slaves, bool branch = true) {
        for (unsigned n = 0; n < slaves; ++n) {
            const std::uint32_t here = add_to_ring(nth(n));
            if (n == 2 && branch) {
                const std::uint32_t one = add_behind(here, 3, nth(50));
                (void)add_behind(one, 1, nth(51));
            }
        }
        close_ring();
    }
    ClockSettings clock_settings{.burst_frames = 2000};
    Result<std::uint16_t> clocks() { return configdc(*ctx, clock_settings); }
    void bring_up() {
        start();
        if (at.empty()) at = segment.order();
        const auto reference = clocks();
        ASSERT_TRUE(reference.ok()) << words(reference.error());
        for (std::uint16_t n = 1; n <= segment.size(); ++n) ctx->slave(n).config.setup = &every_ms;
        run();
        (void)cycles(1000);
        (void)events();
        ASSERT_EQ(status().ring, RingState::whole);
    }
    // Returns how far the clock of a slave is ahead of another clock.
    std::int64_t ahead_ns(std::uint16_t slave, std::uint16_t of = 1) {
        const Time now = osal.now();
        return static_cast<std::int64_t>(segment.slave(at[slave - 1U]).clock().copy(now) -
                                         segment.slave(at[of - 1U]).clock().copy(now));
    }
    // The greatest difference between any two clocks that have power.
    std::int64_t apart_ns() {
        std::int64_t least = INT64_MAX;
        std::int64_t most = INT64_MIN;
        const std::uint64_t zero = segment.slave(at[0]).clock().copy(osal.now());
        for (std::uint16_t n = 1; n <= at.size(); ++n) {
            if (!segment.powered(at[n - 1U]) || !slave_clock(*ctx, n).synchronised) continue;
            const auto ahead = static_cast<std::int64_t>(segment.slave(at[n - 1U]).clock().copy(osal.now()) - zero);
            least = std::min(least, ahead);
            most = std::max(most, ahead);
        }
        return most < least ? 0 : most - least;
    }
    std::int64_t cycles(unsigned count) {
        std::int64_t most = 0;
        for (unsigned n = 0; n < count; ++n) {
            (void)cycle();
            most = std::max(most, apart_ns());
        }
        return most;
    }
    // The limit of ClockSettings, the rounding of the register, and the drift of a clock until it is read.
    static constexpr std::int64_t kMost_ns = 400;
    // Returns the number of cycles in which a clock was reported as in sync with the reference clock, but was not in
    // sync.
    unsigned wrong_cycles(unsigned count) {
        unsigned wrong = 0;
        for (unsigned n = 0; n < count; ++n) {
            (void)cycle();
            const std::uint16_t reference = reference_clock(*ctx);
            std::uint16_t s = 1;
            while (s <= at.size() && (!slave_clock(*ctx, s).in_sync || std::abs(ahead_ns(s, reference)) <= kMost_ns))
                ++s;
            if (s <= at.size() && ++wrong == 1)
                ADD_FAILURE() << "slave " << s << " is in sync and " << ahead_ns(s, reference) << " ns ahead of slave "
                              << reference << ", cycle " << n << "\n"
                              << joined(events());
        }
        return wrong;
    }
    std::uint64_t pulses(std::uint16_t slave) {
        segment.advance(osal.now());
        return segment.slave(at[slave - 1U]).sync().pulses(0);
    }
};

}  // namespace margay
