// The two watchdogs of an ESC, registers 0x0400–0x0443: process data (triggered by SyncManagers) and PDI (triggered by
// the processor).
#pragma once

#include "sim/register_file.hpp"

#include <margay/time.hpp>

namespace margay::sim {

class Watchdogs {
  public:
    struct Expired {
        bool process_data = false;
        bool pdi = false;
    };

    void power_up(RegisterFile& registers, bool has_pdi, Time now);
    // The processor has stopped, so its watchdog starts to count. Before that, a processor that is not reported by
    // feed_pdi() is assumed to trigger the watchdog in time.
    void processor_halted(Time now);
    // The processor has accessed the ESC. Returns true when its watchdog had expired.
    bool feed_pdi(Time now) {
        if (!has_pdi_) return false;
        const bool expired = pdi_.expired;
        pdi_.feed(now);
        return expired;
    }
    // Divider or times were written: both watchdogs start again.
    void reconfigure(Time now);
    // Whether any channel triggers the process data watchdog; if none does, the watchdog is off.
    void set_fed(bool fed, Time now);
    void feed_process_data(Time now);

    // Returns the watchdogs that have expired at `now`, and updates counters and status registers.
    Expired settle(Time now);
    [[nodiscard]] Time next() const { return process_data_.next() < pdi_.next() ? process_data_.next() : pdi_.next(); }
    [[nodiscard]] bool pdi_alive() const { return !pdi_.expired; }

  private:
    struct Timer {
        Duration time{};  // zero: off
        Time fed{};
        bool running = false;
        bool expired = false;
        [[nodiscard]] Time next() const { return running && time > Duration::zero() ? fed + time : kNever; }
        void feed(Time now) { fed = now, running = true, expired = false; }
    };
    void count(std::uint16_t address);
    void show();

    RegisterFile* registers_ = nullptr;
    Timer process_data_;
    Timer pdi_;
    bool fed_ = false;
    bool has_pdi_ = false;
};

}  // namespace margay::sim
