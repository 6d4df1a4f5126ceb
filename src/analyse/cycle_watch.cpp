#include "analyse/cycle_watch.hpp"

#include <algorithm>
#include <utility>

namespace margay::analyse {

CycleWatch::Track* CycleWatch::track_of(const KeptFrame& request) {
    if (const auto found = tracks_.find(request.process_data); found != tracks_.end()) return &found->second;
    if (tracks_.size() >= kMostCyclicFrames) {
        ++analysis_.cyclic_left_out;
        return nullptr;
    }
    auto& track = tracks_[request.process_data];
    track.number = analysis_.cyclic.size();
    CyclicFrame facts{.first = request.when};
    wire::DatagramReader reader(request.bytes);
    while (const auto d = reader.next())
        if (is_process_data(d->header))
            facts.datagrams.push_back(
                {.command = d->header.command, .address = d->header.address.value, .length = d->header.length});
    track.shortfalls.resize(facts.datagrams.size());
    analysis_.cyclic.push_back(std::move(facts));
    return &track;
}

void CycleWatch::sent(const KeptFrame& request) {
    auto* track = request.process_data != 0 ? track_of(request) : nullptr;
    if (track == nullptr) return;
    auto& facts = analysis_.cyclic[track->number];
    if (facts.count != 0) track->intervals.add(request.when.at - facts.last.at, request.when);
    facts.last = request.when;
    ++facts.count;
}

void CycleWatch::frame(const KeptFrame& request, bool answered, bool late) {
    const auto found = tracks_.find(request.process_data);
    present_ = found != tracks_.end() ? &found->second : nullptr;
    next_ = 0;
    if (present_ == nullptr) return;
    auto& facts = analysis_.cyclic[present_->number];
    if (!answered) ++facts.lost;
    if (late) ++facts.late;
}

void CycleWatch::datagram(const Exchanged& e) {
    if (present_ == nullptr || !is_process_data(e.header)) return;
    auto& facts = analysis_.cyclic[present_->number];
    const auto number = next_++;
    if (!e.answered || number >= facts.datagrams.size()) return;
    constexpr std::size_t kMostValues = 64;
    auto& d = facts.datagrams[number];
    if (d.wkcs.size() < kMostValues || d.wkcs.count(e.wkc) != 0) ++d.wkcs[e.wkc];
    auto& open = present_->shortfalls[number];
    if (e.wkc < d.most_wkc) return short_of(*present_, number, e);
    if (open) {
        if (*open < analysis_.shortfalls.items.size()) analysis_.shortfalls.items[*open].end = e.at;
        open.reset();
    }
    d.most_wkc = e.wkc;
}

void CycleWatch::short_of(Track& track, std::size_t datagram, const Exchanged& e) {
    auto& list = analysis_.shortfalls;
    auto& open = track.shortfalls[datagram];
    if (!open) {
        open = list.items.size() < kMostEvents ? list.items.size() : kMostEvents;
        list.add({.begin = e.at,
                  .cyclic_frame = track.number,
                  .datagram = datagram,
                  .expected = analysis_.cyclic[track.number].datagrams[datagram].most_wkc,
                  .least = e.wkc},
                 kMostEvents);
    }
    if (*open >= list.items.size()) return;
    auto& shortfall = list.items[*open];
    ++shortfall.frames;
    shortfall.least = std::min(shortfall.least, e.wkc);
}

void CycleWatch::finish() {
    constexpr std::uint64_t kFewest = 8;
    for (const auto& [key, track] : tracks_) {
        auto& facts = analysis_.cyclic[track.number];
        facts.intervals = track.intervals.result();
        facts.overlapping = facts.late >= kFewest && 2 * facts.late >= facts.count;
        if (facts.overlapping) analysis_.frames.late -= std::exchange(facts.late, 0);
    }
}

}  // namespace margay::analyse
