// Process data: outputs from SM2, the application hook, inputs to SM3, and what watches over them (ETG.1000.6
// "Process data", ETG.1020 "Synchronization").
#pragma once

#include "subdevice/application.hpp"
#include "subdevice/pdo_mapping.hpp"

#include <algorithm>

namespace margay::subdevice {

// Raw process images and the mapping's lists; how much of each is the author's choice.
template <std::size_t OutputBytes, std::size_t InputBytes, std::size_t Entries>
struct ProcessDataMemory {
    std::array<std::byte, OutputBytes> outputs{};
    std::array<std::byte, InputBytes> inputs{};
    std::array<MappedEntry, Entries> output_entries{};
    std::array<MappedEntry, Entries> input_entries{};
};

enum class SyncMode : std::uint8_t {
    process_data,  // the application runs when outputs have come (inputs have been fetched, where there are
                   // no outputs)
    dc_sync0,      // the application runs with SYNC0
};

// The parts of one update, to be combined.
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

    // The sizes that assignment and mapping give. Where the dictionary has no assignment object, the
    // description's maximum is the size.
    [[nodiscard]] ProcessDataSizes sizes();

    // PREOP→SAFEOP: inputs are there before the master sees SAFEOP.
    void start(Time now);
    // SAFEOP→OP: what has not come yet, outputs or SYNC0; none when nothing is missing.
    [[nodiscard]] AlStatusCode missing() const;
    void start_outputs(Time now);
    void stop_outputs(Time now);
    void stop();

    // Parts of an update, as the mode of operation wants them.
    void process(unsigned parts, Time now);
    // Everything that the events ask for, the way the sync mode has it.
    void serve(Time now, std::uint32_t events);

    // What is wrong, if anything, and when it wants to be asked again.
    [[nodiscard]] AlStatusCode watch(Time now, std::uint32_t events);
    [[nodiscard]] Time watch_deadline() const;
    [[nodiscard]] Time serve_deadline() const { return running_ ? std::min(next_cycle_, next_poll_) : kNever; }

    [[nodiscard]] bool running() const { return running_; }
    [[nodiscard]] SyncMode mode() const { return mode_; }
    [[nodiscard]] bool has_outputs() const { return sizes_.outputs_bytes != 0; }
    // AL events that belong to process data in the present mode; 0 below SAFEOP.
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
    bool output_mapped_ = false;  // by objects, else by the application
    bool input_mapped_ = false;
    bool running_ = false;
    bool outputs_valid_ = false;  // OP
    bool outputs_seen_ = false;
    bool sync_seen_ = false;
    bool silent_ = false;   // SM2 does not raise events
    bool watched_ = false;  // by the ESC's watchdog
    SyncMode mode_ = SyncMode::process_data;
    Duration sync_cycle_{};
    Duration watchdog_{};
    unsigned missed_ = 0;  // SYNC0 without new outputs before it
    Time last_outputs_{};
    Time last_sync_{};
    Time next_cycle_ = kNever;  // free run
    Time next_poll_ = kNever;   // where SM2 does not tell
    Time next_watch_ = kNever;
};

}  // namespace margay::subdevice
