#include "sim/esc.hpp"

#include "sim/events.hpp"

#include <algorithm>

namespace margay::sim {

namespace reg = wire::reg;

namespace {

constexpr std::uint8_t kPdiDigitalIo = 0x04;
constexpr Duration kLeastStep = std::chrono::microseconds(1);  // minimum time between two steps of a program

}  // namespace

Esc::Esc(const EscDescription& description, std::vector<std::byte> sii)
    : firmware_latency_(description.firmware_latency),
      ram_(std::size_t{description.ram_kib} * 1024),
      description_(description),
      sii_(std::move(sii)) {
    description_.fmmus = std::min<std::uint8_t>(description_.fmmus, kMaxFmmus);
    description_.sync_managers = std::min<std::uint8_t>(description_.sync_managers, kMaxSyncManagers);
    registers_.lay_out(description_, false);
}

void Esc::power_up(Time now) {
    now_ = now;
    std::fill(ram_.begin(), ram_.end(), std::byte{0});
    writes_ = write_bytes_used_ = 0;
    effects_ = 0;
    end_expected_ = false;
    reset_step_ = {};
    reset_wanted_ = halted_ = false;
    al_control_unread_ = register_writes_enabled_ = esc_writes_enabled_ = false;
    alias_enabled_ = protected_ = false;
    irq_ = 0;
    al_events_ = 0;
    activations_ = 0;
    pulse_ends_ = {kNever, kNever};
    buffer_times_ = {kNever, kNever, kNever};
    link_bits_ = 0;
    loops_end_ = kNever;
    lasting_loops_ = 0;
    power_up_registers();
    al_mask_ = registers_.get<std::uint32_t>(reg::kAlEventMask.address);
    ++loops_written_;
    ++configuration_;
    sync_managers_.power_up(registers_, description_.sync_managers, static_cast<std::uint32_t>(ram_.size()));
    const bool loaded = sii_.power_up(registers_, description_.sii);
    lay_out();
    mii_.power_up(registers_, description_);
    watchdogs_.power_up(registers_, registers_.get<std::uint8_t>(reg::kPdiControl.address) != 0, now);
    clock_.power_up(registers_, description_.clock, description_.dc == DcUnit::bits64, now);
    sync_.power_up(registers_, clock_,
                   {.enhanced = (description_.features & wire::features::kEnhancedSyncActivation) != 0,
                    .wide = description_.dc == DcUnit::bits64});
    reload_mappings();
    firmware_due_ = kNever;
    pdi_operational_ = false;
    if (loaded || description_.sii.emulated) start_pdi(now);
    schedule();
}

// ESC data sheets, "SII EEPROM" and DL status bit 0: the PDI works after the EEPROM was loaded with a correct checksum,
// at power-up or by a reload command. Before that, no program can access the ESC, and PDI control and device emulation
// are 0. No side answers to AL control: the AL status stays INIT, and AL control accepts only the first write.
// Registers and memory work from the EtherCAT side. (With EEPROM emulation the PDI works from power-up on.)
void Esc::start_pdi(Time now) {
    pdi_operational_ = true;
    if (!firmware_) return;
    firmware_->start(*this, now);
    firmware_due_ = firmware_->step(now);
    if (!firmware_polls_ && interrupt_active()) wake_firmware(now);
}

void Esc::interrupt(Time now) {
    wake_firmware(now);
    schedule();
}

void Esc::power_up_registers() {
    registers_.clear();
    registers_.set(reg::kType.address, description_.type);
    registers_.set(reg::kRevision.address, description_.revision);
    registers_.set(reg::kBuild.address, description_.build);
    registers_.set(reg::kFmmuCount.address, description_.fmmus);
    registers_.set(reg::kSyncManagerCount.address, description_.sync_managers);
    registers_.set(reg::kRamSize.address, description_.ram_kib);
    registers_.set(reg::kPortDescriptor.address, description_.port_descriptor());
    registers_.set(reg::kFeatures.address, description_.features);
    // Frames that are not EtherCAT are destroyed, loops are automatic, FIFO size is maximum.
    registers_.set<std::uint32_t>(reg::kDlControl.address, description_.without_ebus() ? 0x00070001u : 0x00C70001u);
    registers_.set<std::uint16_t>(reg::kAlControl.address, 0x0001);
    registers_.set<std::uint16_t>(reg::kAlStatus.address, 0x0001);
    registers_.set<std::uint32_t>(reg::kAlEventMask.address, 0x00FFFF0F);
    registers_.set<std::uint16_t>(reg::kWatchdogDivider.address, 0x09C2);
    registers_.set<std::uint16_t>(reg::kPdiWatchdogTime.address, 0x03E8);
    registers_.set<std::uint16_t>(reg::kProcessDataWatchdogTime.address, 0x03E8);
    registers_.set(reg::kProductId.address, description_.product_id);
    registers_.set(reg::kVendorId.address, description_.vendor_id);
}

void Esc::lay_out() {
    const auto configured = registers_.get<std::uint8_t>(reg::kEscConfiguration.address);
    const bool units_on =
        (configured & (wire::esc_configuration::kDcSyncUnit | wire::esc_configuration::kDcLatchUnit)) != 0;
    dc_on_ = description_.dc >= DcUnit::bits32 && (units_on || !description_.dc_needs_enable);
    registers_.lay_out(description_, dc_on_);
}

void Esc::set_dl_status(std::uint16_t link_bits) {
    link_bits_ = link_bits;
    update_dl_status();
}

// This function creates the bits of 0x0110 that belong to the chip; the segment creates the bits of the ports.
void Esc::update_dl_status() {
    unsigned status = link_bits_;
    const auto sii_status = registers_.get<std::uint16_t>(reg::kSiiControl.address);
    if ((sii_status & wire::sii_control::kNotLoaded) == 0) status |= wire::dl_status::kPdiOperational;
    if (watchdogs_.pdi_alive()) status |= wire::dl_status::kPdiWatchdog;
    if ((registers_.get<std::uint8_t>(reg::kEscConfiguration.address) &
         wire::esc_configuration::kEnhancedLinkDetectionAllPorts) != 0)
        status |= wire::dl_status::kEnhancedLinkDetection;
    const auto was = registers_.get<std::uint16_t>(reg::kDlStatus.address);
    registers_.set(reg::kDlStatus.address, static_cast<std::uint16_t>(status));
    if ((was ^ status) > 0x000F) change_ecat_events(ecat_event::kDlStatus, 0);
}

void Esc::count(std::uint32_t address) {
    auto& counter = registers_.bytes()[address];
    if (counter != std::byte{0xFF}) counter = static_cast<std::byte>(std::to_integer<unsigned>(counter) + 1);
}

void Esc::count_rx_error(unsigned port, bool forwarded) {
    count(forwarded ? reg::kForwardedRxErrorCounter.address + port : reg::kRxErrorCounter.address + 2 * port);
}

void Esc::count_lost_link(unsigned port) { count(reg::kLostLinkCounter.address + port); }

void Esc::count_processing_error() { count(reg::kProcessingUnitErrorCounter.address); }

void Esc::schedule() {
    others_due_ = std::min(
        {watchdogs_.next(), sync_.next(), loops_end_, pulse_ends_[0], pulse_ends_[1], reset_wanted_ ? now_ : kNever});
    *next_event_ = std::min(firmware_due_, others_due_);
}

void Esc::keep_next_event_in(Time* place) {
    auto* const to = place != nullptr ? place : &own_next_event_;
    *to = *next_event_;
    next_event_ = to;
}

// Advances the units that change with time, without a frame, to now_.
void Esc::advance_units() {
    end_temporary_loops();
    const auto expired = watchdogs_.settle(now_);
    if (expired.process_data) {
        set_al_events(wire::al_event::kWatchdog, now_);
        // Without a processor, the chip itself resets digital outputs.
        if (registers_.get<std::uint8_t>(reg::kPdiControl.address) == kPdiDigitalIo)
            registers_.set<std::uint32_t>(0x0F00, 0);
    }
    if (expired.pdi) update_dl_status();
    end_sync_pulses();
    if (const auto pulses = sync_.settle(now_); pulses != 0) set_sync_events(pulses, now_);
}

void Esc::advance(Time now) {
    while (*next_event_ <= now) {
        ++work_;
        now_ = std::max(now_, *next_event_);
        if (reset_wanted_) return power_up(now_);
        const bool units = others_due_ <= now_;
        if (units) advance_units();
        if (firmware_due_ <= now_ && firmware_ && !halted_) {
            firmware_due_ = kNever;
            const auto wanted = firmware_->step(now_);
            firmware_due_ = std::min(firmware_due_, wanted);
            if (!firmware_polls_ && interrupt_active()) wake_firmware(now_);  // the level of the line matters
            firmware_due_ = std::max(firmware_due_, now_ + kLeastStep);       // time must advance
        }
        if (units)
            schedule();
        else
            *next_event_ = std::min(firmware_due_, others_due_);
    }
    now_ = std::max(now_, now);
}

void Esc::latch(unsigned input, bool rising, Time at) {
    if (!dc_on_ || input > 1) return;
    const auto events = sync_.latch(input, rising, at);
    if (events.al != 0) set_al_events(events.al, at);
    if (events.ecat_latch) change_ecat_events(ecat_event::kLatch, 0);
    schedule();
}

void Esc::halt_firmware(Time now) {
    halted_ = true;
    firmware_due_ = kNever;
    watchdogs_.processor_halted(now);
    schedule();
}

void Esc::set_drift(std::int32_t ppb, Time now) {
    clock_.set_drift(ppb, now);
    sync_.clock_changed(now);
    schedule();
}

void Esc::set_al_events(std::uint32_t bits, Time at) {
    if ((al_events_ | bits) == al_events_) return;
    al_events_ |= bits;
    if (firmware_polls_ || (bits & al_mask_) != 0) wake_firmware(at);
}

// ESC data sheets, register 0x0220 bits 2 and 3: the state of the SYNC signals, where register 0x0151 maps them. In
// acknowledge mode (0x0982 is 0) the state stays until the PDI reads 0x098E or 0x098F, otherwise as long as the pulse.
void Esc::set_sync_events(std::uint32_t pulses, Time at) {
    const auto configured = registers_.get<std::uint8_t>(reg::kSyncLatchConfiguration.address);
    const auto pulse = std::chrono::nanoseconds(10) * registers_.get<std::uint16_t>(reg::kSyncPulseLength.address);
    constexpr std::array<std::uint8_t, 2> kMapped{wire::sync_latch::kSync0Event, wire::sync_latch::kSync1Event};
    constexpr std::array<std::uint32_t, 2> kEvents{wire::al_event::kDcSync0, wire::al_event::kDcSync1};
    for (std::size_t signal = 0; signal < 2; ++signal) {
        if ((pulses & kEvents[signal]) == 0 || (configured & kMapped[signal]) == 0) continue;
        if (pulse != Duration::zero()) pulse_ends_[signal] = at + pulse;
        set_al_events(kEvents[signal], at);
    }
}

void Esc::end_sync_pulses() {
    constexpr std::array<std::uint32_t, 2> kEvents{wire::al_event::kDcSync0, wire::al_event::kDcSync1};
    for (std::size_t signal = 0; signal < 2; ++signal) {
        if (pulse_ends_[signal] > now_) continue;
        pulse_ends_[signal] = kNever;
        clear_al_events(kEvents[signal]);
    }
}

void Esc::wake_firmware(Time at) {
    if (!firmware_ || halted_ || !pdi_operational_) return;
    firmware_due_ = std::min(firmware_due_, at + firmware_latency_);
    *next_event_ = std::min(*next_event_, firmware_due_);
}

void Esc::clear_al_events(std::uint32_t bits) { al_events_ &= ~bits; }

void Esc::change_ecat_events(std::uint16_t set, std::uint16_t clear) {
    const auto request =
        static_cast<std::uint16_t>((registers_.get<std::uint16_t>(reg::kEcatEventRequest.address) & ~clear) | set);
    registers_.set(reg::kEcatEventRequest.address, request);
    const auto irq = static_cast<std::uint16_t>(request & registers_.get<std::uint16_t>(reg::kEcatEventMask.address));
    if (irq == irq_) return;
    irq_ = irq;
    ++configuration_;
}

void Esc::carry_out(const SyncManagers::Events& events, Time at) {
    if (events.watchdog) {  // an event that is due too early has no effect
        watchdogs_.feed_process_data(at);
        others_due_ = std::min(others_due_, watchdogs_.next());
        *next_event_ = std::min(*next_event_, others_due_);
    }
    if (events.al_clear != 0) clear_al_events(events.al_clear);
    if (events.al_set != 0) set_al_events(events.al_set, at);
    if (events.arrived && firmware_polls_) wake_firmware(at);
    if (events.pdi_start) buffer_times_[1] = at;
    if (events.pdi_change) buffer_times_[2] = at;
    if ((events.ecat_set | events.ecat_clear) != 0) change_ecat_events(events.ecat_set, events.ecat_clear);
}

// ESC data sheets, "PDI watchdog": each access of the processor triggers it.
void Esc::feed_pdi_watchdog() {
    if (watchdogs_.feed_pdi(now_)) update_dl_status();
    others_due_ = std::min(others_due_, watchdogs_.next());
    *next_event_ = std::min(*next_event_, others_due_);
}

// The AL event request, which every step of a program reads, has no owner and no effect.
void Esc::read(std::uint16_t address, MutableBytes into) noexcept {
    if (accesses_feed_) feed_pdi_watchdog();
    if (address == reg::kAlEventRequest.address && into.size() == sizeof al_events_)
        return store_le(into, 0, al_events_);
    (void)access(Side::pdi, false, address, into.data(), into.size(), now_);
}

void Esc::write(std::uint16_t address, Bytes data) noexcept {
    if (accesses_feed_) feed_pdi_watchdog();
    // access() handles both directions and does not change the data of a write.
    (void)access(Side::pdi, true, address, const_cast<std::byte*>(data.data()), data.size(), now_);
}

}  // namespace margay::sim
