#include "sim/register_file.hpp"

namespace margay::sim {

namespace {

using namespace access;
namespace reg = wire::reg;

constexpr unsigned kPlain = kRead;
constexpr unsigned kWritable = kRead | kEcatWrite;
constexpr unsigned kActing = kRead | kEcatWrite | kWriteEffect;

}  // namespace

void RegisterFile::add(wire::Register where, unsigned flags) {
    for (std::uint32_t a = where.address; a < where.end(); ++a) flags_[a] = static_cast<std::uint8_t>(flags);
}

// ESC data sheets, "Register overview".
void RegisterFile::lay_out(const EscDescription& esc, bool dc_enabled) {
    flags_.fill(0);
    add(reg::kDlInformation, kPlain);
    add(reg::kStationAddress, kActing);
    add(reg::kStationAlias, kRead | kPdiWrite | kWriteEffect);
    add(reg::kWriteRegisterEnable, kActing);
    add(reg::kWriteRegisterProtection, kActing);
    add(reg::kEscWriteEnable, kActing);
    add(reg::kEscWriteProtection, kActing);
    add(reg::kEscResetEcat, kActing);
    add(reg::kEscResetPdi, kRead | kPdiWrite | kWriteEffect);
    add(reg::kDlControl, kActing);
    add(reg::kPhysicalReadWriteOffset, kWritable);
    add(reg::kDlStatus, kRead | kReadEffect);
    add(reg::kAlControl, kActing | kReadEffect);
    add(reg::kAlStatus, kRead | kReadEffect | kPdiWrite | kWriteEffect);
    add(reg::kAlStatusCode, kRead | kPdiWrite);
    add(reg::kRunLedOverride, kWritable | kPdiWrite);
    add(reg::kErrLedOverride, kWritable | kPdiWrite);
    add(reg::kPdiControl, kPlain);
    add(reg::kEscConfiguration, kPlain);
    add(reg::kPdiInformation, kPlain);
    add(reg::kPdiConfiguration, kPlain);
    add(reg::kSyncLatchConfiguration, kPlain);
    add(reg::kExtendedPdiConfiguration, kPlain);
    add(reg::kEcatEventMask, kActing);
    add(reg::kAlEventMask, kRead | kPdiWrite | kWriteEffect);
    add(reg::kEcatEventRequest, kPlain);
    add(reg::kAlEventRequest, kRead | kDynamic);
    add(reg::kRxErrorCounter, kActing);
    add(reg::kForwardedRxErrorCounter, kActing);
    add(reg::kProcessingUnitErrorCounter, kActing);
    add(reg::kPdiErrorCounter, kActing);
    add(reg::kPdiErrorCode, kPlain);
    add(reg::kLostLinkCounter, kActing);
    add(reg::kWatchdogDivider, kActing);
    add(reg::kPdiWatchdogTime, kActing);
    add(reg::kProcessDataWatchdogTime, kActing);
    add(reg::kProcessDataWatchdogStatus, kRead | kDynamic | kReadEffect);
    add(reg::kProcessDataWatchdogCounter, kActing);
    add(reg::kPdiWatchdogCounter, kActing);
    add(reg::kSiiConfig, kActing);
    add(reg::kSiiPdiAccess, kRead | kPdiWrite | kWriteEffect);
    add(reg::kSiiControl, kActing | kPdiWrite | kDynamic);
    add(reg::kSiiAddress, kActing | kPdiWrite | kDynamic);
    add(reg::kSiiData, kActing | kPdiWrite | kDynamic);
    if (esc.mii_management) {
        for (const auto where : {reg::kMiiControl, reg::kMiiPhyAddress, reg::kMiiPhyRegister, reg::kMiiPhyData})
            add(where, kActing | kPdiWrite | kDynamic);
        add(reg::kMiiEcatAccess, kActing);
        add(reg::kMiiPdiAccess, kActing | kPdiWrite);
        add(reg::kMiiPortStatus, kRead | kDynamic);
    }
    for (unsigned n = 0; n < esc.fmmus; ++n) add(reg::fmmu(n), kActing);
    for (unsigned n = 0; n < esc.sync_managers; ++n) {
        const auto at = reg::sync_manager(n).address;
        add({at, 5}, kActing);
        add({static_cast<std::uint16_t>(at + 5), 1}, kRead | kDynamic);
        add({static_cast<std::uint16_t>(at + 6), 1}, kActing | kReadEffect);
        add({static_cast<std::uint16_t>(at + 7), 1}, kRead | kPdiWrite | kWriteEffect);
    }
    add_dc(esc, dc_enabled);
    add(reg::kProductId, kPlain);
    add(reg::kVendorId, kPlain);
    add({0x0F00, 4}, kWritable);              // digital output data
    add({0x0F10, 8}, kWritable | kPdiWrite);  // general purpose outputs
    add({0x0F18, 8}, kPlain);                 // general purpose inputs
    add({reg::kUserRam, 0x80}, kWritable | kPdiWrite);
}

void RegisterFile::add_dc(const EscDescription& esc, bool enabled) {
    if (esc.dc == DcUnit::none) return;
    add(reg::kPortReceiveTime, kPlain);
    add({reg::kPortReceiveTime.address, 4}, kActing);  // any write latches the receive times
    if (!enabled || esc.dc == DcUnit::receive_times) return;
    add(reg::kSystemTime, kActing | kDynamic);
    add(reg::kProcessingUnitReceiveTime, kPlain);
    add(reg::kSystemTimeOffset, kActing);
    add(reg::kSystemTimeDelay, kActing);
    add(reg::kSystemTimeDifference, kPlain);
    add(reg::kSpeedCounterStart, kActing);
    add(reg::kSpeedCounterDifference, kPlain);
    add(reg::kSystemTimeDifferenceFilter, kActing);
    add(reg::kSpeedCounterFilter, kActing);
    add(reg::kCyclicUnitControl, kWritable);  // selects which side may write the following registers
    add(reg::kSyncActivation, kActing | kPdiWrite);
    add(reg::kSyncPulseLength, kPlain);
    add(reg::kActivationStatus, kRead | kDynamic);
    add(reg::kSync0Status, kRead | kReadEffect | kPdiWrite | kWriteEffect);
    add(reg::kSync1Status, kRead | kReadEffect | kPdiWrite | kWriteEffect);
    for (const auto where : {reg::kSyncStartTime, reg::kSync0CycleTime, reg::kSync1CycleTime})
        add(where, kActing | kPdiWrite | kDynamic);
    add(reg::kNextSync1Pulse, kRead | kDynamic);
    for (const auto where : {reg::kLatch0Control, reg::kLatch1Control}) add(where, kActing | kPdiWrite);
    add(reg::kLatch0Status, kPlain);
    add(reg::kLatch1Status, kPlain);
    for (const auto where :
         {reg::kLatch0PositiveEdge, reg::kLatch0NegativeEdge, reg::kLatch1PositiveEdge, reg::kLatch1NegativeEdge})
        add(where, kRead | kReadEffect);
    for (const auto where : {reg::kEcatBufferChangeTime, reg::kPdiBufferStartTime, reg::kPdiBufferChangeTime})
        add(where, kRead | kDynamic);
}

}  // namespace margay::sim
