// The objects of ETG.1020 that a master uses to read and set the synchronization of a device: 0x10F1 "Sync error
// setting", 0x1C32 "Sync manager 2 parameter", 0x1C33 "Sync manager 3 parameter". All of them are optional. A device
// that has them places their values in its image; ProcessData finds them by index and subindex:
//
//     struct Values {
//         Le<std::uint16_t> lamps;  // the values of the device, and then:
//         std::array<std::byte, SyncValues<0>::bytes> sync;
//     };
//     constexpr std::size_t kSync = offset_of(&Values::sync);
//     constexpr auto kSyncError = sync_error_entries<kSync>(kDevice);
//     constexpr auto kOutputSync = sync_output_entries<kSync>(kDevice);
//     constexpr auto kInputSync = sync_input_entries<kSync>(kDevice);
//     … record(0x10F1, "Sync error setting", kSyncError),
//     record(0x1C32, "Output sync", kOutputSync, &kSyncParameterHooks), …
//
// The synchronization type (subindex 1) of the first SyncManager of a direction chooses the mode of the device, and the
// SYNC signals that the master has activated choose it, too:
//
//     written type              SYNC0 off                              SYNC0 on
//     1 SM event (the default)  SM-synchronous                         DC-synchronous
//     0 free run                free run                               SAFEOP is refused (AL status code 0x0030)
//     2 DC SYNC0                SAFEOP is refused (0x0030)             DC-synchronous
//
// So a master that only activates SYNC0 need not write the type. A write of a type that the device does not support is
// refused with Abort::value_range. A type that came in another way (a firmware that writes into its image) refuses
// SAFEOP with AL status code 0x0027 (free run) or 0x0028 (others), and so does a second object whose type contradicts
// that of the first one. In SAFEOP and OP, the objects show the type in use; in PREOP, the one that was written.
//
// Each further SyncManager of a device (DeviceDescription::more_outputs, more_inputs) has such an object, too: 0x1C30 +
// number, from more_sync_output_entries() or more_sync_input_entries(). Type, cycle time and missed frames belong to
// the SyncManager. The rest belongs to the whole device and is the memory of the first object: a device has one update.
#pragma once

#include "subdevice/object_dictionary.hpp"

namespace margay::subdevice {

inline constexpr std::uint16_t kSyncErrorSetting = 0x10F1;
inline constexpr std::uint16_t kOutputSyncParameters = 0x1C32;
inline constexpr std::uint16_t kInputSyncParameters = 0x1C33;

namespace sync_subindex {
// 0x10F1. The limit is the number of consecutive frame periods without new outputs that are tolerated in OP with DC;
// 0: no limit. It is taken over at PREOP→SAFEOP.
inline constexpr std::uint8_t kErrorLimit = 2;
inline constexpr std::uint8_t kErrorReaction = 1;  // DeviceDescription::local_error_reaction
// 0x1C32, 0x1C33, and the objects of further SyncManagers.
inline constexpr std::uint8_t kType = 1;       // see sync_type
inline constexpr std::uint8_t kCycle = 2;      // cycle time of the master in ns; 0: unknown
inline constexpr std::uint8_t kShift = 3;      // in ns: SyncTimes::shift
inline constexpr std::uint8_t kSupported = 4;  // bit 0 free run, bit 1 SM event, bits 2 and 3 DC (01: SYNC0)
inline constexpr std::uint8_t kMinCycle = 5;   // in ns
// The longest measured time in ns. 0x1C32: from the event of an update until the application has used the outputs.
// 0x1C33: from there until the inputs are in the SyncManager. 0: not measured (Application::clock()).
inline constexpr std::uint8_t kCalcAndCopy = 6;
inline constexpr std::uint8_t kMinDelay = 7;          // in ns: SyncTimes::min_delay
inline constexpr std::uint8_t kGetCycleTime = 8;      // bit 0: measure; a write of 1 begins a new measurement
inline constexpr std::uint8_t kMaxDelay = 9;          // in ns: SyncTimes::max_delay
inline constexpr std::uint8_t kSync0Cycle = 0x0A;     // in ns, of the SYNC0 in use; 0: not DC-synchronous
inline constexpr std::uint8_t kMissedFrames = 0x0B;   // frame periods without new outputs in this SyncManager
inline constexpr std::uint8_t kCycleExceeded = 0x0C;  // updates that took longer than the SYNC0 cycle
// Updates in OP after which the outputs were used later than the shift time of the outputs after SYNC0
// (Application::clock()). 0 without a shift time.
inline constexpr std::uint8_t kShiftTooShort = 0x0D;
inline constexpr std::uint8_t kSyncError = 0x20;  // the device left OP because of such periods; OP resets it
}  // namespace sync_subindex

namespace sync_type {
inline constexpr std::uint16_t kFreeRun = 0;
inline constexpr std::uint16_t kSmEvent = 1;      // with the event of this SyncManager
inline constexpr std::uint16_t kDcSync0 = 2;      // with SYNC0
inline constexpr std::uint16_t kSm2Event = 0x22;  // inputs: with the event of the outputs
}  // namespace sync_type

// The object with the values of the whole device: the object of the outputs, or of the inputs for a device without
// outputs.
[[nodiscard]] constexpr std::uint16_t first_sync_object(const DeviceDescription& device) {
    if (device.outputs.present()) return device.outputs.sync_parameters();
    return device.inputs.present() ? device.inputs.sync_parameters() : kOutputSyncParameters;
}

// Whether the master may choose the type for a SyncManager of outputs or inputs.
[[nodiscard]] bool supports_sync_type(const DeviceDescription& device, bool outputs, std::uint16_t type);

// Refuses types that the device does not support.
[[nodiscard]] HookAnswer check_sync_type(const ObjectAccess& access, Bytes data);
inline constexpr ObjectHooks kSyncParameterHooks{.before_write = check_sync_type};

// Values in the image from `Offset` on.
template <std::size_t Offset>
struct SyncValues {
    using error_limit = Field<std::uint16_t, Offset>;
    using output_type = Field<std::uint16_t, Offset + 2>;
    using output_cycle = Field<std::uint32_t, Offset + 4>;
    using missed_frames = Field<std::uint16_t, Offset + 8>;
    using sync_error = Field<std::uint8_t, Offset + 10>;
    using input_type = Field<std::uint16_t, Offset + 11>;
    using input_cycle = Field<std::uint32_t, Offset + 13>;
    using output_calc_and_copy = Field<std::uint32_t, Offset + 17>;
    using get_cycle_time = Field<std::uint16_t, Offset + 21>;
    using cycle_exceeded = Field<std::uint16_t, Offset + 23>;
    using input_calc_and_copy = Field<std::uint32_t, Offset + 25>;
    using sync0_cycle = Field<std::uint32_t, Offset + 29>;
    using shift_too_short = Field<std::uint16_t, Offset + 33>;
    static constexpr std::size_t bytes = 35;
};

// Values of the object of a further SyncManager, in the image from `Offset` on.
template <std::size_t Offset>
struct MoreSyncValues {
    using type = Field<std::uint16_t, Offset>;
    using cycle = Field<std::uint32_t, Offset + 2>;
    using missed_frames = Field<std::uint16_t, Offset + 6>;
    static constexpr std::size_t bytes = 8;
};

namespace sync_entry {
[[nodiscard]] constexpr std::uint16_t supported(const DeviceDescription& d) {
    if (d.dc.required) return 4;  // as supports_sync_type()
    return static_cast<std::uint16_t>((d.free_run_cycle != Duration::zero() ? 1u : 0u) | 2u |
                                      (d.dc.supported ? 4u : 0u));
}
[[nodiscard]] constexpr std::uint16_t first_type(const DeviceDescription& d, bool outputs) {
    if (d.dc.required) return sync_type::kDcSync0;
    return !outputs && d.outputs.present() ? sync_type::kSm2Event : sync_type::kSmEvent;
}
[[nodiscard]] constexpr Entry time(std::uint8_t subindex, const char* name, Duration time) {
    return constant(subindex, name, static_cast<std::uint32_t>(time.count()));
}
}  // namespace sync_entry

template <std::size_t Offset>
[[nodiscard]] constexpr std::array<Entry, 3> sync_error_entries(const DeviceDescription& d) {
    return {entry_count(2), constant(sync_subindex::kErrorReaction, "Local error reaction", d.local_error_reaction),
            value<typename SyncValues<Offset>::error_limit>(sync_subindex::kErrorLimit, "Sync error counter limit",
                                                            od::kReadWritePreop,
                                                            static_cast<std::uint16_t>(d.sync_error_limit))};
}

namespace sync_entry {
// `Device`: the values of the device; the other fields belong to the SyncManager.
template <class Device, class Type, class Cycle, class Missed>
[[nodiscard]] constexpr std::array<Entry, 15> of_outputs(const DeviceDescription& d) {
    using namespace sync_subindex;
    return {
        entry_count(kSyncError),
        value<Type>(kType, "Synchronization type", od::kReadWritePreop, first_type(d, true)),
        value<Cycle>(kCycle, "Cycle time", od::kReadWritePreop),
        time(kShift, "Shift time", d.output_times.shift),
        constant<std::uint16_t>(kSupported, "Synchronization types supported", supported(d)),
        time(kMinCycle, "Minimum cycle time", d.dc.min_cycle),
        value<typename Device::output_calc_and_copy>(kCalcAndCopy, "Calc and copy time", od::kReadOnly),
        time(kMinDelay, "Minimum delay time", d.output_times.min_delay),
        value<typename Device::get_cycle_time>(kGetCycleTime, "Get cycle time", od::kReadWrite).within(kLimits<0, 1>),
        time(kMaxDelay, "Maximum delay time", d.output_times.max_delay),
        value<typename Device::sync0_cycle>(kSync0Cycle, "Sync0 cycle time", od::kReadOnly),
        value<Missed>(kMissedFrames, "SM event missed counter", od::kReadOnly),
        value<typename Device::cycle_exceeded>(kCycleExceeded, "Cycle exceeded counter", od::kReadOnly),
        value<typename Device::shift_too_short>(kShiftTooShort, "Shift too short counter", od::kReadOnly),
        flag<typename Device::sync_error>(kSyncError, "Sync error", od::kReadOnly)};
}
template <class Device, class Type, class Cycle>
[[nodiscard]] constexpr std::array<Entry, 15> of_inputs(const DeviceDescription& d) {
    using namespace sync_subindex;
    return {
        entry_count(kSyncError), value<Type>(kType, "Synchronization type", od::kReadWritePreop, first_type(d, false)),
        value<Cycle>(kCycle, "Cycle time", od::kReadWritePreop), time(kShift, "Shift time", d.input_times.shift),
        constant<std::uint16_t>(kSupported, "Synchronization types supported", supported(d)),
        time(kMinCycle, "Minimum cycle time", d.dc.min_cycle),
        value<typename Device::input_calc_and_copy>(kCalcAndCopy, "Calc and copy time", od::kReadOnly),
        time(kMinDelay, "Minimum delay time", d.input_times.min_delay),
        value<typename Device::get_cycle_time>(kGetCycleTime, "Get cycle time", od::kReadWrite).within(kLimits<0, 1>),
        time(kMaxDelay, "Maximum delay time", d.input_times.max_delay),
        value<typename Device::sync0_cycle>(kSync0Cycle, "Sync0 cycle time", od::kReadOnly),
        // The device updates inputs and outputs together: both directions have the same counters.
        value<typename Device::missed_frames>(kMissedFrames, "SM event missed counter", od::kReadOnly),
        value<typename Device::cycle_exceeded>(kCycleExceeded, "Cycle exceeded counter", od::kReadOnly),
        value<typename Device::shift_too_short>(kShiftTooShort, "Shift too short counter", od::kReadOnly),
        flag<typename Device::sync_error>(kSyncError, "Sync error", od::kReadOnly)};
}
}  // namespace sync_entry

template <std::size_t Offset>
[[nodiscard]] constexpr std::array<Entry, 15> sync_output_entries(const DeviceDescription& d) {
    using V = SyncValues<Offset>;
    return sync_entry::of_outputs<V, typename V::output_type, typename V::output_cycle, typename V::missed_frames>(d);
}

template <std::size_t Offset>
[[nodiscard]] constexpr std::array<Entry, 15> sync_input_entries(const DeviceDescription& d) {
    using V = SyncValues<Offset>;
    return sync_entry::of_inputs<V, typename V::input_type, typename V::input_cycle>(d);
}

// The object of a further SyncManager. `Device`: the offset of the SyncValues. `Offset`: the offset of its
// MoreSyncValues.
template <std::size_t Device, std::size_t Offset>
[[nodiscard]] constexpr std::array<Entry, 15> more_sync_output_entries(const DeviceDescription& d) {
    using V = MoreSyncValues<Offset>;
    return sync_entry::of_outputs<SyncValues<Device>, typename V::type, typename V::cycle, typename V::missed_frames>(
        d);
}
template <std::size_t Device, std::size_t Offset>
[[nodiscard]] constexpr std::array<Entry, 15> more_sync_input_entries(const DeviceDescription& d) {
    using V = MoreSyncValues<Offset>;
    return sync_entry::of_inputs<SyncValues<Device>, typename V::type, typename V::cycle>(d);
}

}  // namespace margay::subdevice
