// Registers of an EtherCAT slave controller: ETG.1000.4 section "Attributes" and the ESC register tables. Each register
// has one constant with its address and its length in octets; constants for its bits are below.
#pragma once

#include <cstdint>

namespace margay::wire {

struct Register {
    std::uint16_t address = 0;
    std::uint16_t length = 0;
    [[nodiscard]] constexpr std::uint16_t end() const { return static_cast<std::uint16_t>(address + length); }
};

namespace reg {

// DL information
inline constexpr Register kType{0x0000, 1};
inline constexpr Register kRevision{0x0001, 1};
inline constexpr Register kBuild{0x0002, 2};
inline constexpr Register kFmmuCount{0x0004, 1};
inline constexpr Register kSyncManagerCount{0x0005, 1};
inline constexpr Register kRamSize{0x0006, 1};         // KiB
inline constexpr Register kPortDescriptor{0x0007, 1};  // two bits per port, see PortKind
inline constexpr Register kFeatures{0x0008, 2};
inline constexpr Register kDlInformation{0x0000, 10};  // all registers above

// Station address
inline constexpr Register kStationAddress{0x0010, 2};
inline constexpr Register kStationAlias{0x0012, 2};

// Write protection
inline constexpr Register kWriteRegisterEnable{0x0020, 1};
inline constexpr Register kWriteRegisterProtection{0x0021, 1};
inline constexpr Register kEscWriteEnable{0x0030, 1};
inline constexpr Register kEscWriteProtection{0x0031, 1};
inline constexpr Register kEscResetEcat{0x0040, 1};
inline constexpr Register kEscResetPdi{0x0041, 1};

// Data link layer
inline constexpr Register kDlControl{0x0100, 4};
inline constexpr Register kAliasEnable{0x0103, 1};  // of DL control; bit 0: the alias is a second station address
inline constexpr Register kPhysicalReadWriteOffset{0x0108, 2};
inline constexpr Register kDlStatus{0x0110, 2};

// Application layer
inline constexpr Register kAlControl{0x0120, 2};
inline constexpr Register kAlStatus{0x0130, 2};
inline constexpr Register kAlStatusCode{0x0134, 2};
inline constexpr Register kRunLedOverride{0x0138, 1};
inline constexpr Register kErrLedOverride{0x0139, 1};

// PDI
inline constexpr Register kPdiControl{0x0140, 1};
inline constexpr Register kEscConfiguration{0x0141, 1};
inline constexpr Register kPdiInformation{0x014E, 2};
inline constexpr Register kPdiConfiguration{0x0150, 1};
inline constexpr Register kSyncLatchConfiguration{0x0151, 1};
inline constexpr Register kExtendedPdiConfiguration{0x0152, 2};

// Events
inline constexpr Register kEcatEventMask{0x0200, 2};
inline constexpr Register kAlEventMask{0x0204, 4};
inline constexpr Register kEcatEventRequest{0x0210, 2};
inline constexpr Register kAlEventRequest{0x0220, 4};

// Error counters
inline constexpr Register kRxErrorCounter{0x0300, 8};           // per port: invalid frames, RX errors
inline constexpr Register kForwardedRxErrorCounter{0x0308, 4};  // per port
inline constexpr Register kProcessingUnitErrorCounter{0x030C, 1};
inline constexpr Register kPdiErrorCounter{0x030D, 1};
inline constexpr Register kPdiErrorCode{0x030E, 1};
inline constexpr Register kLostLinkCounter{0x0310, 4};  // per port

// Watchdogs
inline constexpr Register kWatchdogDivider{0x0400, 2};  // (value + 2) units of 40 ns; default 0x09C2 = 100 µs
inline constexpr Register kPdiWatchdogTime{0x0410, 2};  // multiple of the divider's unit
inline constexpr Register kProcessDataWatchdogTime{0x0420, 2};
inline constexpr Register kProcessDataWatchdogStatus{0x0440, 2};
inline constexpr Register kProcessDataWatchdogCounter{0x0442, 1};
inline constexpr Register kPdiWatchdogCounter{0x0443, 1};

// SII EEPROM interface
inline constexpr Register kSiiConfig{0x0500, 1};
inline constexpr Register kSiiPdiAccess{0x0501, 1};
inline constexpr Register kSiiControl{0x0502, 2};
inline constexpr Register kSiiAddress{0x0504, 4};
inline constexpr Register kSiiData{0x0508, 8};

// MII management
inline constexpr Register kMiiControl{0x0510, 2};
inline constexpr Register kMiiPhyAddress{0x0512, 1};
inline constexpr Register kMiiPhyRegister{0x0513, 1};
inline constexpr Register kMiiPhyData{0x0514, 2};
inline constexpr Register kMiiEcatAccess{0x0516, 1};
inline constexpr Register kMiiPdiAccess{0x0517, 1};
inline constexpr Register kMiiPortStatus{0x0518, 4};

// FMMUs and SyncManagers: arrays
inline constexpr std::uint16_t kFmmuBase = 0x0600;
inline constexpr std::uint16_t kFmmuStride = 16;
inline constexpr std::uint16_t kSyncManagerBase = 0x0800;
inline constexpr std::uint16_t kSyncManagerStride = 8;
[[nodiscard]] constexpr Register fmmu(unsigned n) {
    return {static_cast<std::uint16_t>(kFmmuBase + n * kFmmuStride), kFmmuStride};
}
[[nodiscard]] constexpr Register sync_manager(unsigned n) {
    return {static_cast<std::uint16_t>(kSyncManagerBase + n * kSyncManagerStride), kSyncManagerStride};
}

// Distributed clocks
inline constexpr Register kPortReceiveTime{0x0900, 16};  // 4 octets per port; a write to the first latches all
inline constexpr Register kSystemTime{0x0910, 8};
inline constexpr Register kProcessingUnitReceiveTime{0x0918, 8};
inline constexpr Register kSystemTimeOffset{0x0920, 8};
inline constexpr Register kSystemTimeDelay{0x0928, 4};
inline constexpr Register kSystemTimeDifference{0x092C, 4};  // sign and magnitude
inline constexpr Register kSpeedCounterStart{0x0930, 2};
inline constexpr Register kSpeedCounterDifference{0x0932, 2};
inline constexpr Register kSystemTimeDifferenceFilter{0x0934, 1};
inline constexpr Register kSpeedCounterFilter{0x0935, 1};
inline constexpr Register kCyclicUnitControl{0x0980, 1};
inline constexpr Register kSyncActivation{0x0981, 1};
inline constexpr Register kSyncPulseLength{0x0982, 2};
inline constexpr Register kActivationStatus{0x0984, 1};
inline constexpr Register kSync0Status{0x098E, 1};
inline constexpr Register kSync1Status{0x098F, 1};
inline constexpr Register kSyncStartTime{0x0990, 8};
inline constexpr Register kNextSync1Pulse{0x0998, 8};
inline constexpr Register kSync0CycleTime{0x09A0, 4};
inline constexpr Register kSync1CycleTime{0x09A4, 4};
inline constexpr Register kLatch0Control{0x09A8, 1};
inline constexpr Register kLatch1Control{0x09A9, 1};
inline constexpr Register kLatch0Status{0x09AE, 1};
inline constexpr Register kLatch1Status{0x09AF, 1};
inline constexpr Register kLatch0PositiveEdge{0x09B0, 8};
inline constexpr Register kLatch0NegativeEdge{0x09B8, 8};
inline constexpr Register kLatch1PositiveEdge{0x09C0, 8};
inline constexpr Register kLatch1NegativeEdge{0x09C8, 8};
// Local times of the last buffer events of any SyncManager.
inline constexpr Register kEcatBufferChangeTime{0x09F0, 4};  // begin of the frame that handed over a buffer
inline constexpr Register kPdiBufferStartTime{0x09F8, 4};    // the PDI opened a buffer
inline constexpr Register kPdiBufferChangeTime{0x09FC, 4};   // the PDI handed over a buffer

// ESC specific
inline constexpr Register kProductId{0x0E00, 8};
inline constexpr Register kVendorId{0x0E08, 8};

// User RAM 0x0F80–0x0FFF, process data RAM from 0x1000.
inline constexpr std::uint16_t kUserRam = 0x0F80;
inline constexpr std::uint16_t kProcessRam = 0x1000;

}  // namespace reg

// 0x0007, two bits per port.
enum class PortKind : std::uint8_t { not_implemented = 0, not_configured = 1, ebus = 2, mii = 3 };

// 0x0008 ESC features supported.
namespace features {
inline constexpr std::uint16_t kFmmuBitOperationNotSupported = 0x0001;
inline constexpr std::uint16_t kNoRegisterAccessReserved = 0x0002;
inline constexpr std::uint16_t kDistributedClocks = 0x0004;
inline constexpr std::uint16_t kDistributedClocks64Bit = 0x0008;
inline constexpr std::uint16_t kLowJitterEbus = 0x0010;
inline constexpr std::uint16_t kEnhancedLinkDetectionEbus = 0x0020;
inline constexpr std::uint16_t kEnhancedLinkDetectionMii = 0x0040;
inline constexpr std::uint16_t kSeparateFcsErrorHandling = 0x0080;
inline constexpr std::uint16_t kEnhancedSyncActivation = 0x0100;
inline constexpr std::uint16_t kLrwNotSupported = 0x0200;
inline constexpr std::uint16_t kReadWriteNotSupported = 0x0400;  // BRW, APRW, FPRW
inline constexpr std::uint16_t kFixedFmmuAndSmConfiguration = 0x0800;
}  // namespace features

// 0x0110 DL status.
namespace dl_status {
inline constexpr std::uint16_t kPdiOperational = 0x0001;  // the EEPROM is loaded
inline constexpr std::uint16_t kPdiWatchdog = 0x0002;
inline constexpr std::uint16_t kEnhancedLinkDetection = 0x0004;
[[nodiscard]] constexpr std::uint16_t physical_link(unsigned port) {
    return static_cast<std::uint16_t>(0x0010 << port);
}
[[nodiscard]] constexpr std::uint16_t loop_closed(unsigned port) {
    return static_cast<std::uint16_t>(0x0100 << (2 * port));
}
[[nodiscard]] constexpr std::uint16_t communication(unsigned port) {
    return static_cast<std::uint16_t>(0x0200 << (2 * port));
}
}  // namespace dl_status

// 0x0120 / 0x0130.
namespace al {
inline constexpr std::uint16_t kStateMask = 0x000F;
inline constexpr std::uint16_t kErrorIndication = 0x0010;   // in AL status
inline constexpr std::uint16_t kErrorAcknowledge = 0x0010;  // in AL control
inline constexpr std::uint16_t kDeviceIdentification = 0x0020;
}  // namespace al

// 0x0141 ESC configuration.
namespace esc_configuration {
inline constexpr std::uint8_t kDeviceEmulation = 0x01;  // AL status mirrors AL control
inline constexpr std::uint8_t kEnhancedLinkDetectionAllPorts = 0x02;
inline constexpr std::uint8_t kDcSyncUnit = 0x04;
inline constexpr std::uint8_t kDcLatchUnit = 0x08;
}  // namespace esc_configuration

// 0x0220 AL event request and 0x0204 AL event mask: events that the ESC reports to the processor of the slave.
namespace al_event {
// The master wrote AL control; cleared when the PDI reads 0x0120.
inline constexpr std::uint32_t kAlControl = 0x00000001;
// An edge at a latch input; cleared when the latch times are read.
inline constexpr std::uint32_t kDcLatch = 0x00000002;
inline constexpr std::uint32_t kDcSync0 = 0x00000004;  // cleared when 0x098E is read
inline constexpr std::uint32_t kDcSync1 = 0x00000008;  // cleared when 0x098F is read
// The activate octet of an SM was written; cleared when it is read.
inline constexpr std::uint32_t kSmActivation = 0x00000010;
inline constexpr std::uint32_t kEeprom = 0x00000020;  // EEPROM emulation: a command is waiting in 0x0502
// The process data watchdog expired; cleared when 0x0440 is read.
inline constexpr std::uint32_t kWatchdog = 0x00000040;
// SyncManager n was written by the master (outputs, mailbox out) or read by the master (inputs, mailbox in).
[[nodiscard]] constexpr std::uint32_t sync_manager(unsigned n) { return 0x00000100u << n; }
}  // namespace al_event

// 0x0151 SYNC and latch configuration, four bits per pin (pin 1: shifted by 4).
namespace sync_latch {
inline constexpr std::uint8_t kSync0Output = 0x04;
inline constexpr std::uint8_t kSync0Event = 0x08;  // SYNC0 is mapped to the AL event request
inline constexpr std::uint8_t kSync1Output = 0x40;
inline constexpr std::uint8_t kSync1Event = 0x80;
}  // namespace sync_latch

// 0x0980 cyclic unit control: the units that the PDI controls, not the master.
namespace cyclic_unit {
inline constexpr std::uint8_t kSyncIsPdis = 0x01;
inline constexpr std::uint8_t kLatch0IsPdis = 0x10;
inline constexpr std::uint8_t kLatch1IsPdis = 0x20;
}  // namespace cyclic_unit

// 0x0981 activation of the DC cyclic unit. Bits 3 to 7: features::kEnhancedSyncActivation.
namespace sync_activation {
inline constexpr std::uint8_t kCyclic = 0x01;
inline constexpr std::uint8_t kSync0 = 0x02;
inline constexpr std::uint8_t kSync1 = 0x04;
inline constexpr std::uint8_t kAutoActivation = 0x08;   // a write to the start time sets kCyclic
inline constexpr std::uint8_t kExtendStartTime = 0x10;  // a start time of 32 bits is extended to 64 bits
inline constexpr std::uint8_t kPlausibility = 0x20;     // signals begin at once when the start time is not near
inline constexpr std::uint8_t kNearFuture = 0x40;  // near is about 2.1 s (2^31 ns); 0: half of the width of the clock
inline constexpr std::uint8_t kDebugPulse = 0x80;  // one pulse of the enabled signals at once; reads as 0
}  // namespace sync_activation

// 0x0502 SII control and status.
namespace sii_control {
inline constexpr std::uint16_t kWriteEnable = 0x0001;
inline constexpr std::uint16_t kEmulation = 0x0020;
inline constexpr std::uint16_t kReads8Bytes = 0x0040;
inline constexpr std::uint16_t kTwoByteAddressing = 0x0080;
inline constexpr std::uint16_t kCommandMask = 0x0700;
inline constexpr std::uint16_t kCommandRead = 0x0100;
inline constexpr std::uint16_t kCommandWrite = 0x0200;
inline constexpr std::uint16_t kCommandReload = 0x0400;
inline constexpr std::uint16_t kChecksumError = 0x0800;
inline constexpr std::uint16_t kNotLoaded = 0x1000;  // the device information was not loaded
inline constexpr std::uint16_t kMissingAcknowledge = 0x2000;
inline constexpr std::uint16_t kWriteEnableError = 0x4000;
inline constexpr std::uint16_t kBusy = 0x8000;
inline constexpr std::uint16_t kErrorMask = 0x7800;
}  // namespace sii_control

// 0x0500 SII configuration.
namespace sii_config {
inline constexpr std::uint8_t kOfferedToPdi = 0x01;
inline constexpr std::uint8_t kForceEcat = 0x02;
}  // namespace sii_config

}  // namespace margay::wire
