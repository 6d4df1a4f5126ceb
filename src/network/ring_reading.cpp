#include "network/ring_reading.hpp"

#include "network/by_address.hpp"
#include "network/configure.hpp"
#include "network/members.hpp"
#include "network/places.hpp"
#include "network/recovery.hpp"
#include "network/search.hpp"
#include "network/survey.hpp"
#include "network/transition.hpp"
#include "network/wanted.hpp"
#include "station/al_state.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;

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
    co_return Nothing{};
}

// Whether more than one slave has the station address.
Task<Result<bool>> is_of_two(Station station) {
    auto seen = co_await read<std::uint8_t>(station, reg::kType, Step::recover);
    const bool two = seen.error().code == Errc::working_counter && seen.error().actual > 1;
    co_return two;
}

// Ends clashes: two slaves have the station address of one slave of the table, because a slave has come from another
// machine, where it had the same address. It is not known which of them is the right one, so both lose the address and
// their FMMUs, and the next search identifies both. While a request uses the slave of the table, this search leaves
// them as they are. Returns whether the ring must be read again.
Task<Result<bool>> end_clashes(Network& network) {
    ByAddress table(network);
    const auto ring = network.seen_ring();
    bool any = false;
    for (std::size_t n = 0; n < ring.size(); ++n) {
        const std::uint16_t address = ring[n].address;
        const auto behind = ring.subspan(n + 1);
        if (std::ranges::find(behind, address, &RingPlace::address) == behind.end()) continue;
        Slave* known = table.find(address);
        if (known == nullptr) continue;
        Slave& slave = *known;
        const Station both{network.engine, {address}, 0};
        const bool two = co_await required(is_of_two(both));
        if (!two) co_return true;   // the ring has changed while it was read
        drop_work(network, slave);  // a hook that the supervision has called may take any time
        if (network.marks(slave).in_use) {
            for (RingPlace& place : behind) place.unasked |= place.address == address;
            continue;
        }
        any = true;
        const SlaveToken token(network.marks(slave));
        if (slave.al.state != AlState::none) note_lost(network, slave);
        co_await completion(unmap(both));  // neither of the two may answer in place of the slave
        auto reset = co_await write<std::uint16_t>(both, reg::kStationAddress, 0, Step::recover);
        (void)reset;  // the working counter is 2
    }
    co_return any;
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

void store_places(Network& network) {
    store_topology(network.seen_ring(), network.slaves());
    if (network.topology_read) remember_places(network);
}

void recognise(Network& network) {
    ByAddress table(network);
    for (Slave& slave : network.slaves()) slave.ring_position = 0;
    for (RingPlace& place : network.seen_ring()) {
        Slave* known = table.find(place.address);
        if (known == nullptr) continue;
        Slave& slave = *known;
        if (slave.ring_position != 0 || (is_lost(network, slave) && !slave.seen)) continue;
        slave.ring_position = 1;
        place.slave = slave.number;
    }
    network.topology_read = find_topology(network.seen_ring(), network.parts_read).ok();
    store_places(network);
}

Task<Result<>> read_places(Network& network) {
    auto roll = co_await read_all_states(network);
    for (int more = 5; !roll && more > 0; --more) roll = co_await read_all_states(network);
    if (!roll) co_return roll.error();
    if (roll->count > network.ring.size())
        co_return Error{.code = Errc::capacity,
                        .step = Step::recover,
                        .expected = roll->count,
                        .actual = static_cast<std::uint32_t>(network.ring.size())};
    network.parts_read = network.ring_parts();
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
    // The ring was broken, or closed, or at another place, while it was read.
    if (!network.parts_read.divides_like(network.ring_parts()))
        co_return Error{.code = Errc::unstable, .step = Step::recover};
    network.ring_count = roll->count;
    if (network.redundancy != nullptr && !network.redundancy->begins_right(network))
        co_return Error{.code = Errc::unstable, .step = Step::recover};
    co_return Nothing{};
}

Task<Result<>> read_ring(Network& network) {
    co_await required(read_places(network));
    const auto clashes = co_await required(end_clashes(network));
    recognise(network);
    if (clashes) co_return Error{.code = Errc::unstable, .step = Step::recover};
    co_return Nothing{};
}

}  // namespace margay
