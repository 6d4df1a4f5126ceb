#include "network/members.hpp"

#include "network/coincidence.hpp"
#include "network/expectation.hpp"
#include "network/mailbox_setup.hpp"
#include "network/wanted.hpp"

#include <algorithm>
#include <utility>

namespace margay {
namespace {

ProcessGroup* group_of(Network& network, const Slave& slave) {
    if (slave.image.group >= network.process.groups.size()) return nullptr;
    ProcessGroup& group = network.process.groups[slave.image.group];
    return group.mapped ? &group : nullptr;
}

void change(std::uint16_t& counter, std::uint16_t by, bool more) {
    counter = static_cast<std::uint16_t>(more ? counter + by : counter - by);
}

bool holds_inputs(const ProcessGroup& group) { return group.holds_inputs || group.overlap.sets > 1; }

}  // namespace

void settle(ProcessGroup& group) {
    // Without datagrams no working counter shows that a wanted slave is missing. During a mapping slaves answer that
    // are not in SAFEOP yet, and after a silence other devices may answer.
    const auto doubted = [&group](const Slave& slave) {
        return slave.image.group == group.number && slave.takes_part && group.marks[slave.number - 1U].was_away;
    };
    group.complete = group.mapped && !group.mapping && (!group.statuses.empty() || group.expected_wkc == 0) &&
                     std::ranges::none_of(group.slaves, doubted);
    // Inputs of a slave that is out of the exchange and that the next cycle must set to zero.
    const auto left = [&group](const Slave& slave) {
        return slave.image.group == group.number && !slave.takes_part && slave.image.inputs.bits > 0;
    };
    const bool zeroes =
        holds_inputs(group) && group.config.lost_inputs == LostInputs::zero && std::ranges::any_of(group.slaves, left);
    // If cycles overlap, another thread reads `special` while it sends. So the value of `special` does not change then.
    const bool special =
        group.extras || group.overlap.sets > 1 || !group.complete || zeroes || (group.mapped && group.prepared.empty());
    if (group.special != special) group.special = special;
    const bool doubts = std::ranges::any_of(group.slaves, doubted);
    for (PreparedFrame& frame : group.prepared) {
        frame.doubted = doubts;
        frame.settle();
    }
    group.settling = true;
    group.settled_after = sent_cycles(group);
}

void settle_groups(Network& network) {
    for (ProcessGroup& group : network.process.groups)
        if (group.mapped) settle(group);
}

namespace {

// Adds the share of the slave to the expected working counters, or subtracts it. A slave without a place is also added
// to `full`: a cycle without its data is not complete.
void count(ProcessGroup& group, const Slave& slave, bool more) {
    if (slave.unplaced) {
        group.expected_wkc = more ? group.expected_wkc + 1 : group.expected_wkc - 1;
        if (group.statuses.empty()) return;
        change(group.statuses[0].expected, 1, more);
        change(group.statuses[0].full, 1, more);
        return;
    }
    const SlaveFmmus ranges = exchanged_ranges(slave, group.layout);
    for (std::size_t n = 0; n < group.statuses.size(); ++n) {
        const std::uint16_t share = working_counter_of(ranges, group.plans[n]);
        change(group.statuses[n].expected, share, more);
        group.expected_wkc = more ? group.expected_wkc + share : group.expected_wkc - share;
    }
}

}  // namespace

void set_takes_part(Network& network, Slave& slave, bool takes_part) {
    if (slave.takes_part == takes_part) return;
    slave.takes_part = takes_part;
    network.marks(slave).uncertain = false;
    if (takes_part) network.marks(slave).awaited = true;
    ProcessGroup* group = group_of(network, slave);
    if (group == nullptr) return;
    const SlaveFmmus ranges = exchanged_ranges(slave, group->layout);
    for (std::size_t n = 0; n < group->statuses.size(); ++n)
        change(group->statuses[n].accepted, working_counter_of(ranges, group->plans[n]), takes_part);
    update_counted(network, slave);
    settle(*group);
    if (takes_part)
        note_joining(*group, slave);
    else
        note_leaving(*group);
    if (!holds_inputs(*group)) settle_lost_inputs(*group);
}

LeavingExchange::LeavingExchange(Network& network, Slave& slave, const Datagram& write)
    : network_(network), slave_(slave), write_(write), group_(slave.takes_part ? group_of(network, slave) : nullptr) {
    if (group_ != nullptr) next_ = std::exchange(group_->leaving, this);
}

LeavingExchange::~LeavingExchange() {
    if (group_ == nullptr) return;
    LeavingExchange** at = &group_->leaving;
    while (*at != this) at = &(*at)->next_;
    *at = next_;
}

void LeavingExchange::update(ProcessGroup& group) {
    for (LeavingExchange* one = group.leaving; one != nullptr; one = one->next_) {
        const Reply reply = one->write_.reply();
        if (reply.ok() && reply.wkc == 1) set_takes_part(one->network_, one->slave_, false);
    }
}

bool LeavingExchange::any(const ProcessGroup& group) {
    for (const LeavingExchange* one = group.leaving; one != nullptr; one = one->next_)
        if (one->slave_.takes_part) return true;
    return false;
}

void join_again(Network& network, const Slave& slave) {
    ProcessGroup* group = group_of(network, slave);
    if (group != nullptr && slave.takes_part) note_joining(*group, slave);
}

void note_reached(Network& network, const Slave& slave, AlState before) {
    if (slave.takes_part && !network.marks(slave).in_use) network.marks(slave).uncertain = false;
    if (before < AlState::safeop && slave.al.state >= AlState::safeop) join_again(network, slave);
}

void update_counted(Network& network, Slave& slave) {
    const bool has_share = exchanges(slave) || slave.unplaced;
    const bool counted = has_share && (slave.takes_part || is_wanted_in_exchange(network, slave));
    if (!has_share || counted == network.marks(slave).counted) return;
    ProcessGroup* group = group_of(network, slave);
    if (group == nullptr) return;
    network.marks(slave).counted = counted;
    count(*group, slave, counted);
    settle(*group);
}

void leave_counters(Network& network, Slave& slave) {
    set_takes_part(network, slave, false);
    ProcessGroup* group = group_of(network, slave);
    const bool counted = network.marks(slave).counted;
    network.marks(slave).counted = false;
    if (group == nullptr || !counted) return;
    count(*group, slave, false);
    settle(*group);
}

bool is_first_of_group(Network& network, const Slave& slave) {
    return slave.wanted != nullptr && slave.wanted->hot_connect != 0 && is_located(network.expected, *slave.wanted);
}

bool first_of_group_is_there(const Network& network, std::uint8_t hot_connect) {
    return std::ranges::any_of(network.slaves(), [&](const Slave& s) {
        return s.al.state != AlState::none && s.wanted != nullptr && s.wanted->hot_connect == hot_connect &&
               is_located(network.expected, *s.wanted);
    });
}

void leave_exchange(Network& network, Slave& lost) {
    update_mailbox(network, lost);
    set_takes_part(network, lost, false);
    network.marks(lost).uncertain = false;
    if (lost.wanted == nullptr || lost.wanted->hot_connect == 0) return;
    if (first_of_group_is_there(network, lost.wanted->hot_connect)) return;
    for (Slave& slave : network.slaves()) {
        if (slave.wanted == nullptr || slave.wanted->hot_connect != lost.wanted->hot_connect) continue;
        network.marks(slave).missing_reported = false;
        // A member that still takes part is not being started up, so it stays awaited.
        if (!slave.takes_part) network.marks(slave).awaited = false;
        update_counted(network, slave);
    }
}

void await_slave(Network& network, Slave& slave) {
    network.marks(slave).awaited = true;
    update_counted(network, slave);
}

void begin_counting(Network& network, ProcessGroup& group) {
    for (Slave& slave : network.slaves())
        if (slave.image.group == group.number) network.marks(slave).counted = exchanges(slave);
    settle(group);
    for (Slave& slave : network.slaves())
        if (slave.image.group == group.number) update_counted(network, slave);
}

void forget_unplaced(Network& network, Slave& slave) {
    ProcessGroup* group = group_of(network, slave);
    if (group != nullptr && slave.unplaced && network.marks(slave).counted) count(*group, slave, false);
    if (slave.unplaced) network.marks(slave).counted = false;
    slave.unplaced = false;
    if (group != nullptr) settle(*group);
}

}  // namespace margay
