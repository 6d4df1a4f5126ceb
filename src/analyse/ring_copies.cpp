#include "analyse/ring_copies.hpp"

#include "analyse/ethercat_frame.hpp"
#include "wire/datagram.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <initializer_list>
#include <utility>

namespace margay::analyse {
namespace {

using namespace std::chrono_literals;

constexpr Duration kBeforeRepetition = 10ms;  // a master waits longer before it repeats a frame
constexpr Duration kLongAfter = 500us;        // a copy that passes a tap again comes earlier than this after its reply
// The longest time between both copies, if another thread sends a frame between them.
constexpr Duration kOtherThread = 20ms;

bool is_plain_ethercat(Bytes packet) {
    return packet.size() >= wire::kFramePrefixBytes + wire::kDatagramOverheadBytes && packet[12] == std::byte{0x88} &&
           packet[13] == std::byte{0xA4} && has_datagrams(packet);
}

std::uint8_t index_of(Bytes packet) { return std::to_integer<std::uint8_t>(packet[wire::kFramePrefixBytes + 1]); }

// The source address without the mark of the first slave.
std::array<std::byte, 6> source_of(Bytes packet) {
    std::array<std::byte, 6> mac{};
    std::copy_n(packet.begin() + wire::kSourceMacOffset, 6, mac.begin());
    mac[0] &= ~wire::kPassedEscBit;
    return mac;
}

// Whether the packets can be copies of one frame, or replies to them. Only one copy carries the time of a reference
// clock; in the other copy the datagram has another command. The positions in both copies differ.
bool are_of_one_frame(Bytes a, Bytes b) {
    wire::DatagramReader one(a);
    wire::DatagramReader other(b);
    for (;;) {
        const auto d = one.next();
        const auto e = other.next();
        if (!d || !e) return !d && !e;
        if (d->header.index != e->header.index || d->data.size() != e->data.size() ||
            d->header.address.ado() != e->header.address.ado())
            return false;
    }
}

bool same_access(const wire::DatagramHeader& a, const wire::DatagramHeader& b) {
    return a.command == b.command && (wire::counts_position(a.command) || a.address == b.address);
}

// Merges a copy into the reply, datagram by datagram: the changed data, the sum of the working counters and the sum of
// the passed slaves. If the copies carry the times of two reference clocks, the reply keeps the time of the reference
// clock of the request.
void add_part(MutableBytes reply, Bytes request, Bytes came, Bytes sent) {
    constexpr std::size_t kAdp = 2;
    constexpr std::size_t kIrq = 8;
    wire::DatagramReader asked(request);
    wire::DatagramReader before(sent);
    wire::DatagramReader after(came);
    for (;;) {
        const auto r = asked.next();
        const auto s = before.next();
        const auto c = after.next();
        if (!r || !s || !c) return;
        const std::size_t data = r->offset + wire::kDatagramHeaderBytes;
        const std::size_t counter = data + r->data.size();
        const auto wkc = load_le<std::uint16_t>(Bytes(reply), counter);
        const bool same = same_access(r->header, s->header);
        // Slaves behind a break that take the time of the second reference are counted, too.
        if (same || (wkc != 0 && r->header.command == s->header.command))
            store_le(reply, counter, static_cast<std::uint16_t>(wkc + c->wkc));
        if (!same) continue;
        for (std::size_t n = 0; n < r->data.size(); ++n)
            reply[data + n] = r->data[n] ^ ((reply[data + n] ^ r->data[n]) | (c->data[n] ^ s->data[n]));
        for (std::size_t n = kIrq; n < wire::kDatagramHeaderBytes; ++n) reply[r->offset + n] |= came[c->offset + n];
        if (!wire::counts_position(r->header.command)) continue;
        const auto passed = c->header.address.adp() - s->header.address.adp();
        const auto adp = load_le<std::uint16_t>(Bytes(reply), r->offset + kAdp);
        store_le(reply, r->offset + kAdp, static_cast<std::uint16_t>(adp + passed));
    }
}

}  // namespace

bool RingCopies::is_ring(const std::vector<PacketOrigin>& origins) {
    std::array<bool, 2> sends{};
    for (const PacketOrigin& origin : origins) {
        if (origin.interface > 1) return false;
        sends[origin.interface] |= origin.direction == PacketOrigin::Direction::sent;
    }
    return sends[0] && sends[1];
}

void RingCopies::packet(const PacketOrigin& origin, Moment when, Bytes packet, std::size_t length_on_wire) {
    using Direction = PacketOrigin::Direction;
    const bool has_origin = origin.direction != Direction::unknown && origin.interface < 2;
    const bool is_of_ring =
        is_plain_ethercat(packet) && packet.size() >= length_on_wire && (has_origin || !has_directions_);
    const auto source = is_of_ring ? source_of(packet) : std::array<std::byte, 6>{};
    const std::size_t copy = source == macs_[1] ? 1 : 0;
    const bool is_known = source == macs_[0] || source == macs_[1];
    if (is_of_ring && is_known && !has_directions_) {
        is_marked(packet) ? received(copy, false, when, packet)
                          : sent_or_seen_again(copy, origin.interface, when, packet);
    } else if (is_of_ring && has_directions_ && origin.direction == Direction::refused) {
        ++merged_;  // this packet was not on the wire
    } else if (is_of_ring && has_directions_ && origin.direction == Direction::sent) {
        macs_[origin.interface] = source;
        sent(origin.interface, when, packet);
    } else if (is_of_ring && is_known) {
        received(copy, origin.interface != copy, when, packet);
    } else {
        (void)enqueue({when, {packet.begin(), packet.end()}, length_on_wire});
    }
    flush();
    make_room();
}

void RingCopies::sent(std::size_t copy, Moment when, Bytes packet) {
    note_next(copy);
    const auto index = index_of(packet);
    last_[copy] = index;
    Flights& flights = flights_[index];
    if (Flight* const flight = other_copy(flights, copy, when, packet)) {
        ++merged_;
        flight->sent[copy].keep(when, packet);
        return settle_if_complete(*flight);
    }
    open(flights, when).sent[copy].keep(when, packet);
}

// In the whole ring, a tap sees the copy that no slave processes again at the other end. With more than two recorded
// places, both copies are seen more than once. Each interface sees a copy once, so a second sight is another frame with
// the same index. If the file has one interface, the time decides.
void RingCopies::sent_or_seen_again(std::size_t copy, std::uint32_t interface, Moment when, Bytes packet) {
    const std::uint64_t place = std::uint64_t{1} << std::min<std::uint32_t>(interface, 63);
    interfaces_ |= place;
    const bool by_interface = std::popcount(interfaces_) > 1;
    Flights& flights = flights_[index_of(packet)];
    for (Flight& flight : flights) {
        const Held& before = flight.sent[copy];
        if (by_interface && (flight.seen_at[copy] & place) != 0 && when.at - before.when.at < kLongAfter &&
            std::ranges::equal(before.bytes, packet))
            ++seen_twice_;
        if (!before.there() || opened_ - flight.number >= kRepeatedWithin ||
            (copy == 0 && when.at - before.when.at >= kBeforeRepetition) ||
            (by_interface && (flight.seen_at[copy] & place) != 0) || !are_of_one_frame(before.bytes, packet))
            continue;
        if (!by_interface && flight.came[copy].there() && when.at - flight.came[copy].when.at > kLongAfter)
            ++seen_late_;
        flight.seen_at[copy] |= place;
        ++merged_;
        return;
    }
    sent(copy, when, packet);
    flights.back().seen_at[copy] |= place;  // sent() has opened this flight, or has added the copy to it
}

// The NIC sends its next frame: if the other NIC has not sent the previous frame, it will not send it any more.
void RingCopies::note_next(std::size_t copy) {
    if (!has_directions_ || !last_[copy] || flights_[*last_[copy]].empty()) return;
    Flight& before = flights_[*last_[copy]].back();
    if (!before.sent[copy].there() || before.sent[1 - copy].there()) return;
    before.alone = true;
    settle_if_complete(before);
}

RingCopies::Flight* RingCopies::other_copy(Flights& flights, std::size_t copy, Moment when, Bytes packet) const {
    if (flights.empty()) return nullptr;
    Flight& flight = flights.back();
    const Held& other = flight.sent[1 - copy];
    const bool is_near =
        flight.alone ? when.at - other.when.at < kOtherThread : opened_ - flight.number < kRepeatedWithin;
    const bool is_copy =
        other.there() && !flight.sent[copy].there() && is_near && are_of_one_frame(other.bytes, packet);
    return is_copy ? &flight : nullptr;
}

RingCopies::Flight& RingCopies::open(Flights& flights, Moment when) {
    ++opened_;
    for (Flight& old : flights)
        if (opened_ - old.number >= kRepeatedWithin) settle(old);
    std::erase_if(flights, [](const Flight& old) { return old.over; });
    if (flights.size() >= kMostRepeated) {
        settle(flights.front());
        flights.erase(flights.begin());
    }
    flights.push_back({.number = opened_, .request = enqueue({.when = when, .waits = true})});
    return flights.back();
}

void RingCopies::received(std::size_t copy, bool crossed, Moment when, Bytes packet) {
    Flights& flights = flights_[index_of(packet)];
    const bool processed = is_marked(packet);
    const auto is_of = [&](const Flight& flight) {
        const auto& sent = flight.sent[copy].there() ? flight.sent[copy] : flight.sent[1 - copy];
        return are_of_one_frame(sent.bytes, packet);
    };
    if (processed && std::ranges::none_of(flights, is_of)) {  // the request was sent before the recording
        (void)enqueue({when, {packet.begin(), packet.end()}, packet.size()});
        return;
    }
    if (crossed) idle_[copy] = !processed;
    const auto awaits = [&](const Flight& flight) {
        return !flight.over && !flight.came[copy].there() && !flight.untouched[copy] && is_of(flight);
    };
    const auto youngest = std::find_if(flights.rbegin(), flights.rend(), awaits);
    if (!processed || youngest == flights.rend()) {
        ++merged_;
        if (processed && !has_directions_ && take_farther(flights, copy, when, packet)) return;
        if (processed || !crossed || youngest == flights.rend()) return;
        youngest->untouched[copy] = true;
        return settle_if_complete(*youngest);
    }
    Flight& flight = *youngest;
    flight.came[copy].keep(when, packet);
    flight.crossed[copy] = crossed;
    // The reply is complete when its last part has come.
    if (flight.reply != 0) {
        place(flight.reply).waits = false;
        ++merged_;
    }
    flight.reply = enqueue({.when = when, .waits = true});
    settle_if_complete(flight);
}

// Replaces a copy by the same copy that more slaves have processed, because a tap between the slaves sees a copy before
// all slaves have processed it.
bool RingCopies::take_farther(Flights& flights, std::size_t copy, Moment when, Bytes packet) {
    const auto before = std::find_if(flights.rbegin(), flights.rend(), [&](const Flight& flight) {
        return !flight.over && flight.came[copy].there() && are_of_one_frame(flight.came[copy].bytes, packet) &&
               counters_of(flight.came[copy].bytes) < counters_of(packet);
    });
    if (before == flights.rend()) return false;
    before->came[copy].keep(when, packet);
    place(before->reply).waits = false;
    before->reply = enqueue({.when = when, .waits = true});
    return true;
}

void RingCopies::settle_if_complete(Flight& flight) {
    if (flight.over || (!flight.alone && (!flight.sent[0].there() || !flight.sent[1].there()))) return;
    for (std::size_t copy = 0; copy < 2; ++copy)
        if (flight.sent[copy].there() && !flight.came[copy].there() && !flight.untouched[copy]) return;
    settle(flight);
}

// Finds the NIC at the beginning of the ring: it has sent the processed copy that has passed the whole ring. In a
// broken ring, the slave behind the break marks the copy from the end of the ring as circulating.
void RingCopies::note_head(const Flight& flight) {
    std::array<bool, 2> circulating{};
    for (std::size_t copy = 0; copy < 2; ++copy) {
        const auto& came = flight.came[copy];
        if (!came.there()) continue;
        if (flight.crossed[copy] && idle_[1 - copy]) head_ = copy;
        circulating[copy] = wire::load_datagram_header(Bytes(came.bytes).subspan(wire::kFramePrefixBytes)).circulating;
    }
    if (flight.came[0].there() && flight.came[1].there() && circulating[0] != circulating[1])
        head_ = circulating[0] ? 1 : 0;
}

// The request of the master: it has the positions of the copy that is sent at the beginning of the ring, and the time
// of the reference clock, which may be in either copy.
std::vector<std::byte> RingCopies::request_of(const Flight& flight) const {
    const std::size_t copy = flight.sent[head_].there() ? head_ : 1 - head_;
    auto request = flight.sent[copy].bytes;
    const auto& other = flight.sent[1 - copy].bytes;
    if (other.empty()) return request;
    std::ranges::copy(source_of(flight.sent[0].bytes), request.begin() + wire::kSourceMacOffset);
    wire::DatagramReader own(flight.sent[copy].bytes);
    wire::DatagramReader others(other);
    for (;;) {
        const auto d = own.next();
        const auto e = others.next();
        if (!d || !e) return request;
        if (d->header.command != wire::Command::NOP || e->header.command == wire::Command::NOP) continue;
        std::copy_n(other.begin() + static_cast<std::ptrdiff_t>(e->offset), 6,
                    request.begin() + static_cast<std::ptrdiff_t>(d->offset));
    }
}

// If one copy has found the ring whole and the other copy has found it broken, the copy that has passed all slaves is
// the reply.
std::size_t RingCopies::whole_of(const Flight& flight) const {
    const auto& came = flight.came;
    if (!came[0].there() || !came[1].there()) return 2;
    if (has_directions_) return flight.crossed[0] == flight.crossed[1] ? 2 : flight.crossed[0] ? 0 : 1;
    const auto found = whole_.find(kind_of_copies(came[0].bytes));
    for (const std::size_t copy : {std::size_t{0}, std::size_t{1}})
        if (found != whole_.end() && counters_of(came[copy].bytes) == found->second) return copy;
    return 2;
}

// Passes on the request and the received part of the reply.
void RingCopies::settle(Flight& flight) {
    if (flight.over) return;
    flight.over = true;
    note_head(flight);
    auto request = request_of(flight);
    if (flight.reply != 0) {
        auto reply = request;
        reply[wire::kSourceMacOffset] |= wire::kPassedEscBit;
        const std::size_t whole = whole_of(flight);
        for (const std::size_t copy : {head_, 1 - head_}) {
            const auto& came = flight.came[copy];
            if (!came.there() || whole == 1 - copy) continue;
            const auto& before = flight.sent[copy].there() ? flight.sent[copy] : flight.sent[1 - copy];
            add_part(reply, request, came.bytes, before.bytes);
        }
        auto& at = place(flight.reply);
        at.length_on_wire = reply.size();
        at.bytes = std::move(reply);
        at.waits = false;
    }
    auto& at = place(flight.request);
    at.length_on_wire = request.size();
    at.bytes = std::move(request);
    at.waits = false;
}

std::uint64_t RingCopies::enqueue(Place next) {
    queue_.push_back(std::move(next));
    return first_ + queue_.size() - 1;
}

void RingCopies::flush() {
    while (!queue_.empty() && !queue_.front().waits) {
        const Place next = std::move(queue_.front());
        queue_.pop_front();
        ++first_;
        if (!next.bytes.empty()) emit_(next.when, next.bytes, next.length_on_wire);
    }
}

// Limits the queue when much other traffic follows a request without a reply.
void RingCopies::make_room() {
    while (queue_.size() > kMostWaiting) {
        for (Flights& flights : flights_)
            for (Flight& flight : flights)
                if (flight.request == first_ || flight.reply == first_) settle(flight);
        flush();
    }
}

void RingCopies::finish() {
    for (Flights& flights : flights_)
        for (Flight& flight : flights) settle(flight);
    flush();
}

}  // namespace margay::analyse
