// Synchronization of the process data: the settings of the master, the SYNC signals, and the objects with the counters
// of missed events and the measured times (ETG.1020 "Synchronization").
#include "subdevice/esc_registers.hpp"
#include "subdevice/process_data.hpp"
#include "subdevice/sync_objects.hpp"
#include "subdevice/timestamp.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace margay::subdevice {

namespace reg = wire::reg;
namespace al_event = wire::al_event;

namespace {

// The memory of an entry; empty when the dictionary does not have it with this size.
MutableBytes entry_memory(ObjectDictionary& dictionary, std::uint16_t index, std::uint8_t subindex, std::size_t bytes) {
    const auto* const object = dictionary.find(index);
    const auto* const entry = object != nullptr ? object->entry(subindex) : nullptr;
    if (entry == nullptr || entry->bytes() != bytes) return {};
    return dictionary.in_image(*object, *entry, subindex);
}

MutableBytes time_memory(ObjectDictionary& dictionary, const ProcessDataArea& area) {
    return entry_memory(dictionary, area.sync_parameters(), sync_subindex::kCalcAndCopy, 4);
}

MutableBytes type_memory(ObjectDictionary& dictionary, const ProcessDataArea& area) {
    return entry_memory(dictionary, area.sync_parameters(), sync_subindex::kType, 2);
}

// Calls `visit(memory, outputs, n)` for each object with a synchronization type. `n` counts all areas of a description.
template <class Visit>
void for_each_sync_type(const DeviceDescription& device, ObjectDictionary& dictionary, Visit visit) {
    for (const bool outputs : {true, false})
        for_each_area(device, outputs, [&](const ProcessDataArea& area, std::size_t n) {
            const auto memory = type_memory(dictionary, area);
            if (!memory.empty()) visit(memory, outputs, outputs ? n : 1 + kMostMoreAreas + n);
        });
}

// The object whose type selects the mode: the object of the outputs, or of the inputs for a device without outputs.
std::uint16_t chosen_type(const DeviceDescription& device, ObjectDictionary& dictionary) {
    const auto memory = type_memory(dictionary, device.outputs.present() ? device.outputs : device.inputs);
    return memory.empty() ? sync_type::kSmEvent : load_le<std::uint16_t>(memory);
}

}  // namespace

// ------------------------------------------------------------------ objects

SyncMode ProcessData::chosen_mode() {
    const auto& device = application_.description();
    const auto activation = read_register<std::uint8_t>(esc_, reg::kSyncActivation.address);
    constexpr auto kBoth = wire::sync_activation::kCyclic | wire::sync_activation::kSync0;
    if (device.dc.supported && (activation & kBoth) == kBoth) return SyncMode::dc_sync0;
    return chosen_type(device, dictionary_) == sync_type::kFreeRun ? SyncMode::free_run : SyncMode::process_data;
}

AlStatusCode ProcessData::check_sync_types() {
    const auto& device = application_.description();
    const bool dc = chosen_mode() == SyncMode::dc_sync0;
    const bool free_run = chosen_type(device, dictionary_) == sync_type::kFreeRun;
    auto fault = AlStatusCode::none;
    for_each_sync_type(device, dictionary_, [&](Bytes memory, bool outputs, std::size_t) {
        const auto type = load_le<std::uint16_t>(memory);
        if (fault != AlStatusCode::none) return;
        if (!supports_sync_type(device, outputs, type)) {
            fault = type == sync_type::kFreeRun ? AlStatusCode::free_run_not_supported
                                                : AlStatusCode::sync_mode_not_supported;
        } else if ((type == sync_type::kFreeRun && dc) || (type == sync_type::kDcSync0 && !dc)) {
            fault = AlStatusCode::invalid_dc_sync_configuration;
        } else if (type == sync_type::kFreeRun && !free_run) {
            fault = AlStatusCode::sync_mode_not_supported;
        }
    });
    return fault;
}

// The values of the objects in SAFEOP and OP.
void ProcessData::show_sync_types() {
    const auto shown = [this](bool outputs) {
        switch (mode_) {
            case SyncMode::free_run: return sync_type::kFreeRun;
            case SyncMode::dc_sync0: return sync_type::kDcSync0;
            case SyncMode::process_data: break;
        }
        return !outputs && has_outputs() ? sync_type::kSm2Event : sync_type::kSmEvent;
    };
    for_each_sync_type(application_.description(), dictionary_, [&](MutableBytes memory, bool outputs, std::size_t n) {
        written_types_[n] = load_le<std::uint16_t>(memory);
        store_le(memory, 0, shown(outputs));
    });
}

void ProcessData::restore_sync_types() {
    for_each_sync_type(application_.description(), dictionary_,
                       [&](MutableBytes memory, bool, std::size_t n) { store_le(memory, 0, written_types_[n]); });
}

void ProcessData::read_sync_settings() {
    const auto& device = application_.description();
    mode_ = chosen_mode();
    acknowledged_sync_ = read_register<std::uint16_t>(esc_, reg::kSyncPulseLength.address) == 0;
    sync_cycle_ns_ = read_register<std::uint32_t>(esc_, reg::kSync0CycleTime.address);
    syncs_per_frame_ = 1;
    if (mode_ == SyncMode::dc_sync0 && sync_cycle_ns_ != 0) {
        const auto frame =
            static_cast<std::uint32_t>(dictionary_.number(first_sync_object(device), sync_subindex::kCycle));
        const auto sync1 = read_register<std::uint32_t>(esc_, reg::kSync1CycleTime.address);
        const auto activation = read_register<std::uint8_t>(esc_, reg::kSyncActivation.address);
        const bool sync1_on = (activation & wire::sync_activation::kSync1) != 0;
        if (frame > sync_cycle_ns_) {
            syncs_per_frame_ = (frame - sync_cycle_ns_ / 2) / sync_cycle_ns_ + 1;
        } else if (frame == 0 && sync1_on && sync1 >= sync_cycle_ns_) {
            // A SYNC1 cycle time of n SYNC0 cycles: SYNC1 occurs at each (n + 1)th SYNC0.
            syncs_per_frame_ = sync1 / sync_cycle_ns_ + 1;
        } else if (frame == 0 && device.dc.sync0_cycle_factor < -1) {
            syncs_per_frame_ = static_cast<std::uint32_t>(-device.dc.sync0_cycle_factor);
        }
    }
    const auto* const setting = dictionary_.find(kSyncErrorSetting);
    sync_error_limit_ = setting != nullptr
                            ? static_cast<unsigned>(dictionary_.number(kSyncErrorSetting, sync_subindex::kErrorLimit))
                            : device.sync_error_limit;
    find_sync_objects();
}

void ProcessData::find_sync_objects() {
    const auto first = first_sync_object(application_.description());
    measure_object_ = entry_memory(dictionary_, first, sync_subindex::kGetCycleTime, 2);
    timestamp_object_ = entry_memory(dictionary_, kTimestamp, 0, 8);
    if (const auto cycle = entry_memory(dictionary_, first, sync_subindex::kSync0Cycle, 4); !cycle.empty())
        store_le(cycle, 0, mode_ == SyncMode::dc_sync0 ? sync_cycle_ns_ : std::uint32_t{0});
    show_sync_error(false);
}

void ProcessData::show_sync_error(bool error) {
    for_each_area(application_.description(), true, [&](const ProcessDataArea& area, std::size_t) {
        const auto memory = entry_memory(dictionary_, area.sync_parameters(), sync_subindex::kSyncError, 1);
        if (!memory.empty()) memory[0] = std::byte{error};
    });
}

void ProcessData::add_to_sync_counter(std::uint16_t object, std::uint8_t subindex) {
    const auto memory = entry_memory(dictionary_, object, subindex, 2);
    if (!memory.empty()) store_le(memory, 0, static_cast<std::uint16_t>(load_le<std::uint16_t>(memory) + 1));
}

// The master begins a measurement by a write to 0x1C32:08. The times of the measurement before are deleted.
void ProcessData::begin_measurement() {
    const bool wanted = !measure_object_.empty() && (std::to_integer<unsigned>(measure_object_[0]) & 1) != 0;
    if (std::exchange(measuring_, wanted) || !wanted) return;
    for (const bool outputs : {true, false})
        for_each_area(application_.description(), outputs, [&](const ProcessDataArea& area, std::size_t) {
            std::ranges::fill(time_memory(dictionary_, area), std::byte{0});
        });
}

// Stores the longest time.
void ProcessData::measured(bool outputs, Duration time) {
    if (!measuring_) return;
    const auto most = std::numeric_limits<std::uint32_t>::max();
    const auto ns = static_cast<std::uint32_t>(std::clamp<std::int64_t>(time.count(), 0, most));
    for_each_area(application_.description(), outputs, [&](const ProcessDataArea& area, std::size_t) {
        const auto memory = time_memory(dictionary_, area);
        if (!memory.empty() && ns > load_le<std::uint32_t>(memory)) store_le(memory, 0, ns);
    });
}

// A frame that arrives together with SYNC0 may be before SYNC0 in one cycle and behind it in the next cycle.
void ProcessData::note_phase(Time now) {
    const Duration cycle{sync_cycle_ns_};
    const Duration near = cycle / 32;
    const Duration since = now - last_sync_;
    ++frames_;
    collided_ |= sync_seen_ && (since < near || since > cycle - near);
}

void ProcessData::watch_lock() {
    if (++syncs_of_period_ < syncs_per_frame_) return;
    const bool right = frames_ == 1 && (syncs_per_frame_ > 1 || !collided_);
    locked_ = right ? locked_ + 1 : 0;
    frames_ = syncs_of_period_ = 0;
    collided_ = false;
}

// ------------------------------------------------------------------ SYNC signals

// Reading the status ends the signal and its AL event. Below SAFEOP the pulse length is not known: the read does no
// harm.
void ProcessData::acknowledge(wire::Register status) { (void)read_register<std::uint8_t>(esc_, status.address); }

void ProcessData::serve_sync(Time now) {
    count_sync(now);
    process(part::kApplication | part::kInputs, now);
    const bool exceeded = sync_cycle_ns_ != 0 && (application_.clock(now) - now).count() > sync_cycle_ns_;
    if (exceeded) add_to_sync_counter(first_sync_object(application_.description()), sync_subindex::kCycleExceeded);
}

void ProcessData::sync0(Time now) {
    sync_by_pin_ = true;
    if (acknowledged_sync_ || !running_) acknowledge(reg::kSync0Status);
    if (!running_ || mode_ != SyncMode::dc_sync0) return;
    // Outputs that have arrived belong to this SYNC0, although the handler of their event has not executed yet.
    const auto events = read_register<std::uint32_t>(esc_, reg::kAlEventRequest.address);
    const auto outputs = outputs_waiting(events, now) & ~unseen_;
    if (outputs != 0) update(part::kOutputs, outputs, now);
    serve_sync(now);
}

void ProcessData::sync1(Time now) {
    sync1_by_pin_ = true;
    if (acknowledged_sync_ || !running_) acknowledge(reg::kSync1Status);
    if (running_ && mode_ == SyncMode::dc_sync0) application_.sync1(now);
}

void ProcessData::count_sync(Time now) {
    if (sync_began_ && sync_cycle_ns_ != 0)
        count_missed_syncs(now);
    else
        sync_grid_ = now;
    sync_seen_ = sync_began_ = true;
    last_sync_ = now;
    watch_lock();
    // The arrival of outputs of one octet cannot be detected. The watchdog monitors these outputs.
    if (!outputs_valid_ || !has_outputs() || (last_output_ & unseen_) != 0 || ++syncs_ < syncs_per_frame_) return;
    syncs_ = 0;
    ++missed_;
    count_missed_frames();
}

// A SYNC0 event is served late, never early. Therefore the earliest events define the time grid. A late event moves the
// grid by only a part of its delay, so that the grid follows the drift between this clock and the clock of the ESC.
void ProcessData::count_missed_syncs(Time now) {
    const Duration cycle{sync_cycle_ns_};
    const auto early = sync_cycle_ns_ / 8;
    const std::int64_t most = UINT32_MAX - early;
    const auto gap_ns = static_cast<std::uint32_t>(std::clamp<std::int64_t>((now - sync_grid_).count(), 0, most));
    const auto cycles = std::max<std::uint32_t>((gap_ns + early) / sync_cycle_ns_, 1);
    counters_.missed_syncs += cycles - 1;
    sync_grid_ += cycle * cycles;
    const Duration late = now - sync_grid_;
    sync_grid_ = late < Duration::zero() || late >= cycle ? now : sync_grid_ + late / 16;
}

// The first frame period after outputs is the period of these outputs.
void ProcessData::count_missed_frames() {
    for_each_used(true, [&](const ProcessDataArea& area, std::size_t, std::size_t) {
        if ((late_ & al_event::sync_manager(area.sync_manager)) != 0)
            add_to_sync_counter(area.sync_parameters(), sync_subindex::kMissedFrames);
    });
    if (late_ != 0) ++counters_.missed_frames;
    late_ = output_areas_ & ~unseen_;
}

}  // namespace margay::subdevice
