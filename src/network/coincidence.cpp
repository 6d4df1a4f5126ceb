#include "network/coincidence.hpp"

#include "network/members.hpp"
#include "network/process_data.hpp"
#include "network/transition.hpp"
#include "station/al_state.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace margay {
namespace {

constexpr Duration kPause = std::chrono::milliseconds(2);  // between two readings of the states

// The number of the cycle whose reply is being checked.
std::uint32_t judged_cycle(const ProcessGroup& group) {
    if (group.overlap.sets == 1) return group.cycles_sent;
    return group.overlap.received.load(std::memory_order_relaxed) + 1;
}

// Whether the cycle was sent before the reading of states that ends the doubt.
bool is_doubted(ProcessGroup& group) {
    if (!group.sums_doubted) return false;
    const auto since = static_cast<std::int16_t>(judged_cycle(group) - group.overlap.believed_from);
    if (!group.sums_confirmed || since < 0) return true;
    group.sums_doubted = group.sums_confirmed = false;
    return false;
}

// Whether the accepted working counter may be a sum of slaves of which some do not take part.
bool may_be_coincidence(const ProcessGroup& group) {
    bool entering = false;
    for (const Slave& slave : group.slaves) {
        if (slave.image.group != group.number) continue;
        const SlaveMarks& marks = group.marks[slave.number - 1U];
        // Without the share of this slave the sum would be short. So another slave has answered, or the known state of
        // this slave is old.
        const bool down = std::min(slave.al.state, awaited_state(marks, slave)) < AlState::safeop;
        if (slave.takes_part && (down || marks.uncertain)) return true;
        entering |= marks.uncertain;
    }
    // One slave may have missed the last cycle and may answer now, while another slave that has left does not answer in
    // the cycle under way. If cycles overlap, the library knows a change on the wire only one or more cycles later.
    const bool joined = group.joins_under_way > 0;
    const bool was_fresh = group.unfresh_cycle != (group.cycle_received & 0xFFU);
    const bool both = joined || !was_fresh || group.overlap.sets > 1;
    if (group.leaves_under_way > 0 && both) return true;
    // The missing slave may be the one that is known to be lost: it answers when its cable is connected again.
    if (LeavingExchange::any(group)) return true;
    return entering && both;
}

struct Confirming {
    explicit Confirming(ProcessGroup& which) : group(which) { group.confirming = true; }
    Confirming(const Confirming&) = delete;
    Confirming& operator=(const Confirming&) = delete;
    ~Confirming() { group.confirming = false; }
    ProcessGroup& group;
};

void doubt_sums(ProcessGroup& group) {
    group.sums_doubted = true;
    group.sums_confirmed = false;
    ++group.overlap.doubts;
}

bool all_full(const ProcessGroup& group) {
    const auto is_full = [](const DatagramStatus& d) { return d.came && d.got == d.full && d.accepted == d.full; };
    return std::ranges::all_of(group.statuses, is_full);
}

bool all_accepted(const ProcessGroup& group) {
    return std::ranges::all_of(group.statuses, [](const DatagramStatus& d) { return d.came && d.got == d.accepted; });
}

Task<Result<>> read_member(Network& network, SumConfirmation& confirmation, const Slave& slave) {
    if (!confirmation.concerns(slave)) co_return Nothing{};
    const auto seen = co_await read_al_status(network.station(slave));
    confirmation.note(slave, seen);
    co_return Nothing{};
}

Task<Result<>> read_members(Network& network, ProcessGroup& group) {
    const Confirming confirming(group);
    SumConfirmation confirmation(network, &group);
    const auto read = [&network, &confirmation](Slave& slave) { return read_member(network, confirmation, slave); };
    co_await required(for_each_slave(network, read));
    confirmation.end();
    if (!group.sums_confirmed) co_await network.engine.sleep_for(kPause);
    co_return Nothing{};
}

}  // namespace

void note_joining(ProcessGroup& group, const Slave& slave) {
    if (!group.mapped) return;  // config_map() has failed: there are no cycles
    group.joins_under_way = cycles_under_way(group) & 0xFU;
    ++group.overlap.doubts;  // a reading of states that is under way does not include this slave
    group.marks[slave.number - 1U].joining = true;
    group.marks[slave.number - 1U].joined_after = sent_cycles(group);
}

bool is_joining(const ProcessGroup& group, const Slave& slave) {
    SlaveMarks& marks = group.marks[slave.number - 1U];
    // The numbers of cycles wrap: once the slave has joined, they are not compared any more.
    if (marks.joining) marks.joining = static_cast<std::int32_t>(group.cycle_received - marks.joined_after) <= 0;
    return marks.joining;
}

void note_leaving(ProcessGroup& group) { group.leaves_under_way = cycles_under_way(group) & 0xFU; }

bool is_sure(ProcessGroup& group, const DatagramStatus& status, bool changed) {
    if (status.got != status.accepted) LeavingExchange::update(group);
    if (changed && group.sums_doubted && status.got == status.accepted) doubt_sums(group);
    return status.got == status.accepted && !is_doubted(group) && !may_be_coincidence(group);
}

void note_cycle(ProcessGroup& group, bool fresh) {
    if (!fresh) group.unfresh_cycle = (group.cycle_received + (group.overlap.sets > 1 ? 1U : 0U)) & 0xFFU;
    if (group.joins_under_way > 0) --group.joins_under_way;
    if (group.leaves_under_way > 0) --group.leaves_under_way;
    if (group.mapping) return;  // its inputs are not fresh, and all slaves are configured anew
    // The datagram was lost, or all slaves have answered although one of them does not take part. So the next working
    // counter may be the accepted one by coincidence.
    bool odd = false;
    bool fell_short = false;
    std::uint16_t sums = 0;
    for (const DatagramStatus& d : group.statuses) {
        odd |= !d.came || (d.got == d.full && d.accepted != d.full);
        fell_short |= d.got != d.accepted && d.got != d.full;
        sums = static_cast<std::uint16_t>(31 * sums + d.got);
    }
    const bool changed = std::exchange(group.overlap.last_sums, sums) != sums;
    if (odd || (fell_short && (changed || !group.sums_doubted))) doubt_sums(group);
}

void note_refusal(ProcessGroup& group) {
    group.unfresh_cycle = group.cycle_received & 0xFFU;
    if (!group.mapping) doubt_sums(group);
}

void confirm_sums(Network& network, ProcessGroup& group) {
    if (all_full(group)) {
        group.sums_doubted = group.sums_confirmed = false;
        return;
    }
    if (group.sums_confirmed || group.confirming || group.mapping || !all_accepted(group)) return;
    (void)network.settling.start(read_members(network, group));
}

void SumConfirmation::note(const Slave& slave, const Result<AlStatus>& seen) {
    if (concerns(slave) && seen && seen->state >= AlState::safeop) ++shown_;
}

void SumConfirmation::end() const {
    const auto awaited = [this](const Slave& slave) { return concerns(slave); };
    const auto slaves = network_.slaves();
    if (count_doubts() != doubts_ || std::ranges::count_if(slaves, awaited) != std::ptrdiff_t(shown_)) return;
    for (ProcessGroup& group : network_.process.groups) {
        if (!group.sums_doubted || (only_ != nullptr && only_ != &group)) continue;
        group.sums_confirmed = true;
        group.overlap.believed_from = static_cast<std::uint16_t>(sent_cycles(group) + 1);
    }
}

std::uint32_t SumConfirmation::count_doubts() const {
    std::uint32_t sum = 0;
    for (const ProcessGroup& group : network_.process.groups)
        if (only_ == nullptr || only_ == &group) sum += group.overlap.doubts + 256 * group.mappings;
    return sum;
}

}  // namespace margay
