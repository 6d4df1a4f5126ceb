// Groups of process data as the network keeps them, and their cycle: no coroutine, no allocation, one send a frame.
#pragma once

#include "link/cycle.hpp"
#include "network/image_datagrams.hpp"

#include <margay/group.hpp>
#include <margay/result.hpp>

#include <array>
#include <atomic>
#include <span>

namespace margay {

// Cycles of a group that are under way at once. `sent` and what follows it is written by the thread that sends,
// `received` by the owner.
struct Overlap {
    std::uint8_t sets = 1;  // of frames, each for one cycle; 1: cycles do not overlap
    std::array<Time, GroupConfiguration::kMostCyclesInFlight> sent_at{};
    std::atomic<std::uint32_t> sent{0};
    std::uint8_t send_set = 0;
    std::atomic<std::uint32_t> received{0};
    std::uint8_t receive_set = 0;
};

struct ProcessGroup : Group {
    ImageLayout layout;
    std::span<PreparedFrame> prepared;  // of overlapping cycles all sets
    Overlap overlap;
    std::span<DatagramPlan> plans;  // what each datagram is, in the order of `datagrams`
    std::span<DatagramStatus> statuses;
    std::span<const Slave> slaves;  // of the network
    std::array<PreparedReading, ReadingPlans::kMost> readings{};
    CyclePace pace;
    std::uint8_t number = 0;
    // Not mapped or not complete, cycles overlap, or there are extras: not the path that nearly every cycle takes.
    bool special = true;
    bool under_way = false;   // a cycle was sent that receive_processdata() has not ended; not where cycles overlap
    bool extras = false;      // copies from slave to slave, or a shared image
    bool mapping = false;     // config_map() is at it
    bool complete = false;    // mapped, and its datagrams tell of every slave that is wanted
    bool told_short = false;  // the supervision has told so
    bool unexpected = false;  // a cycle was not usable, or a slave is back: for the supervision
    std::uint16_t cycles_lost = 0;  // of which frames did not come back, in a row
};

// What all groups share: frames and datagrams are handed out to them in runs. Those of one index belong together.
struct ProcessTables {
    std::span<ProcessGroup> groups;
    std::span<PreparedFrame> frames;
    std::span<PreparedDatagram> datagrams;
    std::span<DatagramStatus> statuses;
    std::span<DatagramPlan> plans;
    std::span<DatagramPlan> scratch;  // as many

    // LWR, LRD and the LRD of the mailbox status may share a frame.
    [[nodiscard]] static constexpr std::size_t datagrams_for(std::size_t frames) { return 3 * frames; }
};

// Takes the group's frames away from it. Those in flight are given up.
void unprepare(ProcessGroup& group, Link& link, Time now);

// Gives the group frames for the datagrams planned in `tables.scratch`, whose `count` come first there, and for its
// readings. Errors: too_many_frames.
[[nodiscard]] Result<> prepare(ProcessTables& tables, ProcessGroup& group, std::size_t count, Link& link);

// Sends all frames of a cycle. Errors: nic (a frame was not taken; actual: the system's error number), unknown_group
// (not mapped).
[[nodiscard]] Error not_sent(const ProcessGroup& group, Link& link);
void set_outputs(ProcessGroup& group);
// Of a group that is not special, or whose outputs are set.
[[nodiscard, gnu::always_inline]] inline Result<> send_frames(ProcessGroup& group, Link& link, Time now) {
    ++group.cycles_sent;
    group.under_way = true;
    if (link.send_cycle(group.prepared, group.pace, now, group.config.acyclic_bytes) == SendStatus::sent)
        return Result<>();
    return not_sent(group, link);
}
[[nodiscard]] Result<> send_cycle(ProcessGroup& group, Link& link, Time now);

// Ends a cycle: what is not back is given up. Returns the working counter, of all datagrams together. Errors: no_frame
// (actual: frames missing), working_counter (expected, actual; slave: the first of those in a datagram that fell short
// that is known to be lost; detail: Error::kOthersFresh when all datagrams are fresh), no_cycle.
void give_inputs(ProcessGroup& group);
[[nodiscard]] Result<std::uint32_t> judge_cycle(ProcessGroup& group, std::span<PreparedFrame> frames, Link& link,
                                                Time now);
[[nodiscard, gnu::always_inline]] inline Result<std::uint32_t> end_cycle(ProcessGroup& group, Link& link, CycleEnd end,
                                                                         Time now) {
    group.cycle_received = group.cycles_sent;
    group.under_way = false;
    if (end != CycleEnd::right || group.special) [[unlikely]]
        return judge_cycle(group, group.prepared, link, now);
    group.cycles_lost = 0;
    return group.expected_wkc;
}

[[nodiscard]] Error nothing_sent(const ProcessGroup& group);

// Whether the inputs of the slave (of one with outputs only: its outputs) were exchanged with the last cycle that was
// received. Of a slave of this group.
[[nodiscard]] bool is_fresh(const ProcessGroup& group, const Slave& slave);
// The slave takes part from the next cycle that is sent on.
void note_joining(const ProcessGroup& group, Slave& slave);
// By GroupConfiguration::lost_inputs: what the inputs of slaves become that do not take part.
void settle_lost_inputs(ProcessGroup& group);

// The same where cycles overlap. Errors of sending besides: busy (all cycles are under way; expected: how many).
[[nodiscard]] Result<> send_overlapped(ProcessGroup& group, Link& link, Time now);
// The owner's: the oldest cycle that is under way, empty when there is none; how it has ended.
[[nodiscard]] std::span<PreparedFrame> oldest_cycle(ProcessGroup& group);
[[nodiscard]] inline Time sent_at(const ProcessGroup& group) {
    return group.overlap.sent_at[group.overlap.receive_set];
}
[[nodiscard]] Result<std::uint32_t> end_overlapped(ProcessGroup& group, Link& link, Time now);

}  // namespace margay
