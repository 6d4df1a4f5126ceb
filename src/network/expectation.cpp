#include "network/expectation.hpp"

#include "network/newcomer.hpp"
#include "station/device_id.hpp"

#include <algorithm>
#include <utility>

namespace margay {
namespace {

using Expected = std::span<const ExpectedSlave>;

bool fits(const Slave& slave, const ExpectedSlave& wanted) { return difference(slave, wanted).code == Errc::none; }

bool is_first_of_group(Expected list, std::size_t n) {
    return list[n].hot_connect != 0 && (n == 0 || list[n - 1].hot_connect != list[n].hot_connect);
}

std::size_t group_end(Expected list, std::size_t first) {
    std::size_t end = first + 1;
    while (end < list.size() && list[end].hot_connect == list[first].hot_connect) ++end;
    return end;
}

const ExpectedSlave* find_number(Expected list, std::size_t number) {
    const auto found = std::ranges::find(list, number, &ExpectedSlave::number);
    return found == list.end() ? nullptr : &*found;
}

Slave* find_located(Network& network, const ExpectedSlave& wanted) {
    const auto slaves = network.slaves();
    const auto found =
        std::ranges::find_if(slaves, [&](const Slave& s) { return s.wanted == nullptr && locates(wanted, s); });
    return found == slaves.end() ? nullptr : &*found;
}

// Assigns the slaves connected below `first`, the first slave of a group, to the members of the group: each slave is
// the next member that it can be, or simply the next member if it can be none. `entry`: the entry of `first` in the
// list.
void find_members(Network& network, std::size_t entry, const Slave& first) {
    const Expected list = network.expected;
    const std::size_t end = group_end(list, entry);
    std::size_t next = entry + 1;
    for (std::size_t place = first.ring_position + 1U; place <= network.count && next < end; ++place) {
        Slave& slave = network.slave(place);
        if (slave.wanted != nullptr || group_above(network, slave.ring_position) != list[entry].hot_connect) continue;
        std::size_t member = next;
        while (member < end && !fits(slave, list[member])) ++member;
        if (member == end) member = next;
        slave.wanted = &list[member];
        next = member + 1;
    }
}

void find_those_anywhere(Network& network) {
    const Expected list = network.expected;
    for (std::size_t n = 0; n < list.size(); ++n) {
        if (!is_located(list, list[n])) continue;
        if (Slave* slave = find_located(network, list[n])) slave->wanted = &list[n];
    }
    for (std::size_t n = 0; n < list.size(); ++n) {
        if (!is_first_of_group(list, n)) continue;
        const auto slaves = network.slaves();
        const auto first = std::ranges::find(slaves, &list[n], &Slave::wanted);
        if (first != slaves.end()) find_members(network, n, *first);
    }
}

// Returns the number of a slave of the line when `next` is the next number. Optional slaves that do not fit are skipped
// if the slave fits a later one.
std::size_t number_in_line(Expected list, const Slave& slave, std::size_t next, std::size_t last) {
    for (std::size_t at = next; at <= last; ++at) {
        const ExpectedSlave* wanted = find_number(list, at);
        if (wanted == nullptr || fits(slave, *wanted)) return at;
        if (!wanted->optional) break;
    }
    return next;
}

// Sets slave.number of all slaves to their new place in the table. Until the slaves are moved, slave.number is not
// their index. Returns the resulting number of entries in the table.
std::size_t plan_numbers(Network& network) {
    const Expected list = network.expected;
    std::size_t last = 0;
    for (const ExpectedSlave& wanted : list) last = std::max<std::size_t>(last, wanted.number);
    std::size_t number = last;
    for (const ExpectedSlave& wanted : list) {
        if (wanted.number != 0) continue;
        ++number;
        for (Slave& slave : network.slaves())
            if (slave.wanted == &wanted) slave.number = static_cast<std::uint16_t>(number);
    }
    std::size_t next = 1;
    for (Slave& slave : network.slaves()) {
        if (slave.wanted != nullptr) continue;
        const std::size_t own = next <= last ? number_in_line(list, slave, next, last) : ++number;
        slave.number = static_cast<std::uint16_t>(own);
        if (next > last) continue;
        slave.wanted = find_number(list, own);
        next = own + 1;
    }
    return number;
}

// The expected slave of this number; nullptr where the list leaves out a number.
const ExpectedSlave* wanted_at(Expected list, std::size_t number) {
    std::size_t last = 0;
    for (const ExpectedSlave& wanted : list) last = std::max<std::size_t>(last, wanted.number);
    if (number <= last) return find_number(list, number);
    for (const ExpectedSlave& wanted : list)
        if (wanted.number == 0 && ++last == number) return &wanted;
    return nullptr;
}

// The station address of a slave. An address that the list gives to one slave is not used for another slave, also while
// the first one is missing.
StationAddress address_of(const Network& network, const Slave& slave) {
    if (slave.wanted != nullptr && slave.wanted->station_address != 0) return {slave.wanted->station_address};
    std::uint16_t address = network.station_address(slave.number).value;
    while (std::ranges::find(network.expected, address, &ExpectedSlave::station_address) != network.expected.end())
        address = static_cast<std::uint16_t>(address + network.table.size());
    return {address};
}

// Addresses that the search gives to slaves that are not known.
bool is_reserved(std::uint16_t address) { return address >= 0x0C00 && address <= 0x0FFF; }

// Fills the entry of a missing slave. The resources of its ESC are unknown: the maximum is assumed.
void make_missing(Network& network, std::size_t number) {
    Slave& slave = network.slave(number);
    slave.number = static_cast<std::uint16_t>(number);
    slave.wanted = wanted_at(network.expected, number);
    slave.station_address = address_of(network, slave);
    slave.dl.fmmus = 16;
    slave.dl.sync_managers = 16;
}

}  // namespace

Result<> check_expected(std::span<const ExpectedSlave> expected) {
    for (std::size_t n = 0; n < expected.size(); ++n) {
        const ExpectedSlave& wanted = expected[n];
        const bool member = wanted.hot_connect != 0 && !is_first_of_group(expected, n);
        const bool known = wanted.number != 0 || wanted.alias || wanted.device_id || member;
        bool right = known && (wanted.hot_connect == 0 || wanted.number == 0) && !is_reserved(wanted.station_address);
        for (std::size_t before = 0; before < n && right; ++before) {
            const bool same_number = wanted.number != 0 && expected[before].number == wanted.number;
            // The members of a group are adjacent in the list.
            const bool torn = !member && wanted.hot_connect != 0 && expected[before].hot_connect == wanted.hot_connect;
            const bool same_address =
                wanted.station_address != 0 && expected[before].station_address == wanted.station_address;
            right = !same_number && !torn && !same_address;
        }
        if (right) continue;
        Error error{.code = Errc::invalid_argument, .step = Step::identify};
        error.actual = static_cast<std::uint32_t>(n + 1);
        return error;
    }
    return Result<>();
}

// The error of a slave that could not be read: the cause of the failed reading, if it is still stored; otherwise
// identity_unread. It is not other_slave, because the identity is not known.
static Error reading_error(const Slave& slave) {
    const bool told = slave.error.step == Step::read_sii || slave.error.step == Step::read_dl_information;
    if (told && slave.error.code != Errc::none) return slave.error;
    return {.code = Errc::identity_unread, .step = Step::identify, .slave = slave.number};
}

Error difference(const Slave& slave, const ExpectedSlave& wanted) {
    Error error{.code = Errc::other_slave, .step = Step::identify, .slave = slave.number};
    error.detail = slave.identity.vendor;
    const auto differs = [&](const auto& expected, std::uint32_t actual, IdentityField what) {
        if (!expected.has_value() || *expected == actual) return false;
        error.expected = *expected;
        error.actual = actual;
        error.subindex = static_cast<std::uint8_t>(what);
        return true;
    };
    const Identity& id = slave.identity;
    const bool newer = wanted.newer_revision && id.revision > wanted.revision.value_or(id.revision);
    if (differs(wanted.product, id.product, IdentityField::product) ||
        differs(wanted.vendor, id.vendor, IdentityField::vendor) ||
        (!newer && differs(wanted.revision, id.revision, IdentityField::revision)) ||
        differs(wanted.serial, id.serial, IdentityField::serial) ||
        differs(wanted.alias, slave.alias, IdentityField::alias))
        return is_unread(slave) ? reading_error(slave) : error;
    if (wanted.device_id && !slave.device_id)
        return {.code = Errc::unsupported, .step = Step::identify, .slave = slave.number};
    if (differs(wanted.device_id, slave.device_id.value_or(0), IdentityField::device_id)) return error;
    return {};
}

bool is_located(Expected list, const ExpectedSlave& wanted) {
    return wanted.number == 0 &&
           (wanted.hot_connect == 0 || is_first_of_group(list, static_cast<std::size_t>(&wanted - list.data())));
}

bool locates(const ExpectedSlave& wanted, const Slave& slave) {
    return (!wanted.alias || *wanted.alias == slave.alias) &&
           (!wanted.device_id || wanted.device_id == slave.device_id);
}

std::uint8_t group_above(Network& network, std::uint16_t place) {
    const auto ring = network.seen_ring();
    if (place > ring.size()) return 0;
    for (std::uint16_t at = ring[place - 1U].parent; at != 0; at = ring[at - 1U].parent) {
        if (ring[at - 1U].slave == 0) continue;
        const ExpectedSlave* wanted = network.slave(ring[at - 1U].slave).wanted;
        if (wanted != nullptr && wanted->hot_connect != 0) return wanted->hot_connect;
    }
    return 0;
}

Result<bool> number_slaves(Network& network) {
    if (network.expected.empty()) return false;
    find_those_anywhere(network);
    const std::size_t found = network.count;
    const std::size_t numbers = plan_numbers(network);
    if (numbers > network.table.size()) {
        network.count = 0;
        Error error{.code = Errc::capacity, .step = Step::identify};
        error.expected = static_cast<std::uint32_t>(numbers);
        error.actual = static_cast<std::uint32_t>(network.table.size());
        return error;
    }
    for (std::size_t n = found; n < numbers; ++n) {
        network.table[n] = Slave{};
        network.mark_table[n] = SlaveMarks{};
    }
    network.count = static_cast<std::uint16_t>(numbers);
    bool moved = false;
    for (std::size_t n = 1; n <= numbers; ++n) {
        Slave& here = network.slave(n);
        while (here.number != 0 && here.number != n) std::swap(here, network.slave(here.number));
    }
    for (std::size_t n = 1; n <= numbers; ++n) {
        Slave& slave = network.slave(n);
        if (slave.number == 0) {
            make_missing(network, n);
            continue;
        }
        const StationAddress address = address_of(network, slave);
        moved |= slave.station_address.value != address.value;
        slave.station_address = address;
        if (slave.error.code != Errc::none) slave.error.slave = slave.number;
        if (slave.ring_position != 0 && slave.ring_position <= network.ring.size())
            network.ring[slave.ring_position - 1U].slave = slave.number;
    }
    return moved;
}

void compare_with_expected(Network& network, FirstFault& faults) {
    if (network.expected.empty()) return;
    for (Slave& slave : network.slaves()) {
        if (slave.wanted == nullptr) {
            slave.unexpected = slave.ring_position != 0;
            continue;
        }
        slave.other = slave.ring_position != 0 && difference(slave, *slave.wanted).code != Errc::none;
        if (slave.wanted->config != nullptr) slave.config = *slave.wanted->config;
        slave.config.optional |= slave.wanted->optional || slave.wanted->hot_connect != 0;
    }
    update_held(network);
    for (Slave& slave : network.slaves()) {
        if (slave.ring_position == 0) {
            const Error error = missing_error(network, slave);
            network.marks(slave).awaited = error.code != Errc::none;
            if (error.code != Errc::none) faults.note(network, slave, error);
        }
        Error error;
        if (slave.unexpected) error = {.code = Errc::unexpected_slave, .step = Step::identify, .slave = slave.number};
        if (slave.other) error = difference(slave, *slave.wanted);
        // The cause of a failed reading was noted already.
        if (error.code != Errc::none && error.code != slave.error.code) network.note(slave, error);
        if (slave.held) faults.keep(error);
    }
}

namespace {

// Whether the device id is needed: an expected slave is recognised by its device id, and this slave may be the expected
// slave.
bool id_is_wanted(const Network& network, const Slave& slave) {
    return std::ranges::any_of(network.expected, [&](const ExpectedSlave& wanted) {
        if (!wanted.device_id) return false;
        const bool same = slave.wanted == &wanted || (wanted.number == slave.number && slave.number != 0) ||
                          (wanted.alias && *wanted.alias == slave.alias);
        return slave.device_id_source != DeviceIdSource::none || same;
    });
}

Task<Result<>> read_id(Network& network, Slave& slave) {
    if (!id_is_wanted(network, slave)) co_return Nothing{};
    auto id = co_await read_device_id(network.station(slave), slave);
    if (id) slave.device_id = *id;
    if (!id && id.error().code != Errc::unsupported) network.note(slave, id.error());
    co_return Nothing{};
}

}  // namespace

const Expectation kExpectation{.number = number_slaves,
                               .compare = compare_with_expected,
                               .read_id = read_id,
                               .compare_group = compare_group,
                               .identify = identify_as_expected};

}  // namespace margay
