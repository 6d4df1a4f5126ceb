#include "wire/text.hpp"

#include "wire/esc.hpp"
#include "wire/fmmu.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>
#include <array>

namespace margay::wire {
namespace {

constexpr std::size_t kDataShown = 32;
constexpr std::size_t kAddressColumn = 34;  // "0x1001:0x0130 sync manager names"

struct RegisterName {
    Register at;
    std::string_view name;
};

// In ascending order of addresses.
constexpr RegisterName kNames[] = {
    {reg::kType, "type"},
    {reg::kRevision, "revision"},
    {reg::kBuild, "build"},
    {reg::kFmmuCount, "FMMU count"},
    {reg::kSyncManagerCount, "SM count"},
    {reg::kRamSize, "RAM size"},
    {reg::kPortDescriptor, "port descriptor"},
    {reg::kFeatures, "ESC features"},
    {reg::kStationAddress, "station address"},
    {reg::kStationAlias, "station alias"},
    {reg::kWriteRegisterEnable, "write register enable"},
    {reg::kWriteRegisterProtection, "write register protection"},
    {reg::kEscWriteEnable, "ESC write enable"},
    {reg::kEscWriteProtection, "ESC write protection"},
    {reg::kEscResetEcat, "ESC reset ECAT"},
    {reg::kEscResetPdi, "ESC reset PDI"},
    {reg::kDlControl, "DL control"},
    {reg::kPhysicalReadWriteOffset, "physical read/write offset"},
    {reg::kDlStatus, "DL status"},
    {reg::kAlControl, "AL control"},
    {reg::kAlStatus, "AL status"},
    {reg::kAlStatusCode, "AL status code"},
    {reg::kRunLedOverride, "RUN LED override"},
    {reg::kErrLedOverride, "ERR LED override"},
    {reg::kPdiControl, "PDI control"},
    {reg::kEscConfiguration, "ESC configuration"},
    {reg::kPdiInformation, "PDI information"},
    {reg::kPdiConfiguration, "PDI configuration"},
    {reg::kSyncLatchConfiguration, "SYNC/LATCH configuration"},
    {reg::kExtendedPdiConfiguration, "extended PDI configuration"},
    {reg::kEcatEventMask, "ECAT event mask"},
    {reg::kAlEventMask, "AL event mask"},
    {reg::kEcatEventRequest, "ECAT event request"},
    {reg::kAlEventRequest, "AL event request"},
    {reg::kRxErrorCounter, "RX error counter"},
    {reg::kForwardedRxErrorCounter, "forwarded RX error counter"},
    {reg::kProcessingUnitErrorCounter, "processing unit error counter"},
    {reg::kPdiErrorCounter, "PDI error counter"},
    {reg::kPdiErrorCode, "PDI error code"},
    {reg::kLostLinkCounter, "lost link counter"},
    {reg::kWatchdogDivider, "watchdog divider"},
    {reg::kPdiWatchdogTime, "PDI watchdog time"},
    {reg::kProcessDataWatchdogTime, "process data watchdog time"},
    {reg::kProcessDataWatchdogStatus, "process data watchdog status"},
    {reg::kProcessDataWatchdogCounter, "process data watchdog counter"},
    {reg::kPdiWatchdogCounter, "PDI watchdog counter"},
    {reg::kSiiConfig, "SII configuration"},
    {reg::kSiiPdiAccess, "SII PDI access"},
    {reg::kSiiControl, "SII control"},
    {reg::kSiiAddress, "SII address"},
    {reg::kSiiData, "SII data"},
    {reg::kMiiControl, "MII control"},
    {reg::kMiiPhyAddress, "PHY address"},
    {reg::kMiiPhyRegister, "PHY register"},
    {reg::kMiiPhyData, "PHY data"},
    {reg::kMiiEcatAccess, "MII ECAT access"},
    {reg::kMiiPdiAccess, "MII PDI access"},
    {reg::kMiiPortStatus, "PHY port status"},
    {reg::kPortReceiveTime, "port receive time"},
    {reg::kSystemTime, "system time"},
    {reg::kProcessingUnitReceiveTime, "processing unit receive time"},
    {reg::kSystemTimeOffset, "system time offset"},
    {reg::kSystemTimeDelay, "system time delay"},
    {reg::kSystemTimeDifference, "system time difference"},
    {reg::kSpeedCounterStart, "speed counter start"},
    {reg::kSpeedCounterDifference, "speed counter difference"},
    {reg::kSystemTimeDifferenceFilter, "system time difference filter"},
    {reg::kSpeedCounterFilter, "speed counter filter"},
    {reg::kCyclicUnitControl, "cyclic unit control"},
    {reg::kSyncActivation, "SYNC activation"},
    {reg::kSyncPulseLength, "SYNC pulse length"},
    {reg::kActivationStatus, "activation status"},
    {reg::kSync0Status, "SYNC0 status"},
    {reg::kSync1Status, "SYNC1 status"},
    {reg::kSyncStartTime, "SYNC start time"},
    {reg::kNextSync1Pulse, "next SYNC1 pulse"},
    {reg::kSync0CycleTime, "SYNC0 cycle time"},
    {reg::kSync1CycleTime, "SYNC1 cycle time"},
    {reg::kLatch0Control, "LATCH0 control"},
    {reg::kLatch1Control, "LATCH1 control"},
    {reg::kLatch0Status, "LATCH0 status"},
    {reg::kLatch1Status, "LATCH1 status"},
    {reg::kLatch0PositiveEdge, "LATCH0 positive edge"},
    {reg::kLatch0NegativeEdge, "LATCH0 negative edge"},
    {reg::kLatch1PositiveEdge, "LATCH1 positive edge"},
    {reg::kLatch1NegativeEdge, "LATCH1 negative edge"},
    {reg::kProductId, "product id"},
    {reg::kVendorId, "vendor id"},
};

constexpr bool in_order() {
    for (std::size_t i = 1; i < std::size(kNames); ++i)
        if (kNames[i].at.address < kNames[i - 1].at.end()) return false;
    return true;
}
static_assert(in_order());

constexpr std::uint16_t kMaxFmmus = 16;
constexpr std::uint16_t kMaxSyncManagers = 16;

struct Part {
    std::size_t offset;
    std::string_view name;
};
constexpr Part kSyncManagerParts[] = {
    {SyncManagerLayout::length::offset, "length"},           {SyncManagerLayout::control::offset, "control"},
    {SyncManagerLayout::status::offset, "status"},           {SyncManagerLayout::activate::offset, "activate"},
    {SyncManagerLayout::pdi_control::offset, "PDI control"},
};

void describe_array_element(TextWriter& to, std::string_view name, unsigned from_base, unsigned stride,
                            std::span<const Part> parts) {
    to << name << " " << std::uint64_t{from_base / stride};
    const auto offset = from_base % stride;
    if (offset == 0) return;
    for (const auto& part : parts)
        if (part.offset == offset) {
            to << " " << part.name;
            return;
        }
    to << " +" << std::uint64_t{offset};
}

void put_adp(TextWriter& to, const DatagramHeader& header) {
    const auto adp = header.address.adp();
    if (!counts_position(header.command)) {
        to.hex(adp, 4);
        return;
    }
    // Signed, because the slaves increment the position: a request with -2 is for the third slave.
    const auto value = static_cast<std::int16_t>(adp);
    if (value < 0) to << "-";
    to << static_cast<std::uint64_t>(value < 0 ? -value : value);
}

void pad_to(TextWriter& to, std::size_t column) {
    while (to.text().size() < column) {
        const auto before = to.text().size();
        to << " ";
        if (to.text().size() == before) return;  // the buffer is full
    }
}

}  // namespace

std::string_view to_text(Command command) {
    constexpr std::string_view names[] = {"NOP", "APRD", "APWR", "APRW", "FPRD", "FPWR", "FPRW", "BRD",
                                          "BWR", "BRW",  "LRD",  "LWR",  "LRW",  "ARMW", "FRMW"};
    static_assert(std::size(names) == kLastCommand + 1);
    const auto number = static_cast<std::size_t>(command);
    return number < std::size(names) ? names[number] : "unknown";
}

std::string_view to_text(FrameFault fault) {
    switch (fault) {
        case FrameFault::none: return "no fault";
        case FrameFault::too_short: return "too short for the headers";
        case FrameFault::foreign: return "not a frame of EtherCAT datagrams";
        case FrameFault::truncated: return "a length points past the end";
        case FrameFault::trailing: return "the last datagram ends before the frame does";
    }
    return "unknown fault";
}

void describe_register(TextWriter& to, std::uint16_t address) {
    if (address >= reg::kProcessRam) {
        to << "process RAM";
        return;
    }
    if (address >= reg::kUserRam) {
        to << "user RAM";
        return;
    }
    if (address >= reg::kFmmuBase && address < reg::kFmmuBase + kMaxFmmus * reg::kFmmuStride)
        return describe_array_element(to, "FMMU", address - unsigned{reg::kFmmuBase}, reg::kFmmuStride, {});
    if (address >= reg::kSyncManagerBase &&
        address < reg::kSyncManagerBase + kMaxSyncManagers * reg::kSyncManagerStride)
        return describe_array_element(to, "SM", address - unsigned{reg::kSyncManagerBase}, reg::kSyncManagerStride,
                                      kSyncManagerParts);
    const auto behind = std::upper_bound(std::begin(kNames), std::end(kNames), address,
                                         [](std::uint16_t a, const RegisterName& r) { return a < r.at.address; });
    if (behind == std::begin(kNames)) return;
    const auto& found = *(behind - 1);
    if (address >= found.at.end()) return;
    to << found.name;
    if (address > found.at.address) to << " +" << std::uint64_t{static_cast<unsigned>(address - found.at.address)};
}

void describe_request(TextWriter& to, const DatagramHeader& header) {
    to << to_text(header.command) << " ";
    if (is_logical(header.command)) {
        to << "logical ";
        to.hex(header.address.value, 8);
    } else {
        const bool position =
            header.command == Command::ARMW || (header.command >= Command::APRD && header.command <= Command::APRW);
        if (position)
            to << "position " << std::uint64_t{static_cast<std::uint16_t>(-header.address.adp())} << " ";
        else if (!counts_position(header.command))
            to.hex(header.address.adp(), 4) << " ";
        const auto before = to.text().size();
        describe_register(to, header.address.ado());
        if (to.text().size() != before) to << " ";
        to << "(";
        to.hex(header.address.ado(), 4) << ")";
    }
    to << ", " << std::uint64_t{header.length} << (header.length == 1 ? " octet" : " octets");
}

std::string_view describe(const DatagramView& datagram, std::span<char> out) {
    TextWriter text(out);
    const auto& header = datagram.header;
    text.hex(header.index, 2) << " ";
    if (static_cast<std::uint8_t>(header.command) <= kLastCommand)
        text << to_text(header.command);
    else
        text << "?" << std::uint64_t{static_cast<std::uint8_t>(header.command)};
    pad_to(text, 10);
    if (is_logical(header.command)) {
        text.hex(header.address.value, 8);
    } else {
        put_adp(text, header);
        text << ":";
        text.hex(header.address.ado(), 4) << " ";
        describe_register(text, header.address.ado());
    }
    pad_to(text, 10 + kAddressColumn);
    text << " n" << std::uint64_t{header.length} << " wkc " << std::uint64_t{datagram.wkc};
    if (header.irq != 0) {
        text << " irq ";
        text.hex(header.irq, 4);
    }
    if (header.circulating) text << " circulating";
    text << " :";
    constexpr std::string_view digits = "0123456789abcdef";
    for (const auto octet : datagram.data.first(std::min(datagram.data.size(), kDataShown))) {
        const auto value = std::to_integer<unsigned>(octet);
        const char shown[] = {' ', digits[value >> 4], digits[value & 15]};
        text << std::string_view(shown, sizeof shown);
    }
    if (datagram.data.size() > kDataShown) text << " …";
    return text.text();
}

}  // namespace margay::wire
