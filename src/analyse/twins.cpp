#include "analyse/twins.hpp"

#include "analyse/ethercat_frame.hpp"
#include "wire/datagram.hpp"
#include "wire/ethernet.hpp"

#include <algorithm>
#include <chrono>
#include <numeric>
#include <tuple>
#include <utility>

namespace margay::analyse {
namespace {

using namespace std::chrono_literals;

constexpr Duration kTogether = 20us;   // the longest time between copies on any interfaces
constexpr Duration kUsual = 100us;     // the usual limit of the time between the copies of two taps
constexpr Duration kApart = 1ms;       // the longest time between copies on interfaces that are known to have copies
constexpr Duration kOutOfPlace = 1s;   // the limit of disorder in a file that is examined in parts
constexpr std::uint64_t kFew = 4;      // so many equal frames may be chance
constexpr std::size_t kLookBack = 64;  // clusters of equal frames

class Hash {
  public:
    void add(Bytes octets) {
        for (const auto octet : octets) add(std::to_integer<std::uint64_t>(octet));
    }
    void add(std::uint64_t part) { value_ = (value_ ^ part) * 0x100000001B3; }
    [[nodiscard]] std::uint64_t value() const { return value_ ^ (value_ >> 32); }

  private:
    std::uint64_t value_ = 0xCBF29CE484222325;
};

// Without the padding of short frames, and without a check sequence.
Bytes without_padding(Bytes frame) {
    if (!is_of_datagrams(frame)) return frame;
    const auto length = wire::load_frame_header(frame.subspan(wire::kEthernetHeaderBytes)).length;
    return frame.first(std::min<std::size_t>(frame.size(), wire::kFramePrefixBytes + length));
}

// A hash of the content that a frame and its reply have in common.
std::uint64_t shape_of(Bytes frame) {
    Hash hash;
    for (std::size_t n = 0; n < 6; ++n) {
        auto octet = frame[wire::kSourceMacOffset + n];
        if (n == 0) octet &= ~wire::kPassedEscBit;
        hash.add(std::to_integer<std::uint64_t>(octet));
    }
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next()) {
        const auto& header = d->header;
        hash.add(static_cast<std::uint8_t>(header.command));
        hash.add(header.index);
        hash.add(d->data.size());
        hash.add(wire::counts_position(header.command) ? header.address.ado() : header.address.value);
    }
    return hash.value();
}

std::uint32_t bit(std::size_t interface) { return std::uint32_t{1} << interface; }

// Calls `take` with each part of `all` whose elements are alike.
template <class All, class Alike, class Take>
void for_each_part(All& all, Alike alike, Take take) {
    for (std::size_t begin = 0; begin < all.size();) {
        std::size_t end = begin + 1;
        while (end < all.size() && alike(all[begin], all[end])) ++end;
        take(std::span(all).subspan(begin, end - begin));
        begin = end;
    }
}

}  // namespace

void Twins::look(std::uint64_t number, Duration at, Bytes frame, std::uint32_t interface) {
    ++frames_;
    if (interface >= kMostInterfaces || number > std::numeric_limits<std::uint32_t>::max() ||
        frame.size() < wire::kFramePrefixBytes)
        return;
    if (at < settled_) {
        ++missed_;
        return;
    }
    Hash octets;
    octets.add(without_padding(frame));
    const bool touched = !is_untouched(frame);
    const bool marked = (frame[wire::kSourceMacOffset] & wire::kPassedEscBit) != std::byte{0};
    seen_.push_back({.at = at,
                     .octets = octets.value(),
                     .shape = static_cast<std::uint32_t>(shape_of(frame)),
                     .number = static_cast<std::uint32_t>(number),
                     .interface = static_cast<std::uint8_t>(interface),
                     .touched = touched,
                     .ambiguous = marked && !touched});
    if (seen_.size() >= most_seen_) settle(false);
}

void Twins::decide() { settle(true); }

std::uint32_t Twins::common(std::uint32_t interface) const {
    return related_ && interface < kMostInterfaces ? common_[interface] : interface;
}

// Finds the interfaces that are taps of one segment, and the interfaces that are doubled.
void Twins::relate() {
    related_ = true;
    pairs_.assign(std::size_t{kMostInterfaces} * kMostInterfaces, {});
    std::ranges::sort(seen_, {}, [](const Seen& s) { return std::tuple(s.octets, s.at, s.number); });
    for_each_part(
        seen_, [](const Seen& a, const Seen& b) { return a.octets == b.octets; },
        [&](std::span<Seen> equal) {
            count_seconds(equal);
            count_pairs(equal);
        });
    count_spans();
    count_differences();

    const auto nearly_half = [](const Count& seconds, const Count& of) {
        return seconds.touched > kFew && 20 * seconds.all >= 9 * of.all && 20 * seconds.touched >= 9 * of.touched;
    };
    Count seconds, frames;
    for (std::size_t n = 0; n < kMostInterfaces; ++n) {
        const auto& facts = interfaces_[n];
        if (nearly_half(facts.seconds, facts.frames)) doubled_ |= bit(n);
        seconds.all += facts.seconds.all;
        seconds.touched += facts.seconds.touched;
        frames.all += facts.frames.all;
        frames.touched += facts.frames.touched;
    }
    if (nearly_half(seconds, frames)) doubled_ = ~std::uint32_t{0};
    std::iota(common_.begin(), common_.end(), 0U);
    for (std::size_t one = 0; one < kMostInterfaces; ++one)
        for (std::size_t other = 0; other < one; ++other) {
            if (differ(one, other) || !(is_inside(one, other) || is_inside(other, one))) continue;
            const auto low = std::min(common_[one], common_[other]);
            const auto high = std::max(common_[one], common_[other]);
            std::ranges::replace(common_, high, low);
        }
    std::iota(best_.begin(), best_.end(), 0U);
    for (std::uint32_t n = 0; n < kMostInterfaces; ++n) {
        auto& best = best_[common_[n]];
        if (interfaces_[n].frames.all > interfaces_[best].frames.all) best = n;
    }
}

// Whether nearly every frame of interface `one` was also recorded at interface `other`.
bool Twins::is_inside(std::size_t one, std::size_t other) const {
    const auto& p = pair(one, other);
    const auto& [all, touched] = p.both;
    const auto& whole = interfaces_[other].frames;
    if (all <= kFew || 10 * all < 9 * p.during.all || 10 * touched < 9 * p.during.touched || 2 * p.near < all)
        return false;
    // A tap with only requests may be inside a tap with replies. The second NIC of a ring has no replies of slaves.
    return touched > kFew || (p.during.touched == 0 && 4 * whole.touched >= whole.all);
}

// Whether the interfaces are two similar segments: some frames are equal, and the others have a counterpart with other
// data.
bool Twins::differ(std::size_t one, std::size_t other) const {
    const auto& p = pair(one, other);
    const auto alone = [&](const Pair& of) { return of.during.touched - std::min(of.both.touched, of.during.touched); };
    return p.differ > kFew && 2 * p.differ >= std::min(alone(p), alone(pair(other, one)));
}

void Twins::count_seconds(std::span<const Seen> equal) {
    std::array<Duration, kMostInterfaces> first{};
    std::uint32_t any = 0;
    for (const auto& s : equal) {
        auto& facts = interfaces_[s.interface];
        facts.first = std::min(facts.first, s.at);
        facts.last = std::max(facts.last, s.at);
        const bool is_second = (any & bit(s.interface)) != 0 && s.at - first[s.interface] < kTogether;
        for (auto* count : {&facts.frames, is_second ? &facts.seconds : nullptr}) {
            if (count == nullptr) continue;
            ++count->all;
            count->touched += s.touched ? 1 : 0;
        }
        if (is_second) continue;
        first[s.interface] = s.at;
        any |= bit(s.interface);
    }
}

void Twins::count_pairs(std::span<Seen> equal) {
    cluster(equal, 0);
    std::vector<std::uint32_t> places(clusters_.size());
    for (std::size_t n = 0; n < equal.size(); ++n) {
        auto& s = equal[n];
        const auto& own = clusters_[cluster_of(n)];
        auto& before = places[cluster_of(n)];
        s.places = own.places;
        for (std::size_t k = 0; k < kMostInterfaces && before != 0; ++k) {
            if ((before & bit(k)) == 0) continue;
            for (auto* p : {&pair(k, s.interface), &pair(s.interface, k)}) {
                ++p->both.all;
                p->both.touched += s.touched ? 1 : 0;
                p->near += s.at - own.at < kUsual ? 1 : 0;
            }
        }
        before |= bit(s.interface);
    }
}

void Twins::count_spans() {
    for (const auto& s : seen_)
        for (std::size_t k = 0; k < kMostInterfaces; ++k) {
            if (k == s.interface || s.at < interfaces_[k].first || s.at > interfaces_[k].last) continue;
            auto& during = pair(s.interface, k).during;
            ++during.all;
            during.touched += s.touched ? 1 : 0;
        }
}

void Twins::count_differences() {
    std::ranges::sort(seen_, {}, [](const Seen& s) { return std::tuple(s.shape, s.at, s.number); });
    constexpr std::size_t kNeighbours = 8;
    for (std::size_t n = 0; n < seen_.size(); ++n) {
        const auto& s = seen_[n];
        if (!s.touched) continue;
        for (std::size_t k = n; k-- > 0 && n - k <= kNeighbours;) {
            const auto& before = seen_[k];
            if (before.shape != s.shape || s.at - before.at >= kApart) break;
            if (!before.touched || before.interface == s.interface || before.octets == s.octets ||
                (before.places & bit(s.interface)) != 0 || (s.places & bit(before.interface)) != 0)
                continue;
            ++pair(s.interface, before.interface).differ;
            ++pair(before.interface, s.interface).differ;
            break;
        }
    }
}

// Combines equal frames, which are in order of time, to clusters. A cluster has one frame of each interface, and more
// frames of an interface in the set `doubled`.
void Twins::cluster(std::span<const Seen> equal, std::uint32_t doubled) {
    clusters_.clear();
    of_.clear();
    std::size_t begin = 0;
    for (const auto& s : equal) {
        while (begin < clusters_.size() &&
               (s.at - clusters_[begin].at >= kTogether || clusters_.size() - begin > kLookBack))
            ++begin;
        auto at = begin;
        while (at < clusters_.size() && (clusters_[at].places & bit(s.interface) & ~doubled) != 0) ++at;
        if (at == clusters_.size())
            clusters_.push_back({.at = s.at, .into = static_cast<std::uint32_t>(at), .ambiguous = s.ambiguous});
        clusters_[at].places |= bit(s.interface);
        ++clusters_[at].frames;
        of_.push_back(static_cast<std::uint32_t>(at));
    }
    if (clusters_.size() > 1) join_leftovers(doubled);
}

// Joins late copies to their clusters: a copy is late if the recorder was interrupted.
void Twins::join_leftovers(std::uint32_t doubled) {
    std::size_t begin = 0;
    for (std::size_t n = 1; n < clusters_.size(); ++n) {
        auto& late = clusters_[n];
        while (begin < n && (late.at - clusters_[begin].at >= kApart || n - begin > kLookBack)) ++begin;
        for (auto k = begin; k < n; ++k) {
            auto& first = clusters_[k];
            if (first.into != k) continue;
            const auto shared = first.places & late.places;
            const bool alone = first.frames == 1 && late.frames == 1 && !late.ambiguous;
            if (shared != 0 && ((shared & ~doubled) != 0 || !alone)) continue;
            late.into = static_cast<std::uint32_t>(k);
            first.places |= late.places;
            first.frames += late.frames;
            break;
        }
    }
}

void Twins::leave_out(std::span<const Seen> equal) {
    if (equal.size() < 2) return;
    cluster(equal, doubled_);
    std::vector<const Seen*> stays(clusters_.size());
    std::vector<std::uint64_t> times(clusters_.size());
    for (std::size_t n = 0; n < equal.size(); ++n) {
        const auto& s = equal[n];
        auto& one = stays[cluster_of(n)];
        const auto count = ++times[cluster_of(n)];
        repeated_ += count == 2 ? 1 : 0;
        most_times_ = std::max(most_times_, count);
        const auto best = best_[common_[s.interface]];
        const bool is_better =
            one != nullptr && s.interface == best && one->interface != best && s.at - one->at < kTogether;
        const auto* other = is_better ? std::exchange(one, &s) : &s;
        if (one == nullptr) {
            one = &s;
            continue;
        }
        if (left_.size() <= other->number) left_.resize(other->number + std::size_t{1});
        left_[other->number] = true;
        ++copies_;
    }
}

// Finds the copies among the packets so far. Packets shortly before the last packet wait for the next part of the file.
void Twins::settle(bool end) {
    if (!related_) relate();
    std::ranges::sort(seen_, {},
                      [&](const Seen& s) { return std::tuple(s.octets, common_[s.interface], s.at, s.number); });
    for_each_part(
        seen_,
        [&](const Seen& a, const Seen& b) {
            return a.octets == b.octets && common_[a.interface] == common_[b.interface];
        },
        [&](std::span<const Seen> equal) { leave_out(equal); });
    if (end || seen_.empty()) {
        seen_ = {};
        return;
    }
    settled_ = std::ranges::max(seen_, {}, &Seen::at).at - kOutOfPlace;
    std::erase_if(seen_, [&](const Seen& s) { return s.at < settled_ || is_left_out(s.number); });
    // If the times are not useful, the packets are deleted in order to limit the memory.
    if (2 * seen_.size() > most_seen_) seen_.clear();
}

}  // namespace margay::analyse
