// The state machine of a drive (IEC 61800-7-201, CiA 402: "Power drive system state machine"; control word 0x6040,
// status word 0x6041).
#pragma once

#include <cstdint>

namespace margay::sim {

enum class DriveState : std::uint8_t {
    not_ready,
    switch_on_disabled,
    ready_to_switch_on,
    switched_on,
    operation_enabled,
    quick_stop_active,
    fault_reaction_active,
    fault,
};

// Bits of the control word.
namespace control_word {
inline constexpr unsigned kSwitchOn = 0x0001;
inline constexpr unsigned kEnableVoltage = 0x0002;
inline constexpr unsigned kQuickStop = 0x0004;  // 0: quick stop
inline constexpr unsigned kEnableOperation = 0x0008;
inline constexpr unsigned kNewSetPoint = 0x0010;  // pp: new set point; hm: start
inline constexpr unsigned kChangeAtOnce = 0x0020;
inline constexpr unsigned kRelative = 0x0040;
inline constexpr unsigned kFaultReset = 0x0080;
inline constexpr unsigned kHalt = 0x0100;
}  // namespace control_word

// Bits of the status word, except the bits of the state.
namespace status_word {
inline constexpr unsigned kVoltageEnabled = 0x0010;
inline constexpr unsigned kWarning = 0x0080;
inline constexpr unsigned kRemote = 0x0200;
inline constexpr unsigned kTargetReached = 0x0400;
inline constexpr unsigned kInternalLimit = 0x0800;
// Pp: set point acknowledge; hm: attained; cyclic modes: the drive follows the command value.
inline constexpr unsigned kSetPointAcknowledge = 0x1000;
inline constexpr unsigned kFollowingError = 0x2000;  // following error; hm: homing error
}  // namespace status_word

class DriveStates {
  public:
    void start() { *this = {}; }
    // Executes a control word. `standstill`: quick stop and fault reaction end when the motor has stopped.
    void command(std::uint16_t control, bool standstill);
    // Enters the fault reaction. `controlled_stop`: the motor can still be stopped with control.
    void fail(bool controlled_stop);
    // The quick stop ramp has ended. With option codes 5 to 7 of 0x605A the drive stays in quick stop.
    void stopped(bool stay_in_quick_stop);

    [[nodiscard]] DriveState state() const { return state_; }
    [[nodiscard]] bool powered() const {
        return state_ == DriveState::operation_enabled || state_ == DriveState::quick_stop_active ||
               state_ == DriveState::fault_reaction_active;
    }
    // The bits of the status word that represent the state.
    [[nodiscard]] std::uint16_t status_bits() const;

  private:
    DriveState state_ = DriveState::not_ready;
    bool reset_seen_ = false;  // fault reset acts on its rising edge
};

}  // namespace margay::sim
