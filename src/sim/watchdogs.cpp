#include "sim/watchdogs.hpp"

namespace margay::sim {

namespace reg = wire::reg;

void Watchdogs::power_up(RegisterFile& registers, bool has_pdi, Time now) {
    registers_ = &registers;
    process_data_ = pdi_ = {};
    fed_ = false;
    has_pdi_ = has_pdi;
    reconfigure(now);
    pdi_.expired = !has_pdi;
    show();
}

// 0x0400: the unit is (value + 2) · 40 ns; the times are multiples of this unit (ESC data sheets, "Watchdog").
void Watchdogs::reconfigure(Time now) {
    const Duration unit(40 * (registers_->get<std::uint16_t>(reg::kWatchdogDivider.address) + 2));
    process_data_.time = unit * registers_->get<std::uint16_t>(reg::kProcessDataWatchdogTime.address);
    pdi_.time = unit * registers_->get<std::uint16_t>(reg::kPdiWatchdogTime.address);
    process_data_.fed = pdi_.fed = now;
    show();
}

void Watchdogs::set_fed(bool fed, Time) {
    if (fed == fed_) return;
    fed_ = fed;
    process_data_.running = process_data_.expired = false;  // starts with the first process data
    show();
}

void Watchdogs::feed_process_data(Time now) {
    const bool was_running = process_data_.running;
    process_data_.feed(now);
    if (!was_running) show();
}

void Watchdogs::processor_halted(Time now) { pdi_.feed(now); }

Watchdogs::Expired Watchdogs::settle(Time now) {
    Expired result;
    if (process_data_.next() <= now) {
        process_data_.running = false;
        process_data_.expired = true;
        count(reg::kProcessDataWatchdogCounter.address);
        result.process_data = true;
    }
    if (pdi_.next() <= now) {
        pdi_.running = false;
        pdi_.expired = true;
        count(reg::kPdiWatchdogCounter.address);
        result.pdi = true;
    }
    if (result.process_data || result.pdi) show();
    return result;
}

void Watchdogs::count(std::uint16_t address) {
    const auto value = registers_->get<std::uint8_t>(address);
    if (value != 0xFF) registers_->set(address, static_cast<std::uint8_t>(value + 1));
}

// 0x0440: 1 while the watchdog is running or off.
void Watchdogs::show() {
    const bool off = !fed_ || process_data_.time == Duration::zero();
    registers_->set(reg::kProcessDataWatchdogStatus.address,
                    static_cast<std::uint16_t>(off || process_data_.running ? 1 : 0));
}

}  // namespace margay::sim
