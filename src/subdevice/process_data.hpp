// Process data of a device: copies the outputs from their SyncManagers, calls the application, copies the inputs to
// their SyncManagers, and monitors watchdog and synchronization (ETG.1000.6 "Process data", ETG.1020
// "Synchronization").
#pragma once

#include "subdevice/application.hpp"
#include "subdevice/pdo_mapping.hpp"
#include "wire/esc.hpp"

#include <algorithm>
#include <type_traits>

namespace margay::subdevice {

// Memory for the raw process images and for the lists of the mapping. The author chooses the sizes: an image has the
// octets of all SyncManagers of its direction.
template <std::size_t OutputBytes, std::size_t InputBytes, std::size_t Entries>
struct ProcessDataMemory {
    std::array<std::byte, OutputBytes> outputs{};
    std::array<std::byte, InputBytes> inputs{};
    std::array<MappedEntry, Entries> output_entries{};
    std::array<MappedEntry, Entries> input_entries{};
};

enum class SyncMode : std::uint8_t {
    // The application is called when outputs arrive (without outputs: when the master has read the inputs).
    process_data,
    dc_sync0,  // the application is called at each SYNC0
    free_run,  // the application is called each DeviceDescription::free_run_cycle (type 0 in 0x1C32:01)
};

// The parts of one update. They can be combined.
namespace part {
inline constexpr unsigned kOutputs = 1;
inline constexpr unsigned kApplication = 2;
inline constexpr unsigned kInputs = 4;
inline constexpr unsigned kAll = 7;
}  // namespace part

// Device calls these functions. A function that changes or reads what step() and the interrupt handlers share has the
// word "locked" in its comment: the caller must hold the lock of the EscAccess.
class ProcessData {
  public:
    struct Counters {
        // SYNC0 signals that were not seen, computed from the time between seen signals. A signal that is served late,
        // but before the next signal (up to 7/8 of the cycle), is not missed.
        std::uint32_t missed_syncs = 0;
        std::uint32_t missed_frames = 0;  // frame periods (see syncs_per_frame()) in OP in which outputs did not arrive
        // Outputs in OP that were outside of the limits of their entry (Entry::within()) and were not applied.
        std::uint32_t refused_values = 0;
    };

    template <std::size_t O, std::size_t I, std::size_t E>
    ProcessData(EscAccess& esc, Application& application, ObjectDictionary& dictionary,
                ProcessDataMemory<O, I, E>& memory)
        : esc_(esc),
          application_(application),
          dictionary_(dictionary),
          outputs_(memory.outputs),
          inputs_(memory.inputs),
          output_map_(memory.output_entries),
          input_map_(memory.input_entries) {
        dictionary.set_lock(&esc);
    }

    // The sizes from assignment (0x1C10 + number of the SyncManager) and mapping. When the dictionary does not have the
    // assignment object, the size is that of Application::process_data_sizes(), or else the maximum of the description.
    // In SAFEOP and OP the sizes stay as they were at the transition to SAFEOP.
    [[nodiscard]] ProcessDataSizes sizes();

    // PREOP→SAFEOP: compares the synchronization types (subindex 1 of 0x1C32, 0x1C33 and the objects of further
    // SyncManagers) with the device, with the SYNC signals, and with each other. AlStatusCode::none when they fit.
    [[nodiscard]] AlStatusCode check_sync_types();
    // PREOP→SAFEOP: writes the first inputs before the master reads SAFEOP. Locked.
    void start(Time now);
    // SAFEOP→OP: the condition that is not met: outputs have not arrived, or are too old (the watchdog of the ESC has
    // expired, or DeviceDescription::output_timeout has passed), or SYNC0 has not arrived, or it has stopped.
    // AlStatusCode::none when all are met. Locked.
    [[nodiscard]] AlStatusCode missing(Time now);
    void start_outputs(Time now);  // locked
    void stop_outputs(Time now);   // locked
    void stop();                   // locked

    // Executes parts of an update. part::kOutputs reads the SyncManagers that have new outputs, and does nothing when
    // none has. Locked.
    void process(unsigned parts, Time now);
    // Executes the updates that the AL events, the sync mode and the deadlines require. Locked.
    void serve(Time now, std::uint32_t events);
    // The handlers of a SYNC0 or SYNC1 pin. Locked.
    void sync0(Time now);
    void sync1(Time now);

    // watch() returns the AL status code of an error, or none. watch_deadline() is the time of its next call. Locked.
    [[nodiscard]] AlStatusCode watch(Time now, std::uint32_t events);
    [[nodiscard]] Time watch_deadline() const;
    // The time of the next call of serve() without an event: the free run cycle, or polling of sync managers that raise
    // no events. Locked.
    [[nodiscard]] Time serve_deadline() const { return running_ ? std::min(next_cycle_, next_poll_) : kNever; }

    [[nodiscard]] ObjectDictionary& dictionary() { return dictionary_; }
    [[nodiscard]] bool running() const { return running_; }
    [[nodiscard]] SyncMode mode() const { return mode_; }
    [[nodiscard]] bool has_outputs() const { return output_bytes_ != 0; }
    // AL events that process data use now; 0 below SAFEOP. Changes with each update. Locked.
    [[nodiscard]] std::uint32_t events() const;
    // Number of SYNC0 signals in one frame period of the master (oversampling). It is the cycle time in object
    // 0x1C32:02 divided by the SYNC0 cycle time; without that value, it follows from the SYNC1 cycle time; otherwise
    // from DcDescription::sync0_cycle_factor.
    [[nodiscard]] std::uint32_t syncs_per_frame() const { return syncs_per_frame_; }
    [[nodiscard]] const Counters& counters() const { return counters_; }

  private:
    [[nodiscard]] AlStatusCode build_map(bool outputs);
    void count_bytes(bool outputs);
    // Calls `visit(area, place in the process image, octets)` for the SyncManagers with a length. One loop for all
    // functions: each instance would need its code again.
    using UsedVisit = void (*)(void* function, const ProcessDataArea& area, std::size_t at, std::size_t bytes);
    void visit_used(bool outputs, UsedVisit visit, void* function) const;
    template <class F>
    void for_each_used(bool outputs, F&& f) const {
        const auto visit = [](void* function, const ProcessDataArea& area, std::size_t at, std::size_t bytes) {
            (*static_cast<std::remove_reference_t<F>*>(function))(area, at, bytes);
        };
        visit_used(outputs, visit, &f);
    }
    void update(unsigned parts, std::uint32_t areas, Time now);
    void read_sync_settings();
    [[nodiscard]] SyncMode chosen_mode();
    void show_sync_types();
    void restore_sync_types();
    void find_sync_objects();
    void count_missed_frames();
    void add_to_sync_counter(std::uint16_t object, std::uint8_t subindex);
    void show_sync_error(bool error);
    void take_outputs(std::uint32_t areas, Time now);
    void apply_outputs();
    void give_inputs(Time now);
    void discard_old_outputs();
    void find_silent(Time now);
    void set_watchdog(Time now);
    void look_again(Time now);
    void begin_measurement();
    void measured(bool outputs, Duration time);
    void forget_old_outputs(Time now);
    void forget_outputs(Time now);
    [[nodiscard]] Time lost_sync() const;
    void forget_lost_sync(Time now);
    void acknowledge(wire::Register status);
    void count_sync(Time now);
    void count_missed_syncs(Time now);
    void watch_lock();
    void note_phase(Time now);
    void serve_sync(Time now);
    void arm(Time now);
    [[nodiscard]] bool undriven() const;
    [[nodiscard]] bool outputs_seen() const { return (output_areas_ & ~arrived_) == 0; }
    [[nodiscard]] Duration own_period() const;
    [[nodiscard]] std::uint32_t outputs_waiting(std::uint32_t events, Time now);
    [[nodiscard]] bool inputs_fetched(std::uint32_t events) const;
    [[nodiscard]] bool inputs_drive() const {
        return undriven() && input_bytes_ != 0 && !inputs_silent_ && mode_ != SyncMode::free_run;
    }
    [[nodiscard]] Duration watchdog_time();
    [[nodiscard]] bool watchdog_running();

    EscAccess& esc_;
    Application& application_;
    ObjectDictionary& dictionary_;
    MutableBytes outputs_;
    MutableBytes inputs_;
    PdoMapping output_map_;
    PdoMapping input_map_;
    ProcessDataSizes sizes_{};
    std::uint16_t output_bytes_ = 0;  // of all SyncManagers of the direction
    std::uint16_t input_bytes_ = 0;
    // SyncManagers, as bits of their AL events.
    std::uint32_t output_areas_ = 0;
    std::uint32_t last_output_ = 0;  // the one that drives
    std::uint32_t last_input_ = 0;
    std::uint32_t silent_ = 0;    // outputs that do not raise events
    std::uint32_t unseen_ = 0;    // outputs of one octet, whose arrival cannot be detected
    std::uint32_t arrived_ = 0;   // outputs that have arrived since PREOP, or since they were too old
    bool output_mapped_ = false;  // mapped by objects; false: the application copies the outputs itself
    bool input_mapped_ = false;
    bool running_ = false;
    bool outputs_valid_ = false;    // true in OP
    bool outputs_expired_ = false;  // outputs were seen, but they are too old
    bool sync_seen_ = false;        // SYNC0 has occurred in SAFEOP or OP, and has not stopped since then
    bool sync_began_ = false;       // SYNC0 has arrived since PREOP: last_sync_ is its time
    bool inputs_silent_ = false;    // the last input SyncManager does not raise events
    bool watched_ = false;          // the watchdog of the ESC monitors the outputs
    bool sync_by_pin_ = false;      // sync0() was called, so the AL event is ignored
    bool sync1_by_pin_ = false;
    bool acknowledged_sync_ = false;  // SYNC signals stay active until their status is read
    SyncMode mode_ = SyncMode::process_data;
    std::uint32_t sync_cycle_ns_ = 0;
    std::uint32_t syncs_per_frame_ = 1;
    std::uint32_t syncs_ = 0;  // SYNC0 signals of the present frame period
    Duration watchdog_{};
    std::uint32_t late_ = 0;  // outputs that have not arrived since the last frame period ended
    unsigned missed_ = 0;     // frame periods since the last outputs
    // For DcDescription::pll: periods in succession with one frame, and the frames of this period.
    unsigned locked_ = 0;
    unsigned frames_ = 0;
    std::uint32_t syncs_of_period_ = 0;
    bool collided_ = false;  // a frame of this period arrived together with SYNC0
    unsigned sync_error_limit_ = 0;
    Time last_outputs_{};
    Time last_sync_{};
    Time sync_grid_{};          // the time of the last SYNC0, without the delay until it was served
    Time next_cycle_ = kNever;  // the application is called without an event
    Time next_poll_ = kNever;   // used when SyncManagers of the outputs do not raise events
    Time next_watch_ = kNever;
    // The types that the master has written, of all areas of the outputs and of the inputs. The objects show the type
    // in use while the process data run.
    std::array<std::uint16_t, 2 * (1 + kMostMoreAreas)> written_types_{};
    MutableBytes measure_object_;    // memory of 0x1C32:08; empty: the object does not exist
    MutableBytes timestamp_object_;  // memory of 0x10F8
    bool measuring_ = false;
    Counters counters_;
};

}  // namespace margay::subdevice
