#include "analyse/reply_clock.hpp"

#include "analyse/ethercat_frame.hpp"
#include "analyse/exchanges.hpp"
#include "wire/datagram.hpp"

#include <algorithm>
#include <array>

namespace margay::analyse {

void ReplyClock::look(Duration at, Bytes frame) {
    if (frames_.size() >= kMost) return;
    frames_.push_back({at, content_of(frame), process_data_of(frame), is_marked(frame)});
}

// The times from replies to the next request with the same content, if the previous request with this content is much
// farther away.
std::vector<Duration> ReplyClock::leads() const {
    constexpr Duration::rep kFarther = 8;
    Requests requests;
    for (const auto& frame : frames_)
        if (!frame.reply) requests[frame.content].push_back(frame.at);
    std::vector<Duration> all;
    for (const auto& frame : frames_) {
        const auto found = frame.reply ? requests.find(frame.content) : requests.end();
        if (found == requests.end()) continue;
        const auto& times = found->second;
        const auto next = std::ranges::upper_bound(times, frame.at);
        if (next == times.end()) continue;
        const auto lead = *next - frame.at;
        if (next == times.begin() || lead * kFarther < frame.at - *std::prev(next)) all.push_back(lead);
    }
    return all;
}

// Counts requests without a reply, replies without a request and late replies, if the times of all replies are
// increased by `moved`.
std::uint64_t ReplyClock::faults(Duration moved) const {
    std::vector<const Frame*> order;
    order.reserve(frames_.size());
    for (const auto& frame : frames_) order.push_back(&frame);
    std::ranges::stable_sort(order, {},
                             [&](const Frame* f) { return std::pair(f->reply ? f->at + moved : f->at, f->reply); });
    struct Sent {
        std::uint64_t number = 0, turn = 0;
    };
    std::unordered_map<std::uint64_t, std::vector<Sent>> pending;  // by content
    std::unordered_map<std::uint64_t, std::uint64_t> turns;        // by process data
    std::uint64_t number = 0, found = 0, replies = 0, late = 0;
    for (const Frame* frame : order) {
        auto& sent = pending[frame->content];
        if (!frame->reply) {
            sent.push_back({++number, frame->process_data == 0 ? 0 : ++turns[frame->process_data]});
            continue;
        }
        ++replies;
        if (sent.empty() || number - sent.back().number > Exchanges::kPending) continue;
        ++found;
        if (frame->process_data != 0 && turns[frame->process_data] > sent.back().turn) ++late;
        sent.pop_back();
    }
    return number - found + replies - found + late;
}

std::optional<Duration> ReplyClock::behind() {
    constexpr std::size_t kFew = 16;
    std::ranges::stable_sort(frames_, {}, &Frame::at);
    auto all = leads();
    if (all.size() < kFew) return std::nullopt;
    std::ranges::sort(all);
    // If the reply to the next request is lost, the reply is long before a request with its content. So the longest
    // times may not come from the clock.
    constexpr std::array<std::size_t, 6> kPerThousand{500, 750, 900, 990, 999, 1000};
    std::optional<Duration> best;
    std::uint64_t fewest = 0;
    for (const auto part : kPerThousand) {
        const auto moved = all[(all.size() - 1) * part / 1000];
        if (best == moved) continue;
        const auto count = faults(moved);
        if (best && count >= fewest) continue;
        best = moved;
        fewest = count;
    }
    return best;
}

std::uint64_t unmatched(const FrameCounts& frames) {
    return frames.late + std::min(frames.unasked, frames.lost + frames.open);
}

void LaterReplies::packet(Moment when, Bytes packet, std::size_t length_on_wire, bool reply) {
    while (!waiting_.empty() && waiting_.front().when.at < when.at) pass_reply();
    if (reply)
        waiting_.push_back({{when.frame, when.at + behind_}, {packet.begin(), packet.end()}, length_on_wire});
    else
        analyser_.packet(when, packet, length_on_wire);
}

void LaterReplies::pass_reply() {
    const Reply& first = waiting_.front();
    analyser_.packet(first.when, first.bytes, first.length_on_wire);
    waiting_.pop_front();
}

void LaterReplies::finish() {
    while (!waiting_.empty()) pass_reply();
}

}  // namespace margay::analyse
