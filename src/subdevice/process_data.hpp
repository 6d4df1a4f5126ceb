// Process data of a device: copies the outputs from SM2, calls the application, copies the inputs to SM3, and monitors
// watchdog and synchronization (ETG.1000.6 "Process data", ETG.1020 "Synchronization").
#pragma once

#include "subdevice/application.hpp"
#include "subdevice/pdo_mapping.hpp"

#include <algorithm>

namespace margay::subdevice {

// Memory for the raw process images and for the lists of the mapping. The author chooses the sizes.
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
};

// The parts of one update. They can be combined.
namespace part {
inline constexpr unsigned kOutputs = 1;
inline constexpr unsigned kApplication = 2;
inline constexpr unsigned kInputs = 4;
inline constexpr unsigned kAll = 7;
}  // namespace part

class ProcessData {
  public:
    template <std::size_t O, std::size_t I, std::size_t E>
    ProcessData(EscAccess& esc, Application& application, ObjectDictionary& dictionary,
                ProcessDataMemory<O, I, E>& memory)
        : esc_(esc),
          application_(application),
          dictionary_(dictionary),
          outputs_(memory.outputs),
          inputs_(memory.inputs),
          output_map_(memory.output_entries),
          input_map_(memory.input_entries) {}

    // The sizes from assignment and mapping. When the dictionary has no assignment object, the size is that of
    // Application::process_data_sizes(), or the maximum of the description.
    [[nodiscard]] ProcessDataSizes sizes();

    // PREOP→SAFEOP: writes the first inputs before the master reads SAFEOP.
    void start(Time now);
    // SAFEOP→OP: the condition that is not yet met (outputs or SYNC0 have not arrived); AlStatusCode::none when all are
    // met.
    [[nodiscard]] AlStatusCode missing() const;
    void start_outputs(Time now);
    void stop_outputs(Time now);
    void stop();

    // Executes parts of an update.
    void process(unsigned parts, Time now);
    // Executes the updates that the AL events and the sync mode require.
    void serve(Time now, std::uint32_t events);

    // watch() returns the AL status code of an error, or none. watch_deadline() is the time of its next call.
    [[nodiscard]] AlStatusCode watch(Time now, std::uint32_t events);
    [[nodiscard]] Time watch_deadline() const;
    [[nodiscard]] Time serve_deadline() const { return running_ ? std::min(next_cycle_, next_poll_) : kNever; }

    [[nodiscard]] bool running() const { return running_; }
    [[nodiscard]] SyncMode mode() const { return mode_; }
    [[nodiscard]] bool has_outputs() const { return sizes_.outputs_bytes != 0; }
    // AL events that process data use in the current mode; 0 below SAFEOP.
    [[nodiscard]] std::uint32_t events() const;

  private:
    void take_outputs(Time now);
    void give_inputs();
    void count_sync(Time now);
    [[nodiscard]] bool outputs_waiting(std::uint32_t events);
    [[nodiscard]] Duration watchdog_time();

    EscAccess& esc_;
    Application& application_;
    ObjectDictionary& dictionary_;
    MutableBytes outputs_;
    MutableBytes inputs_;
    PdoMapping output_map_;
    PdoMapping input_map_;
    ProcessDataSizes sizes_{};
    bool output_mapped_ = false;  // mapped by objects; false: the application copies the outputs itself
    bool input_mapped_ = false;
    bool running_ = false;
    bool outputs_valid_ = false;  // true in OP
    bool outputs_seen_ = false;
    bool sync_seen_ = false;
    bool silent_ = false;   // SM2 does not raise events
    bool watched_ = false;  // the watchdog of the ESC monitors the outputs
    SyncMode mode_ = SyncMode::process_data;
    Duration sync_cycle_{};
    Duration watchdog_{};
    unsigned missed_ = 0;  // SYNC0 events since the last outputs
    Time last_outputs_{};
    Time last_sync_{};
    Time next_cycle_ = kNever;  // of the free run cycle
    Time next_poll_ = kNever;   // used when SM2 does not raise events
    Time next_watch_ = kNever;
};

}  // namespace margay::subdevice
