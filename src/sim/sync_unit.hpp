// SYNC0, SYNC1 and the latch inputs of an ESC, registers 0x0980–0x09CF (ETG.1000.4 "Distributed clock"; ESC data
// sheets, "SyncSignal generation" and "LatchSignals").
#pragma once

#include "sim/dc_clock.hpp"
#include "sim/register_file.hpp"

#include <margay/time.hpp>

namespace margay::sim {

class SyncUnit {
  public:
    // Bits of the AL event request and of the ECAT event request.
    struct Events {
        std::uint32_t al = 0;
        bool ecat_latch = false;
    };

    struct Features {
        bool enhanced = false;  // 0x0981 has bits 3 to 7
        bool wide = true;       // the clock has 64 bits
    };

    void power_up(RegisterFile& registers, const DcClock& clock, Features features);

    // Call it after the registers [address, address + length) were written. Returns the signals of a debug pulse, as
    // AL event bits.
    [[nodiscard]] std::uint32_t written(std::uint32_t address, std::size_t length, Time at);
    // Call it after a status or latch register was read: executes the acknowledge. A latch input obeys only the side
    // that controls it (0x0980 bits 4 and 5). Returns the event bits to clear.
    [[nodiscard]] Events was_read(std::uint32_t address, std::size_t length, bool by_pdi);
    // Call it after the rate or the offset of the clock has changed.
    void clock_changed(Time now);

    [[nodiscard]] Time next() const { return next_[0] < next_[1] ? next_[0] : next_[1]; }
    // Generates the pulses that are due at `now`. Returns AL event bits.
    std::uint32_t settle(Time now);
    // An edge at latch input 0 or 1.
    Events latch(unsigned input, bool rising, Time at);
    // Number of SYNC0 or SYNC1 pulses since power-up.
    [[nodiscard]] std::uint64_t pulses(unsigned signal) const { return pulses_[signal]; }
    void refresh();

  private:
    void activate(Time at);
    void extend_start_time(std::uint32_t address, std::size_t length, Time at);
    [[nodiscard]] bool plausible(std::uint64_t start, Time at) const;
    [[nodiscard]] std::uint32_t debug_pulse();
    void show_pulse(unsigned signal);
    [[nodiscard]] bool latch_is_pdis(unsigned input) const;
    void skip_missed(Time at);

    RegisterFile* registers_ = nullptr;
    const DcClock* clock_ = nullptr;
    std::array<Time, 2> next_{kNever, kNever};
    std::array<std::uint64_t, 2> due_{};  // in system time
    std::array<bool, 2> on_{};
    std::array<std::uint64_t, 2> pulses_{};
    std::uint32_t cycle0_ = 0;
    std::uint32_t cycle1_ = 0;
    std::uint32_t countdown1_ = 0;  // SYNC0 pulses until the next SYNC0 that starts a SYNC1
    bool active_ = false;
    Features features_;
};

}  // namespace margay::sim
