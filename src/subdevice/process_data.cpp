#include "subdevice/process_data.hpp"

#include "subdevice/esc_registers.hpp"
#include "subdevice/esm_checks.hpp"
#include "subdevice/sync_objects.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace reg = wire::reg;
namespace al_event = wire::al_event;

namespace {

constexpr Duration kPollEvery = std::chrono::milliseconds(1);  // used when a SyncManager raises no events
// after this number of cycle times without SYNC0, SYNC0 counts as lost
constexpr int kLostSyncs = 3;

AlStatusCode mapping_fault(Abort abort, AlStatusCode code) {
    if (abort == Abort::out_of_memory) return AlStatusCode::no_memory;
    return abort == Abort::none ? AlStatusCode::none : code;
}

std::uint8_t sm_status_of(EscAccess& esc, unsigned n) {
    return read_register<std::uint8_t>(
        esc, static_cast<std::uint16_t>(reg::sync_manager(n).address + wire::SyncManagerLayout::status::offset));
}

}  // namespace

ProcessDataSizes ProcessData::sizes() {
    if (running_) return sizes_;  // interrupt handlers use the mapping
    const auto& device = application_.description();
    ProcessDataSizes most;
    for (const bool outputs : {true, false})
        for_each_area(device, outputs,
                      [&](const ProcessDataArea& area, std::size_t n) { most.of(outputs, n) = area.max_bytes; });
    sizes_ = application_.process_data_sizes().value_or(most);
    const auto own_fault = sizes_.fault;
    if (own_fault != AlStatusCode::none) return sizes_;
    sizes_.fault = build_map(true);
    if (sizes_.fault == AlStatusCode::none) sizes_.fault = build_map(false);
    const bool room = sizes_.all(true) <= outputs_.size() && sizes_.all(false) <= inputs_.size() &&
                      device.more_outputs.size() <= kMostMoreAreas && device.more_inputs.size() <= kMostMoreAreas;
    if (sizes_.fault == AlStatusCode::none && !room) sizes_.fault = AlStatusCode::no_memory;
    count_bytes(true);
    count_bytes(false);
    return sizes_;
}

// A direction is mapped by objects when the dictionary has the assignment of each of its SyncManagers.
AlStatusCode ProcessData::build_map(bool outputs) {
    const auto& device = application_.description();
    auto& map = outputs ? output_map_ : input_map_;
    auto& mapped = outputs ? output_mapped_ : input_mapped_;
    const auto memory = (outputs ? outputs_ : inputs_).size();
    mapped = true;
    for_each_area(device, outputs, [&](const ProcessDataArea& area, std::size_t) {
        mapped = mapped && dictionary_.find(area.assignment()) != nullptr;
    });
    map.clear();
    if (!mapped) return AlStatusCode::none;
    auto wrong = Abort::none;
    // Assigned PDOs of a direction that the device does not have. The object may belong to the other direction.
    const auto usual = outputs ? kOutputAssignment : kInputAssignment;
    bool of_other = false;
    for_each_area(device, !outputs,
                  [&](const ProcessDataArea& area, std::size_t) { of_other = of_other || area.assignment() == usual; });
    if (!(outputs ? device.outputs : device.inputs).present() && !of_other) wrong = map.add(dictionary_, usual, 0);
    for_each_area(device, outputs, [&](const ProcessDataArea& area, std::size_t n) {
        const std::size_t before = map.bytes();
        const auto room = std::min<std::size_t>(area.max_bytes, memory - std::min(memory, before));
        if (wrong == Abort::none) wrong = check_assigned(dictionary_, area.assignment(), outputs);
        if (wrong == Abort::none) wrong = map.add(dictionary_, area.assignment(), room);
        sizes_.of(outputs, n) = static_cast<std::uint16_t>(map.bytes() - before);
    });
    return mapping_fault(wrong, outputs ? AlStatusCode::invalid_output_mapping : AlStatusCode::invalid_input_mapping);
}

void ProcessData::visit_used(bool outputs, UsedVisit visit, void* function) const {
    std::size_t at = 0;
    for_each_area(application_.description(), outputs, [&](const ProcessDataArea& area, std::size_t n) {
        const std::size_t bytes = sizes_.of(outputs, n);
        if (bytes != 0) visit(function, area, at, bytes);
        at += bytes;
    });
}

void ProcessData::count_bytes(bool outputs) {
    (outputs ? output_bytes_ : input_bytes_) = static_cast<std::uint16_t>(sizes_.all(outputs));
    if (outputs) output_areas_ = 0;
    auto& last = outputs ? last_output_ : last_input_;
    last = 0;
    for_each_used(outputs, [&](const ProcessDataArea& area, std::size_t, std::size_t) {
        last = al_event::sync_manager(area.sync_manager);
        if (outputs) output_areas_ |= last;
    });
}

// ------------------------------------------------------------------ start and stop

void ProcessData::start(Time now) {
    outputs_expired_ = sync_seen_ = sync_began_ = outputs_valid_ = false;
    arrived_ = 0;
    missed_ = syncs_ = 0;
    late_ = 0;
    discard_old_outputs();
    next_poll_ = kNever;
    find_silent(now);
    read_sync_settings();
    // Events of SYNC signals of an earlier activation, which were not acknowledged.
    if (acknowledged_sync_) {
        acknowledge(reg::kSync0Status);
        acknowledge(reg::kSync1Status);
    }
    show_sync_types();
    running_ = true;
    last_sync_ = now;
    locked_ = frames_ = syncs_of_period_ = 0;
    collided_ = false;
    next_watch_ = kNever;
    process(part::kApplication | part::kInputs, now);
}

// Outputs of an earlier use that the device has not read: they came together with the request for a lower state, SAFEOP
// included. Their AL event, and the status of their SyncManager, would make them look new. A read clears both.
void ProcessData::discard_old_outputs() {
    for_each_used(true, [this](const ProcessDataArea& area, std::size_t at, std::size_t bytes) {
        esc_.read(area.start, outputs_.subspan(at, bytes));
    });
}

// The SyncManagers that raise no events, by the control octets of the master.
void ProcessData::find_silent(Time now) {
    silent_ = unseen_ = 0;
    const auto raises_no_event = [this](const ProcessDataArea& area) {
        return (read_sync_manager_control(esc_, area.sync_manager) & wire::sm_control::kPdiInterrupt) == 0;
    };
    for_each_used(true, [&](const ProcessDataArea& area, std::size_t, std::size_t bytes) {
        const auto event = al_event::sync_manager(area.sync_manager);
        if (bytes == 1) unseen_ |= event;
        if (bytes == 1 || raises_no_event(area)) silent_ |= event;
    });
    inputs_silent_ = false;
    for_each_used(false, [&](const ProcessDataArea& area, std::size_t, std::size_t bytes) {
        inputs_silent_ = bytes == 1 || raises_no_event(area);
    });
    if (silent_ == 0)
        next_poll_ = kNever;
    else if (next_poll_ == kNever)
        next_poll_ = now + kPollEvery;
}

AlStatusCode ProcessData::missing(Time now) {
    if (has_outputs()) {
        forget_old_outputs(now);
        if (!outputs_seen())
            return outputs_expired_ ? AlStatusCode::sync_manager_watchdog : AlStatusCode::no_valid_outputs;
    }
    if (mode_ != SyncMode::dc_sync0) return AlStatusCode::none;
    forget_lost_sync(now);
    if (!sync_seen_) return AlStatusCode::no_sync_error;
    constexpr unsigned kEnough = 4;
    const bool counted = has_outputs() && (last_output_ & unseen_) == 0;
    const bool unlocked = application_.description().dc.pll && counted && locked_ < kEnough;
    return unlocked ? AlStatusCode::pll_error : AlStatusCode::none;
}

// In SAFEOP. In OP, watch() takes the device to SAFEOP instead.
void ProcessData::forget_old_outputs(Time now) {
    if (!running_ || arrived_ == 0 || outputs_valid_) return;
    const auto own = application_.description().output_timeout;
    const bool too_old = own != Duration::zero() && now - last_outputs_ >= own;
    if (too_old || (watchdog_time() != Duration::zero() && !watchdog_running())) forget_outputs(now);
}

void ProcessData::forget_outputs(Time now) {
    arrived_ = 0;
    outputs_expired_ = true;
    arm(now);
}

// The time at which SYNC0 counts as lost.
Time ProcessData::lost_sync() const { return last_sync_ + Duration{kLostSyncs * std::int64_t{sync_cycle_ns_} + 1}; }

// In SAFEOP. SYNC0 has stopped: the application is called as before the first SYNC0, and OP needs a new SYNC0.
void ProcessData::forget_lost_sync(Time now) {
    if (!sync_seen_ || outputs_valid_ || now < lost_sync()) return;
    sync_seen_ = collided_ = false;
    locked_ = frames_ = syncs_of_period_ = 0;
    arm(now);
}

// Watchdog time of the ESC for the outputs; zero when the master has disabled the watchdog.
Duration ProcessData::watchdog_time() {
    bool triggered = false;
    for_each_used(true, [&](const ProcessDataArea& area, std::size_t, std::size_t) {
        triggered =
            triggered || (read_sync_manager_control(esc_, area.sync_manager) & wire::sm_control::kWatchdogTrigger) != 0;
    });
    if (!triggered) return {};
    const auto divider = read_register<std::uint16_t>(esc_, reg::kWatchdogDivider.address);
    const auto time = read_register<std::uint16_t>(esc_, reg::kProcessDataWatchdogTime.address);
    return std::chrono::nanoseconds(40) * (std::int64_t{divider} + 2) * time;
}

bool ProcessData::watchdog_running() {
    return (read_register<std::uint16_t>(esc_, reg::kProcessDataWatchdogStatus.address) & 1) != 0;
}

void ProcessData::start_outputs(Time now) {
    outputs_valid_ = true;
    show_sync_error(false);
    missed_ = syncs_ = 0;
    late_ = 0;
    set_watchdog(now);
    if (output_mapped_) dictionary_.block_downloads(&output_map_);
    if (!has_outputs()) return;
    apply_outputs();  // the application starts with the last outputs that arrived in SAFEOP
}

void ProcessData::set_watchdog(Time now) {
    watchdog_ = has_outputs() ? watchdog_time() : Duration{};
    watched_ = watchdog_ != Duration::zero();
    if (const auto own = application_.description().output_timeout; own != Duration::zero() && has_outputs())
        watchdog_ = watched_ ? std::min(watchdog_, own) : own;
    next_watch_ = watchdog_ == Duration::zero() ? kNever : now + watchdog_;
}

void ProcessData::stop_outputs(Time now) {
    if (!outputs_valid_) return;
    outputs_valid_ = false;
    outputs_expired_ = false;
    arrived_ = 0;
    next_watch_ = kNever;
    dictionary_.block_downloads(nullptr);
    discard_old_outputs();
    if (output_mapped_) output_map_.reset();
    application_.safe_outputs(now);
    forget_lost_sync(now);
    arm(now);
}

void ProcessData::stop() {
    if (running_) restore_sync_types();
    running_ = false;
    next_cycle_ = next_poll_ = next_watch_ = kNever;
}

// ------------------------------------------------------------------ updates

void ProcessData::process(unsigned parts, Time now) {
    std::uint32_t areas = 0;
    if (running_ && (parts & part::kOutputs) != 0)
        areas = outputs_waiting(read_register<std::uint32_t>(esc_, reg::kAlEventRequest.address), now);
    update(areas != 0 ? parts : parts & ~part::kOutputs, areas, now);
}

void ProcessData::update(unsigned parts, std::uint32_t areas, Time now) {
    if (!running_) return;
    begin_measurement();
    if ((parts & part::kOutputs) != 0 && has_outputs()) take_outputs(areas, now);
    Time used = now;
    if ((parts & part::kApplication) != 0) {
        application_.cycle(now, outputs_valid_);
        arm(now);
        const auto shift = application_.description().output_times.shift;
        const bool shifted = shift != Duration::zero() && outputs_valid_ && mode_ == SyncMode::dc_sync0;
        if (measuring_ || shifted) used = application_.clock(now);
        if (shifted && used - now > shift)
            add_to_sync_counter(first_sync_object(application_.description()), sync_subindex::kShiftTooShort);
        measured(true, used - now);
    }
    if ((parts & part::kInputs) == 0 || input_bytes_ == 0) return;
    give_inputs(now);
    if (measuring_) measured(false, application_.clock(now) - used);
}

// Whether the cyclic data of the master do not drive the application: there are no outputs, or none have arrived yet,
// or SYNC0 has not started. The inputs must stay up to date in this case too.
bool ProcessData::undriven() const {
    return mode_ == SyncMode::dc_sync0 ? !sync_seen_ : !has_outputs() || !outputs_seen();
}

// The time after which the application is called without an event; zero: never.
Duration ProcessData::own_period() const {
    const auto free_run = application_.description().free_run_cycle;
    if (free_run != Duration::zero() && (mode_ != SyncMode::dc_sync0 || undriven())) return free_run;
    return undriven() && input_bytes_ != 0 && inputs_silent_ ? kPollEvery : Duration{};
}

void ProcessData::arm(Time now) {
    const auto period = own_period();
    next_cycle_ = period == Duration::zero() ? kNever : now + period;
}

// `areas`: AL events of SyncManagers. Each of them is read.
void ProcessData::take_outputs(std::uint32_t areas, Time now) {
    for_each_used(true, [&](const ProcessDataArea& area, std::size_t at, std::size_t bytes) {
        if ((areas & al_event::sync_manager(area.sync_manager)) != 0)
            esc_.read(area.start, outputs_.subspan(at, bytes));
    });
    late_ &= ~areas;
    arrived_ |= areas;
    outputs_expired_ = false;
    if ((areas & last_output_) != 0 || !outputs_valid_) last_outputs_ = now;
    if ((areas & last_output_) != 0) {
        missed_ = syncs_ = 0;
        if (mode_ == SyncMode::dc_sync0) note_phase(now);
        if (next_watch_ != kNever) next_watch_ = now + watchdog_;
    }
    if (outputs_valid_) apply_outputs();  // SAFEOP: the outputs are read, but not applied
}

void ProcessData::apply_outputs() {
    const auto raw = outputs_.first(output_bytes_);
    if (!application_.unpack_outputs(raw) && output_mapped_) counters_.refused_values += output_map_.unpack(raw);
}

void ProcessData::give_inputs(Time now) {
    const auto full = [this](const ProcessDataArea& area) {
        return !area.three_buffers && (sm_status_of(esc_, area.sync_manager) & wire::sm_status::kMailboxFull) != 0;
    };
    bool room = false;
    for_each_used(false, [&](const ProcessDataArea& area, std::size_t, std::size_t) { room = room || !full(area); });
    if (!room) return;  // one buffer, and the master has not read the last inputs
    const auto raw = inputs_.first(input_bytes_);
    if (!timestamp_object_.empty()) store_le(timestamp_object_, 0, application_.timestamp_ns(now));
    if (!application_.pack_inputs(raw) && input_mapped_) input_map_.pack(raw);
    for_each_used(false, [&](const ProcessDataArea& area, std::size_t at, std::size_t bytes) {
        if (!full(area)) esc_.write(area.start, raw.subspan(at, bytes));
    });
}

std::uint32_t ProcessData::events() const {
    if (!running_) return 0;
    const auto& device = application_.description();
    std::uint32_t bits = 0;
    if (mode_ == SyncMode::dc_sync0) {
        if (!sync_by_pin_) bits |= al_event::kDcSync0;
        if (device.dc.sync1 && !sync1_by_pin_) bits |= al_event::kDcSync1;
    }
    bits |= output_areas_;
    if (inputs_drive()) bits |= last_input_;
    return bits;
}

// The SyncManagers of the outputs that have new data, as bits of their AL events.
std::uint32_t ProcessData::outputs_waiting(std::uint32_t events, Time now) {
    auto waiting = events & output_areas_;
    if (silent_ == 0) return waiting;
    for_each_used(true, [&](const ProcessDataArea& area, std::size_t, std::size_t) {
        const auto event = al_event::sync_manager(area.sync_manager);
        if ((silent_ & event) == 0) return;
        if ((unseen_ & event) == 0) {
            if ((sm_status_of(esc_, area.sync_manager) & wire::sm_status::kInterruptWrite) != 0) waiting |= event;
        } else if (now >= next_poll_ && (watchdog_time() == Duration::zero() || watchdog_running())) {
            waiting |= event;
        }
    });
    return waiting;
}

bool ProcessData::inputs_fetched(std::uint32_t events) const { return inputs_drive() && (events & last_input_) != 0; }

void ProcessData::serve(Time now, std::uint32_t events) {
    if (!running_) return;
    const auto outputs = outputs_waiting(events, now);
    if (silent_ != 0 && now >= next_poll_) next_poll_ = now + kPollEvery;
    const bool driven = (outputs & last_output_) != 0;
    if (mode_ == SyncMode::dc_sync0) {
        if (outputs != 0) update(part::kOutputs, outputs, now);
        if ((events & al_event::kDcSync1) != 0 && !sync1_by_pin_ && application_.description().dc.sync1) {
            acknowledge(reg::kSync1Status);
            application_.sync1(now);
        }
        if ((events & al_event::kDcSync0) != 0 && !sync_by_pin_) {
            acknowledge(reg::kSync0Status);
            return serve_sync(now);
        }
    } else if (driven && mode_ == SyncMode::process_data) {
        return update(part::kAll, outputs, now);
    } else if (outputs != 0) {
        update(part::kOutputs, outputs, now);
    }
    if (inputs_fetched(events) || next_cycle_ <= now) process(part::kApplication | part::kInputs, now);
}

// ------------------------------------------------------------------ monitoring

// The master may have written other control octets. Deadlines that exist stay.
void ProcessData::look_again(Time now) {
    const Time cycle = next_cycle_;
    const Time watch = next_watch_;
    find_silent(now);
    arm(now);
    if (next_cycle_ != kNever) next_cycle_ = std::min(next_cycle_, cycle);
    if (!outputs_valid_) return;
    set_watchdog(now);
    if (next_watch_ != kNever) next_watch_ = std::min(next_watch_, watch);
}

AlStatusCode ProcessData::watch(Time now, std::uint32_t events) {
    if (running_ && (events & al_event::kSmActivation) != 0) look_again(now);
    if ((events & al_event::kWatchdog) != 0) {
        const bool expired = !watchdog_running();  // clears the event
        if (outputs_valid_ && watched_ && expired) return AlStatusCode::sync_manager_watchdog;
        forget_old_outputs(now);
    }
    if (!outputs_valid_) {
        forget_lost_sync(now);
        return AlStatusCode::none;
    }
    if (mode_ == SyncMode::dc_sync0) {
        if (now >= lost_sync()) return AlStatusCode::fatal_sync_error;
        if (sync_error_limit_ != 0 && missed_ > sync_error_limit_) {
            show_sync_error(true);
            return application_.description().dc.pll ? AlStatusCode::dc_sync_timeout
                                                     : AlStatusCode::synchronization_error;
        }
    }
    if (next_watch_ > now) return AlStatusCode::none;
    const auto own = application_.description().output_timeout;
    if (own != Duration::zero() && now - last_outputs_ >= own) return AlStatusCode::sync_manager_watchdog;
    if (watched_ && !watchdog_running()) return AlStatusCode::sync_manager_watchdog;
    next_watch_ = now + watchdog_ / 8;  // the clock of the ESC and this clock may differ, so check again soon
    return AlStatusCode::none;
}

Time ProcessData::watch_deadline() const {
    return running_ && sync_seen_ ? std::min(next_watch_, lost_sync()) : next_watch_;
}

}  // namespace margay::subdevice
