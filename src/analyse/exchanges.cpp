#include "analyse/exchanges.hpp"

#include "analyse/ethercat_frame.hpp"
#include "analyse/ring_signs.hpp"
#include "wire/esc.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace margay::analyse {
namespace {

using wire::Command;
using namespace std::chrono_literals;

constexpr Duration kEarly = 5us;         // a reply may be this much before its request
constexpr auto kPatience = 20ms;         // at the end of a recording, a reply is lost after this time
constexpr std::size_t kMostTurns = 256;  // numbers of process data that are remembered

constexpr std::uint64_t kNothing = 0xCBF29CE484222325;  // FNV-1a
constexpr std::uint64_t kPrime = 0x100000001B3;

bool writes(Command c) { return c == Command::APWR || c == Command::FPWR || c == Command::BWR || c == Command::LWR; }

// Whether the frames have the same datagrams: the same commands, indices, lengths, and addresses that slaves do not
// change.
bool alike(Bytes request, Bytes reply) {
    wire::DatagramReader asked(request);
    wire::DatagramReader got(reply);
    for (;;) {
        const auto a = asked.next();
        const auto b = got.next();
        if (!a || !b) return !a && !b;
        if (a->header.command != b->header.command || a->header.index != b->header.index ||
            a->data.size() != b->data.size() || a->header.address.ado() != b->header.address.ado())
            return false;
        if (!wire::counts_position(a->header.command) && a->header.address != b->header.address) return false;
        if (writes(a->header.command) && !std::ranges::equal(a->data, b->data)) return false;
    }
}

bool same_sender(Bytes a, Bytes b) {
    for (std::size_t i = 0; i < 6; ++i) {
        auto differ = a[wire::kSourceMacOffset + i] ^ b[wire::kSourceMacOffset + i];
        if (i == 0) differ &= ~wire::kPassedEscBit;
        if (differ != std::byte{0}) return false;
    }
    return true;
}

}  // namespace

bool is_process_data(const wire::DatagramHeader& header) {
    if (wire::is_logical(header.command)) return true;
    return (header.command == Command::FRMW || header.command == Command::ARMW) &&
           header.address.ado() == wire::reg::kSystemTime.address;
}

std::uint64_t content_of(Bytes frame) {
    std::uint64_t hash = kNothing;
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next()) {
        const auto& header = d->header;
        for (const std::uint64_t part :
             {std::uint64_t{static_cast<std::uint8_t>(header.command)}, std::uint64_t{header.index},
              std::uint64_t{header.length}, std::uint64_t{header.address.ado()},
              std::uint64_t{wire::counts_position(header.command) ? 0 : header.address.value}})
            hash = (hash ^ part) * kPrime;
        if (!writes(header.command)) continue;
        for (const auto octet : d->data) hash = (hash ^ std::to_integer<std::uint64_t>(octet)) * kPrime;
    }
    return hash;
}

std::uint64_t process_data_of(Bytes frame) {
    std::uint64_t hash = kNothing;
    bool any = false;
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next()) {
        if (!is_process_data(d->header)) continue;
        any = true;
        const auto address = wire::is_logical(d->header.command) ? d->header.address.value : 0;
        for (const std::uint64_t part : {std::uint64_t{static_cast<std::uint8_t>(d->header.command)},
                                         std::uint64_t{address}, std::uint64_t{d->header.length}})
            hash = (hash ^ part) * kPrime;
    }
    return any ? std::max<std::uint64_t>(hash, 1) : 0;
}

void Exchanges::take(Moment when, Bytes frame) {
    if (decided_) return place(when, frame);
    early_.push_back({when, {frame.begin(), frame.end()}});
    if (early_.size() >= kLook) decide();
}

bool Exchanges::come_again() const {
    constexpr std::size_t kNext = 64;
    constexpr std::size_t kLeast = 16;
    std::vector<bool> taken(early_.size());
    std::size_t pairs = 0;
    std::size_t larger = 0;
    std::size_t smaller = 0;
    std::size_t near = 0;  // pairs after which the next frame with these datagrams comes much later
    for (std::size_t first = 0; first < early_.size(); ++first) {
        if (taken[first]) continue;
        for (auto second = first + 1; second < early_.size() && second <= first + kNext; ++second) {
            if (taken[second] || !alike(early_[first].bytes, early_[second].bytes)) continue;
            taken[second] = true;
            ++pairs;
            const auto before = counters_of(early_[first].bytes);
            const auto behind = counters_of(early_[second].bytes);
            larger += behind > before ? 1 : 0;
            smaller += behind < before ? 1 : 0;
            const auto passed = early_[second].when.at - early_[first].when.at;
            auto next = second + 1;
            while (next < early_.size() && next <= second + kNext && !alike(early_[first].bytes, early_[next].bytes))
                ++next;
            const bool is_other = next >= early_.size() || next > second + kNext;
            near += is_other || early_[next].when.at - early_[second].when.at > 2 * passed ? 1 : 0;
            break;
        }
    }
    return 10 * pairs >= 4 * early_.size() && larger >= kLeast && 16 * smaller <= larger && 2 * near > pairs;
}

void Exchanges::decide() {
    decided_ = true;
    const auto count =
        static_cast<std::size_t>(std::ranges::count_if(early_, [](const Early& e) { return is_marked(e.bytes); }));
    if (early_.empty())
        directions_ = Directions::none;
    else if (count == 0)
        directions_ = Directions::requests_only;
    else if (count < early_.size())
        directions_ = Directions::marked;
    else {
        // Each request of a master with a locally administered address has working counters 0, and most of them are
        // followed by the reply. In a recording of replies, a frame without an answer is not followed by another one
        // with an answer.
        std::size_t fresh = 0;
        std::size_t followed = 0;
        for (std::size_t i = 0; i < early_.size(); ++i) {
            if (!is_untouched(early_[i].bytes)) continue;
            ++fresh;
            for (std::size_t k = i < 8 ? 0 : i - 8; k < early_.size() && k < i + 9; ++k)
                if (early_[k].when.at + kEarly >= early_[i].when.at && alike(early_[i].bytes, early_[k].bytes) &&
                    !is_untouched(early_[k].bytes)) {
                    ++followed;
                    break;
                }
        }
        directions_ =
            fresh * 3 >= early_.size() && followed * 2 >= fresh ? Directions::same_address : Directions::replies_only;
    }
    passes_twice_ = directions_ == Directions::replies_only && come_again();
    auto early = std::move(early_);
    early_.clear();
    for (const auto& e : early) place(e.when, e.bytes);
}

void Exchanges::place(Moment when, Bytes frame) {
    give_up_early_replies(when.at - kEarly);
    switch (directions_) {
        case Directions::replies_only: (void)reply(when, frame); return;
        case Directions::same_address:
            if (reply(when, frame)) return;
            return is_untouched(frame) ? request(when, frame) : keep_early_reply(when, frame);
        default:
            if (!is_marked(frame)) return request(when, frame);
            if (directions_ == Directions::requests_only) directions_ = Directions::marked;
            if (!reply(when, frame)) keep_early_reply(when, frame);
    }
}

// If the clock of the recorder is coarse, or two recordings were merged, a reply may be shortly before its request.
void Exchanges::keep_early_reply(Moment when, Bytes frame) {
    if (early_replies_.size() >= kMostEarly) give_up_early_replies(Duration::max());
    early_replies_.push_back({when, {frame.begin(), frame.end()}});
}

void Exchanges::give_up_early_replies(Duration before) {
    while (!early_replies_.empty() && early_replies_.front().when.at < before) {
        const Early one = std::move(early_replies_.front());
        early_replies_.pop_front();
        if (directions_ == Directions::same_address)
            request(one.when, one.bytes);
        else
            unasked(one.when, one.bytes);
    }
}

std::uint64_t& Exchanges::turn_of(std::uint64_t process_data) {
    if (turns_.size() >= kMostTurns && turns_.count(process_data) == 0) turns_.clear();
    return turns_[process_data];
}

void Exchanges::request(Moment when, Bytes frame) {
    ++counts_.requests;
    KeptFrame kept{.when = when, .bytes = {frame.begin(), frame.end()}, .process_data = process_data_of(frame)};
    if (kept.process_data != 0) kept.turn = ++turn_of(kept.process_data);
    sent_(kept);
    pending_.push_back(std::move(kept));
    if (pending_.size() > kPending) {
        give_up(pending_.front());
        pending_.pop_front();
    }
    const auto early = std::ranges::find_if(
        early_replies_, [&](const Early& one) { return same_sender(frame, one.bytes) && alike(frame, one.bytes); });
    if (early == early_replies_.end()) return;
    const Early answered = std::move(*early);
    early_replies_.erase(early);
    answer(pending_.size() - 1, answered.when, answered.bytes);
}

// Finds the youngest request with these datagrams, because a master repeats a lost request with the same index. If the
// youngest request was sent too shortly before for a reply, finds the next older one.
std::optional<std::size_t> Exchanges::find(Moment when, Bytes frame) const {
    std::optional<std::size_t> found;
    for (std::size_t i = pending_.size(); i-- > 0;) {
        const auto& kept = pending_[i];
        if (!same_sender(kept.bytes, frame) || !alike(kept.bytes, frame)) continue;
        if (found) return i;
        found = i;
        if (trips_ < 16 || when.at - kept.when.at >= counts_.shortest_trip / 2) break;
    }
    return found;
}

bool Exchanges::reply(Moment when, Bytes frame) {
    const auto found = find(when, frame);
    if (found) answer(*found, when, frame);
    if (!found && directions_ == Directions::replies_only) unasked(when, frame);
    return found.has_value();
}

void Exchanges::unasked(Moment when, Bytes frame) {
    ++counts_.replies;
    if (!is_untouched(frame)) ++counts_.answered;
    KeptFrame self{.when = when};
    if (directions_ == Directions::replies_only) {
        self.bytes.assign(frame.begin(), frame.end());
        self.process_data = process_data_of(frame);
        sent_(self);
    } else {
        ++counts_.unasked;
    }
    frame_(self, true, false);
    spread(nullptr, when, frame);
}

void Exchanges::answer(std::size_t pending, Moment when, Bytes frame) {
    ++counts_.replies;
    if (!is_untouched(frame)) ++counts_.answered;
    const KeptFrame kept = std::move(pending_[pending]);
    pending_.erase(pending_.begin() + static_cast<std::ptrdiff_t>(pending));
    const auto trip = std::max(when.at - kept.when.at, Duration{0});
    if (trips_ == 0 || trip < counts_.shortest_trip) counts_.shortest_trip = trip;
    if (trips_ == 0 || trip > counts_.longest_trip) {
        counts_.longest_trip = trip;
        counts_.longest_trip_at = when;
    }
    ++trips_;
    const bool late = kept.process_data != 0 && turn_of(kept.process_data) > kept.turn;
    if (late) ++counts_.late;
    frame_(kept, true, late);
    spread(&kept, when, frame);
}

void Exchanges::give_up(const KeptFrame& request) {
    ++counts_.lost;
    frame_(request, false, false);
    datagrams_of(request, datagram_);
}

void Exchanges::datagrams_of(const KeptFrame& request, const Listener& listener) {
    wire::DatagramReader reader(request.bytes);
    for (std::size_t number = 0; const auto d = reader.next(); ++number)
        listener({.header = d->header, .sent = d->data, .sent_at = request.when, .at = request.when}, number);
}

void Exchanges::finish(Duration end) {
    if (!decided_) decide();
    give_up_early_replies(Duration::max());
    for (const auto& kept : pending_) {
        if (directions_ != Directions::requests_only && end - kept.when.at < kPatience) {
            ++counts_.open;
            continue;
        }
        give_up(kept);
    }
    pending_.clear();
}

void Exchanges::spread(const KeptFrame* request, Moment when, Bytes reply) {
    wire::DatagramReader asked(request != nullptr ? Bytes(request->bytes) : reply);
    wire::DatagramReader got(reply);
    for (std::size_t number = 0;; ++number) {
        const auto a = asked.next();
        const auto b = got.next();
        if (!a || !b) return;
        Exchanged e{.header = a->header,
                    .sent = a->data,
                    .received = b->data,
                    .wkc = b->wkc,
                    .answered = true,
                    .sent_at = request != nullptr ? request->when : when,
                    .at = when};
        if (wire::counts_position(e.header.command)) {
            const auto arrived = b->header.address.adp();
            if (request != nullptr) {
                e.passed = static_cast<std::uint16_t>(arrived - a->header.address.adp());
                ring_ = e.passed;
            } else {
                // A broadcast is sent with address 0, so its address is the number of slaves that it has passed.
                const bool broadcast = e.header.command >= Command::BRD && e.header.command <= Command::BRW;
                if (broadcast) ring_ = e.passed = arrived;
                e.address_known = ring_.has_value();
                e.header.address = wire::DatagramAddress(static_cast<std::uint16_t>(arrived - ring_.value_or(0)),
                                                         e.header.address.ado());
            }
        }
        datagram_(e, number);
    }
}

}  // namespace margay::analyse
