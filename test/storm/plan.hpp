// A storm plan as plain data: the devices of a segment, settings, and steps in sequence. A plan can be generated from
// a seed, written as text, read from text, and reduced.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace margay::storm {

struct DevicePlan {
    std::uint32_t id = 0;  // used by steps to name the device; it does not change when other devices are removed
    std::string name;      // name in the device library
    std::vector<std::string> quirks;
    std::int32_t parent = -1;  // id of the device to which this device is connected; -1: the master
    std::uint32_t port = 0;    // port of the parent
};

// Who performs a step. Steps of the world and of other threads can occur while the owner waits in a blocking call.
enum class Actor : std::uint8_t { world, other, owner };

enum class Op : std::uint8_t {
    // Steps of the segment.
    cut,           // device: breaks the cable to this device
    mend,          // device
    power_off,     // device
    power_on,      // device
    noise,         // lost, corrupted: frames per million, on the wire
    eeprom_nacks,  // device, count: the EEPROM does not acknowledge this many commands
    eeprom_word,   // device, word, value: another master writes the EEPROM
    halt,          // device: its processor stops until the power is switched
    quirk,         // device, number of a quirk: the firmware gets the quirk while it runs
    replug,        // device: unplugs and replugs it without a pause
    // Steps of the NIC; rates in frames per million.
    drop,       // rate of outgoing frames, rate of incoming frames
    duplicate,  // rate of outgoing frames, rate of incoming frames
    delay,      // rate, microseconds: incoming frames arrive later and out of order
    flip,       // rate: bits of incoming frames are inverted, not detected by the FCS
    busy,       // rate, microseconds: the NIC accepts no frame during this time
    // Steps of other threads.
    submit_other,  // slot, kind, slave, a, b
    ask_cancel,    // slot
    // Steps of the owner.
    submit,       // slot, kind, slave, a, b
    cancel,       // slot
    destroy,      // slot
    cycles,       // 0 or 1: whether cycles are sent
    map,          // group: calls config_map(), which blocks
    late,         // microseconds by which each poll() of the owner is late
    watch,        // microseconds: argument of watch_mailboxes()
    configure,    // slave, what, value: sets a field of the slave's configuration
    write_state,  // slave, state: calls writestate(), which blocks
    // device, address, value, octets: writes any value to a register of this device. Some time later the power of the
    // device is switched off and on, because nothing else mends its registers.
    hostile,
    eeprom_update,  // device, value, how: writes the configuration area of its EEPROM, see World::update_eeprom()
    // Steps of the segment, added later: their numbers do not change the numbers of the steps above.
    eeprom_deaf,  // device, milliseconds (at most 190): its EEPROM acknowledges nothing during this time
    // Milliseconds, blocks: the arena has only so many free blocks of 64 octets during this time. 0 ms: ends it.
    hoard,
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
    bool names_device;  // args[0] is the id of a device
};
[[nodiscard]] const OpInfo& info(Op op);

// Settings for the whole run.
struct Settings {
    std::uint32_t calm = 0;         // 1: the segment is in OP and supervised when the steps begin, and again at the end
    std::uint32_t cycle_us = 1000;  // interval of the cycle
    std::uint32_t groups = 1;       // number of groups; slaves are assigned to them in rotation
    std::uint32_t bits = 0;         // 1: packed bits
    std::uint32_t overlapped = 0;   // inputs and outputs have the same logical addresses
    std::uint32_t group_lrd_lwr = 0;  // no group uses LRW
    std::uint32_t slave_lrd_lwr = 0;  // every n-th slave has no LRW; 0: none
    std::uint32_t in_flight = 1;      // number of cycles in flight
    std::uint32_t acyclic_bytes = 1498;
    std::uint32_t reserve_bytes = 0;
    std::uint32_t al_status = 0;       // a BRD of the AL status in each cycle
    std::uint32_t mailbox_status = 0;  // every n-th slave maps its mailbox status; 0: none
    std::uint32_t watchdog_us = 0;     // watchdog of process data; 0: the value of the slave
    std::uint32_t tasks = 0;           // Limits::tasks
    std::uint32_t frames = 64;
    std::uint32_t process_frames = 8;
    // 1: the slaves of the segment, 2: with a wrong slave, 3: with a missing slave, 4: some slaves are switched off at
    // first, and the PDOs of their setup keep their places, 5: a hot connect group
    std::uint32_t expect = 0;
    // Transition hooks: 1: that are busy at first, 2: that sometimes fail, 3: that read objects, 4: that cancel
    // requests
    std::uint32_t hooks = 0;
    std::uint32_t startup = 0;    // 1: each slave has a list of start-up commands
    std::uint32_t callback = 0;   // 1: a callback receives events, 2: it also cancels requests, 3: and the supervision
    std::uint32_t copies = 0;     // 1: inputs of one slave become outputs of another one
    std::uint32_t shared = 0;     // 1: groups have a shared image
    std::uint32_t wire_time = 0;  // frames need time on the wire
    std::uint32_t round_trip_us = 100;
    std::uint32_t supervise_target = 8;
    std::uint32_t line_ms = 0;  // interval for reading the error counters
    // Incoming frames per million that are lost while the segment is scanned and mapped for the first time.
    std::uint32_t bring_up_drop = 0;
    std::uint32_t close_busy = 0;  // 1: the context is destroyed while requests are busy
    std::uint32_t unmarked = 0;    // 1: replies come back without the mark of the first ESC
};
struct SettingInfo {
    std::string_view name;
    std::uint32_t Settings::*value;
};
[[nodiscard]] const std::vector<SettingInfo>& setting_infos();

struct Plan {
    std::uint64_t seed = 0;
    Settings settings;
    std::vector<DevicePlan> devices;  // a parent is listed before its children
    std::vector<Step> steps;
};

[[nodiscard]] Plan make_plan(std::uint64_t seed);
[[nodiscard]] std::string to_text(const Plan& plan);
// Returns nothing when the text is not a plan; `why` then names the wrong line.
[[nodiscard]] std::optional<Plan> parse_plan(std::string_view text, std::string& why);

// Removes a device. Its first child is connected to the port of the removed device at the parent. The other children
// and all devices behind them are removed, too. Steps that name a removed device are removed.
[[nodiscard]] Plan without_device(const Plan& plan, std::size_t which);

}  // namespace margay::storm
