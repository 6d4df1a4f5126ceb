// What a storm does, as plain data: the devices of a segment, settings, and steps one after the other. A plan is made
// from a seed, written as text, read again, and made smaller.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace margay::storm {

struct DevicePlan {
    std::uint32_t id = 0;  // steps name the device by it; it stays when other devices are taken out
    std::string name;      // of the device library
    std::vector<std::string> quirks;
    std::int32_t parent = -1;  // id of the device whose port leads here; -1: the master
    std::uint32_t port = 0;    // of the parent
};

// Who does a step: the world may act while the owner waits in a blocking call, and so may other threads.
enum class Actor : std::uint8_t { world, other, owner };

enum class Op : std::uint8_t {
    // The segment.
    cut,           // device: the cable that leads to it is interrupted
    mend,          // device
    power_off,     // device
    power_on,      // device
    noise,         // lost, corrupted: frames per million, on the wire
    eeprom_nacks,  // device, count: its EEPROM does not acknowledge so many commands
    eeprom_word,   // device, word, value: somebody else writes its EEPROM
    halt,          // device: its processor stops until the power is switched
    quirk,         // device, number of a quirk of the firmware: a manner is switched on while it runs
    replug,        // device: pulled out, and put in again without a break
    // The NIC, in frames per million.
    drop,       // on the way out, on the way back
    duplicate,  // on the way out, on the way back
    delay,      // rate, microseconds: frames on the way back come later and out of order
    flip,       // bits of frames on the way back are turned over, which no FCS has seen
    busy,       // rate, microseconds: the NIC takes no frame for so long
    // Other threads.
    submit_other,  // slot, kind, slave, a, b
    ask_cancel,    // slot
    // The owner.
    submit,       // slot, kind, slave, a, b
    cancel,       // slot
    destroy,      // slot
    cycles,       // 0 or 1: whether cycles run
    map,          // group: config_map(), which waits
    late,         // microseconds by which the owner is late with each poll()
    watch,        // microseconds: watch_mailboxes()
    configure,    // slave, what, value: a field of its configuration
    write_state,  // slave, state: the blocking call
    count_of_ops,
};

struct Step {
    std::uint32_t after_us = 0;
    Op op = Op::cut;
    std::array<std::uint32_t, 5> args{};
};

struct OpInfo {
    std::string_view name;
    std::uint8_t args;
    Actor actor;
    bool names_device;  // args[0] is the id of one
};
[[nodiscard]] const OpInfo& info(Op op);

// Numbers that hold for the whole run.
struct Settings {
    std::uint32_t calm = 0;         // 1: the segment is in OP and supervised when the steps begin, and again at the end
    std::uint32_t cycle_us = 1000;  // interval of the cycle
    std::uint32_t groups = 1;       // slaves take turns in them
    std::uint32_t bits = 0;         // 1: packing by bits
    std::uint32_t overlapped = 0;   // inputs and outputs at the same logical address
    std::uint32_t group_lrd_lwr = 0;  // no LRW in any group
    std::uint32_t slave_lrd_lwr = 0;  // every so many slaves blocks LRW; 0: none
    std::uint32_t in_flight = 1;      // cycles on their way
    std::uint32_t acyclic_bytes = 1498;
    std::uint32_t reserve_bytes = 0;
    std::uint32_t al_status = 0;       // a BRD of AL status with each cycle
    std::uint32_t mailbox_status = 0;  // every so many slaves maps its mailbox status; 0: none
    std::uint32_t watchdog_us = 0;     // of process data; 0: the slave's own
    std::uint32_t tasks = 0;           // Limits
    std::uint32_t frames = 64;
    std::uint32_t process_frames = 8;
    // 1: the slaves that are there, 2: with a wrong one, 3: with a missing one, 4: some are switched off at first, and
    // places are kept for them by the PDOs of their setup, 5: a hot connect group
    std::uint32_t expect = 0;
    // 1: transition hooks that are busy at first, 2: that fail now and then, 3: that read objects, 4: that cancel
    // requests
    std::uint32_t hooks = 0;
    std::uint32_t startup = 0;    // 1: a list of commands for every slave
    std::uint32_t callback = 0;   // 1: events have a callback, 2: that cancels requests, 3: and the supervision
    std::uint32_t copies = 0;     // 1: inputs of a slave become outputs of another one
    std::uint32_t shared = 0;     // 1: groups have a shared image
    std::uint32_t wire_time = 0;  // frames take their time on the wire
    std::uint32_t round_trip_us = 100;
    std::uint32_t supervise_target = 8;
    std::uint32_t line_ms = 0;     // error counters are read this often
    std::uint32_t close_busy = 0;  // 1: the context goes away while requests are busy
};
struct SettingInfo {
    std::string_view name;
    std::uint32_t Settings::*value;
};
[[nodiscard]] const std::vector<SettingInfo>& setting_infos();

struct Plan {
    std::uint64_t seed = 0;
    Settings settings;
    std::vector<DevicePlan> devices;  // a parent stands before its children
    std::vector<Step> steps;
};

[[nodiscard]] Plan make_plan(std::uint64_t seed);
[[nodiscard]] std::string to_text(const Plan& plan);
// Nothing when the text is no plan; `why` says which line is wrong.
[[nodiscard]] std::optional<Plan> parse_plan(std::string_view text, std::string& why);

// Takes a device out: its children hang at its parent where a port is free, and steps that name it go.
[[nodiscard]] Plan without_device(const Plan& plan, std::size_t which);

}  // namespace margay::storm
