#include "network/search.hpp"

#include "network/recovery.hpp"
#include "station/al_state.hpp"
#include "station/sii_access.hpp"
#include "wire/sii.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;
namespace sii = wire::sii;

// One that answers in the ring and is not known.
struct Newcomer {
    RingPosition at;
    std::uint16_t address = 0;        // that it has
    std::uint16_t behind = 0;         // the last known slave before it
    std::uint16_t of = 0;             // how many slaves the ring had
};

bool fits(const Slave& slave, const Identity& identity) {
    return slave.identity.vendor == identity.vendor && slave.identity.product == identity.product &&
           slave.identity.revision == identity.revision;
}

Task<Result<>> read_address(Network& network, RingPosition at, std::uint16_t& into) {
    std::array<std::byte, 2> address{};
    Datagram look(network.engine.link(), wire::Command::APRD, {at, reg::kStationAddress.address}, MutableBytes(address));
    auto reply = co_await look;
    if (!reply.ok()) co_return Error{.code = reply.errc, .step = Step::recover};
    if (reply.wkc != 1) co_return Error{.code = Errc::unstable, .step = Step::recover};
    into = load_le<std::uint16_t>(address);
    co_return Result<>();
}

// The addresses of some slaves in the order of the ring, all at once.
using Addresses = std::array<std::uint16_t, 32>;
Task<Result<>> read_addresses(Network& network, std::uint16_t first, std::size_t count, Addresses& into) {
    Crew crew(network.tasks);
    for (std::size_t n = 0; n < count; ++n) {
        while (crew.full()) co_await crew.one();
        const RingPosition at{static_cast<std::uint16_t>(first + n)};
        while (!crew.start(read_address(network, at, into[n]))) {
            if (crew.running() == 0) co_return Error{.code = Errc::capacity, .step = Step::recover};
            co_await crew.one();
        }
    }
    co_await crew.all();
    co_return crew.first_error().code == Errc::none ? Result<>() : Result<>(crew.first_error());
}

// Gives the newcomer an address, unless the ring is not what it was any more: then whoever got it gets back what he had.
Task<Result<>> name(Network& network, const Newcomer& newcomer, StationAddress address) {
    std::array<std::byte, 1> type{};
    std::array<std::byte, 2> before{};
    std::array<std::byte, 2> after{};
    store_le<std::uint16_t>(after, 0, address.value);
    Link& link = network.engine.link();
    Datagram count(link, wire::Command::BRD, {std::uint16_t{0}, reg::kType.address}, MutableBytes(type));
    Datagram look(link, wire::Command::APRD, {newcomer.at, reg::kStationAddress.address}, MutableBytes(before), Repeat::no);
    Datagram write(link, wire::Command::APWR, {newcomer.at, reg::kStationAddress.address}, Bytes(after), Repeat::no);
    co_await together(count, look, write);
    const bool came = count.reply().ok() && look.reply().ok() && write.reply().ok();
    if (came && count.reply().wkc == newcomer.of && load_le<std::uint16_t>(before) == newcomer.address) co_return Result<>();
    Datagram undo(link, wire::Command::FPWR, {address, reg::kStationAddress.address}, Bytes(before));
    if (look.reply().ok()) co_await undo;
    co_return Error{.code = Errc::unstable, .step = Step::recover};
}

Task<Result<>> unname(Network& network, const Newcomer& newcomer, StationAddress address) {
    std::array<std::byte, 2> before{};
    store_le<std::uint16_t>(before, 0, newcomer.address);
    Datagram undo(network.engine.link(), wire::Command::FPWR, {address, reg::kStationAddress.address}, Bytes(before));
    co_await undo;
    co_return Result<>();
}

Task<Result<Identity>> read_identity(Station station) {
    auto taken = co_await sii_assign(station, false);
    if (!taken) co_return taken.error();
    std::array<std::byte, sii::kIdentityBytes> octets{};
    SiiReader reader(station);
    auto read = co_await reader.read(sii::word::kIdentity, octets);
    if (!read) co_return read.error();
    co_return sii::load_identity(octets);
}

// Whether the newcomer is the slave; if so it has its station address afterwards, else the one that it had.
Task<Result<bool>> admit(Network& network, const Newcomer& newcomer, Slave& slave, Identity* seen) {
    auto named = co_await name(network, newcomer, slave.station_address);
    if (!named) co_return named.error();
    auto identity = co_await read_identity(network.station(slave));
    if (identity && fits(slave, *identity)) {
        auto al = co_await read_al_status(network.station(slave));
        if (!al) co_return al.error();
        network.tell({.kind = EventKind::found, .slave = slave.position, .before = slave.al, .now = *al});
        slave.al = *al;
        slave.attempts = 0;
        co_return true;
    }
    if (seen != nullptr && identity) *seen = *identity;
    auto undone = co_await unname(network, newcomer, slave.station_address);
    if (!undone) co_return undone.error();
    if (!identity) co_return identity.error();
    co_return false;
}

// The next lost slave behind `position`, or nobody.
Slave* next_lost(Network& network, std::uint16_t position) {
    for (std::size_t n = position + 1U; n <= network.count; ++n)
        if (network.slave(n).al.state == AlState::none) return &network.slave(n);
    return nullptr;
}

// First the one that belongs there, then any other that it can be.
Task<Result<std::uint16_t>> place(Network& network, Newcomer newcomer) {
    Slave* expected = next_lost(network, newcomer.behind);
    Identity seen;
    if (expected != nullptr) {
        auto right = co_await admit(network, newcomer, *expected, &seen);
        if (!right) co_return right.error();
        if (*right) co_return expected->position;
    }
    for (std::size_t n = 1; n <= network.count; ++n) {
        Slave& slave = network.slave(n);
        if (&slave == expected || slave.al.state != AlState::none || (expected != nullptr && !fits(slave, seen))) continue;
        auto right = co_await admit(network, newcomer, slave, nullptr);
        if (!right) co_return right.error();
        if (*right) co_return slave.position;
    }
    if (expected == nullptr) co_return std::uint16_t{0};
    network.tell({.kind = EventKind::other_slave,
                  .slave = expected->position,
                  .expected = expected->identity.product,
                  .actual = seen.product,
                  .detail = seen.vendor});
    Error error{.code = Errc::other_slave, .step = Step::recover, .slave = expected->position};
    error.expected = expected->identity.product;
    error.actual = seen.product;
    error.detail = seen.vendor;
    network.note(*expected, error);
    co_return std::uint16_t{0};
}

// The known slave with this address, if it can be behind `position`.
const Slave* known(Network& network, std::uint16_t address, std::uint16_t position) {
    const unsigned first = network.settings.first_station_address;
    if (address < first || address >= first + network.count) return nullptr;
    const Slave& slave = network.slave(address - first + 1U);
    return slave.position > position ? &slave : nullptr;
}

}  // namespace

Task<Result<Roll>> call_roll(Network& network) {
    std::array<std::byte, 2> states{};
    Datagram look(network.engine.link(), wire::Command::BRD, {std::uint16_t{0}, reg::kAlStatus.address}, MutableBytes(states));
    auto reply = co_await look;
    if (!reply.ok()) co_return Error{.code = reply.errc, .step = Step::count_slaves};
    co_return Roll{.count = reply.wkc, .al_status = load_le<std::uint16_t>(states)};
}

Task<Result<std::uint16_t>> find_lost(Network& network) {
    auto roll = co_await call_roll(network);
    if (!roll) co_return roll.error();
    std::uint16_t found = 0;
    std::uint16_t behind = 0;
    Addresses addresses{};
    for (std::uint16_t n = 0; n < roll->count; ++n) {
        if (n % addresses.size() == 0) {
            auto read = co_await read_addresses(network, n, std::min<std::size_t>(addresses.size(), roll->count - n), addresses);
            if (!read) co_return read.error();
        }
        const std::uint16_t address = addresses[n % addresses.size()];
        if (const Slave* slave = known(network, address, behind)) {
            behind = slave->position;
            continue;
        }
        auto placed = co_await place(network, {RingPosition{n}, address, behind, roll->count});
        if (!placed) co_return placed.error();
        if (*placed == 0) continue;
        ++found;
        if (*placed > behind) behind = *placed;
    }
    co_return found;
}

}  // namespace margay
