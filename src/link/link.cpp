#include "link/cycle.hpp"

#include <algorithm>

namespace margay {

void Datagram::submit(Waiter& waiter) {
    waiter_ = &waiter;
    ++waiter.pending;
    sendings_ = 0;
    errc_ = Errc::canceled;
    wkc_ = 0;
    link_.queue_.push_back(*this);
}

void Link::complete(Datagram& datagram, Errc errc, List<Waiter>& ready) {
    datagram.unlink();
    datagram.errc_ = errc;
    if (--datagram.waiter_->pending == 0) ready.push_back(*datagram.waiter_);
}

void Link::receive(Time now, List<Waiter>& ready) {
    while (receive_one(now, ready)) {
    }
    while (FrameSlot* slot = frames_.expired(now)) give_up(*slot, now, ready);
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

void Link::take(Bytes frame, Time now, List<Waiter>& ready) {
    wire::DatagramReader reader(frame);
    const auto first = reader.next();
    while (reader.next()) {
    }
    if (reader.fault() != wire::FrameFault::none) {
        ++(reader.fault() == wire::FrameFault::foreign ? statistics_.foreign : statistics_.malformed);
        return;
    }
    if ((frame[wire::kSourceMacOffset] & wire::kPassedEscBit) == std::byte{0}) {
        ++statistics_.echoes;
        return;
    }
    FrameSlot* slot = frames_.find(first->header.index);
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

void Link::give_up(FrameSlot& slot, Time now, List<Waiter>& ready) {
    if (slot.prepared != nullptr) {
        slot.prepared->slot = nullptr;
        strip(*slot.prepared);
    }
    if (!slot.refused) ++statistics_.lost;
    List<Datagram> again;
    while (Datagram* d = slot.datagrams.pop_front()) {
        if (d->repeat_ == Repeat::yes && d->sendings_ < settings.sendings) {
            ++statistics_.retried;
            again.push_back(*d);
        } else {
            complete(*d, slot.refused ? Errc::nic : Errc::no_frame, ready);
        }
    }
    // In front of what was queued since: the order on the wire stays the order of submission as far as it can.
    again.take_back(queue_);
    queue_.take_back(again);
    frames_.close(slot, true, now);
}

void Link::pack(FrameSlot& slot, wire::FrameBuilder& builder) {
    while (Datagram* d = queue_.front()) {
        if (!builder.fits(d->sent_data_.size())) break;
        d->offset_ = static_cast<std::uint16_t>(builder.size());
        const auto data = builder.append(d->command_, slot.index, d->address_, d->sent_data_.size());
        std::copy(d->sent_data_.begin(), d->sent_data_.end(), data.begin());
        slot.datagrams.push_back(*d);
    }
}

// Nothing has left: all go back to where they were.
void Link::unpack(FrameSlot& slot) {
    while (Datagram* d = slot.datagrams.back()) queue_.push_front(*d);
}

void Link::note_sent(FrameSlot& slot) {
    for (Datagram* d = slot.datagrams.front(); d != nullptr; d = slot.datagrams.after(*d)) {
        ++d->sendings_;
        ++statistics_.datagrams_sent;
    }
}

bool Link::send_one(FrameSlot& slot, Time now, std::size_t room) {
    wire::FrameBuilder builder(MutableBytes(buffer_).first(room), source_);
    pack(slot, builder);
    const Bytes frame = builder.finish();
    slot.length = static_cast<std::uint16_t>(frame.size() - wire::kFramePrefixBytes);
    slot.deadline = now + settings.frame_timeout;
    const SendStatus status = nic_.send(frame);
    if (status == SendStatus::busy) {
        ++statistics_.send_refused;
        unpack(slot);
        return false;
    }
    note_sent(slot);
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
            nic_busy_ = true;
            break;
        }
        any = true;
    }
    if (any) ++statistics_.bursts;
}

Time Link::next_deadline(Time now) const {
    constexpr Duration kTryAgain = std::chrono::microseconds(50);
    Time next = std::min(frames_.next_deadline(), nic_.next_arrival());
    if (!queue_.empty() && cycling(now)) next = std::min(next, cycles_until());
    return nic_busy_ ? std::min(next, now + kTryAgain) : next;
}

}  // namespace margay
