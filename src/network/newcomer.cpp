#include "network/newcomer.hpp"

#include "network/configure.hpp"
#include "network/expectation.hpp"
#include "network/places.hpp"
#include "network/survey.hpp"
#include "network/topology.hpp"
#include "station/al_state.hpp"
#include "station/sii_access.hpp"
#include "wire/sii.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;
namespace sii = wire::sii;

// Whether the guest is the slave that was seen at this place. If another slave than the expected one was seen there,
// the guest may be either of them: the expected slave, or the other slave, also with another alias or revision. The
// other slave is then held or tolerated as before.
bool fits(const Slave& slave, const Slave& guest) {
    const bool same_kind =
        slave.identity.vendor == guest.identity.vendor && slave.identity.product == guest.identity.product;
    if (slave.seen && slave.other && same_kind) return true;
    if (is_known(slave) && !slave.other && !same_kind) return false;
    return is_the_wanted_one(slave, guest);
}

bool anywhere(const Network& network, const Slave& slave) {
    return slave.wanted != nullptr && is_located(network.expected, *slave.wanted);
}
std::uint8_t group_of(const Slave& slave) {
    return slave.wanted != nullptr ? slave.wanted->hot_connect : std::uint8_t{0};
}

Task<Result<Identity>> read_identity(Station station) {
    co_await required(sii_assign(station, false));
    std::array<std::byte, sii::kIdentityBytes> octets{};
    SiiReader reader(station);
    auto read = co_await reader.read(sii::word::kIdentity, octets);
    auto offered = co_await sii_assign(station, true);
    if (!read) co_return read.error();
    if (!offered) co_return offered.error();
    // A blank EEPROM contains no identity. The known identity of a slave with a blank EEPROM is empty, too.
    if (sii::is_blank(octets)) co_return Identity{};
    co_return sii::load_identity(octets);
}

// Returns the last slave before a place of the ring for which the condition holds.
template <class Holds>
const Slave* last_before(Network& network, std::size_t n, Holds holds) {
    while (n-- > 0)
        if (const std::uint16_t slave = network.ring[n].slave; slave != 0 && holds(network.slave(slave)))
            return &network.slave(slave);
    return nullptr;
}

// Returns the lost member of a group that fits the guest. The members behind `after` are compared first, then the
// others.
template <class Holds>
Verdict choose_member(Network& network, const Slave* after, Holds holds) {
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

// The guest fits `slave` by its kind alone, and is exactly what is expected of another lost slave.
bool is_wanted_elsewhere(Network& network, const Slave& slave) {
    const bool itself = slave.identity == network.guest.identity && slave.alias == network.guest.alias;
    if (itself || is_the_wanted_one(slave, network.guest)) return false;
    return std::ranges::any_of(network.slaves(), [&](const Slave& other) {
        return &other != &slave && other.wanted != nullptr && is_lost(network, other) &&
               is_the_wanted_one(other, network.guest);
    });
}

// A number 0 means that the device has no such number.
bool agrees(std::uint32_t known, std::uint32_t seen) { return known != 0 && known == seen; }
bool contradicts(std::uint32_t known, std::uint32_t seen) { return known != 0 && seen != 0 && known != seen; }

Verdict identify_newcomer(Network& network, std::uint16_t n) {
    Verdict verdict;
    if (network.expectation != nullptr) verdict = network.expectation->identify(network, n);
    if (verdict.slave != nullptr || verdict.instead_of != nullptr) return verdict;
    verdict = choose_by_place(network, n);
    // An optional slave that has never been present is not reported as replaced by another slave.
    if (verdict.instead_of != nullptr && !verdict.instead_of->seen && is_optional(*verdict.instead_of))
        verdict.instead_of = nullptr;
    return verdict;
}

}  // namespace

bool fits_guest(const Network& network, const Slave& slave) { return fits(slave, network.guest); }

bool guest_may_be(Network& network, const Slave& slave) {
    return fits(slave, network.guest) && !contradicts(slave.alias, network.guest.alias) &&
           !(slave.other && is_wanted_elsewhere(network, slave));
}

bool is_guest_by_serial(const Network& network, const Slave& slave) {
    const Identity& guest = network.guest.identity;
    const auto has_it = [&](const Slave& s) {
        return agrees(s.identity.serial, guest.serial) && s.identity.vendor == guest.vendor &&
               s.identity.product == guest.product;
    };
    // If several devices have the same serial number, it does not identify a device.
    return is_known(slave) && has_it(slave) && std::ranges::count_if(network.slaves(), has_it) == 1;
}

bool is_guest_by_number(const Network& network, const Slave& slave) {
    const Slave& guest = network.guest;
    if (is_guest_by_serial(network, slave) || agrees(slave.alias, guest.alias)) return true;
    const ExpectedSlave* wanted = slave.wanted;  // a slave that was never present has its numbers in the list
    return wanted != nullptr && (agrees(wanted->serial.value_or(0), guest.identity.serial) ||
                                 agrees(wanted->alias.value_or(0), guest.alias));
}

Verdict identify_as_expected(Network& network, std::uint16_t n) {
    for (Slave& slave : network.slaves()) {
        if (!is_lost(network, slave) || !anywhere(network, slave) || !locates(*slave.wanted, network.guest)) continue;
        return fits(slave, network.guest) ? Verdict{&slave, nullptr} : Verdict{nullptr, &slave};
    }
    const std::uint8_t group = group_above(network, static_cast<std::uint16_t>(n + 1));
    if (group == 0) return {};
    const auto in_group = [&](const Slave& s) { return group_of(s) == group; };
    const auto member = [&](const Slave& s) { return group_of(s) == group && !anywhere(network, s); };
    return choose_member(network, last_before(network, n, in_group), member);
}

StationAddress newcomer_address(const Network& network) {
    constexpr std::uint16_t kNewcomers = 0x0D00;  // below the addresses of unknown slaves
    return {static_cast<std::uint16_t>(kNewcomers | network.newcomers)};
}

bool is_lost(const Network& network, const Slave& slave) {
    // If the list of expect() has no slave with this number, no newcomer can be this slave.
    const bool nobody = !network.expected.empty() && slave.wanted == nullptr && !slave.unexpected;
    return slave.al.state == AlState::none && !nobody && !network.marks(slave).in_use &&
           (slave.ring_position == 0 || !slave.seen);
}

bool is_the_wanted_one(const Slave& slave, const Slave& guest) {
    return slave.wanted == nullptr || difference(guest, *slave.wanted).code == Errc::none;
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

Task<Result<>> unmap(Station station) {
    const auto zeros = Bytes(kClearedRegisters).first(16 * reg::kFmmuStride);
    auto written = co_await write_bytes(station, reg::kFmmuBase, zeros, Step::recover);
    co_return written || does_not_answer(written.error()) ? Result<>() : written;  // some slaves have no FMMUs
}

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
    Datagram upper(link, wire::Command::APRD, {RingPosition{parent}, reg::kStationAddress.address},
                   MutableBytes(above));
    Datagram guest(link, wire::Command::FPRD, {newcomer_address(network), reg::kType.address}, MutableBytes(other));
    Datagram look(link, wire::Command::APRD, {at, reg::kStationAddress.address}, MutableBytes(before), Repeat::no);
    Datagram write(link, wire::Command::APWR, {at, reg::kStationAddress.address}, Bytes(after), Repeat::no);
    co_await together(count, upper, guest, look, write);
    bool came = true;
    for (const Datagram* d : {&count, &upper, &guest, &look, &write}) came &= d->reply().ok();
    const bool same = count.reply().wkc == network.ring_count && guest.reply().wkc == 0 &&
                      load_le<std::uint16_t>(above) == network.ring[parent].address &&
                      load_le<std::uint16_t>(before) == network.ring[n].address &&
                      network.parts_read.divides_like(network.ring_parts());
    if (came && same) co_return Nothing{};
    Datagram undo(link, wire::Command::FPWR, {newcomer_address(network), reg::kStationAddress.address}, Bytes(before));
    if (look.reply().ok()) co_await undo;
    co_return Error{.code = Errc::unstable, .step = Step::recover};
}

Task<Result<>> read_newcomer(Network& network) {
    Slave& guest = network.guest;
    guest = Slave{};
    guest.station_address = newcomer_address(network);
    const Station station = network.station(guest);
    const auto al = co_await required(read_al_status(station));
    co_await required(unmap(station));
    co_await required(write<std::uint8_t>(station, reg::kAliasEnable, 0, Step::recover));
    const bool by_id = std::ranges::any_of(network.slaves(), [&](const Slave& s) {
        return is_lost(network, s) && s.wanted != nullptr && s.wanted->device_id;
    });
    if (by_id) {
        co_await required(sii_assign(station, false));
        co_await required(survey(network, guest));
        // A failed read is not an answer. A missing device id, or a contradictory SII, is an answer.
        if (guest.error.step == Step::identify) co_return guest.error;
        co_await required(sii_assign(station, true));
    } else {
        const auto alias = co_await required(read<std::uint16_t>(station, reg::kStationAlias, Step::recover));
        guest.alias = alias;
        const auto identity = co_await required(read_identity(station));
        guest.identity = identity;
    }
    guest.al = al;
    co_return Nothing{};
}

Task<Result<Verdict>> verify_newcomer(Network& network, std::uint16_t n) {
    const Verdict verdict = identify_newcomer(network, n);
    if (verdict.slave != nullptr || verdict.rivals[0] != nullptr) co_return verdict;
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

Error identity_difference(const Slave& slave, const Identity& there, std::uint16_t alias) {
    Error error{.code = Errc::other_slave, .step = Step::recover, .slave = slave.number, .detail = there.vendor};
    const auto differs = [&error](IdentityField field, std::uint32_t known, std::uint32_t seen) {
        if (known == seen) return false;
        error.subindex = static_cast<std::uint8_t>(field);
        error.expected = known;
        error.actual = seen;
        return true;
    };
    const Identity& known = slave.identity;
    const bool any = differs(IdentityField::vendor, known.vendor, there.vendor) ||
                     differs(IdentityField::product, known.product, there.product) ||
                     differs(IdentityField::serial, known.serial, there.serial) ||
                     differs(IdentityField::alias, slave.alias, alias) ||
                     differs(IdentityField::revision, known.revision, there.revision);
    return any ? error : Error{};
}

Task<Result<>> compare_identity(Network& network, Slave& slave) {
    if (!is_known(slave)) co_return Nothing{};
    const Station station = network.station(slave);
    const auto alias = co_await required(read<std::uint16_t>(station, reg::kStationAlias, Step::recover));
    const auto identity = co_await required(read_identity(station));
    co_return identity_difference(slave, identity, alias);
}

}  // namespace margay
