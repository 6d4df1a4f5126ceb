#include "network/expectation.hpp"
#include "network/ring_reading.hpp"

namespace margay {

static bool is_below_break(std::span<const RingPlace> ring, std::uint16_t at) {
    while (ring[at - 1U].parent != 0) at = ring[at - 1U].parent;
    return ring[at - 1U].behind_break;
}

Task<Result<>> compare_group(Network& network, const Slave& slave) {
    const bool member =
        slave.wanted != nullptr && slave.wanted->hot_connect != 0 && !is_located(network.expected, *slave.wanted);
    if (!member) co_return Nothing{};
    while (network.searching) co_await network.engine.sleep_for(std::chrono::milliseconds(1));
    const Searching searching(network);
    co_await required(read_places(network));
    recognise(network);
    Error error{.code = Errc::unstable, .step = Step::recover, .slave = slave.number};
    if (slave.ring_position == 0) co_return error;
    const std::uint8_t group = group_above(network, slave.ring_position);
    if (group == slave.wanted->hot_connect) co_return Nothing{};
    // The first slave of the group may be on the other side of the break.
    if (group == 0 && is_below_break(network.seen_ring(), slave.ring_position)) co_return Nothing{};
    error.code = Errc::other_slave;
    error.subindex = static_cast<std::uint8_t>(IdentityField::hot_connect);
    error.expected = slave.wanted->hot_connect;
    error.actual = group;
    error.detail = slave.identity.vendor;
    co_return error;
}

}  // namespace margay
