// Groups of process data with their frames, and their cycle. The cycle uses no coroutine, does not allocate, and sends
// each frame by one call to the NIC.
#pragma once

#include "link/cycle.hpp"
#include "network/image_datagrams.hpp"
#include "network/slave_marks.hpp"

#include <margay/group.hpp>
#include <margay/result.hpp>
#include <margay/shared_image.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <span>

namespace margay {

struct Master;

// The access of the cycle to the image of another thread; nullptr: there is no shared image.
struct SharedImageAccess {
    [[nodiscard]] static bool attach(SharedImage* shared, std::size_t output_bytes, std::size_t input_bytes) {
        return shared == nullptr || shared->attach(output_bytes, input_bytes);
    }
    static void take_outputs(SharedImage* shared, std::span<std::byte> image) {
        if (shared != nullptr) shared->take_outputs(image);
    }
    static void give_inputs(SharedImage* shared, std::span<const std::byte> image) {
        if (shared != nullptr) shared->give_inputs(image);
    }
};

// State of overlapping cycles of a group. The sending thread writes `sent_at`, `sent` and `send_set`, the owner's
// thread writes `received` and `receive_set`.
struct Overlap {
    std::array<Time, GroupConfiguration::kMostCyclesInFlight> sent_at{};
    std::atomic<std::uint32_t> sent{0};
    std::atomic<std::uint32_t> received{0};
    std::uint8_t sets = 1;  // sets of frames, each for one cycle; 1: cycles do not overlap
    std::uint8_t send_set = 0;
    std::uint8_t receive_set = 0;
    // These three members are used by the owner's thread, also if cycles do not overlap; see coincidence.hpp. `doubts`:
    // how often the working counters of the group were doubted. `believed_from`: the low half of the number of the
    // first cycle whose working counters can be believed again. `last_sums`: a check value of the working counters of
    // the last cycle that has not passed the fast check.
    std::uint8_t doubts = 0;
    std::uint16_t believed_from = 0;
    std::uint16_t last_sums = 0;
};

class LeavingExchange;

struct ProcessGroup : Group {
    LeavingExchange* leaving = nullptr;  // the slaves whose FMMUs are being cleared: see members.hpp
    ImageLayout layout;
    std::span<PreparedFrame> prepared;  // if cycles overlap: the frames of all sets
    Overlap overlap;
    std::span<DatagramPlan> plans;  // the plan of each datagram, in the order of `datagrams`
    std::span<DatagramStatus> statuses;
    std::span<const Slave> slaves;  // all slaves of the network
    std::span<SlaveMarks> marks;    // the marks of all slaves
    std::array<PreparedReading, ReadingPlans::kMost> readings{};
    CyclePace pace;
    Time seen_at{};  // when what_is_wrong() saw `cycles_seen` cycles for the first time
    std::uint32_t cycles_seen = 0;
    std::uint32_t settled_after = 0;  // see `settling`
    std::uint16_t dc_reference = 0;   // the slave whose time the cycle carries, as config_map() has found it
    std::uint8_t number = 0;
    // Not mapped, not complete, without frames, with overlapping cycles or with extras: the fast path of the cycle
    // cannot be used.
    bool special = true;
    bool under_way = false;           // a cycle was sent that is not received yet; unused where cycles overlap
    bool extras = false;              // copies from slave to slave, or a shared image
    bool mapping = false;             // config_map() is executing for this group
    bool was_mapped = false;          // since the last scan, or since run_cycle() began: now its data is missing
    bool complete = false;            // mapped completely, and the working counters contain every wanted slave
    bool short_reported : 1 = false;  // the supervision has reported a working counter that fell short
    bool fell_short : 1 = false;      // without a supervision: a working counter has fallen short
    bool was_right : 1 = false;       // without a supervision: readstate() has found the cycles right since the mapping
    bool unexpected : 1 = false;      // for the supervision: a cycle was not usable, or a slave is back
    // The expected working counters have changed, and no cycle after `settled_after` was received.
    bool settling : 1 = false;
    // A working counter was neither the accepted one nor that of all slaves, or did not come, and the states of the
    // slaves that take part were not read since. See coincidence.hpp.
    bool sums_doubted : 1 = false;
    // The states were read, and the cycles from `overlap.believed_from` on are believed.
    bool sums_confirmed : 1 = false;
    bool confirming : 1 = false;    // the states are being read
    bool by_position : 1 = false;   // ClockSettings::by_position, as config_map() has found it
    bool holds_inputs : 1 = false;  // GroupConfiguration::hold_inputs, as config_map() has found it
    std::uint8_t next_place = 0;    // where the logical addresses of the next mapping begin: see next_start()
    // The low octet of the number of the last cycle that did not bring the inputs of all slaves that take part.
    std::uint8_t unfresh_cycle = 0;
    // Cycles to be received that were sent before a slave took part, or before one left the exchange.
    std::uint8_t joins_under_way : 4 = 0;
    std::uint8_t leaves_under_way : 4 = 0;
    std::uint16_t cycles_lost = 0;  // consecutive cycles with frames that did not come back
};

// Whether every wanted slave took part in the last cycle that was received.
[[nodiscard]] inline bool is_right(const ProcessGroup& group) {
    return group.complete && std::ranges::all_of(group.statuses, [](const DatagramStatus& d) { return d.right(); });
}

// Tables shared by all groups: each group has a run of frames and a run of datagrams. Elements of `datagrams`,
// `statuses` and `plans` with the same index belong together.
struct ProcessTables {
    std::span<ProcessGroup> groups;
    std::span<PreparedFrame> frames;
    std::span<PreparedDatagram> datagrams;
    std::span<DatagramStatus> statuses;
    std::span<DatagramPlan> plans;
    std::span<DatagramPlan> scratch;  // same size as `plans`

    // LWR, LRD and the LRD of the mailbox status may share a frame.
    [[nodiscard]] static constexpr std::size_t datagrams_for(std::size_t frames) { return 3 * frames; }
};

// Removes the frames of the group. Frames in flight are given up.
void unprepare(ProcessGroup& group, Link& link, Time now);

// Assigns frames to the group for the first `count` datagrams of `tables.scratch`, where they were planned, and for its
// readings. Errors: too_many_frames.
[[nodiscard]] Result<> prepare(ProcessTables& tables, ProcessGroup& group, std::size_t count, Link& link);

// The error of a cycle of which frames were not sent; callable from the cycle. Their datagrams have not come: old
// inputs are not fresh. Errors: nic (actual: the system's error number), unknown_group (not mapped).
[[nodiscard]] Error not_sent(ProcessGroup& group, Link& link);
void set_outputs(ProcessGroup& group);
// The slave of the copy whose bits are not part of its data in this group; 0: the copy can be executed.
[[nodiscard]] std::uint16_t invalid_end(const ProcessGroup& group, const SlaveToSlave& copy);
// For a group that is not special, or whose outputs are already set.
[[nodiscard, gnu::always_inline]] inline Result<> send_frames(ProcessGroup& group, Link& link, Time now) {
    ++group.cycles_sent;
    group.under_way = true;
    if (link.send_cycle(group.prepared, group.pace, now, group.config.acyclic_bytes) == SendStatus::sent)
        return Result<>();
    return not_sent(group, link);
}
// Sends all frames of a cycle; callable from the cycle. Errors: the errors of not_sent().
[[nodiscard]] Result<> send_cycle(ProcessGroup& group, Link& link, Time now);

// For a group without frames, for example a hot connect group that is away and whose sizes are not known: whether other
// frames show that no slave answers, or that the NIC has no link. poll() keeps this information up to date. The cycle
// asks the NIC itself only if poll() is not called.
constexpr std::chrono::milliseconds kCableKnown{10};
[[nodiscard]] bool is_silent(const ProcessGroup& group, Link& link, Time now);

// Ends a cycle: frames that are not back are given up. Returns the sum of the working counters of all datagrams.
// Errors: no_frame (actual: frames missing), working_counter (expected, actual; slave: the first slave that is known to
// be lost and belongs to a datagram that fell short; detail: Error::kOthersFresh when all datagrams are fresh),
// no_cycle.
void give_inputs(ProcessGroup& group);
[[nodiscard]] Result<std::uint32_t> evaluate_cycle(ProcessGroup& group, std::span<PreparedFrame> frames, Link& link,
                                                   Time now);
[[nodiscard, gnu::always_inline]] inline Result<std::uint32_t> end_cycle(ProcessGroup& group, Link& link, CycleEnd end,
                                                                         Time now) {
    group.cycle_received = group.cycles_sent;
    group.under_way = false;
    if (end != CycleEnd::right || group.special) [[unlikely]]
        return evaluate_cycle(group, group.prepared, link, now);
    group.cycles_lost = 0;
    return group.expected_wkc;
}

// The next cycle that is sent carries the time of this slave; nullptr: no time. False if cycles overlap, because
// another thread may be sending: the frames keep their reference. A frame that only reads the time, because the
// reference has not answered, continues to read it until a slave is set again.
[[nodiscard]] bool redirect_time(ProcessGroup& group, const Slave* reference);
// The first cycles only read the time, until the next time can be predicted from two of them. Otherwise the clocks
// before the reference would take zeros as the time.
void begin_by_reading(ProcessGroup& group);
// Sets the standby: the slave whose time the cycle carries as soon as the reference is lost; 0: none. No effect if
// cycles overlap.
void set_time_standby(ProcessGroup& group, StationAddress standby);
// Command and address of the datagram with the time as it is sent now; command NOP: the cycle carries no time.
[[nodiscard]] TimeSource time_source(const ProcessGroup& group);

// Whether Group::dc_time has all 64 bits of a clock. False if the reference clock has 32 bits, or had 32 bits when the
// group was mapped. False also while the cycle carries the time of the standby, which may have 32 bits.
[[nodiscard]] bool is_time_whole(const ProcessGroup& group);
// How many cycles have brought the time of the reference clock to the other clocks: cycles that came back and have also
// written the time. The number wraps, and starts again after config_map().
[[nodiscard]] std::uint16_t cycles_with_time(const ProcessGroup& group);
// Whether Group::dc_time is not of the cycle that was sent last, because the first frame of this cycle is not back.
// Also poll() reads frames: then dc_time is of a cycle that is still under way.
[[nodiscard]] inline bool is_time_awaited(const ProcessGroup& group) {
    return group.under_way && (group.prepared.empty() || group.prepared.front().end == CycleEnd::missing);
}
// When the cycle was sent that has brought Group::dc_time. If cycles overlap: when the cycle of any group was sent that
// was received last.
[[nodiscard]] inline Time time_sent_at(const ProcessGroup& group, const Link& link) {
    if (group.overlap.sets > 1) return link.last_cycle();
    return is_time_awaited(group) ? group.pace.before : group.pace.last;
}

[[nodiscard]] Error nothing_sent(const ProcessGroup& group);

// Whether the inputs of the slave (for a slave with outputs only: its outputs) were exchanged with the last cycle that
// was received. `slave` belongs to `group`.
[[nodiscard]] bool is_fresh(const ProcessGroup& group, const Slave& slave);
[[nodiscard]] std::uint32_t sent_cycles(const ProcessGroup& group);
// Whether no cycle was received since the slave takes part. Call it at least once in 2^31 cycles.
[[nodiscard]] bool is_joining(const ProcessGroup& group, const Slave& slave);
// Sets the inputs of slaves that do not take part, according to GroupConfiguration::lost_inputs.
void settle_lost_inputs(ProcessGroup& group);

// The same where cycles overlap. Additional error of sending: busy (all cycles are in flight; expected: their number).
struct OverlapFeature {
    Result<> (*send)(ProcessGroup& group, Link& link, Time now);
    Result<std::uint32_t> (*receive)(Master& master, ProcessGroup& group, Duration timeout);
};
[[nodiscard]] Result<> send_overlapped(ProcessGroup& group, Link& link, Time now);
// For the owner's thread: the frames of the oldest cycle in flight (empty: there is none), when it was sent, and its
// end.
[[nodiscard]] std::span<PreparedFrame> oldest_cycle(ProcessGroup& group);
[[nodiscard]] inline bool is_cycle_sent(const ProcessGroup& group) {
    return group.overlap.sent.load(std::memory_order_acquire) != group.overlap.received.load(std::memory_order_relaxed);
}
// How many cycles were sent and are not received yet.
[[nodiscard]] inline std::uint32_t cycles_under_way(const ProcessGroup& group) {
    if (group.overlap.sets == 1) return group.under_way ? 1 : 0;
    return group.overlap.sent.load(std::memory_order_acquire) - group.overlap.received.load(std::memory_order_relaxed);
}
// How many cycles were sent and have not brought Group::dc_time yet.
[[nodiscard]] inline std::uint32_t cycles_without_time(const ProcessGroup& group) {
    if (group.overlap.sets == 1) return is_time_awaited(group) ? 1 : 0;
    return cycles_under_way(group);
}
[[nodiscard]] inline Time sent_at(const ProcessGroup& group) {
    return group.overlap.sent_at[group.overlap.receive_set];
}
[[nodiscard]] Result<std::uint32_t> end_overlapped(ProcessGroup& group, Link& link, Time now);

}  // namespace margay
