// Esc: the effects of register reads and writes.
#include "sim/esc.hpp"

#include "sim/events.hpp"
#include "wire/sync_manager.hpp"

#include <algorithm>
#include <bit>
#include <utility>

namespace margay::sim {

namespace {

namespace reg = wire::reg;

struct Range {
    std::uint32_t begin;
    std::uint32_t end;
    [[nodiscard]] bool covers(std::uint32_t address) const { return begin <= address && address < end; }
    [[nodiscard]] bool meets(wire::Register r) const { return begin < r.end() && r.address < end; }
    [[nodiscard]] bool meets(std::uint32_t from, std::uint32_t to) const { return begin < to && from < end; }
};

// Accesses by the master that have an effect at the end of the frame.
enum Effect : std::uint16_t {
    kDlStatusRead = 1,
    kAlStatusRead = 2,
    kReceiveTimes = 4,
    kCompare = 8,
    kLatchRead = 16  // and the next three bits: the edges in the order of their registers
};

constexpr std::uint16_t latch_time(unsigned edge) {
    return static_cast<std::uint16_t>(reg::kLatch0PositiveEdge.address + 8 * edge);
}

constexpr std::uint32_t kFmmuArea = reg::kFmmuBase;
constexpr std::uint32_t kSyncManagerArea = reg::kSyncManagerBase;

}  // namespace

void Esc::frame_end(const FrameEnd& end) {
    const bool good = end.good;
    const Time at = end.at;
    now_ = std::max(now_, at);
    end_expected_ = false;
    const auto effects = std::exchange(effects_, std::uint16_t{0});
    if (good)
        for (std::size_t i = 0; i < writes_; ++i) apply_write(write_list_[i], end);
    writes_ = write_bytes_used_ = 0;
    register_writes_enabled_ = esc_writes_enabled_ = false;
    if (good && (effects & kDlStatusRead) != 0) change_ecat_events(0, ecat_event::kDlStatus);
    if (good && (effects & kAlStatusRead) != 0) change_ecat_events(0, ecat_event::kAlStatus);
    if (good && effects >= kLatchRead) latches_read(effects / kLatchRead);
    // Set by the register writes above.
    if (const auto wanted = std::exchange(effects_, std::uint16_t{0}); wanted != 0) {
        if ((wanted & kReceiveTimes) != 0) latch_receive_times(end);
        if ((wanted & kCompare) != 0) {
            clock_.compare(compare_with_, end.processing);
            sync_.clock_changed(at);
            schedule();
        }
    }
    if (sync_managers_.frame_pending()) {
        SyncManagers::Events events;
        sync_managers_.frame_end(good, events);
        if (good) buffer_times_[0] = end.processing;
        handle(events, at);
    }
}

// Reading the time of an edge enables the latch for the next edge.
void Esc::latches_read(unsigned edges) {
    bool cleared = false;
    for (unsigned edge = 0; edge < 4; ++edge)
        if ((edges >> edge & 1) != 0) cleared = sync_.was_read(latch_time(edge), 8, false).ecat_latch;
    if (cleared) change_ecat_events(0, ecat_event::kLatch);
}

// Executes one write of the shadow buffer: copies the octets that are writable into the registers.
void Esc::apply_write(const Write& write, const FrameEnd& end) {
    const Time at = end.at;
    const Range range{write.address, static_cast<std::uint32_t>(write.address) + write.length};
    // The state of the EEPROM (busy or not) is that of the time when the frame passes, so that reads and writes in one
    // frame match.
    if (range.meets(reg::kSiiConfig.address, reg::kSiiData.end())) settle_sii(end.processing);
    const bool sii_free = sii_.accepts(false);
    bool effect = false;
    for (std::uint32_t a = range.begin; a < range.end; ++a) {
        const auto flags = registers_.flags(a);
        if ((flags & access::kEcatWrite) == 0) continue;
        if (a >= kSyncManagerArea && a < kSyncManagerArea + kMaxSyncManagers * reg::kSyncManagerStride) {
            const auto n = (a - kSyncManagerArea) / reg::kSyncManagerStride;
            if (a % reg::kSyncManagerStride < 5 && sync_managers_.locked(n)) continue;
        }
        if (a >= reg::kSiiControl.address && a < reg::kSiiData.end() && !sii_free) continue;
        if (a >= reg::kAlControl.address && a < reg::kAlControl.end() && al_control_unread_) continue;
        if (sync_registers_are_pdis(a)) continue;
        if (a >= reg::kSystemTime.address && a < reg::kSystemTime.end() && dc_on_) {  // compared, not stored
            if (a == reg::kSystemTime.address) compare_with_ = 0;
            if (a < reg::kSystemTime.address + 4u)
                compare_with_ |= std::to_integer<std::uint32_t>(write_bytes_[write.offset + (a - range.begin)])
                                 << (8 * (a - reg::kSystemTime.address));
            effect = true;
            continue;
        }
        registers_.bytes()[a] = write_bytes_[write.offset + (a - range.begin)];
        effect |= (flags & access::kWriteEffect) != 0;
    }
    if (effect) written(range.begin, write.length, false, at);
}

void Esc::written(std::uint32_t address, std::size_t length, bool from_pdi, Time at) {
    const Range range{address, static_cast<std::uint32_t>(address + length)};
    if (range.meets(reg::kStationAddress) || range.meets(reg::kStationAlias)) ++configuration_;
    if (range.meets(reg::kWriteRegisterProtection) || range.meets(reg::kEscWriteProtection))
        protected_ = ((registers_.get<std::uint8_t>(reg::kWriteRegisterProtection.address) |
                       registers_.get<std::uint8_t>(reg::kEscWriteProtection.address)) &
                      1) != 0;
    if (range.meets(reg::kDlControl)) {
        alias_enabled_ = (registers_.get<std::uint32_t>(reg::kDlControl.address) & 0x01000000) != 0;
        temporary_loops(at);
        ++loops_written_;
        ++configuration_;
    }
    if (!from_pdi && range.covers(reg::kAlControl.address)) {
        al_control_written();
        set_al_events(wire::al_event::kAlControl, at);
    }
    if (from_pdi && range.covers(reg::kAlStatus.address)) change_ecat_events(ecat_event::kAlStatus, 0);
    if (range.meets(reg::kEcatEventMask)) change_ecat_events(0, 0);
    if (from_pdi && range.meets(reg::kAlEventMask)) {
        al_mask_ = registers_.get<std::uint32_t>(reg::kAlEventMask.address);
        if (interrupt_active()) wake_firmware(at);
    }
    const auto clear = [&](std::uint32_t from, std::uint32_t to) {
        if (!from_pdi && range.meets(from, to))
            std::fill(registers_.bytes().begin() + from, registers_.bytes().begin() + to, std::byte{0});
    };
    clear(0x0300, 0x030C);
    clear(0x030C, 0x030D);
    clear(0x030D, 0x030E);
    clear(0x0310, 0x0314);
    clear(0x0442, 0x0444);
    if (range.meets(reg::kSiiConfig.address, reg::kSiiData.end())) {
        sii_.written(static_cast<std::uint16_t>(address), length, from_pdi, at);
        if (sii_.waits_for_pdi())
            set_al_events(wire::al_event::kEeprom, at);
        else
            clear_al_events(wire::al_event::kEeprom);
        if (from_pdi) settle_sii(at);  // a reload by the firmware
    }
    if (range.meets(0x0400, 0x0444)) written_watchdog(address, length, at);
    if (range.meets(0x0510, 0x0518)) mii_.written(address, length, from_pdi, at);
    if (range.meets(0x0900, 0x0A00)) written_dc(address, length, at);
    if (range.covers(from_pdi ? reg::kEscResetPdi.address : reg::kEscResetEcat.address)) reset_written(from_pdi, at);
    if (range.meets(kFmmuArea, kFmmuArea + kMaxFmmus * reg::kFmmuStride)) reload_mappings();
    if (range.meets(kSyncManagerArea, kSyncManagerArea + kMaxSyncManagers * reg::kSyncManagerStride)) {
        for (unsigned n = 0; n < description_.sync_managers; ++n) {
            const auto channel = reg::sync_manager(n);
            if (!range.meets(channel)) continue;
            if (sync_managers_.reconfigure(n)) {
                clear_al_events(wire::al_event::sync_manager(n));
                change_ecat_events(0, ecat_event::sync_manager(n));
            }
            if (!from_pdi && range.covers(channel.address + wire::SyncManagerLayout::activate::offset)) {
                activations_ |= 1u << n;
                set_al_events(wire::al_event::kSmActivation, at);
            }
        }
        link_mappings();
        watchdogs_.set_fed(sync_managers_.feeds_watchdog(), at);
        schedule();
    }
}

// 0x0100 bit 1: the loop settings of this write are valid for about one second; then the previous settings are
// restored.
void Esc::temporary_loops(Time at) {
    const bool temporary = (registers_.get<std::uint8_t>(reg::kDlControl.address) & 0x02) != 0;
    const auto loops = registers_.get<std::uint8_t>(reg::kDlControl.address + 1);
    if (!temporary) {
        loops_end_ = kNever;
        lasting_loops_ = loops;
    } else {
        loops_end_ = at + std::chrono::seconds(1);
    }
    schedule();
}

void Esc::end_temporary_loops() {
    if (loops_end_ > now_) return;
    loops_end_ = kNever;
    auto& control = registers_.bytes()[reg::kDlControl.address];
    control &= ~std::byte{0x02};
    registers_.set(reg::kDlControl.address + 1, lasting_loops_);
    ++loops_written_;
    ++configuration_;
}

// 0x0980 bit 0: the PDI, not the master, controls the SYNC registers; bits 4 and 5: the same for latch inputs 0 and 1.
bool Esc::sync_registers_are_pdis(std::uint32_t address) const {
    if (!dc_on_ || address <= reg::kCyclicUnitControl.address || address >= reg::kLatch0Status.address) return false;
    const auto control = registers_.get<std::uint8_t>(reg::kCyclicUnitControl.address);
    const unsigned bit = address == reg::kLatch0Control.address ? 4 : address == reg::kLatch1Control.address ? 5 : 0;
    return (control >> bit & 1) != 0;
}

// ETG.1000.4 "AL control": with device emulation, AL status follows AL control automatically. Otherwise AL control
// cannot be written again until the PDI has read it.
void Esc::al_control_written() {
    const auto configured = registers_.get<std::uint8_t>(reg::kEscConfiguration.address);
    if ((configured & wire::esc_configuration::kDeviceEmulation) == 0) {
        al_control_unread_ = firmware_ != nullptr;
        return;
    }
    const auto requested = registers_.get<std::uint16_t>(reg::kAlControl.address);
    registers_.set(reg::kAlStatus.address, static_cast<std::uint16_t>(requested & 0x001F));
    change_ecat_events(ecat_event::kAlStatus, 0);
}

void Esc::was_read(std::uint32_t address, std::size_t length, Side side) {
    const Range range{address, static_cast<std::uint32_t>(address + length)};
    if (side == Side::ecat) {
        if (range.meets(reg::kDlStatus)) effects_ |= kDlStatusRead;
        if (range.meets(reg::kAlStatus)) effects_ |= kAlStatusRead;
        for (unsigned edge = 0; edge < 4; ++edge)
            if (range.meets({latch_time(edge), 8}))
                effects_ = static_cast<std::uint16_t>(effects_ | kLatchRead << edge);
        return;
    }
    if (range.meets(reg::kAlControl)) {
        al_control_unread_ = false;
        clear_al_events(wire::al_event::kAlControl);
    }
    // Assumed as the data sheets do not say it: each channel that was changed must be read.
    for (auto left = activations_; left != 0; left &= left - 1) {
        const auto n = static_cast<unsigned>(std::countr_zero(left));
        if (range.covers(reg::sync_manager(n).address + wire::SyncManagerLayout::activate::offset))
            activations_ &= ~(1u << n);
    }
    if (activations_ == 0) clear_al_events(wire::al_event::kSmActivation);
    if (range.meets(reg::kProcessDataWatchdogStatus)) clear_al_events(wire::al_event::kWatchdog);
    if (dc_on_ && range.meets(reg::kSync0Status.address, reg::kLatch1NegativeEdge.end()))
        clear_al_events(sync_.was_read(address, length, true).al);
}

void Esc::refresh(std::uint32_t address, std::size_t length, Side side, Time at) {
    const Range range{address, static_cast<std::uint32_t>(address + length)};
    if (range.meets(reg::kSiiControl.address, reg::kSiiData.end())) settle_sii(at);
    if (range.meets(reg::kMiiControl.address, reg::kMiiPortStatus.end())) mii_.settle(at);
    if (range.meets(reg::kProcessDataWatchdogStatus)) {
        if (watchdogs_.settle(at).process_data) set_al_events(wire::al_event::kWatchdog, at);
        schedule();
    }
    if (range.meets(reg::kAlEventRequest)) registers_.set(reg::kAlEventRequest.address, al_events_);
    if (range.meets(kSyncManagerArea, kSyncManagerArea + kMaxSyncManagers * reg::kSyncManagerStride))
        sync_managers_.settle();
    if (!dc_on_) return;
    if (range.meets(reg::kSystemTime)) {
        // The master reads the copy of the time when the frame passed the reference clock; the PDI reads the present
        // copy.
        const auto time = side == Side::ecat ? clock_.system(at) : clock_.copy(at);
        registers_.set(reg::kSystemTime.address, time);
    }
    if (range.meets(reg::kSyncStartTime.address, reg::kNextSync1Pulse.end())) sync_.refresh();
    constexpr std::array kBufferTimes{reg::kEcatBufferChangeTime, reg::kPdiBufferStartTime, reg::kPdiBufferChangeTime};
    for (std::size_t n = 0; n < kBufferTimes.size(); ++n)
        if (range.meets(kBufferTimes[n]) && buffer_times_[n] != kNever)
            registers_.set(kBufferTimes[n].address, static_cast<std::uint32_t>(clock_.local(buffer_times_[n])));
}

void Esc::settle_sii(Time at) {
    (void)sii_.settle(at);
    if (!sii_.reset_reloaded()) return;
    lay_out();
    if (!pdi_operational_) start_pdi(at);
    update_dl_status();
    schedule();
}

void Esc::written_watchdog(std::uint32_t address, std::size_t length, Time at) {
    const Range range{address, static_cast<std::uint32_t>(address + length)};
    if (!range.meets(reg::kWatchdogDivider) && !range.meets(reg::kPdiWatchdogTime) &&
        !range.meets(reg::kProcessDataWatchdogTime))
        return;
    watchdogs_.reconfigure(at);
    schedule();
}

void Esc::written_dc(std::uint32_t address, std::size_t length, Time at) {
    const Range range{address, static_cast<std::uint32_t>(address + length)};
    if (range.meets(0x0900, 0x0904)) effects_ |= kReceiveTimes;
    if (!dc_on_) return;
    if (range.covers(reg::kSystemTime.address)) effects_ |= kCompare;
    if (range.meets(reg::kSystemTimeOffset.address, reg::kSystemTimeDelay.end())) {
        clock_.reconfigure();
        sync_.clock_changed(at);
    }
    if (range.meets(reg::kSpeedCounterStart)) {
        clock_.reset_loop(at);
        sync_.clock_changed(at);
    }
    if (range.meets(reg::kSystemTimeDifferenceFilter)) clock_.reset_difference();
    if (range.meets(reg::kSyncActivation) || range.meets(reg::kSyncStartTime))
        set_sync_events(sync_.written(address, length, at), at);
    schedule();
}

// A write to the first receive time register latches the arrival time of this frame at each port and at the processing
// unit (ETG.1000.4 "Distributed clock local time parameter"). A port at which the frame did not arrive keeps its value.
void Esc::latch_receive_times(const FrameEnd& end) {
    for (unsigned p = 0; p < kMaxPorts; ++p)
        if (end.ports[p] != kNever)
            registers_.set(static_cast<std::uint16_t>(reg::kPortReceiveTime.address + 4 * p),
                           static_cast<std::uint32_t>(clock_.stamp(end.ports[p])));
    if (!dc_on_) return;
    // A frame that arrives at port 0 has one time.
    auto received = clock_.stamp(end.processing);
    if (end.ports[0] != kNever) {
        const auto low = registers_.get<std::uint32_t>(reg::kPortReceiveTime.address);
        received += static_cast<std::uint64_t>(
            std::int64_t{static_cast<std::int32_t>(low - static_cast<std::uint32_t>(received))});
    }
    registers_.set(reg::kProcessingUnitReceiveTime.address,
                   description_.dc == DcUnit::bits64 ? received : received & 0xFFFFFFFF);
}

// "RES", one letter per frame, resets the chip (ESC data sheets, "ESC reset"). A read shows the number of accepted
// letters.
void Esc::reset_written(bool from_pdi, Time at) {
    constexpr std::array<std::uint8_t, 3> kLetters{0x52, 0x45, 0x53};
    const auto address = from_pdi ? reg::kEscResetPdi.address : reg::kEscResetEcat.address;
    const auto letter = registers_.get<std::uint8_t>(address);
    auto& step = reset_step_[from_pdi ? 1 : 0];
    step = letter == kLetters[step] ? static_cast<std::uint8_t>(step + 1)
           : letter == kLetters[0]  ? std::uint8_t{1}
                                    : std::uint8_t{0};
    registers_.set(address, step);
    if (step < kLetters.size()) return;
    step = 0;
    reset_wanted_ = true;
    now_ = std::max(now_, at);
    schedule();
}

}  // namespace margay::sim
