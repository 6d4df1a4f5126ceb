#include "subdevice/process_data.hpp"

#include "subdevice/esc_registers.hpp"
#include "subdevice/esm_checks.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace reg = wire::reg;
namespace al_event = wire::al_event;

namespace {

constexpr Duration kPollEvery = std::chrono::milliseconds(1);  // used when SM2 raises no events
// after this number of cycle times without SYNC0, SYNC0 counts as lost
constexpr int kLostSyncs = 3;

AlStatusCode mapping_fault(Abort abort, AlStatusCode code) { return abort == Abort::none ? AlStatusCode::none : code; }

std::uint8_t sm_status_of(EscAccess& esc, unsigned n) {
    return read_register<std::uint8_t>(
        esc, static_cast<std::uint16_t>(reg::sync_manager(n).address + wire::SyncManagerLayout::status::offset));
}

}  // namespace

ProcessDataSizes ProcessData::sizes() {
    const auto& device = application_.description();
    const ProcessDataSizes most{device.outputs.max_bytes, device.inputs.max_bytes, AlStatusCode::none};
    sizes_ = application_.process_data_sizes().value_or(most);
    output_mapped_ = dictionary_.find(kOutputAssignment) != nullptr;
    input_mapped_ = dictionary_.find(kInputAssignment) != nullptr;
    if (output_mapped_) {
        const auto room = std::min<std::size_t>(device.outputs.max_bytes, outputs_.size());
        sizes_.fault = mapping_fault(output_map_.build(dictionary_, kOutputAssignment, room),
                                     AlStatusCode::invalid_output_mapping);
        sizes_.outputs_bytes = output_map_.bytes();
    }
    if (input_mapped_ && sizes_.fault == AlStatusCode::none) {
        const auto room = std::min<std::size_t>(device.inputs.max_bytes, inputs_.size());
        sizes_.fault =
            mapping_fault(input_map_.build(dictionary_, kInputAssignment, room), AlStatusCode::invalid_input_mapping);
        sizes_.inputs_bytes = input_map_.bytes();
    }
    if (sizes_.outputs_bytes > outputs_.size() || sizes_.inputs_bytes > inputs_.size())
        sizes_.fault = AlStatusCode::no_memory;
    return sizes_;
}

void ProcessData::start(Time now) {
    const auto& device = application_.description();
    const auto activation = read_register<std::uint8_t>(esc_, reg::kSyncActivation.address);
    constexpr auto kBoth = wire::sync_activation::kCyclic | wire::sync_activation::kSync0;
    mode_ = device.dc.supported && (activation & kBoth) == kBoth ? SyncMode::dc_sync0 : SyncMode::process_data;
    sync_cycle_ = Duration{read_register<std::uint32_t>(esc_, reg::kSync0CycleTime.address)};
    outputs_seen_ = sync_seen_ = outputs_valid_ = false;
    missed_ = 0;
    silent_ = has_outputs() &&
              (read_sync_manager(esc_, device.outputs.sync_manager).control & wire::sm_control::kPdiInterrupt) == 0;
    running_ = true;
    last_sync_ = now;
    next_cycle_ = kNever;
    next_watch_ = kNever;
    next_poll_ = silent_ ? now + kPollEvery : kNever;
    process(part::kApplication | part::kInputs, now);
}

AlStatusCode ProcessData::missing() const {
    if (has_outputs() && !outputs_seen_) return AlStatusCode::no_valid_outputs;
    return mode_ == SyncMode::dc_sync0 && !sync_seen_ ? AlStatusCode::no_sync_error : AlStatusCode::none;
}

// Watchdog time of the ESC for the outputs; zero when the master has disabled the watchdog.
Duration ProcessData::watchdog_time() {
    const auto& area = application_.description().outputs;
    const auto sm = read_sync_manager(esc_, area.sync_manager);
    if ((sm.control & wire::sm_control::kWatchdogTrigger) == 0) return {};
    const auto divider = read_register<std::uint16_t>(esc_, reg::kWatchdogDivider.address);
    const auto time = read_register<std::uint16_t>(esc_, reg::kProcessDataWatchdogTime.address);
    return std::chrono::nanoseconds(40) * (std::int64_t{divider} + 2) * time;
}

void ProcessData::start_outputs(Time now) {
    outputs_valid_ = true;
    missed_ = 0;
    watchdog_ = has_outputs() ? watchdog_time() : Duration{};
    watched_ = watchdog_ != Duration::zero();
    if (const auto own = application_.description().output_timeout; own != Duration::zero() && has_outputs())
        watchdog_ = watched_ ? std::min(watchdog_, own) : own;
    next_watch_ = watchdog_ == Duration::zero() ? kNever : now + watchdog_;
    if (output_mapped_) dictionary_.block_downloads(&output_map_);
    if (!has_outputs()) return;
    // The application starts with the last outputs that arrived in SAFEOP.
    if (!application_.unpack_outputs(outputs_.first(sizes_.outputs_bytes)) && output_mapped_)
        output_map_.unpack(outputs_, dictionary_.image());
}

void ProcessData::stop_outputs(Time now) {
    if (!outputs_valid_) return;
    outputs_valid_ = false;
    outputs_seen_ = false;
    next_watch_ = kNever;
    dictionary_.block_downloads(nullptr);
    if (output_mapped_) output_map_.reset(dictionary_.image());
    application_.safe_outputs(now);
}

void ProcessData::stop() {
    running_ = false;
    next_cycle_ = next_poll_ = next_watch_ = kNever;
}

void ProcessData::process(unsigned parts, Time now) {
    if (!running_) return;
    if ((parts & part::kOutputs) != 0 && has_outputs()) take_outputs(now);
    if ((parts & part::kApplication) != 0) {
        application_.cycle(now, outputs_valid_);
        const auto free_run = application_.description().free_run_cycle;
        if (free_run != Duration::zero() && mode_ != SyncMode::dc_sync0) next_cycle_ = now + free_run;
    }
    if ((parts & part::kInputs) != 0 && sizes_.inputs_bytes != 0) give_inputs();
}

void ProcessData::take_outputs(Time now) {
    const auto raw = outputs_.first(sizes_.outputs_bytes);
    esc_.read(application_.description().outputs.start, raw);
    outputs_seen_ = true;
    last_outputs_ = now;
    missed_ = 0;
    if (next_watch_ != kNever) next_watch_ = now + watchdog_;
    if (!outputs_valid_) return;  // SAFEOP: the outputs are read, but not applied
    if (!application_.unpack_outputs(raw) && output_mapped_) output_map_.unpack(raw, dictionary_.image());
}

void ProcessData::give_inputs() {
    const auto& area = application_.description().inputs;
    if (!area.three_buffers && (sm_status_of(esc_, area.sync_manager) & wire::sm_status::kMailboxFull) != 0)
        return;  // one buffer, and the master has not read the last inputs
    const auto raw = inputs_.first(sizes_.inputs_bytes);
    if (!application_.pack_inputs(raw) && input_mapped_) input_map_.pack(dictionary_.image(), raw);
    esc_.write(area.start, raw);
}

std::uint32_t ProcessData::events() const {
    if (!running_) return 0;
    const auto& device = application_.description();
    std::uint32_t bits = mode_ == SyncMode::dc_sync0 ? al_event::kDcSync0 : 0;
    if (has_outputs()) {
        bits |= al_event::sync_manager(device.outputs.sync_manager);
    } else if (mode_ == SyncMode::process_data && sizes_.inputs_bytes != 0) {
        bits |= al_event::sync_manager(device.inputs.sync_manager);
    }
    return bits;
}

bool ProcessData::outputs_waiting(std::uint32_t events) {
    if (!has_outputs()) return false;
    const auto n = application_.description().outputs.sync_manager;
    if ((events & al_event::sync_manager(n)) != 0) return true;
    return silent_ && (sm_status_of(esc_, n) & wire::sm_status::kInterruptWrite) != 0;
}

void ProcessData::serve(Time now, std::uint32_t events) {
    if (!running_) return;
    if (silent_) next_poll_ = now + kPollEvery;
    const bool outputs = outputs_waiting(events);
    if (mode_ == SyncMode::dc_sync0) {
        if (outputs) process(part::kOutputs, now);
        if ((events & al_event::kDcSync0) == 0) return;
        (void)read_register<std::uint8_t>(esc_, reg::kSync0Status.address);  // acknowledges the event
        count_sync(now);
        return process(part::kApplication | part::kInputs, now);
    }
    if (outputs) return process(part::kAll, now);
    const bool fetched =
        !has_outputs() && (events & al_event::sync_manager(application_.description().inputs.sync_manager)) != 0;
    if (fetched || next_cycle_ <= now) process(part::kApplication | part::kInputs, now);
}

void ProcessData::count_sync(Time now) {
    sync_seen_ = true;
    last_sync_ = now;
    if (outputs_valid_ && has_outputs()) ++missed_;
}

AlStatusCode ProcessData::watch(Time now, std::uint32_t events) {
    if ((events & al_event::kWatchdog) != 0) {
        const auto status =
            read_register<std::uint16_t>(esc_, reg::kProcessDataWatchdogStatus.address);  // clears the event
        if (outputs_valid_ && watched_ && (status & 1) == 0) return AlStatusCode::sync_manager_watchdog;
    }
    if (!outputs_valid_) return AlStatusCode::none;
    if (mode_ == SyncMode::dc_sync0) {
        if (now - last_sync_ > kLostSyncs * sync_cycle_) return AlStatusCode::fatal_sync_error;
        const auto limit = application_.description().sync_error_limit;
        if (limit != 0 && missed_ > limit) return AlStatusCode::synchronization_error;
    }
    if (next_watch_ > now) return AlStatusCode::none;
    const auto own = application_.description().output_timeout;
    if (own != Duration::zero() && now - last_outputs_ >= own) return AlStatusCode::sync_manager_watchdog;
    if (watched_ && (read_register<std::uint16_t>(esc_, reg::kProcessDataWatchdogStatus.address) & 1) == 0)
        return AlStatusCode::sync_manager_watchdog;
    next_watch_ = now + watchdog_ / 8;  // the clock of the ESC and this clock may differ, so check again soon
    return AlStatusCode::none;
}

Time ProcessData::watch_deadline() const {
    if (!outputs_valid_) return kNever;
    if (mode_ != SyncMode::dc_sync0) return next_watch_;
    return std::min(next_watch_, last_sync_ + kLostSyncs * sync_cycle_ + std::chrono::nanoseconds(1));
}

}  // namespace margay::subdevice
