#include "sim/library/model.hpp"

#include "subdevice/esc_registers.hpp"
#include "subdevice/esm_checks.hpp"

namespace margay::sim {

using subdevice::AlStatusCode;
using subdevice::Verdict;
namespace reg = wire::reg;

namespace {

constexpr Duration kSlow = std::chrono::milliseconds(300);

bool control_differs(subdevice::EscAccess& esc, const subdevice::ProcessDataArea& area, bool outputs) {
    if (!area.present()) return false;
    const auto sm = subdevice::read_sync_manager(esc, area.sync_manager);
    return sm.length_bytes != 0 && sm.control != (!outputs ? 0x20 : area.watchdog ? 0x64 : 0x24);
}

}  // namespace

void Model::begin(const Surroundings& around, Time now) {
    pdi_ = around.esc;
    slow_until_ = kNever;
    op_refused_ = false;
    start(around, now);
}

Verdict Model::decide(subdevice::Transition transition, Time now) {
    if (const auto why = objection(transition); why != AlStatusCode::none) return Verdict::refuse(why);
    if (quirks_.has(Quirk::slow_state_changes) && transition.up()) {
        if (slow_until_ == kNever) slow_until_ = now + kSlow;
        if (now < slow_until_) return Verdict::wait(slow_until_);
        slow_until_ = kNever;
    }
    return may(transition, now);
}

AlStatusCode Model::objection(subdevice::Transition transition) {
    using subdevice::read_register;
    if (transition.from == AlState::init && quirks_.has(Quirk::needs_eeprom) &&
        (read_register<std::uint8_t>(*pdi_, reg::kSiiConfig.address) & 1) == 0)
        return AlStatusCode::eeprom_no_access;
    if (transition == subdevice::Transition{AlState::preop, AlState::safeop}) {
        if (quirks_.has(Quirk::strict_sync_managers)) {
            if (control_differs(*pdi_, description().outputs, true)) return AlStatusCode::invalid_output_configuration;
            if (control_differs(*pdi_, description().inputs, false)) return AlStatusCode::invalid_input_configuration;
        }
        if (quirks_.has(Quirk::no_cycle1) && read_register<std::uint32_t>(*pdi_, reg::kSync1CycleTime.address) != 0)
            return AlStatusCode::invalid_dc_sync1_cycle_time;
    }
    if (transition.to == AlState::op && quirks_.has(Quirk::refuses_op_once) && !op_refused_) {
        op_refused_ = true;
        return AlStatusCode::external_hardware_not_ready;
    }
    return AlStatusCode::none;
}

void Model::report(std::uint16_t error_code, std::uint8_t error_register, Time now) {
    [[maybe_unused]] const bool queued = emergencies_.raise({error_code, error_register, {}});
    [[maybe_unused]] const bool noted = diagnosis_.add(
        {.code = 0xE8000000u | error_code,
         .type = error_code == 0 ? subdevice::DiagnosisType::information : subdevice::DiagnosisType::error,
         .text_id = error_code,
         .time_stamp_ns = static_cast<std::uint64_t>(now.time_since_epoch().count())});
}

}  // namespace margay::sim
