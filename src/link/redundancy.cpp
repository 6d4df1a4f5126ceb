#include "link/redundancy.hpp"

#include "link/cycle.hpp"

#include <algorithm>
#include <cstring>

namespace margay {
namespace {

constexpr std::size_t kSmallestFrame = wire::kFramePrefixBytes + wire::kDatagramOverheadBytes;
constexpr std::size_t kIndexOffset = wire::kFramePrefixBytes + 1;
constexpr auto kRelaxed = std::memory_order_relaxed;
constexpr auto kNop = static_cast<std::byte>(wire::Command::NOP);

constexpr std::uint8_t bit(unsigned nic) { return static_cast<std::uint8_t>(1U << nic); }

bool is_positional(wire::Command command) {
    return command == wire::Command::ARMW || (command >= wire::Command::APRD && command <= wire::Command::APRW);
}

bool has_positions(Bytes frame) {
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next())
        if (is_positional(d->header.command)) return true;
    return false;
}

// Adds `by` to the positions of all datagrams that have one: this copy does not pass the first `by` slaves.
void move_positions(MutableBytes frame, std::uint16_t by) {
    constexpr std::size_t kAdp = 2;
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next()) {
        if (!is_positional(d->header.command)) continue;
        const std::size_t at = d->offset + kAdp;
        store_le<std::uint16_t>(frame, at, static_cast<std::uint16_t>(load_le<std::uint16_t>(Bytes(frame), at) + by));
    }
}

bool is_marked(Bytes frame) { return (frame[wire::kSourceMacOffset] & wire::kPassedEscBit) != std::byte{0}; }

// Whether a slave has incremented the working counter of any datagram.
bool is_counted(Bytes frame) {
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next())
        if (d->wkc != 0) return true;
    return false;
}

void set_source(MutableBytes frame, const MacAddress& source) {
    std::ranges::copy(std::as_bytes(std::span(source)), frame.begin() + wire::kSourceMacOffset);
}

// Whether a datagram has written to a slave by position.
bool has_written_by_position(Bytes frame) {
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next())
        if (is_positional(d->header.command) && d->header.command != wire::Command::APRD && d->wkc != 0) return true;
    return false;
}

// Sets the working counters of all datagrams that write by position to 0: their callers get an error.
void refuse_writes_by_position(MutableBytes frame) {
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next()) {
        if (!is_positional(d->header.command) || d->header.command == wire::Command::APRD) continue;
        store_le<std::uint16_t>(frame, d->offset + wire::kDatagramHeaderBytes + d->data.size(), 0);
    }
}

// The slaves that have processed the copy: each of them has incremented the address of some datagrams.
std::optional<std::uint16_t> count_slaves(Bytes sent, Bytes reply, std::uint16_t shift) {
    wire::DatagramReader reader(sent);
    while (const auto d = reader.next()) {
        const wire::Command command = d->header.command;
        if (!wire::counts_position(command)) continue;
        const auto moved = is_positional(command) ? shift : std::uint16_t{0};
        const auto got = wire::load_datagram_header(reply.subspan(d->offset)).address.adp();
        return static_cast<std::uint16_t>(got - d->header.address.adp() - moved);
    }
    return std::nullopt;
}

void add(std::atomic<std::uint32_t>& counter) { counter.fetch_add(1, kRelaxed); }

}  // namespace

// The source addresses of both NICs differ in more bits than the mark of the first ESC.
Redundancy::Redundancy(Nic& first, Nic& second, std::span<FramePair> own, std::span<FramePair> overlapped) noexcept
    : nics_{&first, &second}, source_{first.source_mac(), second.source_mac()}, own_(own), overlapped_(overlapped) {
    constexpr auto kMark = std::to_integer<std::uint8_t>(wire::kPassedEscBit);
    for (MacAddress& source : source_) source[0] = static_cast<std::uint8_t>(source[0] & ~kMark);
    if (source_[0] == source_[1]) source_[1].back() ^= 1;
    for (auto& number : number_of_) number.store(kNoPair, kRelaxed);
}

FramePair* Redundancy::pair_of(std::uint8_t index) noexcept {
    const std::uint16_t number = number_of_[index].load(std::memory_order_acquire);
    return number == kNoPair ? nullptr : &pair(number);
}

bool Redundancy::hold(FramePair& pair, FramePair::State from) noexcept {
    std::uint8_t expected = from;
    return pair.state.compare_exchange_strong(expected, FramePair::held, std::memory_order_acquire, kRelaxed);
}

// The next pair in turn that is not in use; send() opens it.
FramePair* Redundancy::free_pair(std::span<FramePair> pairs, std::size_t& next) noexcept {
    FramePair& pair = pairs[next];
    if (!hold(pair, FramePair::unused)) return find_pair(pairs, next);
    next = next + 1 == pairs.size() ? 0 : next + 1;
    return &pair;
}

FramePair* Redundancy::open(std::uint8_t index) noexcept {
    constexpr std::uint8_t kFirstOverlapped = 128;  // see FrameTable::split()
    const bool overlapped = split_ && index >= kFirstOverlapped;
    FramePair* pair = overlapped ? free_pair(overlapped_, next_overlapped_) : free_pair(own_, next_own_);
    if (pair == nullptr) return nullptr;
    pair->index = index;
    pair->came = pair->crossed = pair->idle = pair->circulated = pair->counted = 0;
    pair->arrivals = {arrivals_[0].load(kRelaxed), arrivals_[1].load(kRelaxed)};
    return pair;
}

bool Redundancy::reaches_nothing(unsigned nic) const noexcept { return refused_[nic].load(kRelaxed) || is_silent(nic); }

SendStatus Redundancy::send_by(unsigned nic, FramePair& pair, Bytes frame) noexcept {
    const bool moved = pair.shift != 0 && nic != pair.front;
    const bool divided = pair.times[0].offset != 0;
    const bool of_head = divided && nic == pair.head;
    const bool changed = divided && (!of_head || pair.second_is_first || pair.times_held);
    const auto own = Bytes(pair.out).first(pair.size);
    SendStatus status = SendStatus::failed;
    if (nic == 0 && !moved && !changed && !frame.empty()) {
        status = nics_[0]->send(frame);
    } else if (nic != 0 && !moved && !of_head) {
        status = nics_[1]->send(own);
    } else {
        // The pair is open: `out` is read by the receiving thread as soon as the first copy is back.
        std::array<std::byte, wire::kMaxFrameBytes> copy;
        const auto out = MutableBytes(copy).first(pair.size);
        std::ranges::copy(own, out.begin());
        if (of_head) set_times(pair, out, TimeDatagram::of_head);
        if (moved) move_positions(out, pair.shift);
        if (nic == 0) set_source(out, source_[0]);
        status = nics_[nic]->send(out);
    }
    add(status == SendStatus::sent ? counters_[nic].sent : counters_[nic].refused);
    busy_[nic].store(status == SendStatus::busy, kRelaxed);
    if (status != SendStatus::busy) refused_[nic].store(status == SendStatus::failed, kRelaxed);
    // A copy that a NIC does not accept for once is as a lost one: the slaves of its part have not answered.
    const bool idle = nic != pair.head && by_head_.load(kRelaxed);
    const bool no_loss = status == SendStatus::failed || (status == SendStatus::busy && idle);
    if (no_loss) pair.sent.fetch_and(static_cast<std::uint8_t>(~bit(nic)), std::memory_order_release);
    return status;
}

// One copy has the positions as sent. The positions of the other copy are moved by the number of slaves before the
// break. While this number is not known, or the head seems to reach no slave, the moved positions meet no slave, so
// that no wrong slave is written. A silent head may still reach slaves: only its replies are lost.
void Redundancy::place(FramePair& pair, bool head_only) const noexcept {
    constexpr std::uint16_t kNowhere = 0x8000;
    const bool known = front_known_.load(kRelaxed);
    const std::uint16_t before = slaves_[pair.head].load(kRelaxed);
    const bool lost = !head_only && (reaches_nothing(pair.head) || (known && before == 0));
    pair.front = static_cast<std::uint8_t>(lost ? 1 - pair.head : pair.head);
    pair.positions = has_positions(Bytes(pair.out).first(pair.size));
    pair.shift = lost || !known ? kNowhere : before;
    if (!pair.positions) pair.shift = 0;
}

SendStatus Redundancy::send_by_head(FramePair& pair, Bytes frame) noexcept {
    const SendStatus only = send_by(pair.head, pair, frame);
    if (only != SendStatus::sent && hold(pair)) pair.state.store(FramePair::unused, std::memory_order_release);
    if (foreign_.load(kRelaxed) && probe_turn_.fetch_add(1, kRelaxed) % kFramesPerProbe == 0)
        (void)send_probe(1U - pair.head);
    return only;
}

SendStatus Redundancy::send(Bytes frame) noexcept {
    if (frame.size() < kSmallestFrame || frame.size() > wire::kMaxFrameBytes) return SendStatus::failed;
    const auto index = std::to_integer<std::uint8_t>(frame[kIndexOffset]);
    FramePair* const pair = open(index);
    if (pair == nullptr) return SendStatus::busy;
    std::ranges::copy(frame, pair->out.begin());
    set_source(pair->out, source_[1]);
    pair->size = static_cast<std::uint16_t>(frame.size());
    pair->head = head_.load(kRelaxed);
    divide_times(*pair);
    const bool opened = opening_.load(kRelaxed) != Opening::none && is_opened_by(frame);
    const bool head_only = opened || foreign_.load(kRelaxed);
    place(*pair, head_only);
    pair->sent.store(head_only ? bit(pair->head) : static_cast<std::uint8_t>(bit(0) | bit(1)), kRelaxed);
    const bool own = pair >= own_.data() && pair < own_.data() + own_.size();
    if (!own) frame = {};  // the owner writes the reply into these octets as soon as one copy is back
    const auto number = own ? pair - own_.data() : pair - overlapped_.data() + static_cast<std::ptrdiff_t>(own_.size());
    pair->state.store(FramePair::open, std::memory_order_release);
    number_of_[index].store(static_cast<std::uint16_t>(number), std::memory_order_release);
    // NIC 0 is the first to send, unless it has refused the last frame or was busy for the last frame.
    const unsigned first = refused_[0].load(kRelaxed) || busy_[0].load(kRelaxed) ? 1 : 0;
    if (head_only) return send_by_head(*pair, frame);
    const SendStatus one = send_by(first, *pair, frame);
    // If the first NIC is busy, slaves would miss the frame, unless slaves process only the copy of the other NIC.
    const bool useless = one == SendStatus::busy && (first == pair->head || !by_head_.load(kRelaxed));
    const SendStatus two = useless ? SendStatus::busy : send_by(1 - first, *pair, frame);
    for (unsigned nic = 0; nic < 2; ++nic)
        if (hearing_[nic].load(kRelaxed) == Hearing::doubted) send_probes(*pair, nic);
    if (one == SendStatus::sent || two == SendStatus::sent) return SendStatus::sent;
    if (hold(*pair)) pair->state.store(FramePair::unused, std::memory_order_release);
    return one == SendStatus::busy || two == SendStatus::busy ? SendStatus::busy : SendStatus::failed;
}

// The NICs are asked in turn, so that the frames of one NIC do not pile up while the other one has frames.
std::size_t Redundancy::receive(MutableBytes into) noexcept {
    for (unsigned empty = 0; empty < 2;) {
        const unsigned at = turn_;
        turn_ = 1 - turn_;
        const std::size_t length = nics_[at]->receive(into);
        if (length == 0) {
            ++empty;
            continue;
        }
        empty = 0;
        if (const std::size_t whole = collect(at, into.first(std::min(length, into.size()))); whole != 0) return whole;
    }
    return 0;
}

unsigned Redundancy::sender_of(Bytes frame) const noexcept {
    for (unsigned nic = 0; nic < 2; ++nic) {
        const auto source = std::as_bytes(std::span(source_[nic]));
        const auto got = frame.subspan(wire::kSourceMacOffset, source.size());
        if ((got[0] & ~wire::kPassedEscBit) == source[0] && std::memcmp(&got[1], &source[1], source.size() - 1) == 0)
            return nic;
    }
    return 2;
}

// Whether the copy of `nic` is awaited after the other copy has come. It is not awaited while the library may have
// closed a port, or while no copy of `nic` comes back. But if the other copy has crossed the ring, which was not whole
// before, the cable of `nic` was repaired perhaps.
bool Redundancy::awaits(const FramePair& pair, unsigned nic) const noexcept {
    const bool closed = opening_.load(kRelaxed) == Opening::closed && nic != pair.head;
    if (closed && (pair.crossed & bit(pair.head)) == 0) return false;
    const bool is_whole_now = (pair.crossed & bit(1 - nic)) != 0;
    return (pair.sent.load(std::memory_order_acquire) & bit(nic)) != 0 && (pair.came & bit(nic)) == 0 &&
           (!is_silent(nic) || (is_whole_now && ring_ != RingState::whole) || (pair.idle & bit(1 - nic)) != 0);
}

std::size_t Redundancy::collect(unsigned at, MutableBytes frame) noexcept {
    if (frame.size() < kSmallestFrame || wire::load_ether_type(frame) != wire::kEtherTypeEtherCat) return frame.size();
    const unsigned from = sender_of(frame);
    if (from > 1) return frame.size();
    const bool marked = is_marked(frame);
    const bool crossed = from != at;
    if (!marked && !crossed && !nics_[at]->hides_own_frames()) return frame.size();  // an echo: the link counts it
    add(counters_[at].received);
    hearing_[from].store(Hearing::heard, kRelaxed);
    arrivals_[from].store(static_cast<std::uint8_t>(arrivals_[from].load(kRelaxed) + 1), kRelaxed);
    missed_[from] = 0;
    if (foreign_.load(kRelaxed) && from != head()) {
        note_probe(frame, at, from);
        return 0;
    }
    if (frame[wire::kFramePrefixBytes] == kNop && is_probe(frame)) return 0;
    const bool idle = crossed && !marked && !is_counted(frame);
    FramePair* const pair = pair_of(std::to_integer<std::uint8_t>(frame[kIndexOffset]));
    // The pair is held before it is read: another thread may open it for another index at any time, even after its end.
    const bool is_open = pair != nullptr && hold(*pair);
    if (!is_open && (pair == nullptr || !hold(*pair, FramePair::unused))) {
        if (!idle) add(counters_[at].late);
        return 0;
    }
    const bool its = pair->index == std::to_integer<std::uint8_t>(frame[kIndexOffset]);
    if (!is_open || !its) {
        if (its) note_late(*pair, at, from, idle, marked);
        if (!idle && (!its || (pair->came & bit(from)) != 0)) add(counters_[at].late);
        pair->state.store(is_open ? FramePair::open : FramePair::unused, std::memory_order_release);
        return 0;
    }
    const bool known = (pair->came & bit(from)) == 0 && is_reply_to(*pair, frame, from);
    if (!known) {
        note_late(*pair, at, from, idle, marked);
        add(counters_[at].late);
        pair->state.store(FramePair::open, std::memory_order_release);
        return 0;
    }
    if (crossed) pair->crossed |= bit(from);
    if (idle) pair->idle |= bit(from);
    note_copy(*pair, from, frame);
    take_second_time(*pair, frame, from);
    const unsigned other = 1 - from;
    if (awaits(*pair, other) && !(crossed && !idle && idle_[other])) {
        if (!idle) std::ranges::copy(Bytes(frame).first(pair->size), pair->back.begin());
        pair->state.store(FramePair::open, std::memory_order_release);
        return 0;
    }
    const std::size_t whole = finish(*pair, frame, from);
    pair->state.store(FramePair::unused, std::memory_order_release);
    return whole;
}

void Redundancy::note_copy(FramePair& pair, unsigned from, Bytes frame) noexcept {
    pair.came |= bit(from);
    if (wire::load_datagram_header(frame.subspan(wire::kFramePrefixBytes)).circulating) pair.circulated |= bit(from);
    if ((pair.idle & bit(from)) != 0)
        idle_[from] = true;
    else if ((pair.crossed & bit(from)) != 0)  // a slave that only this copy reaches has come back
        idle_[from] = false;
    const std::uint16_t shift = from == pair.front ? std::uint16_t{0} : pair.shift;
    const auto count = count_slaves(Bytes(pair.out).first(pair.size), frame, shift);
    if (!count) return;
    pair.counted |= bit(from);
    pair.count[from] = *count;
}

// Notes a copy that comes after the end of its pair, or that comes for the second time.
void Redundancy::note_late(const FramePair& pair, unsigned at, unsigned from, bool idle, bool marked) noexcept {
    const bool crossed = from != at;
    if ((pair.came & bit(from)) != 0) {
        // The same copy has come back at both NICs.
        if (((pair.crossed & bit(from)) != 0) != crossed) {
            set_fault(CablingFault::same_port);
            clean_ = 0;
        }
        return;
    }
    // This copy was processed, so it reaches branches that the other copy does not reach.
    if (crossed && marked && !idle) idle_[from] = false;
}

void Redundancy::set_ring(RingState state) noexcept {
    if (state == ring_) return;
    ++changes_;
    if (ring_ == RingState::whole) ++breaks_;
    if (state == RingState::whole && ever_whole_) ++heals_;
    ever_whole_ |= state == RingState::whole;
    ring_ = state;
    count_is_new_ = {};
    note_way();
    front_known_.store(false, kRelaxed);
}

// Both copies have come back at their own NICs. The copy that has passed a slave with a closed port 0 comes from the
// end of the ring.
void Redundancy::note_two_ends(const FramePair& pair) noexcept {
    if (pair.circulated == bit(0) || pair.circulated == bit(1)) {
        head_.store(pair.circulated == bit(0) ? 1 : 0, kRelaxed);
        ever_parted_ = true;
        two_beginnings_ = 0;
        if (fault_ == CablingFault::second_segment) set_fault(CablingFault::none);
    } else if (pair.circulated == 0 && ((!ever_whole_ && !ever_parted_) || ++two_beginnings_ >= kTwoBeginnings)) {
        set_fault(CablingFault::second_segment);
    }
}

void Redundancy::guard_times(bool guard) noexcept {
    times_guarded_ = guard;
    if (!guard) times_held_.store(false, kRelaxed);
}

void Redundancy::note_way() noexcept {
    ++ways_;
    if (times_guarded_) times_held_.store(true, kRelaxed);
    // If the break has moved, the copies may pass clocks before the second reference. These clocks would take the time
    // that was sent. So the copies carry no time until the second reference is set again. The differences of the
    // earlier ways have another constant.
    std::uint32_t second = second_.load(kRelaxed);
    const bool is_first = second >> 16 != 0;
    if (!times_guarded_ && !is_first) (void)second_.compare_exchange_strong(second, 0, kRelaxed);
    // The other copy carries the only time, perhaps behind a break where the reference is not any more: both copies
    // only read the reference until the second reference is set again.
    if (!times_guarded_ && is_first) times_held_.store(true, kRelaxed);
    difference_ = {};
}

void Redundancy::store_count(unsigned nic, std::uint16_t slaves) noexcept {
    if (slaves_[nic].exchange(slaves, kRelaxed) != slaves && count_is_new_[nic]) note_way();
    count_is_new_[nic] = true;
}

void Redundancy::note_ring(const FramePair& pair, unsigned processed) noexcept {
    constexpr unsigned kCleanFrames = 64;
    const unsigned crossing = processed & pair.crossed;
    if (fault_ == CablingFault::same_port && ++clean_ >= kCleanFrames) set_fault(CablingFault::none);
    if (crossing != 0) {
        if (fault_ == CablingFault::second_segment) set_fault(CablingFault::none);
        set_ring(RingState::whole);
        if (crossing == bit(0) && idle_[1]) head_.store(0, kRelaxed);
        if (crossing == bit(1) && idle_[0]) head_.store(1, kRelaxed);
    } else if (processed != 0) {
        set_ring(RingState::broken);
        if (processed == (bit(0) | bit(1))) note_two_ends(pair);
    }
    // If only an idle copy has come back, the other copy was not accepted, and says nothing about its slaves.
    for (unsigned nic = 0; nic < 2; ++nic) {
        const bool gone = processed != 0 && ((pair.sent.load(kRelaxed) & bit(nic)) == 0 || is_silent(nic));
        const bool idle = ring_ == RingState::whole && idle_[nic] && (pair.came & bit(nic)) == 0;
        if ((pair.counted & bit(nic)) == 0 && !gone && !idle) continue;
        store_count(nic, (pair.counted & bit(nic)) != 0 ? pair.count[nic] : std::uint16_t{0});
    }
    // In the whole ring, no slave processes an idle copy. But a new break may change this for the next copy.
    by_head_.store(ring_ == RingState::whole && idle_[1 - head()], kRelaxed);
    front_known_.store(ring_ == RingState::whole ? !idle_[1 - head()] : counts_are_new(), kRelaxed);
}

std::size_t Redundancy::finish(FramePair& pair, MutableBytes frame, unsigned from) noexcept {
    unsigned processed = pair.came & static_cast<unsigned>(~pair.idle);
    // If one copy has found the ring whole, and the other copy has found it broken, the ring has changed meanwhile:
    // some slaves have processed both copies or none. A copy that has crossed is complete if the other copy is idle.
    const bool changed = pair.came == (bit(0) | bit(1)) && (pair.crossed == bit(0) || pair.crossed == bit(1));
    const unsigned crossing = processed & pair.crossed;
    const bool complete = crossing != 0 && idle_[crossing == bit(0) ? 1 : 0];
    if (changed && complete) {
        if (processed != crossing) take_messages(pair, frame, crossing == bit(from));
        processed = crossing;
    }
    if (opening_.load(kRelaxed) == Opening::none) note_ring(pair, processed);
    if (processed == 0) return 0;
    const bool misplaced = is_misplaced(pair, processed);
    // The caller must know that a wrong slave was written.
    const auto wrote = [&](unsigned nic) {
        const Bytes copy = nic == from ? Bytes(frame) : Bytes(pair.back);
        return (processed & bit(nic)) != 0 && has_written_by_position(copy.first(pair.size));
    };
    const bool harmed = misplaced && (wrote(1U - pair.front) || (pair.front != pair.head && wrote(pair.front)));
    if ((changed && !complete) || (misplaced && !harmed)) {
        ++repeated_;
        return 0;
    }
    const auto whole = frame.first(pair.size);
    if (processed == (bit(0) | bit(1))) {
        merge_replies(whole, Bytes(pair.back).first(pair.size), Bytes(pair.out).first(pair.size));
        compare_times(pair, whole);
        ++merged_;
    } else if (processed != bit(from)) {
        std::ranges::copy(Bytes(pair.back).first(pair.size), whole.begin());
    }
    if (harmed) refuse_writes_by_position(whole);
    set_source(whole, source_[0]);
    whole[wire::kSourceMacOffset] |= wire::kPassedEscBit;
    return whole.size();
}

void Redundancy::give_up(std::uint8_t index) noexcept {
    FramePair* const pair = pair_of(index);
    if (pair == nullptr || !hold(*pair)) return;
    if (pair->index != index) {  // the pair was opened for another frame
        pair->state.store(FramePair::open, std::memory_order_release);
        return;
    }
    const std::uint8_t sent = pair->sent.load(kRelaxed);
    for (unsigned nic = 0; nic < 2; ++nic) {
        if ((sent & bit(nic)) == 0 || (pair->came & bit(nic)) != 0) continue;
        add(counters_[nic].lost);
        const bool other_came = (pair->came & bit(1 - nic)) != 0;
        if (other_came) note_miss(*pair, nic);
        // The cable of the other NIC was repaired, and this NIC still sends nothing: its copies are not awaited any
        // more.
        constexpr unsigned kMissesUntilWhole = 2 * kMissesUntilSilent;
        const unsigned crossing = pair->crossed & static_cast<unsigned>(~pair->idle) & bit(1 - nic);
        if (crossing != 0 && missed_[nic] >= kMissesUntilWhole) note_ring(*pair, crossing);
    }
    pair->state.store(FramePair::unused, std::memory_order_release);
}

}  // namespace margay
