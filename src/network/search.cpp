#include "network/search.hpp"

#include "network/configure.hpp"
#include "network/expectation.hpp"
#include "network/members.hpp"
#include "network/recovery.hpp"
#include "network/survey.hpp"
#include "network/wanted.hpp"
#include "station/al_state.hpp"
#include "station/sii_access.hpp"
#include "wire/sii.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;
namespace sii = wire::sii;

// The station address of the newcomer that is being identified. Each newcomer gets another one: a slave that was
// disconnected as a newcomer and comes back must not be taken for the present one.
StationAddress newcomer_address(const Network& network) {
    constexpr std::uint16_t kNewcomers = 0x0D00;  // below the marks of unknown slaves
    return {static_cast<std::uint16_t>(kNewcomers | network.newcomers)};
}

// A slave that has its own address in the ring is not lost: the supervision reads its state and readmits it.
bool is_lost(const Network& network, const Slave& slave) {
    return slave.al.state == AlState::none && !network.marks(slave).in_use && (slave.ring_position == 0 || !slave.seen);
}

bool is_the_wanted_one(const Slave& slave, const Slave& guest) {
    return slave.wanted == nullptr || difference(guest, *slave.wanted).code == Errc::none;
}

// The guest is the slave that was seen in this place, or the wanted one where that was another one. The other one may
// come back too: then it is this slave again, and held as before.
bool fits(const Slave& slave, const Slave& guest) {
    const bool same = slave.identity.vendor == guest.identity.vendor &&
                      slave.identity.product == guest.identity.product &&
                      slave.identity.revision == guest.identity.revision;
    if (slave.seen && slave.other && same && slave.alias == guest.alias) return true;
    if (slave.seen && !slave.other && !same) return false;
    return is_the_wanted_one(slave, guest);
}

bool anywhere(const Network& network, const Slave& slave) {
    return slave.wanted != nullptr && is_located(network.expected, *slave.wanted);
}
std::uint8_t group_of(const Slave& slave) {
    return slave.wanted != nullptr ? slave.wanted->hot_connect : std::uint8_t{0};
}
bool of_the_line(const Slave& slave) { return slave.wanted == nullptr || slave.wanted->position != 0; }

// Marks a search as executing, until it is destroyed. No scan begins meanwhile.
class Searching {
  public:
    explicit Searching(Network& network) : network_(network) { network_.searching = true; }
    Searching(const Searching&) = delete;
    Searching& operator=(const Searching&) = delete;
    ~Searching() { network_.searching = false; }

  private:
    Network& network_;
};

// ------------------------------------------------------------------ the places of the ring

Task<Result<>> read_place(Network& network, std::uint16_t n) {
    std::array<std::byte, 2> address{};
    std::array<std::byte, 2> dl_status{};
    const RingPosition at{n};
    Datagram look(network.engine.link(), wire::Command::APRD, {at, reg::kStationAddress.address},
                  MutableBytes(address));
    Datagram ports(network.engine.link(), wire::Command::APRD, {at, reg::kDlStatus.address}, MutableBytes(dl_status));
    co_await together(look, ports);
    for (const Datagram* d : {&look, &ports}) {
        if (!d->reply().ok()) co_return Error{.code = d->reply().errc, .step = Step::recover};
        if (d->reply().wkc != 1) co_return Error{.code = Errc::unstable, .step = Step::recover};
    }
    network.ring[n] = {.address = load_le<std::uint16_t>(address), .dl_status = load_le<std::uint16_t>(dl_status)};
    co_return Result<>();
}

// Assigns the places of the ring to the slaves that answer, by their station addresses; of two places with the same
// address the first one counts. The other places are not assigned yet. A slave that was lost and has its address
// belongs to readmit_slave(), which may be working on it; an address that no slave has had since the scan comes from an
// earlier master.
void recognise(Network& network) {
    const std::size_t first = network.settings.first_station_address;
    for (Slave& slave : network.slaves()) slave.ring_position = 0;
    for (RingPlace& place : network.seen_ring()) {
        if (place.address < first || place.address >= first + network.count) continue;
        Slave& slave = network.slave(place.address - first + 1);
        if (slave.ring_position != 0 || (is_lost(network, slave) && !slave.seen)) continue;
        slave.ring_position = 1;
        place.slave = slave.number;
    }
    (void)find_topology(network.seen_ring());
    store_topology(network.seen_ring(), network.slaves());
}

Task<Result<>> read_ring(Network& network) {
    auto roll = co_await read_all_states(network);
    for (int more = 5; !roll && more > 0; --more) roll = co_await read_all_states(network);
    if (!roll) co_return roll.error();
    if (roll->count > network.ring.size())
        co_return Error{.code = Errc::capacity,
                        .step = Step::recover,
                        .expected = roll->count,
                        .actual = static_cast<std::uint32_t>(network.ring.size())};
    Crew crew(network.tasks);
    for (std::uint16_t n = 0; n < roll->count; ++n) {
        while (crew.full()) co_await crew.one();
        while (!crew.start(read_place(network, n))) {
            if (crew.running() == 0)
                co_return Error{.code = Errc::capacity, .step = Step::recover, .detail = Error::kTasks};
            co_await crew.one();
        }
    }
    co_await crew.all();
    if (crew.first_error().code != Errc::none) co_return crew.first_error();
    network.ring_count = roll->count;
    recognise(network);
    co_return Result<>();
}

// Notes the slaves that are absent from the ring and not reported lost yet: a newcomer may be one of them.
Task<Result<>> miss_absent(Network& network) {
    for (Slave& slave : network.slaves()) {
        if (slave.ring_position != 0 || network.marks(slave).in_use || slave.al.state == AlState::none) continue;
        auto there = co_await read_al_status(network.station(slave));
        if (does_not_answer(there.error()) && !network.marks(slave).in_use && slave.al.state != AlState::none)
            note_lost(network, slave);
    }
    co_return Result<>();
}

// ------------------------------------------------------------------ identification of a newcomer

// Gives its address to a newcomer. The same frame checks that the ring is as it was read: the number of slaves,
// the address of the newcomer and that of the slave above it, which may be the head of its group; and that no slave has
// the newcomer's address. Otherwise the slave that
// received the address gets its previous address back.
Task<Result<>> address_newcomer(Network& network, std::uint16_t n) {
    ++network.newcomers;
    const RingPosition at{n};
    const std::uint16_t parent =
        network.ring[n].parent == 0 ? n : static_cast<std::uint16_t>(network.ring[n].parent - 1);
    std::array<std::byte, 1> type{};
    std::array<std::byte, 2> above{};
    std::array<std::byte, 2> before{};
    std::array<std::byte, 2> after{};
    std::array<std::byte, 1> other{};
    store_le<std::uint16_t>(after, 0, newcomer_address(network).value);
    Link& link = network.engine.link();
    Datagram count(link, wire::Command::BRD, {std::uint16_t{0}, reg::kType.address}, MutableBytes(type));
    Datagram head(link, wire::Command::APRD, {RingPosition{parent}, reg::kStationAddress.address}, MutableBytes(above));
    Datagram guest(link, wire::Command::FPRD, {newcomer_address(network), reg::kType.address}, MutableBytes(other));
    Datagram look(link, wire::Command::APRD, {at, reg::kStationAddress.address}, MutableBytes(before), Repeat::no);
    Datagram write(link, wire::Command::APWR, {at, reg::kStationAddress.address}, Bytes(after), Repeat::no);
    co_await together(count, head, guest, look, write);
    bool came = true;
    for (const Datagram* d : {&count, &head, &guest, &look, &write}) came &= d->reply().ok();
    const bool same = count.reply().wkc == network.ring_count && guest.reply().wkc == 0 &&
                      load_le<std::uint16_t>(above) == network.ring[parent].address &&
                      load_le<std::uint16_t>(before) == network.ring[n].address;
    if (came && same) co_return Result<>();
    Datagram undo(link, wire::Command::FPWR, {newcomer_address(network), reg::kStationAddress.address}, Bytes(before));
    if (look.reply().ok()) co_await undo;
    co_return Error{.code = Errc::unstable, .step = Step::recover};
}

Task<Result<>> rename(Network& network, StationAddress from, std::uint16_t to) {
    const Station station{network.engine, from, 0};
    auto written = co_await write<std::uint16_t>(station, reg::kStationAddress, to, Step::recover);
    // Two slaves had the address: both are newcomers for the next search.
    if (written.error().code == Errc::working_counter && written.error().actual > 1 && to != 0) {
        const Station both{network.engine, {to}, 0};
        auto reset = co_await write<std::uint16_t>(both, reg::kStationAddress, 0, Step::recover);
        (void)reset;
    }
    co_return written;
}

Task<Result<Identity>> read_identity(Station station) {
    auto taken = co_await sii_assign(station, false);
    if (!taken) co_return taken.error();
    std::array<std::byte, sii::kIdentityBytes> octets{};
    SiiReader reader(station);
    auto read = co_await reader.read(sii::word::kIdentity, octets);
    auto offered = co_await sii_assign(station, true);
    if (!read) co_return read.error();
    if (!offered) co_return offered.error();
    co_return sii::load_identity(octets);
}

// Reads the identity of the guest. The whole SII is read only if a lost slave is recognised by its device id.
Task<Result<>> read_newcomer(Network& network) {
    Slave& guest = network.guest;
    guest = Slave{};
    guest.station_address = newcomer_address(network);
    const Station station = network.station(guest);
    auto al = co_await read_al_status(station);
    if (!al) co_return al.error();
    const bool by_id = std::ranges::any_of(network.slaves(), [&](const Slave& s) {
        return is_lost(network, s) && s.wanted != nullptr && s.wanted->device_id;
    });
    if (by_id) {
        auto assigned = co_await sii_assign(station, false);
        if (!assigned) co_return assigned;
        auto surveyed = co_await survey(network, guest);
        if (!surveyed) co_return surveyed;
        // A failed read is not an answer. A missing device id, or a contradictory SII, is an answer.
        if (!guest.seen || guest.error.step == Step::identify) co_return guest.error;
        auto offered = co_await sii_assign(station, true);
        if (!offered) co_return offered;
    } else {
        auto alias = co_await read<std::uint16_t>(station, reg::kStationAlias, Step::recover);
        if (!alias) co_return alias.error();
        guest.alias = *alias;
        auto identity = co_await read_identity(station);
        if (!identity) co_return identity.error();
        guest.identity = *identity;
    }
    guest.al = *al;
    co_return Result<>();
}

// The result of the identification: the guest is `slave`; or it is none of them, but at the place of `instead_of`.
struct Verdict {
    Slave* slave = nullptr;
    Slave* instead_of = nullptr;
};

// Returns the last slave before a place of the ring for which the condition holds.
template <class Holds>
const Slave* last_before(Network& network, std::size_t n, Holds holds) {
    while (n-- > 0)
        if (const std::uint16_t slave = network.ring[n].slave; slave != 0 && holds(network.slave(slave)))
            return &network.slave(slave);
    return nullptr;
}

// Returns the lost slave that the guest is: the search begins behind `after`, then continues with the others.
template <class Holds>
Verdict choose(Network& network, const Slave* after, Holds holds) {
    Verdict verdict;
    for (const bool behind : {true, false}) {
        for (Slave& slave : network.slaves()) {
            if (!is_lost(network, slave) || !holds(slave) ||
                (after == nullptr || slave.number > after->number) != behind)
                continue;
            if (fits(slave, network.guest)) return {&slave, nullptr};
            if (verdict.instead_of == nullptr && behind) verdict.instead_of = &slave;
        }
    }
    return verdict;
}

Verdict identify_newcomer(Network& network, std::uint16_t n) {
    for (Slave& slave : network.slaves()) {
        if (!is_lost(network, slave) || !anywhere(network, slave) || !locates(*slave.wanted, network.guest)) continue;
        return fits(slave, network.guest) ? Verdict{&slave, nullptr} : Verdict{nullptr, &slave};
    }
    if (const std::uint8_t group = group_above(network, static_cast<std::uint16_t>(n + 1)); group != 0) {
        const auto in_group = [&](const Slave& s) { return group_of(s) == group; };
        const auto member = [&](const Slave& s) { return group_of(s) == group && !anywhere(network, s); };
        const Verdict verdict = choose(network, last_before(network, n, in_group), member);
        if (verdict.slave != nullptr || verdict.instead_of != nullptr) return verdict;
    }
    Verdict verdict = choose(network, last_before(network, n, of_the_line), of_the_line);
    // An optional slave that has never been present is not reported as replaced by another slave.
    if (verdict.instead_of != nullptr && !verdict.instead_of->seen && verdict.instead_of->config.optional)
        verdict.instead_of = nullptr;
    return verdict;
}

// A ring that changes while it is read shows a slave twice, or in a place that the slave has left; and a slave may be
// readmitted while the newcomer is read. The newcomer is that slave if no slave answers at the address of the slave.
Task<Result<Verdict>> verify_newcomer(Network& network, std::uint16_t n) {
    const Verdict verdict = identify_newcomer(network, n);
    if (verdict.slave != nullptr) co_return verdict;
    for (Slave& slave : network.slaves()) {
        const bool may_be = slave.al.state == AlState::none || network.ring[n].address == slave.station_address.value;
        if (slave.ring_position == 0 || !slave.seen || !may_be || !fits(slave, network.guest)) continue;
        auto there = co_await read_al_status(network.station(slave));
        if (there) continue;
        if (!does_not_answer(there.error())) co_return there.error();
        co_return Verdict{&slave, nullptr};
    }
    co_return verdict;
}

// ------------------------------------------------------------------ result of the identification

Task<Result<>> assign_slave_address(Network& network, std::uint16_t n, Slave& slave) {
    const AlStatus now = network.guest.al;
    slave.alias = network.guest.alias;
    slave.device_id = network.guest.device_id;
    auto named = co_await rename(network, network.guest.station_address, slave.station_address.value);
    if (!named) co_return named;
    network.ring[n].slave = slave.number;
    network.ring[n].address = slave.station_address.value;
    store_topology(network.seen_ring(), network.slaves());
    // The slave was never reported lost.
    if (slave.al.state != AlState::none || network.marks(slave).in_use) co_return Result<>();
    network.report({.kind = EventKind::found, .slave = slave.number, .before = slave.al, .now = now});
    slave.al = now;
    network.marks(slave).attempts = 0;
    network.marks(slave).missing_reported = false;
    network.marks(slave).settled = AlState::none;
    // The held slave is gone: delete what was read from it.
    if (slave.other && is_the_wanted_one(slave, network.guest)) {
        slave.seen = false;
        slave.other = false;
        slave.held = false;
        slave.dl = {.fmmus = 16, .sync_managers = 16};
    }
    co_return Result<>();
}

void report_other_slave(Network& network, Slave& slave) {
    const Identity& there = network.guest.identity;
    const Identity& wanted = slave.identity;
    Error error = slave.wanted != nullptr ? difference(network.guest, *slave.wanted) : Error{};
    if (error.code == Errc::none) {
        error.code = Errc::other_slave;
        error.expected = wanted.product;
        error.actual = there.product;
        error.detail = there.vendor;
    }
    error.step = Step::recover;
    error.slave = slave.number;
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

// An unknown slave gets a mark as its station address. It is reported when it is found a second time, because a ring
// that changes while it is being read can mislead; after that it is not reported again.
Task<Result<>> mark_stranger(Network& network, std::uint16_t n, Slave* instead_of) {
    constexpr std::uint16_t kSuspect = 0x0100;  // below the mark of reported slaves
    const std::uint16_t told = network.stranger_mark;
    const std::uint16_t before = network.ring[n].address;
    const bool at_once = told == 0;
    const bool again = !at_once && before == told - kSuspect;
    const bool known = !at_once && before == told;
    const auto mark = static_cast<std::uint16_t>(at_once || again || known ? told : told - kSuspect);
    auto marked = co_await rename(network, network.guest.station_address, mark);
    if (!marked) co_return marked;
    network.ring[n].address = mark;
    if (!at_once && !again) co_return Result<>();
    if (instead_of != nullptr)
        report_other_slave(network, *instead_of);
    else
        report_stranger(network, n);
    co_return Result<>();
}

// A newcomer below an unidentified slave cannot be identified: the slave above may be the head of its group.
bool below_unasked(Network& network, std::size_t n) {
    for (std::uint16_t at = network.ring[n].parent; at != 0; at = network.ring[at - 1U].parent)
        if (network.ring[at - 1U].unasked) return true;
    return false;
}

// Identifies a newcomer. Returns whether it is a slave of the network.
Task<Result<bool>> receive_newcomer(Network& network, std::uint16_t n) {
    auto named = co_await address_newcomer(network, n);
    if (!named) co_return named.error();
    auto asked = co_await read_newcomer(network);
    Result<Verdict> verdict;
    if (asked) verdict = co_await verify_newcomer(network, n);
    if (!asked || !verdict) {
        auto undone = co_await rename(network, newcomer_address(network), network.ring[n].address);
        (void)undone;  // the newcomer is gone, or it is read again in the next search
        co_return asked ? verdict.error() : asked.error();
    }
    if (verdict->slave == nullptr) {
        auto dismissed = co_await mark_stranger(network, n, verdict->instead_of);
        co_return dismissed ? Result<bool>(false) : Result<bool>(dismissed.error());
    }
    auto admitted = co_await assign_slave_address(network, n, *verdict->slave);
    co_return admitted ? Result<bool>(true) : Result<bool>(admitted.error());
}

Task<Result<bool>> is_the_same(Network& network, Slave& slave) {
    const Station station = network.station(slave);
    auto alias = co_await read<std::uint16_t>(station, reg::kStationAlias, Step::recover);
    if (!alias) co_return alias.error();
    auto identity = co_await read_identity(station);
    if (!identity) co_return identity.error();
    co_return *alias == slave.alias&&* identity == slave.identity;
}

}  // namespace

Task<Result<BroadcastState>> read_all_states(Network& network) {
    std::array<std::byte, 2> states{};
    Datagram look(network.engine.link(), wire::Command::BRD, {std::uint16_t{0}, reg::kAlStatus.address},
                  MutableBytes(states), Repeat::no);
    auto reply = co_await look;
    if (!reply.ok()) co_return Error{.code = reply.errc, .step = Step::count_slaves};
    co_return BroadcastState{.count = reply.wkc, .al_status = load_le<std::uint16_t>(states)};
}

Task<Result<std::uint16_t>> find_lost(Network& network) {
    const Searching searching(network);
    auto read = co_await read_ring(network);
    if (!read) co_return read.error();
    auto missed = co_await miss_absent(network);
    if (!missed) co_return missed.error();
    std::uint16_t found = 0;
    Error error;
    for (std::uint16_t n = 0; n < network.ring_count && error.code != Errc::unstable; ++n) {
        if (network.ring[n].slave != 0 || below_unasked(network, n)) continue;
        auto ours = co_await receive_newcomer(network, n);
        network.ring[n].unasked = !ours;
        if (!ours) error = ours.error();  // of this newcomer; those behind it may be correct
        if (ours && *ours) ++found;
    }
    co_return found == 0 && error.code != Errc::none ? Result<std::uint16_t>(error) : Result<std::uint16_t>(found);
}

void note_reading(Network& network, Slave& slave, const Result<AlStatus>& seen) {
    if (!network.supervised) {
        take_al_status(slave.al, seen);
        if (slave.al.state == AlState::none) set_takes_part(network, slave, false);
        return;
    }
    if (slave.al.state == AlState::none || network.marks(slave).in_use) return;
    if (seen) return note_state(network, slave, *seen);
    if (does_not_answer(seen.error())) note_lost(network, slave);
}

void note_lost(Network& network, Slave& slave) {
    network.report({.kind = EventKind::lost, .slave = slave.number, .before = slave.al});
    slave.al = {};
    slave.ring_position = 0;
    network.marks(slave).settled = AlState::none;
    set_takes_part(network, slave, false);
}

Task<Result<>> readmit_if_there(Network& network, Slave& slave) {
    if (slave.al.state != AlState::none || !slave.seen) co_return Result<>();
    auto seen = co_await read_al_status(network.station(slave));
    if (!seen || slave.al.state != AlState::none || network.marks(slave).in_use) co_return Result<>();
    co_return co_await readmit_slave(network, slave, *seen);
}

// FMMUs with the expected values are sufficient proof, and faster: the cycle waits for the slave. Otherwise the SII is
// read.
Task<Result<>> readmit_slave(Network& network, Slave& slave, AlStatus now) {
    const SlaveToken token(network.marks(slave));
    bool mapped = false;
    if (exchanges(slave) && is_mapped(network, slave) && !slave.held) {
        auto same = co_await has_fmmus(network, slave, network.process.groups[slave.config.group].layout);
        mapped = same && *same;
    }
    if (!mapped) {
        auto same = co_await is_the_same(network, slave);
        if (!same) co_return Result<>();  // the next look repeats the check
        if (!*same) co_return co_await rename(network, slave.station_address, 0);
    }
    network.report({.kind = EventKind::found, .slave = slave.number, .before = slave.al, .now = now});
    slave.al = now;
    network.marks(slave).attempts = 0;
    if (mapped && now.state != AlState::init) set_takes_part(network, slave, true);
    co_return Result<>();
}

}  // namespace margay
