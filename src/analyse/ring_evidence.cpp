#include "analyse/ring_evidence.hpp"

#include "wire/datagram.hpp"

#include <algorithm>
#include <chrono>

namespace margay::analyse {
namespace {

using namespace std::chrono_literals;

constexpr Duration kTogether = 100us;       // the longest time between the copies that both NICs send
constexpr Duration kNear = 1ms;             // the same, if the interfaces have different clocks
constexpr std::uint64_t kLeastCopies = 16;  // fewer copies may be chance
constexpr std::size_t kMostSeen = 1 << 20;

}  // namespace

void RingEvidence::look(const PacketOrigin& origin, Duration at, Bytes packet) {
    using Direction = PacketOrigin::Direction;
    const bool is_short = packet.size() < wire::kFramePrefixBytes + wire::kDatagramOverheadBytes;
    if (is_short || origin.interface > 1 || origin.direction == Direction::unknown || seen_.size() >= kMostSeen) return;
    Seen seen{.at = at,
              .size = static_cast<std::uint16_t>(packet.size()),
              .interface = static_cast<std::uint8_t>(origin.interface),
              .index = std::to_integer<std::uint8_t>(packet[wire::kFramePrefixBytes + 1]),
              .received = origin.direction == Direction::received};
    std::copy_n(packet.begin() + wire::kSourceMacOffset, seen.address.size(), seen.address.begin());
    seen.address[0] &= ~wire::kPassedEscBit;
    seen_.push_back(seen);
}

RingSigns::Sight RingEvidence::decide() {
    std::ranges::stable_sort(seen_, {}, &Seen::at);
    struct Sent {
        std::uint16_t size = 0;
        Duration at{};
    };
    std::array<std::array<Sent, 256>, 2> last{};
    std::array<RingSigns::Address, 2> addresses{};
    std::array<std::uint64_t, 2> sent{};
    std::uint64_t together = 0, near = 0, foreign = 0;
    bool crossed = false;
    for (const Seen& seen : seen_) {
        const std::size_t other = 1U - seen.interface;
        const auto is_copy_of = [&](const Sent& one, Duration within) {
            return one.size == seen.size && seen.at - one.at <= within;
        };
        if (seen.received) {
            if (seen.address == addresses[seen.interface]) continue;
            crossed |= seen.address == addresses[other];
            if (is_copy_of(last[seen.interface][seen.index], kNear)) ++foreign;
            continue;
        }
        addresses[seen.interface] = seen.address;
        ++sent[seen.interface];
        if (is_copy_of(last[other][seen.index], kTogether)) ++together;
        if (is_copy_of(last[other][seen.index], kNear)) ++near;
        last[seen.interface][seen.index] = {seen.size, seen.at};
    }
    seen_ = {};
    const auto fewer = std::min(sent[0], sent[1]);
    using Sight = RingSigns::Sight;
    if (fewer == 0) return foreign >= kLeastCopies && 2 * foreign >= sent[0] + sent[1] ? Sight::part : Sight::none;
    if (crossed || 2 * together >= fewer) return Sight::whole;
    return near >= kLeastCopies && 2 * near >= fewer ? Sight::like : Sight::none;
}

}  // namespace margay::analyse
