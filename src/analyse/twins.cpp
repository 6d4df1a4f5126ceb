#include "analyse/twins.hpp"

#include "analyse/ethercat_frame.hpp"

#include <algorithm>

namespace margay::analyse {
namespace {

constexpr Duration kTogether = std::chrono::microseconds(20);
constexpr std::size_t kMostKept = 64;  // packets
constexpr std::uint64_t kFew = 4;      // equal frames are chance

}  // namespace

std::uint32_t Copies::common(std::uint32_t interface) const {
    // Each step goes to a lower number.
    for (auto found = same.find(interface); found != same.end(); found = same.find(interface))
        interface = found->second;
    return interface;
}

bool Copies::left_out(std::uint32_t first, std::uint32_t second) const {
    return all || std::ranges::count(interfaces, second) != 0 || (first != second && common(first) == common(second));
}

bool Twins::Counts::nearly_half() const {
    return touched_seconds > kFew && 20 * seconds >= 9 * frames && 20 * touched_seconds >= 9 * touched;
}

bool Twins::Pairs::nearly_all(const Counts& of) const {
    return touched > kFew && 10 * all >= 9 * of.frames && 10 * touched >= 9 * of.touched;
}

std::optional<std::uint32_t> Twins::first_of(Duration at, Bytes packet, Bytes frame, std::uint32_t interface) {
    while (!last_.empty() && (last_.size() >= kMostKept || at - last_.front().at >= kTogether)) last_.pop_front();
    const auto first = std::ranges::find_if(last_, [&](const Packet& p) {
        return at >= p.at && at - p.at < kTogether && !p.paired && std::ranges::equal(p.bytes, packet);
    });
    std::optional<std::uint32_t> found;
    if (first != last_.end()) found = first->interface;
    const bool touched = !is_untouched(frame);
    auto& counts = counts_[interface];
    ++counts.frames;
    counts.seconds += found ? 1 : 0;
    counts.touched += touched ? 1 : 0;
    counts.touched_seconds += touched && found ? 1 : 0;
    if (found && *found != interface) {
        auto& pairs = pairs_[std::minmax(*found, interface)];
        ++pairs.all;
        pairs.touched += touched ? 1 : 0;
    }
    last_.push_back({at, {packet.begin(), packet.end()}, interface, found.has_value()});
    return found;
}

Copies Twins::copies() const {
    Counts sum;
    Copies found;
    for (const auto& [interface, counts] : counts_) {
        if (counts.nearly_half()) found.interfaces.push_back(interface);
        sum.frames += counts.frames;
        sum.seconds += counts.seconds;
        sum.touched += counts.touched;
        sum.touched_seconds += counts.touched_seconds;
    }
    for (const auto& [places, pairs] : pairs_) {
        const auto& [low, high] = places;
        if (pairs.nearly_all(counts_.at(low)) || pairs.nearly_all(counts_.at(high))) {
            const auto a = found.common(low);
            const auto b = found.common(high);
            if (a != b) found.same[std::max(a, b)] = std::min(a, b);
        }
    }
    found.all = sum.nearly_half();
    return found;
}

}  // namespace margay::analyse
