// The objects of "drive": the objects that CiA 402 (IEC 61800-7-201) specifies for a servo drive with the modes pp, hm,
// csp, csv and cst.
#pragma once

#include "sim/library/device_tables.hpp"
#include "sim/library/motor.hpp"

namespace margay::sim::drive {

using namespace subdevice;
using namespace std::chrono_literals;

constexpr std::int32_t kTurn = static_cast<std::int32_t>(Motor::kCountsPerTurn);

struct Values {
    using error_register = Field<std::uint8_t, 0>;
    using error_code = Field<std::uint16_t, error_register::end>;
    using control = Field<std::uint16_t, error_code::end>;
    using status = Field<std::uint16_t, control::end>;
    using quick_stop_option = Field<std::int16_t, status::end>;
    using fault_option = Field<std::int16_t, quick_stop_option::end>;
    using mode = Field<std::int8_t, fault_option::end>;
    using mode_display = Field<std::int8_t, mode::end>;
    using position_demand = Field<std::int32_t, mode_display::end>;
    using position = Field<std::int32_t, position_demand::end>;
    using following_window = Field<std::uint32_t, position::end>;
    using following_timeout = Field<std::uint16_t, following_window::end>;
    using position_window = Field<std::uint32_t, following_timeout::end>;
    using speed = Field<std::int32_t, position_window::end>;
    using target_torque = Field<std::int16_t, speed::end>;
    using max_torque = Field<std::uint16_t, target_torque::end>;
    using torque = Field<std::int16_t, max_torque::end>;
    using voltage = Field<std::uint32_t, torque::end>;
    using target_position = Field<std::int32_t, voltage::end>;
    using home_offset = Field<std::int32_t, target_position::end>;
    using limit_low = Field<std::int32_t, home_offset::end>;
    using limit_high = Field<std::int32_t, limit_low::end>;
    using max_speed = Field<std::uint32_t, limit_high::end>;
    using profile_speed = Field<std::uint32_t, max_speed::end>;
    using acceleration = Field<std::uint32_t, profile_speed::end>;
    using deceleration = Field<std::uint32_t, acceleration::end>;
    using quick_stop_deceleration = Field<std::uint32_t, deceleration::end>;
    using homing_method = Field<std::int8_t, quick_stop_deceleration::end>;
    using homing_fast = Field<std::uint32_t, homing_method::end>;
    using homing_slow = Field<std::uint32_t, homing_fast::end>;
    using homing_acceleration = Field<std::uint32_t, homing_slow::end>;
    using interpolation_value = Field<std::uint8_t, homing_acceleration::end>;
    using interpolation_index = Field<std::int8_t, interpolation_value::end>;
    using following_error = Field<std::int32_t, interpolation_index::end>;
    using digital_inputs = Field<std::uint32_t, following_error::end>;
    using target_speed = Field<std::int32_t, digital_inputs::end>;
    using raise_error = Field<std::uint16_t, target_speed::end>;
    using load = Field<std::int16_t, raise_error::end>;
    using jammed = Field<std::uint8_t, load::end>;
    using supply = Field<std::uint32_t, jammed::end>;
    static constexpr std::size_t rx_pdo = supply::end;
    static constexpr std::size_t tx_pdo = rx_pdo + kListBytes<std::uint32_t, 8>;
    static constexpr std::size_t rx_assignment = tx_pdo + kListBytes<std::uint32_t, 10>;
    static constexpr std::size_t tx_assignment = rx_assignment + kListBytes<std::uint16_t, 2>;
    static constexpr std::size_t bytes = tx_assignment + kListBytes<std::uint16_t, 2>;
};

inline constexpr auto kDevice = [] {
    auto device = io_device({.product_code = 0x5402,
                             .name = "Servo drive",
                             .order_code = "MG5402",
                             .group = "Drives",
                             .output_bytes = 48,
                             .input_bytes = 48,
                             .mailbox_bytes = 256,
                             .mailbox_room = 512,
                             .least_mailbox = 48});
    device.dc.min_cycle = 250us;
    device.dc.pll = true;
    device.free_run_cycle = {};
    device.drive_axes = 1;
    return device;
}();
using Common = CommonObjects<kDevice, 0x00020192>;  // profile 402, servo drive

inline constexpr auto kOut = od::kReadWrite | od::kRxMappable;
inline constexpr auto kIn = od::kRead | od::kTxMappable;
inline constexpr auto kSet = od::kReadWrite | od::kBackup | od::kSettings;

inline constexpr Entry kErrorRegister[] = {value<Values::error_register>(0, "Error register", kIn)};
inline constexpr Entry kErrorCode[] = {value<Values::error_code>(0, "Error code", kIn)};
inline constexpr Entry kControl[] = {value<Values::control>(0, "Controlword", kOut)};
inline constexpr Entry kStatus[] = {value<Values::status>(0, "Statusword", kIn)};
inline constexpr Entry kQuickStopOption[] = {
    value<Values::quick_stop_option>(0, "Quick stop option code", kSet, 2).within(kLimits<0, 6>)};
inline constexpr Entry kShutdownOption[] = {constant<std::int16_t>(0, "Shutdown option code", 0)};
inline constexpr Entry kDisableOption[] = {constant<std::int16_t>(0, "Disable operation option code", 0)};
inline constexpr Entry kFaultOption[] = {
    value<Values::fault_option>(0, "Fault reaction option code", kSet, 2).within(kLimits<0, 2>)};
inline constexpr Entry kMode[] = {value<Values::mode>(0, "Modes of operation", kOut)};
inline constexpr Entry kModeDisplay[] = {value<Values::mode_display>(0, "Modes of operation display", kIn)};
inline constexpr Entry kDemand[] = {value<Values::position_demand>(0, "Position demand value", kIn)};
inline constexpr Entry kPosition[] = {value<Values::position>(0, "Position actual value", kIn)};
inline constexpr Entry kFollowingWindow[] = {
    value<Values::following_window>(0, "Following error window", kSet, kTurn / 4)};
inline constexpr Entry kFollowingTimeout[] = {
    value<Values::following_timeout>(0, "Following error time out", kSet, 10)};
inline constexpr Entry kPositionWindow[] = {value<Values::position_window>(0, "Position window", kSet, 1000)};
inline constexpr Entry kSpeed[] = {value<Values::speed>(0, "Velocity actual value", kIn)};
inline constexpr Entry kTargetTorque[] = {
    value<Values::target_torque>(0, "Target torque", kOut).within(kLimits<-3000, 3000>)};
inline constexpr Entry kMaxTorque[] = {
    value<Values::max_torque>(0, "Max torque", kSet | od::kRxMappable, 3000).within(kLimits<0, 3000>)};
inline constexpr Entry kRatedTorque[] = {constant<std::uint32_t>(0, "Motor rated torque", 2400)};
inline constexpr Entry kTorque[] = {value<Values::torque>(0, "Torque actual value", kIn)};
inline constexpr Entry kVoltage[] = {value<Values::voltage>(0, "DC link circuit voltage", kIn, 325'000)};
inline constexpr Entry kTargetPosition[] = {value<Values::target_position>(0, "Target position", kOut)};
inline constexpr Entry kHomeOffset[] = {value<Values::home_offset>(0, "Home offset", kSet)};
inline constexpr Entry kSoftwareLimits[] = {entry_count(2), value<Values::limit_low>(1, "Min position limit", kSet),
                                            value<Values::limit_high>(2, "Max position limit", kSet)};
inline constexpr Entry kMaxSpeed[] = {value<Values::max_speed>(0, "Max motor speed", kSet, 100 * kTurn)};
inline constexpr Entry kProfileSpeed[] = {
    value<Values::profile_speed>(0, "Profile velocity", kSet | od::kRxMappable, 20 * kTurn)};
inline constexpr Entry kAcceleration[] = {
    value<Values::acceleration>(0, "Profile acceleration", kSet | od::kRxMappable, 200 * kTurn)
        .within(kLimits<1, UINT32_MAX>)};
inline constexpr Entry kDeceleration[] = {
    value<Values::deceleration>(0, "Profile deceleration", kSet | od::kRxMappable, 200 * kTurn)
        .within(kLimits<1, UINT32_MAX>)};
inline constexpr Entry kQuickStop[] = {
    value<Values::quick_stop_deceleration>(0, "Quick stop deceleration", kSet, 1000 * kTurn)
        .within(kLimits<1, UINT32_MAX>)};
inline constexpr Entry kEncoderResolution[] = {entry_count(2),
                                               constant<std::uint32_t>(1, "Encoder increments", 1u << 20),
                                               constant<std::uint32_t>(2, "Motor revolutions", 1)};
inline constexpr Entry kHomingMethod[] = {value<Values::homing_method>(0, "Homing method", kSet, 35)};
inline constexpr Entry kHomingSpeeds[] = {
    entry_count(2), value<Values::homing_fast>(1, "Speed during search for switch", kSet, 20 * kTurn),
    value<Values::homing_slow>(2, "Speed during search for zero", kSet, 2 * kTurn)};
inline constexpr Entry kHomingAcceleration[] = {
    value<Values::homing_acceleration>(0, "Homing acceleration", kSet, 200 * kTurn).within(kLimits<1, UINT32_MAX>)};
inline constexpr Entry kInterpolationTime[] = {
    entry_count(2),
    value<Values::interpolation_value>(1, "Interpolation time period value", kSet, 1).within(kLimits<1, 255>),
    value<Values::interpolation_index>(2, "Interpolation time index", kSet, -3).within(kLimits<-6, -1>)};
inline constexpr Entry kFollowingError[] = {value<Values::following_error>(0, "Following error actual value", kIn)};
inline constexpr Entry kDigitalInputs[] = {value<Values::digital_inputs>(0, "Digital inputs", kIn)};
inline constexpr Entry kTargetSpeed[] = {value<Values::target_speed>(0, "Target velocity", kOut)};
inline constexpr Entry kModes[] = {
    constant<std::uint32_t>(0, "Supported drive modes", 1u << 0 | 1u << 5 | 1u << 7 | 1u << 8 | 1u << 9)};
// Objects of the simulation: faults on request.
inline constexpr Entry kFaults[] = {entry_count(4), value<Values::raise_error>(1, "Raise error code", od::kReadWrite),
                                    value<Values::load>(2, "External load, per mille", od::kReadWrite),
                                    flag<Values::jammed>(3, "Axis is jammed", od::kReadWrite),
                                    value<Values::supply>(4, "Supply voltage, mV", od::kReadWrite, 325'000)};

inline constexpr auto kRxPdo = changeable_list<std::uint32_t, 8>(
    Values::rx_pdo, 6, "Mapping entry",
    {map(0x6040, 0, 16), map(0x607A, 0, 32), map(0x60FF, 0, 32), map(0x6071, 0, 16), map(0x6060, 0, 8), map(0, 0, 8)});
inline constexpr auto kTxPdo =
    changeable_list<std::uint32_t, 10>(Values::tx_pdo, 8, "Mapping entry",
                                       {map(0x6041, 0, 16), map(0x6064, 0, 32), map(0x606C, 0, 32), map(0x6077, 0, 16),
                                        map(0x6061, 0, 8), map(0, 0, 8), map(0x603F, 0, 16), map(0x60FD, 0, 32)});
inline constexpr Entry kRxPosition[] = {entry_count(2), mapped(1, 0x6040, 0, 16), mapped(2, 0x607A, 0, 32)};
inline constexpr Entry kRxSpeed[] = {entry_count(2), mapped(1, 0x6040, 0, 16), mapped(2, 0x60FF, 0, 32)};
inline constexpr Entry kRxTorque[] = {entry_count(2), mapped(1, 0x6040, 0, 16), mapped(2, 0x6071, 0, 16)};
inline constexpr Entry kTxPosition[] = {entry_count(2), mapped(1, 0x6041, 0, 16), mapped(2, 0x6064, 0, 32)};
inline constexpr auto kRxAssignment =
    changeable_list<std::uint16_t, 2>(Values::rx_assignment, 1, "Assigned PDO", {0x1600});
inline constexpr auto kTxAssignment =
    changeable_list<std::uint16_t, 2>(Values::tx_assignment, 1, "Assigned PDO", {0x1A00});

inline constexpr auto kObjects = with_common<Common>({
    variable(0x1001, "Error register", kErrorRegister),
    record(0x1600, "RxPDO", kRxPdo, &kPdoMappingHooks, DataType::pdo_mapping),
    record(0x1601, "RxPDO csp", kRxPosition, nullptr, DataType::pdo_mapping),
    record(0x1602, "RxPDO csv", kRxSpeed, nullptr, DataType::pdo_mapping),
    record(0x1603, "RxPDO cst", kRxTorque, nullptr, DataType::pdo_mapping),
    record(0x1A00, "TxPDO", kTxPdo, &kPdoMappingHooks, DataType::pdo_mapping),
    record(0x1A01, "TxPDO position", kTxPosition, nullptr, DataType::pdo_mapping),
    array(0x1C12, "RxPDO assignment", kRxAssignment, &kPdoAssignmentHooks),
    array(0x1C13, "TxPDO assignment", kTxAssignment, &kPdoAssignmentHooks),
    record(0x2F00, "Faults on request", kFaults),
    variable(0x603F, "Error code", kErrorCode),
    variable(0x6040, "Controlword", kControl),
    variable(0x6041, "Statusword", kStatus),
    variable(0x605A, "Quick stop option code", kQuickStopOption),
    variable(0x605B, "Shutdown option code", kShutdownOption),
    variable(0x605C, "Disable operation option code", kDisableOption),
    variable(0x605E, "Fault reaction option code", kFaultOption),
    variable(0x6060, "Modes of operation", kMode),
    variable(0x6061, "Modes of operation display", kModeDisplay),
    variable(0x6062, "Position demand value", kDemand),
    variable(0x6064, "Position actual value", kPosition),
    variable(0x6065, "Following error window", kFollowingWindow),
    variable(0x6066, "Following error time out", kFollowingTimeout),
    variable(0x6067, "Position window", kPositionWindow),
    variable(0x606C, "Velocity actual value", kSpeed),
    variable(0x6071, "Target torque", kTargetTorque),
    variable(0x6072, "Max torque", kMaxTorque),
    variable(0x6076, "Motor rated torque", kRatedTorque),
    variable(0x6077, "Torque actual value", kTorque),
    variable(0x6079, "DC link circuit voltage", kVoltage),
    variable(0x607A, "Target position", kTargetPosition),
    variable(0x607C, "Home offset", kHomeOffset),
    array(0x607D, "Software position limit", kSoftwareLimits),
    variable(0x6080, "Max motor speed", kMaxSpeed),
    variable(0x6081, "Profile velocity", kProfileSpeed),
    variable(0x6083, "Profile acceleration", kAcceleration),
    variable(0x6084, "Profile deceleration", kDeceleration),
    variable(0x6085, "Quick stop deceleration", kQuickStop),
    array(0x608F, "Position encoder resolution", kEncoderResolution),
    variable(0x6098, "Homing method", kHomingMethod),
    array(0x6099, "Homing speeds", kHomingSpeeds),
    variable(0x609A, "Homing acceleration", kHomingAcceleration),
    record(0x60C2, "Interpolation time period", kInterpolationTime),
    variable(0x60F4, "Following error actual value", kFollowingError),
    variable(0x60FD, "Digital inputs", kDigitalInputs),
    variable(0x60FF, "Target velocity", kTargetSpeed),
    variable(0x6502, "Supported drive modes", kModes),
});
static_assert(well_formed(kObjects, Values::bytes));

}  // namespace margay::sim::drive
