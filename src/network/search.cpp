#include "network/search.hpp"

#include "network/configure.hpp"
#include "network/doubt.hpp"
#include "network/expectation.hpp"
#include "network/mailbox_setup.hpp"
#include "network/members.hpp"
#include "network/newcomer.hpp"
#include "network/places.hpp"
#include "network/recovery.hpp"
#include "network/ring_reading.hpp"
#include "network/survey.hpp"
#include "network/transition.hpp"
#include "network/wanted.hpp"
#include "station/al_state.hpp"
#include "station/sii_access.hpp"
#include "wire/sii.hpp"

#include <algorithm>
#include <bit>
#include <utility>

namespace margay {
namespace {

// Notes the slaves that are absent from the ring and not reported lost yet: a newcomer may be one of them.
Task<Result<>> miss_absent(Network& network) {
    for (Slave& slave : network.slaves()) {
        if (slave.ring_position != 0 || network.marks(slave).in_use || slave.al.state == AlState::none) continue;
        auto there = co_await read_al_status(network.station(slave));
        if (does_not_answer(there.error()) && !network.marks(slave).in_use && slave.al.state != AlState::none)
            note_lost(network, slave);
    }
    co_return Nothing{};
}

// ------------------------------------------------------------------ result of the identification

// Deletes what was read from the slave: its SII and its registers are read again.
void read_again(Slave& slave) {
    slave.seen = false;
    slave.dl = {.fmmus = 16, .sync_managers = 16};
}

// A device of another revision, for example with new firmware, may have other PDOs.
void revise(Network& network, Slave& slave) {
    if (!slave.config.unchecked_pdos) network.marks(slave).pdos_written = true;
    read_again(slave);
}

// Whether only the revision of the slave differs from the known revision, and expect() names no other revision.
bool accept_revision(Slave& slave, const Error& differs) {
    if (differs.code != Errc::other_slave || differs.subindex != static_cast<std::uint8_t>(IdentityField::revision) ||
        slave.held)
        return false;
    slave.identity.revision = differs.actual;
    if (!slave.other && !is_the_wanted_one(slave, slave)) {
        slave.identity.revision = differs.expected;
        return false;
    }
    return true;
}

Task<Result<>> assign_slave_address(Network& network, std::uint16_t n, Slave& slave) {
    const AlStatus now = network.guest.al;
    slave.alias = network.guest.alias;
    slave.device_id = network.guest.device_id;
    co_await required(rename(network, network.guest.station_address, slave.station_address.value));
    network.ring[n].slave = slave.number;
    network.ring[n].address = slave.station_address.value;
    store_places(network);
    doubt_pdos(network, slave);  // in any state: the device may be a spare part from another machine
    // A slave whose loss was never reported keeps its state.
    if (slave.al.state != AlState::none || network.marks(slave).in_use) co_return Nothing{};
    network.report({.kind = EventKind::found, .slave = slave.number, .before = slave.al, .now = now});
    slave.al = now;
    network.marks(slave).attempts = 0;
    network.marks(slave).missing_reported = false;
    network.marks(slave).settled = AlState::none;
    // The held slave is gone, and the expected slave has come: delete the values that were read from the held slave.
    if (slave.other && is_the_wanted_one(slave, network.guest)) {
        slave.other = slave.held = false;
        read_again(slave);
    }
    if (slave.seen && !slave.held && slave.identity.revision != network.guest.identity.revision) revise(network, slave);
    slave.identity = network.guest.identity;
    network.marks(slave).trust();
    update_mailbox(network, slave);
    co_return Nothing{};
}

Error guest_error(const Network& network, const Slave& slave) {
    Error error = slave.wanted != nullptr ? difference(network.guest, *slave.wanted) : Error{};
    if (error.code == Errc::none) error = identity_difference(slave, network.guest.identity, network.guest.alias);
    error.step = Step::recover;
    error.slave = slave.number;
    return error;
}

void report_other_slave(Network& network, Slave& slave) {
    const Identity& there = network.guest.identity;
    const Identity& wanted = slave.identity;
    const Error error = guest_error(network, slave);
    Event event{.kind = EventKind::other_slave, .slave = slave.number, .error = error};
    event.expected = slave.seen || slave.wanted == nullptr ? wanted.product : slave.wanted->product.value_or(0);
    event.actual = there.product;
    event.detail = there.vendor;
    network.report(event);
    network.note(slave, error);
}

void report_stranger(Network& network, std::uint16_t n) {
    const auto ring = network.seen_ring();
    if (n >= ring.size()) return;
    Event event{.kind = EventKind::stranger, .port = ring[n].parent_port};
    std::uint16_t parent = ring[n].parent;
    for (; parent != 0 && ring[parent - 1U].slave == 0; parent = ring[parent - 1U].parent)
        event.port = ring[parent - 1U].parent_port;
    event.slave = parent == 0 ? std::uint16_t{0} : ring[parent - 1U].slave;
    event.expected = network.guest.identity.revision;
    event.actual = network.guest.identity.product;
    event.detail = network.guest.identity.vendor;
    network.report(event);
}

void report_rivals(Network& network, std::uint16_t n, const Verdict& verdict) {
    const RingPlace& place = network.ring[n];
    Event event{.kind = EventKind::ambiguous, .port = place.parent_port};
    event.slave = verdict.rivals[0]->number;
    event.other = verdict.rivals[1]->number;
    event.expected = place.parent == 0 ? 0U : network.ring[place.parent - 1U].slave;
    network.report(event);
}

// An unknown slave gets the station address of strangers. The slave is reported when it is found for the second time,
// because a ring that changes while it is read can mislead the search. After that, the slave is not reported again.
Task<Result<>> address_stranger(Network& network, std::uint16_t n, const Verdict* verdict) {
    using stranger_address::kSuspect;
    using stranger_address::kUndecided;
    const std::uint16_t reported = network.stranger_address;
    const std::uint16_t before = network.ring[n].address;
    const bool rivals = verdict->rivals[0] != nullptr;
    const bool waits = rivals || !neighbour_is_known(network, n);
    const auto undecided = static_cast<std::uint16_t>(reported != 0 && waits ? kUndecided : 0);
    const bool known = reported != 0 && (before == reported - kUndecided || (before == reported && !rivals));
    const bool at_once = !network.supervised && !known;  // the application searches only once
    const bool again =
        reported != 0 && (before == reported - kSuspect - kUndecided || (before == reported - kSuspect && !rivals));
    const auto suspect = static_cast<std::uint16_t>(at_once || again || known ? 0 : kSuspect);
    const auto address = static_cast<std::uint16_t>(reported - undecided - suspect);
    co_await required(rename(network, network.guest.station_address, address));
    network.ring[n].address = address;
    Slave* const instead_of = verdict->instead_of;
    if (known && instead_of != nullptr) instead_of->error = guest_error(network, *instead_of);
    if (!at_once && !again) co_return Nothing{};
    if (rivals)
        report_rivals(network, n, *verdict);
    else if (instead_of != nullptr)
        report_other_slave(network, *instead_of);
    else
        report_stranger(network, n);
    co_return Nothing{};
}

// A newcomer below an unidentified slave cannot be identified: the slave above may be the first slave of its group. The
// slaves between the second NIC and a break are identified before the slaves above them: see place_of_turn().
bool below_unasked(Network& network, std::size_t n) {
    if (network.ring[n].behind_break) return false;
    for (std::uint16_t at = network.ring[n].parent; at != 0; at = network.ring[at - 1U].parent)
        if (network.ring[at - 1U].unasked) return true;
    return false;
}

// The newcomers are identified in this order: the places before a break in the order of the ring; the places on the way
// from the second NIC to the break in the opposite order; then the branches of these places. Each round has one turn
// for each place.
constexpr std::uint16_t kNoPlace = UINT16_MAX;  // this place has no turn in this round
std::uint16_t place_of_turn(Network& network, std::size_t turn) {
    const auto ring = network.seen_ring();
    const std::size_t round = turn / ring.size();
    const std::size_t at = turn % ring.size();
    const std::size_t n = round == 1 ? ring.size() - 1 - at : at;
    const auto is_behind = [](const RingPlace& place) { return static_cast<bool>(place.behind_break); };
    const auto first = static_cast<std::size_t>(std::ranges::find_if(ring, is_behind) - ring.begin());
    const std::size_t own = n < first ? 0 : (ring[n].behind_break ? 1 : 2);
    return own == round ? static_cast<std::uint16_t>(n) : kNoPlace;
}

// A slave that is in doubt while it is started up may have lost its power again, and a lost slave may have come back
// together with it. A search finds both after the start-up has given up. Until then a newcomer that fits such a slave
// is not reported as a stranger.
bool is_awaited(Network& network) {
    const auto starts = [&network](const Slave& slave) {
        return network.marks(slave).in_use && network.is_doubted(slave);
    };
    const auto fits = [&](const Slave& slave) {
        return (starts(slave) || is_lost(network, slave)) && fits_guest(network, slave);
    };
    return std::ranges::any_of(network.slaves(), starts) && std::ranges::any_of(network.slaves(), fits);
}

// Identifies a newcomer. Returns whether it is a slave of the network.
Task<Result<bool>> receive_newcomer(Network& network, std::uint16_t n) {
    co_await required(address_newcomer(network, n));
    auto asked = co_await read_newcomer(network);
    Result<Verdict> verdict;
    if (asked) verdict = co_await verify_newcomer(network, n);
    const bool awaited = asked && verdict && verdict->slave == nullptr && is_awaited(network);
    if (!asked || !verdict || awaited) {
        // Restores the previous address. If this fails, the newcomer is gone, or the next search identifies it again.
        co_await completion(rename(network, newcomer_address(network), network.ring[n].address));
        if (awaited) co_return false;
        co_return asked ? verdict.error() : asked.error();
    }
    if (verdict->slave == nullptr) {
        auto dismissed = co_await address_stranger(network, n, &*verdict);
        co_return dismissed ? Result<bool>(false) : Result<bool>(dismissed.error());
    }
    auto admitted = co_await assign_slave_address(network, n, *verdict->slave);
    co_return admitted ? Result<bool>(true) : Result<bool>(admitted.error());
}

// The EEPROM of the newcomer at place `n` cannot be read. If only one slave is lost, and this slave was at place `n`,
// the error names this slave. The supervision reports the error once, although each search finds the newcomer again.
void note_unreadable(Network& network, std::size_t n, Error& error) {
    Slave* only = nullptr;
    std::size_t lost = 0;
    for (Slave& slave : network.slaves()) {
        if (!is_lost(network, slave)) continue;
        only = &slave;
        ++lost;
    }
    if (lost == 1 && was_at_place(network, n, *only)) {
        error.slave = only->number;
        if (only->error == error) return;
        only->error = error;
    } else if (std::exchange(network.unreadable, error.code) == error.code) {
        return;
    }
    if (network.supervised) network.note(error);
}

}  // namespace

Task<Result<std::uint16_t>> find_lost(Network& network) {
    const Searching searching(network);
    co_await required(read_ring(network));
    co_await required(miss_absent(network));
    std::uint16_t found = 0;
    Error error;
    for (std::size_t turn = 0; turn < std::size_t{network.ring_count} * 3 && error.code != Errc::unstable; ++turn) {
        const std::uint16_t n = place_of_turn(network, turn);
        if (n == kNoPlace || network.ring[n].slave != 0 || network.ring[n].unasked || below_unasked(network, n))
            continue;
        auto ours = co_await receive_newcomer(network, n);
        network.ring[n].unasked = !ours;
        if (!ours) {
            error = ours.error();  // the error of this newcomer; the slaves behind it may still be identified
            if (is_unreadable(error)) note_unreadable(network, n, error);
        }
        if (ours && *ours) ++found;
    }
    if (error.code == Errc::none) network.unreadable = Errc::none;
    co_return found == 0 && error.code != Errc::none ? Result<std::uint16_t>(error) : Result<std::uint16_t>(found);
}

void note_reading(Network& network, Slave& slave, const Result<AlStatus>& seen, bool own) {
    if (!network.supervised) {
        if (seen ? seen->state != slave.al.state : does_not_answer(seen.error())) drop_work(network, slave);
        const bool worked_on = !own && (network.marks(slave).in_use || is_being_mapped(network, slave));
        const bool by_itself =
            seen && seen->state != slave.al.state && !worked_on && !is_requested(network, slave, seen->state);
        const bool away = slave.al.state == AlState::none;
        if (is_known(slave) && (away || by_itself)) network.marks(slave).doubt(away);
        if (seen && seen->state == AlState::boot) note_boot(network, slave);
        const AlState before = slave.al.state;
        update_al_status(slave.al, seen);
        if (slave.al.state == AlState::none) return leave_exchange(network, slave);
        if (seen) note_reached(network, slave, before);
        // A sequence that starts the slave may have opened the mailbox meanwhile.
        if (slave.al.state != AlState::init || !worked_on) update_mailbox(network, slave);
        return;
    }
    if (slave.al.state == AlState::none || network.marks(slave).in_use) return;
    if (seen) return note_state(network, slave, *seen);
    if (does_not_answer(seen.error())) note_lost(network, slave);
}

// If slaves are in different states, the OR of all states hides the change of a slave from one of these states to
// another one. A lost slave that has kept its power may come back when another slave leaves. In both cases, the looks
// follow each other closely. The time between two looks is 4 times as long as a look, if `retry` is not shorter, so
// that mailboxes keep most of the acyclic traffic.
Time next_look(Network& network, const SuperviseRequest& wanted, Time begun, unsigned al_status) {
    const Time now = network.engine.now();
    const bool may_come_back = std::ranges::any_of(network.slaves(), [](const Slave& slave) {
        return slave.al.state == AlState::none && slave.seen && exchanges(slave);
    });
    const bool hides = may_come_back || std::popcount(al_status & 0x1FU) > 1;
    const Duration interval = hides ? std::max(wanted.interval, 4 * (now - begun)) : wanted.retry;
    return later(now, std::min(interval, wanted.retry));
}

void note_lost(Network& network, Slave& slave) {
    network.report({.kind = EventKind::lost, .slave = slave.number, .before = slave.al});
    slave.al = {};
    slave.ring_position = 0;
    network.marks(slave).settled = AlState::none;
    network.marks(slave).unanswered = false;
    network.clocks.lose_sync(slave);
    leave_exchange(network, slave);
}

Task<Result<>> readmit_if_there(Network& network, Slave& slave) {
    const bool boot = slave.al.state == AlState::boot;  // its firmware may use the EEPROM
    if (slave.al.state != AlState::none && !boot && network.marks(slave).unproved && !network.marks(slave).in_use) {
        const SlaveToken token(network.marks(slave));
        // Without a supervision, reading the state has readmitted the slave.
        co_return co_await required(prove(network, slave));
    }
    if (slave.al.state != AlState::none || !slave.seen) co_return Nothing{};
    auto seen = co_await read_al_status(network.station(slave));
    if (!seen || slave.al.state != AlState::none || network.marks(slave).in_use) co_return Nothing{};
    co_return co_await required(readmit_slave(network, slave, *seen));
}

Task<Result<AlStatus>> read_anew(Network& network, Slave& slave) {
    (void)doubt_after_silence(network);
    if (!network.supervised && network.is_unobserved() && is_known(slave)) network.marks(slave).doubt(false);
    auto seen = co_await read_al_status(network.station(slave));
    const AlStatus before = slave.al;
    if (!network.supervised) {
        note_reading(network, slave, seen, true);
    } else if (before.state != AlState::none) {  // the supervision readmits lost slaves
        update_al_status(slave.al, seen);
        note_change(network, slave, before);
    }
    co_return seen;
}

Task<Result<>> prove(Network& network, Slave& slave) {
    auto same = co_await compare_identity(network, slave);
    if (accept_revision(slave, same.error())) {
        if (!slave.config.unchecked_pdos) {
            revise(network, slave);
            // Its place in the image belongs to the PDOs of the earlier revision.
            set_takes_part(network, slave, false);
            auto unmapped = co_await unmap(network.station(slave));  // no outputs until config_map() has read its PDOs
            if (!unmapped) {
                slave.identity.revision = same.error().expected;  // the revision is compared again
                co_return unmapped;
            }
        }
        same = Nothing{};
    }
    const bool member = slave.wanted != nullptr && slave.wanted->hot_connect != 0;
    if (same && member && network.marks(slave).was_away)
        same = co_await network.expectation->compare_group(network, slave);
    if (same) {
        const bool away = network.marks(slave).was_away;
        network.marks(slave).trust();
        update_mailbox(network, slave);
        if (away) {
            settle_groups(network);
            join_again(network, slave);
        }
    }
    if (slave.al.state >= AlState::preop && slave.al.state != AlState::boot)
        network.marks(slave).from_boot &= !same.ok();
    if (same.error().code != Errc::other_slave) co_return same;
    if (network.supervised && slave.al.state != AlState::none) note_lost(network, slave);
    slave.al = {};
    leave_exchange(network, slave);
    if (!network.supervised) network.note(slave, same.error());  // the search of a supervision reports it
    co_await required(unmap(network.station(slave)));
    // The search must not find the other slave at this station address.
    co_await completion(rename(network, slave.station_address, 0));
    co_return same;
}

Task<Result<>> prove_before_request(Network& network, Slave& slave, AlState wanted) {
    const AlState now = slave.al.state;
    const SlaveMarks& marks = network.marks(slave);
    const bool due = (marks.unproved || marks.from_boot) && now != AlState::none && now != AlState::boot;
    if (!due || wanted == AlState::init) co_return Nothing{};
    co_return co_await required(prove(network, slave));
}

Task<Result<>> readmit_slave(Network& network, Slave& slave, AlStatus now) {
    const SlaveToken token(network.marks(slave));
    bool mapped = false;
    if (exchanges(slave) && is_mapped(network, slave) && !slave.held) {
        auto same = co_await has_fmmus(network, slave, network.process.groups[slave.image.group].layout);
        mapped = same && *same;
    }
    network.marks(slave).uncertain = mapped;
    // The identity of a slave in BOOT is compared when it leaves BOOT, because its firmware may use the EEPROM.
    if (is_known(slave)) network.marks(slave).doubt(true);
    if (now.state != AlState::boot) {
        auto same = co_await prove(network, slave);
        // Another slave is identified by the search. If the SII cannot be read, the next look repeats the check.
        if (!same) {
            if (same.error().code != slave.error.code) network.note(slave, same.error());
            if (!is_first_silence(network, slave, same.error()))
                co_await completion(unmap(network.station(slave)));  // until then the slave gets no outputs
            network.marks(slave).uncertain = false;
            co_return Nothing{};
        }
    }
    network.report({.kind = EventKind::found, .slave = slave.number, .before = slave.al, .now = now});
    slave.al = now;
    update_mailbox(network, slave);
    network.marks(slave).attempts = 0;
    network.group_is_back |= is_first_of_group(network, slave);
    network.marks(slave).uncertain = false;
    if (!mapped || now.state == AlState::init || !slave.seen) co_return Nothing{};
    set_takes_part(network, slave, true);
    const bool well =
        network.supervised && now.state == wanted_state(network, slave) && !now.error && !is_unfinished(network, slave);
    if (well) network.report({.kind = EventKind::recovered, .slave = slave.number, .now = now});
    co_return Nothing{};
}

}  // namespace margay
