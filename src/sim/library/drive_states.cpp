#include "sim/library/drive_states.hpp"

namespace margay::sim {

namespace cw = control_word;

// CiA 402 table "Command coding": the bits of each command and their values. Numbers in the comments below are
// transitions.
void DriveStates::command(std::uint16_t control, bool standstill) {
    const auto is = [control](unsigned mask, unsigned bits) { return (control & mask) == bits; };
    const bool disable_voltage = is(cw::kEnableVoltage, 0);
    const bool quick_stop = is(cw::kEnableVoltage | cw::kQuickStop, cw::kEnableVoltage);
    const bool shutdown = is(0x07, cw::kEnableVoltage | cw::kQuickStop);
    const bool switch_on = is(0x07, 0x07);
    const bool enable = is(0x0F, 0x0F);

    const bool reset = (control & cw::kFaultReset) != 0;
    const bool edge = reset && !reset_seen_;
    reset_seen_ = reset;

    switch (state_) {
        case DriveState::not_ready: state_ = DriveState::switch_on_disabled; break;  // transition 1: automatic
        case DriveState::switch_on_disabled:
            if (shutdown) state_ = DriveState::ready_to_switch_on;  // 2
            break;
        case DriveState::ready_to_switch_on:
            if (disable_voltage || quick_stop) {
                state_ = DriveState::switch_on_disabled;  // 7
            } else if (switch_on) {
                state_ = DriveState::switched_on;  // 3; "switch on and enable" needs two steps
            }
            break;
        case DriveState::switched_on:
            if (disable_voltage || quick_stop) {
                state_ = DriveState::switch_on_disabled;  // 10
            } else if (shutdown) {
                state_ = DriveState::ready_to_switch_on;  // 6
            } else if (enable) {
                state_ = DriveState::operation_enabled;  // 4
            }
            break;
        case DriveState::operation_enabled:
            if (disable_voltage) {
                state_ = DriveState::switch_on_disabled;  // 9
            } else if (quick_stop) {
                state_ = DriveState::quick_stop_active;  // 11
            } else if (shutdown) {
                state_ = DriveState::ready_to_switch_on;  // 8
            } else if (switch_on && !enable) {
                state_ = DriveState::switched_on;  // 5
            }
            break;
        case DriveState::quick_stop_active:
            if (disable_voltage) {
                state_ = DriveState::switch_on_disabled;  // 12
            } else if (enable && standstill) {
                state_ = DriveState::operation_enabled;  // 16
            }
            break;
        case DriveState::fault_reaction_active: break;
        case DriveState::fault:
            if (edge) state_ = DriveState::switch_on_disabled;  // 15
            break;
    }
}

void DriveStates::fail(bool controlled_stop) {
    if (state_ == DriveState::fault || state_ == DriveState::fault_reaction_active) return;
    state_ = controlled_stop && powered() ? DriveState::fault_reaction_active : DriveState::fault;  // 13, 14
}

void DriveStates::stopped(bool stay_in_quick_stop) {
    if (state_ == DriveState::fault_reaction_active) {
        state_ = DriveState::fault;
    } else if (state_ == DriveState::quick_stop_active && !stay_in_quick_stop) {
        state_ = DriveState::switch_on_disabled;
    }
}

// CiA 402 table "State coding".
std::uint16_t DriveStates::status_bits() const {
    switch (state_) {
        case DriveState::not_ready: return 0x0000;
        case DriveState::switch_on_disabled: return 0x0040;
        case DriveState::ready_to_switch_on: return 0x0021;
        case DriveState::switched_on: return 0x0023;
        case DriveState::operation_enabled: return 0x0027;
        case DriveState::quick_stop_active: return 0x0007;
        case DriveState::fault_reaction_active: return 0x000F;
        case DriveState::fault: return 0x0008;
    }
    return 0;
}

}  // namespace margay::sim
