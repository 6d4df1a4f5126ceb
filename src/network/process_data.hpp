// Groups of process data as the network keeps them, and their cycle: no coroutine, no allocation, one send a frame.
#pragma once

#include "link/cycle.hpp"
#include "network/image_datagrams.hpp"

#include <margay/group.hpp>
#include <margay/result.hpp>

#include <array>
#include <span>

namespace margay {

struct ProcessGroup : Group {
    ImageLayout layout;
    std::span<PreparedFrame> prepared;
    std::span<DatagramPlan> plans;     // what each datagram is, in the order of `datagrams`
    std::span<DatagramStatus> statuses;
    std::span<const Slave> slaves;     // of the network
    std::array<PreparedReading, ReadingPlans::kMost> readings{};
    std::uint8_t number = 0;
    bool extras = false;               // copies from slave to slave, or a shared image
    bool mapping = false;              // config_map() is at it
    bool told_short = false;           // the supervision has told so
    bool unexpected = false;           // a cycle was not usable, or a slave is back: for the supervision
    std::uint16_t cycles_lost = 0;     // of which frames did not come back, in a row
};

// What all groups share: frames and datagrams are handed out to them in runs. Those of one index belong together.
struct ProcessTables {
    std::span<ProcessGroup> groups;
    std::span<PreparedFrame> frames;
    std::span<PreparedDatagram> datagrams;
    std::span<DatagramStatus> statuses;
    std::span<DatagramPlan> plans;
    std::span<DatagramPlan> scratch;  // as many

    // LWR and LRD may share a frame.
    [[nodiscard]] static constexpr std::size_t datagrams_for(std::size_t frames) { return 2 * frames; }
};

// Takes the group's frames away from it. Those in flight are given up.
void unprepare(ProcessGroup& group, Link& link, Time now);

// Gives the group frames for the datagrams planned in `tables.scratch`, whose `count` come first there, and for its readings. Errors: too_many_frames.
[[nodiscard]] Result<> prepare(ProcessTables& tables, ProcessGroup& group, std::size_t count, const MacAddress& source);

// Sends all frames of a cycle. Errors: nic (a frame was not taken; actual: the system's error number), unknown_group (not mapped).
[[nodiscard]] Error not_sent(const ProcessGroup& group, Link& link);
void set_outputs(ProcessGroup& group);
[[nodiscard, gnu::always_inline]] inline Result<> send_cycle(ProcessGroup& group, Link& link, Time now) {
    if (group.extras) [[unlikely]] set_outputs(group);
    if (group.mapped && link.send_cycle(group.prepared, now, group.config.acyclic_bytes) == SendStatus::sent) return Result<>();
    return not_sent(group, link);
}

// Ends a cycle: what is not back is given up. Returns the working counter, of all datagrams together. Errors: no_frame (actual: frames
// missing), working_counter (expected, actual; slave: the first of those in a datagram that fell short that is known to be lost).
void give_inputs(ProcessGroup& group);
[[nodiscard]] Result<std::uint32_t> judge_cycle(ProcessGroup& group, Link& link, Time now);
[[nodiscard, gnu::always_inline]] inline Result<std::uint32_t> end_cycle(ProcessGroup& group, Link& link, CycleEnd end, Time now) {
    if (end != CycleEnd::right || !group.mapped) [[unlikely]] return judge_cycle(group, link, now);
    group.cycles_lost = 0;
    if (group.extras) [[unlikely]] give_inputs(group);
    return group.expected_wkc;
}

}  // namespace margay
