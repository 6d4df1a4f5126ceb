#include "link/cycle.hpp"

#include <algorithm>

namespace margay {

Waiter::~Waiter() = default;

Datagram::Datagram(Link& link, wire::Command command, wire::DatagramAddress address, MutableBytes data, Repeat repeat)
    : link_(link), sent_data_(data), reply_data_(data), address_(address), command_(command), repeat_(repeat) {}

Datagram::Datagram(Link& link, wire::Command command, wire::DatagramAddress address, Bytes data, Repeat repeat)
    : link_(link), sent_data_(data), address_(address), command_(command), repeat_(repeat) {}

Datagram::~Datagram() = default;

TimedDatagram::TimedDatagram(Link& link, wire::Command command, wire::DatagramAddress address, MutableBytes data,
                             Repeat repeat)
    : Datagram(link, command, address, data, repeat) {
    timed_ = true;
}

bool DatagramWait::submit(std::coroutine_handle<> waiting, std::span<Datagram* const> datagrams) noexcept {
    handle = waiting;
    for (Datagram* datagram : datagrams) (void)datagram->submit(*this);
    return pending > 0;
}

bool DatagramWait::submit(std::coroutine_handle<> waiting, Datagram& datagram) noexcept {
    Datagram* const one = &datagram;
    return submit(waiting, std::span(&one, 1));
}

bool Datagram::submit(Waiter& waiter) {
    sendings_ = 0;
    unmarked_ = false;
    wkc_ = 0;
    // No frame can carry this datagram.
    if (sent_data_.size() > wire::kMaxDatagramData) {
        errc_ = Errc::datagram_size;
        return false;
    }
    errc_ = Errc::canceled;
    waiter_ = &waiter;
    ++waiter.pending;
    if (link_.queue_.empty()) link_.stuck_since_ = kNever;  // the datagrams that the NIC did not accept were destroyed
    link_.queue_.push_back(*this);
    return true;
}

void Link::complete(Datagram& datagram, Errc errc, List<Waiter>& ready) {
    datagram.unlink();
    datagram.errc_ = errc;
    if (--datagram.waiter_->pending == 0) ready.push_back(*datagram.waiter_);
}

void Link::receive(Time now, List<Waiter>& ready) {
    ready.take_back(early_);
    while (receive_one(now, ready)) {
    }
    while (FrameSlot* slot = frames_.expired(now)) give_up(*slot, now, ready);
    if (stuck_since_ != kNever && now - stuck_since_ >= queue_timeout()) end_queued(ready);
}

// The NIC has not accepted a queued datagram, or a frame of the cycle with queued datagrams in it.
void Link::note_stuck(Time now) {
    if (stuck_since_ == kNever) stuck_since_ = now;
}

void Link::end_queued(List<Waiter>& ready) {
    while (Datagram* d = queue_.front()) complete(*d, Errc::nic_busy, ready);
    stuck_since_ = kNever;
}

bool Link::matches(FrameSlot& slot, Bytes frame) {
    if (wire::load_frame_header(frame.subspan(wire::kEthernetHeaderBytes)).length != slot.length) return false;
    for (Datagram* d = slot.datagrams.front(); d != nullptr; d = slot.datagrams.after(*d)) {
        const auto got = wire::load_datagram_header(frame.subspan(d->offset_));
        const bool same_address =
            wire::counts_position(got.command) ? got.address.ado() == d->address_.ado() : got.address == d->address_;
        if (got.command != d->command_ || got.index != slot.index || got.length != d->sent_data_.size() ||
            !same_address)
            return false;
    }
    return true;
}

void Link::accept_datagrams(Bytes frame, Time now, List<Waiter>& ready) {
    wire::DatagramReader reader(frame);
    const auto first = reader.next();
    while (reader.next()) {
    }
    if (reader.fault() != wire::FrameFault::none) {
        ++(reader.fault() == wire::FrameFault::foreign ? statistics_.foreign : statistics_.malformed);
        return;
    }
    FrameSlot* slot = frames_.find(first->header.index);
    if (!is_genuine(frame)) {
        drop_unmarked(frame, slot);
        return;
    }
    if (slot == nullptr) {
        ++statistics_.unexpected;
        return;
    }
    if (slot->prepared != nullptr || !matches(*slot, frame)) {
        ++statistics_.mismatched;
        return;
    }
    deliver(*slot, frame, now, ready);
}

// The first ESC marks the source address, but some slaves do not set the mark. If the NIC hides own frames, an unmarked
// frame with the own source address has passed the segment, too. Frames of another master have another source address.
bool Link::is_genuine(Bytes frame) const {
    if ((frame[wire::kSourceMacOffset] & wire::kPassedEscBit) != std::byte{0}) return true;
    return nic_.hides_own_frames() &&
           std::ranges::equal(std::as_bytes(std::span(source_)), frame.subspan(wire::kSourceMacOffset, source_.size()));
}

// Frames are sent with working counters of zero. A nonzero counter shows that the frame is not an echo.
void Link::drop_unmarked(Bytes frame, FrameSlot* slot) {
    bool counted = false;
    wire::DatagramReader reader(frame);
    while (const auto d = reader.next()) counted |= d->wkc != 0;
    ++(counted ? statistics_.unmarked : statistics_.echoes);
    if (counted && slot != nullptr) slot->unmarked = true;
}

void Link::deliver(FrameSlot& slot, Bytes frame, Time now, List<Waiter>& ready) {
    ++statistics_.frames_received;
    deliver_riders(slot, frame, ready);
    frames_.close(slot, false, now);
}

void Link::deliver_riders(FrameSlot& slot, Bytes frame, List<Waiter>& ready) {
    while (Datagram* d = slot.datagrams.front()) {
        const std::size_t data_at = d->offset_ + wire::kDatagramHeaderBytes;
        const auto data = frame.subspan(data_at, d->sent_data_.size());
        if (!d->reply_data_.empty()) std::copy(data.begin(), data.end(), d->reply_data_.begin());
        d->wkc_ = load_le<std::uint16_t>(frame, data_at + data.size());
        complete(*d, Errc::none, ready);
    }
}

void Link::note_silence() {
    if (std::exchange(received_before_, statistics_.frames_received) != statistics_.frames_received) silence_ = 0;
    longest_silence_ = std::max(longest_silence_, ++silence_);
}

void Link::give_up(FrameSlot& slot, Time now, List<Waiter>& ready) {
    if (slot.prepared != nullptr) {
        slot.prepared->slot = nullptr;
        lose_readings(*slot.prepared);
        remove_riders(*slot.prepared);
    }
    if (!slot.refused) ++statistics_.lost;
    note_silence();
    List<Datagram> again;
    while (Datagram* d = slot.datagrams.pop_front()) {
        if (d->repeat_ == Repeat::yes && d->sendings_ < settings.sendings) {
            ++statistics_.retried;
            again.push_back(*d);
        } else {
            d->unmarked_ = slot.unmarked;
            complete(*d, slot.refused ? Errc::nic : Errc::no_frame, ready);
        }
    }
    // The old datagrams are placed before the datagrams that were queued since, so that the order of submission is kept
    // as far as possible.
    again.take_back(queue_);
    queue_.take_back(again);
    close_lost(slot, now);
}

void Link::close_lost(FrameSlot& slot, Time now) {
    if (cables_ != nullptr) cables_->give_up(slot.index);
    frames_.close(slot, true, now);
}

void Link::pack(FrameSlot& slot, wire::FrameBuilder& builder) {
    while (Datagram* d = queue_.front()) {
        if (!builder.fits(d->sent_data_.size()) || (d->alone_ && !builder.empty())) break;
        d->offset_ = static_cast<std::uint16_t>(builder.size());
        const auto data = builder.append(d->command_, slot.index, d->address_, d->sent_data_.size());
        std::copy(d->sent_data_.begin(), d->sent_data_.end(), data.begin());
        slot.datagrams.push_back(*d);
        if (d->alone_) break;
    }
}

// The frame was not sent: its datagrams return to the front of the queue.
void Link::unpack(FrameSlot& slot) {
    while (Datagram* d = slot.datagrams.back()) queue_.push_front(*d);
}

void Link::note_sent(FrameSlot& slot, Time now) {
    if (!slot.datagrams.empty()) stuck_since_ = kNever;
    for (Datagram* d = slot.datagrams.front(); d != nullptr; d = slot.datagrams.after(*d)) {
        ++d->sendings_;
        if (d->timed_) static_cast<TimedDatagram*>(d)->sent_at_ = now;
        ++statistics_.datagrams_sent;
    }
}

bool Link::send_one(FrameSlot& slot, Time now, std::size_t room) {
    wire::FrameBuilder builder(MutableBytes(buffer_).first(room), source_);
    pack(slot, builder);
    if (slot.datagrams.empty()) return false;  // no datagram fits: stop instead of trying forever
    const Bytes frame = builder.finish();
    slot.length = static_cast<std::uint16_t>(frame.size() - wire::kFramePrefixBytes);
    slot.deadline = later(now, frame_timeout());
    const SendStatus status = nic_.send(frame);
    if (status == SendStatus::busy) {
        ++statistics_.send_refused;
        unpack(slot);
        return false;
    }
    note_sent(slot, now);
    slot.refused = status == SendStatus::failed;
    if (slot.refused) {
        ++statistics_.send_refused;
    } else {
        ++statistics_.frames_sent;
        statistics_.bytes_on_wire += wire::bytes_on_the_wire(frame.size());
    }
    return true;
}

void Link::send(Time now) {
    nic_busy_ = false;
    if (cycling(now)) return;
    bool any = false;
    while (!queue_.empty()) {
        FrameSlot* slot = frames_.open(now);
        if (slot == nullptr) break;
        if (!send_one(*slot, now)) {
            frames_.close(*slot, false, now);
            note_stuck(now);
            nic_busy_ = true;
            break;
        }
        any = true;
    }
    if (any) ++statistics_.bursts;
}

Time Link::next_deadline(Time now) {
    constexpr Duration kTryAgain = std::chrono::microseconds(50);
    Time next = std::min(frames_.next_deadline(), nic_.next_arrival());
    if (!queue_.empty() && cycling(now)) next = std::min(next, cycles_until());
    if (stuck_since_ != kNever) next = std::min(next, stuck_since_ + queue_timeout());
    return nic_busy_ ? std::min(next, now + kTryAgain) : next;
}

}  // namespace margay
