#include "analyse/masters.hpp"

#include "analyse/ethercat_frame.hpp"
#include "analyse/recording.hpp"
#include "wire/datagram.hpp"

#include <algorithm>

namespace margay::analyse {
std::optional<Masters::Place> Masters::place_of(Bytes frame, std::uint32_t interface) {
    if (frame.size() < wire::kFramePrefixBytes || !has_datagrams(frame)) return std::nullopt;
    Place place{{}, interface};
    std::copy_n(frame.begin() + wire::kSourceMacOffset, place.first.size(), place.first.begin());
    place.first[0] &= ~wire::kPassedEscBit;
    return place;
}

void Masters::look(Bytes frame, std::uint32_t interface) {
    const auto place = place_of(frame, interface);
    if (!place) return;
    auto found = seen_.find(*place);
    if (found == seen_.end()) {
        if (seen_.size() >= kMostPlaces) return;
        found = seen_.emplace(*place, Seen{}).first;
        order_.push_back(*place);
    }
    auto& seen = found->second;
    ++((frame[wire::kSourceMacOffset] & wire::kPassedEscBit) != std::byte{0} ? seen.marked : seen.unmarked);
    ++(is_untouched(frame) ? seen.untouched : seen.touched);
}

// If an interface has both requests and replies of an address, it belongs to a separate master. Interfaces with only
// requests and interfaces with only replies belong together, because a tap has one interface for each direction.
std::vector<Masters::Master> Masters::pairs_of_requests_and_replies() {
    std::map<Address, bool> has_unmarked;
    for (const auto& [place, seen] : seen_) has_unmarked[place.first] |= seen.unmarked != 0;
    std::vector<Master> masters;
    std::map<Address, std::size_t> half;  // the master whose requests and replies have different interfaces
    for (const auto& place : order_) {
        auto& seen = seen_[place];
        // If the address of the master itself has the mark, the working counters show which frames are replies,
        // although some replies have the working counter 0.
        const bool whole = has_unmarked[place.first] ? seen.marked != 0 && seen.unmarked != 0
                                                     : 4 * std::min(seen.touched, seen.untouched) > seen.touched;
        const auto other = half.find(place.first);
        seen.master = !whole && other != half.end() ? other->second : masters.size();
        if (seen.master == masters.size()) masters.push_back({.address = place.first});
        if (!whole) half[place.first] = seen.master;
        auto& master = masters[seen.master];
        master.whole = whole || !master.interfaces.empty();
        master.interfaces.push_back(place.second);
        master.frames += seen.frames();
    }
    return masters;
}

// A few frames of an address that does not have both requests and replies are no second master: TwinCAT, for example,
// sends single frames with the address of the NIC. They belong to the busiest master of their interface.
void Masters::join_strays(const std::vector<Master>& masters) {
    constexpr std::uint64_t kFew = 16;
    std::vector<std::size_t> into(masters.size());
    for (std::size_t n = 0; n < masters.size(); ++n) {
        into[n] = n;
        if (masters[n].whole) continue;
        for (std::size_t k = 0; k < masters.size(); ++k) {
            const bool shared =
                std::ranges::find_first_of(masters[k].interfaces, masters[n].interfaces) != masters[k].interfaces.end();
            if (masters[k].whole && shared && masters[n].frames * kFew <= masters[k].frames &&
                (into[n] == n || masters[k].frames > masters[into[n]].frames))
                into[n] = k;
        }
    }
    std::vector<std::optional<std::size_t>> number(masters.size());
    for (const auto& place : order_) {
        auto& seen = seen_[place];
        auto& known = number[into[seen.master]];
        if (!known) known = count_++;
        seen.master = *known;
    }
}

void Masters::decide() {
    const auto masters = pairs_of_requests_and_replies();
    join_strays(masters);
    std::map<Address, std::size_t> uses;
    for (const auto& master : masters) ++uses[master.address];
    interfaces_.resize(count_);
    for (const auto& [place, seen] : seen_)
        if (uses[place.first] > 1) interfaces_[seen.master] = place.second;
    count_ = std::min(count_, kMostMasters);
}

std::optional<std::size_t> Masters::of(Bytes frame, std::uint32_t interface) const {
    const auto place = place_of(frame, interface);
    if (!place) return std::nullopt;
    const auto found = seen_.find(*place);
    return found == seen_.end() ? kMostMasters : found->second.master;
}

std::optional<std::uint32_t> Masters::interface_of(std::size_t master) const {
    return master < interfaces_.size() ? interfaces_[master] : std::nullopt;
}

}  // namespace margay::analyse
