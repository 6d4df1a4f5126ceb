// The part of the cycle outside the fast path of cycle.hpp: queued datagrams sent with the cycle ("riders"), lost
// frames, slaves that do not take part, several datagrams in a frame.
#include "link/cycle.hpp"

#include <algorithm>

namespace margay {
namespace {

using wire::Command;

// ARMW and FRMW bring the time of the reference clock to the other clocks; APRD and FPRD only read it.
constexpr std::byte kFirstWithTime{static_cast<std::uint8_t>(Command::ARMW)};
constexpr std::byte without_time(std::byte command) {
    return static_cast<std::byte>(command == kFirstWithTime ? Command::APRD : Command::FPRD);
}
constexpr std::byte with_time(std::byte command) {
    return static_cast<std::byte>(command == static_cast<std::byte>(Command::APRD) ? Command::ARMW : Command::FRMW);
}

// The next frames only read the reference clock, until the next time can be predicted from two consecutive replies.
void read_only(PreparedFrame& frame, PreparedReading& reading) {
    std::byte& command = frame.bytes[reading.offset];
    if (command == static_cast<std::byte>(Command::BRD)) return;
    if (command >= kFirstWithTime) command = without_time(command);
    if (frame.overlapped) return;
    if (command == static_cast<std::byte>(Command::NOP) && reading.standby != 0) {
        command = static_cast<std::byte>(Command::FPRD);
        store_le<std::uint16_t>(frame.bytes, reading.offset + 2U, reading.standby);
    }
    reading.into->slaves = 0;
}

}  // namespace

// The clock is only read until the next time can be predicted from two consecutive replies, because slaves before the
// reference take the time that is sent.
void change_time(PreparedFrame& frame, PreparedReading& reading) {
    const Command read = reading.by_position ? Command::APRD : Command::FPRD;
    const std::uint16_t address = std::exchange(reading.standby, std::uint16_t{0});
    frame.bytes[reading.offset] = static_cast<std::byte>(address == 0 && !reading.by_position ? Command::NOP : read);
    store_le<std::uint16_t>(frame.bytes, reading.offset + 2U, address);
    reading.into->value = 0;  // the next time must not be predicted from the last time
    reading.into->slaves = 0;
    reading.changes = false;
}

// Returns the time until which the queue waits for the next cycle. Only groups whose cycles keep their interval are
// considered.
Time Link::cycles_until() {
    constexpr Duration kLongestWait = std::chrono::milliseconds(10);
    Time until = Time::min();
    for (CyclePace* pace = paces_.front(); pace != nullptr; pace = paces_.after(*pace)) {
        if (pace->budget_bytes == 0 || pace->before == Time::min()) continue;
        const Duration interval = pace->last - pace->before;
        // The next cycle may be late by its jitter.
        const Duration wait = std::min(2 * interval, kLongestWait + interval / 8);
        if (interval < kLongestWait) until = std::max(until, pace->last + wait);
    }
    return until;
}

SendStatus Link::send_with_queue(std::span<PreparedFrame> frames, Time now, std::size_t budget_bytes) {
    rider_budget_ = budget_bytes;
    riders_ = false;
    const SendStatus all = send_rest(frames, SendStatus::sent, now);
    if (!queue_.empty()) send_riders(now);
    return all;
}

SendStatus Link::send_rest(std::span<PreparedFrame> frames, SendStatus all, Time now) {
    for (PreparedFrame& frame : frames) {
        const SendStatus status = queue_.empty() ? send_prepared(frame, now) : send_with_riders(frame, now);
        if (status != SendStatus::sent) all = status;
    }
    return all;
}

// Writes the index and the outputs into the frame.
void Link::fill(PreparedFrame& frame, std::uint8_t index) {
    if (frame.is_held()) {
        lose_readings(frame);
        drop_held(frame);
    }
    for (PreparedDatagram& d : frame.datagrams) {
        std::byte* at = &frame.bytes[d.offset];
        at[1] = std::byte{index};
        if (frame.degraded && !frame.apart) cycle::copy(at + wire::kDatagramHeaderBytes + d.input_at, d.input);
        cycle::copy(at + wire::kDatagramHeaderBytes, d.output);
    }
    for (PreparedReading& r : frame.readings) {
        if (r.changes) change_time(frame, r);
        frame.bytes[r.offset + 1U] = std::byte{index};
    }
    frame.regrouped = false;
    frame.own.unmarked = false;
}

// Octets of queued datagrams that may still be sent with this cycle: the rest of the budget, but at least one datagram.
std::size_t Link::rider_room() {
    const std::size_t first = queue_.empty() ? 0 : queue_.front()->sent_data_.size() + wire::kDatagramOverheadBytes;
    return riders_ || rider_budget_ == 0 ? rider_budget_ : std::max(rider_budget_, first);
}

Bytes Link::add_riders(PreparedFrame& frame, FrameSlot& slot) {
    const std::size_t end = std::min(frame.bytes.size(), frame.size + rider_room());
    wire::FrameBuilder builder(MutableBytes(frame.bytes).first(end), frame.size, frame.last);
    pack(slot, builder);
    return builder.finish();
}

// Removes the riders from the frame.
void Link::remove_riders(PreparedFrame& frame) {
    frame.bytes[frame.last + 7U] &= std::byte{0x7F};  // flag "more datagrams follow"
    (void)wire::FrameBuilder(frame.bytes, frame.size, frame.last).finish();
}

void Link::note_riders(std::size_t bytes) {
    riders_ = true;
    rider_budget_ -= std::min(rider_budget_, bytes);
}

void Link::send_riders(Time now) {
    while (!queue_.empty() && rider_room() > 0) {
        const std::size_t room = std::min(wire::kMaxFrameBytes, wire::kFramePrefixBytes + rider_room());
        if (wire::kFramePrefixBytes + wire::kDatagramOverheadBytes + queue_.front()->sent_data_.size() > room) return;
        FrameSlot* slot = frames_.open(now);
        if (slot == nullptr) return;
        if (!send_one(*slot, now, room)) {
            frames_.close(*slot, false, now);
            note_stuck(now);
            return;
        }
        note_riders(slot->length);
    }
}

FrameSlot* Link::leave_slot(PreparedFrame& frame) {
    FrameSlot* slot = std::exchange(frame.slot, nullptr);
    if (slot == nullptr) return nullptr;
    if (slot != &frame.own) {
        slot->prepared = nullptr;
        remove_riders(frame);
    }
    return slot->datagrams.empty() ? slot : nullptr;
}

bool Link::take_half(PreparedFrame& frame, Time now) {
    if (cables_ == nullptr || frame.slot == nullptr) return false;
    const std::size_t length = cables_->half(frame, frame.slot->index, buffer_);
    if (length == 0) return false;
    commit_frame(frame, Bytes(buffer_).first(length));
    ++statistics_.frames_received;
    if (FrameSlot* slot = leave_slot(frame); slot != nullptr) close_lost(*slot, now);
    return true;
}

void Link::give_up_prepared(PreparedFrame& frame, Time now) {
    if (frame.slot == nullptr) return;
    lose_readings(frame);
    FrameSlot* slot = leave_slot(frame);
    if (slot == nullptr) return;
    ++statistics_.lost;
    note_silence();
    close_lost(*slot, now);
    if (silence_ % kMostUnread == 0) drain(now);
}

// Empties the NIC: a reply that stayed in the NIC until its index is used again would be mistaken for the reply to a
// new frame.
void Link::drain(Time now) {
    while (receive_one(now, early_)) {
    }
}

// commit() for a datagram in which some slave does not take part. Its inputs are copied if exactly the other slaves
// have answered.
void Link::commit_short(PreparedFrame& frame, const PreparedDatagram& datagram, const std::byte* data) {
    frame.end = CycleEnd::odd;
    DatagramStatus& status = *datagram.status;
    const auto got = load_le<std::uint16_t>(Bytes(data + datagram.bytes, 2));
    const bool changed = !frame.degraded || !status.came || status.got != got;  // commit() overwrites these values
    status.got = got;
    status.came = true;
    status.fresh = got == status.full || (frame.owner == nullptr ? got == status.accepted
                                                                 : frame.owner->is_sure(frame.group, status, changed));
    if (!status.fresh) return;
    const std::byte* inputs = data + datagram.input_at;
    const auto n = static_cast<std::size_t>(&datagram - frame.datagrams.data());
    // With the working counter of all slaves, a device has answered at the place of a slave that does not take part.
    if (frame.apart || frame.regrouped || frame.doubted || status.got != status.accepted)
        frame.owner->copy_inputs(frame.group, frame, n, Bytes(inputs, datagram.input.size()));
    else
        cycle::copy(datagram.input.data(), Bytes(inputs, datagram.input.size()));
}

// After a frame that was lost, the time in the next one is too early: the clocks would take it if the reference was
// lost meanwhile. So the next frame only reads the reference.
void Link::lose_readings(PreparedFrame& frame) {
    for (PreparedReading& r : frame.readings) {
        r.into->came = false;
        read_only(frame, r);
    }
}

void Link::mark_not_received(PreparedFrame& frame) {
    if (frame.is_held()) drop_held(frame);
    frame.end = CycleEnd::missing;
    for (PreparedDatagram& d : frame.datagrams) d.status->came = d.status->fresh = false;
    lose_readings(frame);
}

SendStatus Link::send_with_riders(PreparedFrame& frame, Time now) {
    give_up_prepared(frame, now);
    frame.end = CycleEnd::missing;
    FrameSlot* slot = frames_.open(now);
    if (slot == nullptr) return SendStatus::busy;
    fill(frame, slot->index);
    const Bytes whole = add_riders(frame, *slot);
    slot->length = static_cast<std::uint16_t>(whole.size() - wire::kFramePrefixBytes);
    slot->deadline = later(now, frame_timeout());
    slot->prepared = &frame;
    frame.slot = slot;
    const SendStatus status = nic_.send(whole);
    if (status != SendStatus::sent) {
        not_sent(frame, now);
        return status;
    }
    note_prepared(frame);
    statistics_.bytes_on_wire += wire::bytes_on_the_wire(whole.size()) - frame.wire_bytes;
    note_sent(*slot, now);
    if (whole.size() > frame.size) note_riders(whole.size() - frame.size);
    return status;
}

// The frame is not in flight; the datagrams that were packed into it return to the queue.
void Link::not_sent(PreparedFrame& frame, Time now) {
    ++statistics_.send_refused;
    note_silence();
    if (!frame.slot->datagrams.empty()) note_stuck(now);
    unpack(*frame.slot);
    if (frame.slot != &frame.own) remove_riders(frame);
    frames_.close(*frame.slot, false, now);
    frame.slot = nullptr;
}

namespace {

[[gnu::noinline]] void copy_reading(const PreparedReading& reading, const std::byte* data) {
    reading.into->came = true;
    reading.into->slaves = load_le<std::uint16_t>(Bytes(data + reading.bytes, 2));
    if (reading.into->slaves == 0) return;
    std::array<std::byte, sizeof(std::uint64_t)> value{};
    std::memcpy(value.data(), data, reading.bytes);
    reading.into->value = load_le<std::uint64_t>(value);
}

// The number of slaves that have answered a frame with the time.
std::uint8_t answers(const PreparedReading& reading) { return static_cast<std::uint8_t>(reading.into->slaves); }

// Whether another number of slaves has answered than for the last frame with the time. True also if that number is not
// known.
bool are_others(const PreparedReading& reading) { return reading.full == 0 || reading.full != answers(reading); }

// The datagram that carries the time of the reference clock (FRMW or ARMW). When the reference clock is lost, all other
// slaves take the time that was sent, and zeros would disturb their control loops. So the datagram is sent with the
// time that the reference will probably have. A reply that still has this value, and comes from other slaves than
// before, was not read from the reference: then the next cycles carry the time of the standby. The position of the
// standby in the ring has changed, so FRMW addresses it. Without a standby, no time is sent until the owner chooses
// another reference. After that, and after a lost frame, the clock is only read until the next time can be predicted
// from two consecutive replies: the reference may be back, and would take the time that is sent.
void take_time(PreparedFrame& sent, PreparedReading& reading, const RegisterReading& before, const std::byte* data) {
    RegisterReading& into = *reading.into;
    std::byte* const head = &sent.bytes[reading.offset];
    if (*head == static_cast<std::byte>(Command::BRD)) return;
    std::byte* const time = head + wire::kDatagramHeaderBytes;
    // Added to the expected time, so that the reference shows the sent time only by chance. With exact cycles, the
    // reference would often show the expected time itself.
    constexpr std::uint64_t kBeside_ns = 64;
    const bool as_sent = sent.parked ? sent.no_time : std::memcmp(time, data, reading.bytes) == 0;
    std::array<std::byte, sizeof(std::uint64_t)> next{};
    store_le<std::uint64_t>(next, 0, (before.value == 0 ? into.value : 2 * into.value - before.value) + kBeside_ns);
    if (*head < kFirstWithTime) {
        if (before.slaves != 0) *head = with_time(*head);
    } else if (as_sent && are_others(reading)) {
        const MutableBytes address(head + 2, 2);
        const bool standby = reading.standby != 0 && load_le<std::uint16_t>(address) != reading.standby;
        *head = static_cast<std::byte>(standby ? Command::FPRD : Command::NOP);
        if (standby) store_le<std::uint16_t>(address, 0, reading.standby);
        reading.full = answers(reading);  // the answers to a frame with the time of the standby
        into.slaves = 0;
        into.value = before.value;
    } else {
        ++reading.times;
        reading.full = answers(reading);
    }
    std::memcpy(time, next.data(), reading.bytes);
}

// The same where cycles overlap. The sending thread continues the time, see link/overlap.cpp, and the owner chooses the
// command before it returns the frame to that thread. A frame that has not brought the time of the reference only reads
// the time at the next cycle: a time that the master has sent is never continued. When the reference answers, the frame
// carries its time again, unless PreparedReading::held.
void take_overlapped_time(PreparedFrame& sent, PreparedReading& reading, const RegisterReading& before) {
    RegisterReading& into = *reading.into;
    std::byte& command = sent.bytes[reading.offset];
    if (command == static_cast<std::byte>(Command::BRD)) return;
    if (command < kFirstWithTime) {
        if (!reading.held && into.value != 0) command = with_time(command);
    } else if (sent.no_time && are_others(reading)) {
        command = without_time(command);
        into.slaves = 0;
        into.value = before.value;
    } else {
        ++reading.times;
        reading.full = answers(reading);
    }
}

}  // namespace

// Whether `frame` contains all datagrams that were sent in the frame of `slot`.
bool Link::is_reply(FrameSlot& slot, Bytes frame) const {
    constexpr std::size_t kTypeAndLength = wire::kEthernetHeaderBytes - 2;
    const PreparedFrame& sent = *slot.prepared;
    const Bytes own = Bytes(sent.bytes).first(sent.size);
    if (frame.size() < own.size() || !is_genuine(frame)) return false;
    if (load_le<std::uint32_t>(own, kTypeAndLength) != load_le<std::uint32_t>(frame, kTypeAndLength)) return false;
    for (const PreparedDatagram& d : sent.datagrams)
        if (!cycle::same_datagram(&own[d.offset], &frame[d.offset])) return false;
    for (const PreparedReading& r : sent.readings)
        if (!cycle::same_datagram(&own[r.offset], &frame[r.offset])) return false;
    return &slot == &sent.own || (frame.size() >= wire::kFramePrefixBytes + slot.length && matches(slot, frame));
}

// Commits the reply to all datagrams and readings of a frame.
void Link::commit_frame(PreparedFrame& sent, Bytes frame) {
    sent.end = sent.degraded ? CycleEnd::odd : CycleEnd::right;
    for (const PreparedDatagram& d : sent.datagrams) {
        const std::byte* data = &frame[d.offset + wire::kDatagramHeaderBytes];
        if (sent.degraded || !commit(d, data)) commit_short(sent, d, data);
    }
    for (PreparedReading& r : sent.readings) {
        const std::byte* data = &frame[r.offset + wire::kDatagramHeaderBytes];
        const RegisterReading before = *r.into;
        copy_reading(r, data);
        if (r.into->slaves == 0)
            read_only(sent, r);  // the time in the frame is too early for the next cycle
        else if (sent.overlapped)
            take_overlapped_time(sent, r, before);
        else
            take_time(sent, r, before, data);
    }
}

// A reply to a prepared frame is recognised by comparison with the frame that was sent, whose octets are kept.
bool Link::accept_prepared(Bytes frame, Time now, List<Waiter>& ready) {
    constexpr std::size_t kIndexOffset = wire::kFramePrefixBytes + 1;
    if (frame.size() < wire::kFramePrefixBytes + wire::kDatagramOverheadBytes) return false;
    FrameSlot* slot = frames_.find(std::to_integer<std::uint8_t>(frame[kIndexOffset]));
    if (slot == nullptr || slot->prepared == nullptr || !is_reply(*slot, frame)) return false;
    PreparedFrame& sent = *slot->prepared;
    if (sent.park != PreparedFrame::kNever && sent.park != receiving_)
        keep(sent, frame);
    else
        commit_frame(sent, frame);
    sent.slot = nullptr;
    ++statistics_.frames_received;
    if (slot != &sent.own) {
        deliver_riders(*slot, frame, ready);
        remove_riders(sent);
    }
    frames_.close(*slot, false, now);
    return true;
}

void Link::accept_frame(Bytes frame, Time now, List<Waiter>& ready) {
    if (!accept_prepared(frame, now, ready)) accept_datagrams(frame, now, ready);
}

// A frame from the NIC, in `buffer_`, while the cycle of the group of `awaited` is being received.
void Link::accept_in_cycle(const PreparedFrame& awaited, std::size_t length, Time now, List<Waiter>& ready) {
    receiving_ = awaited.park;
    accept_frame(Bytes(buffer_).first(length), now, ready);
    receiving_ = PreparedFrame::kNever;
}

CycleEnd Link::receive_rest(std::span<PreparedFrame> frames, Time now, List<Waiter>& ready) {
    if (PreparedFrame& first = frames.front(); first.end == CycleEnd::unjudged)
        commit_short(first, first.datagrams[0], &buffer_[wire::kFramePrefixBytes + wire::kDatagramHeaderBytes]);
    for (PreparedFrame& frame : frames)
        if (frame.is_held()) commit_held(frame);
    for (const PreparedFrame& frame : frames) {
        while (frame.slot != nullptr) {
            const std::size_t length = nic_.receive(buffer_);
            if (length == 0) return CycleEnd::missing;
            accept_in_cycle(frame, length, now, ready);
        }
    }
    return CycleEnd::odd;
}

void Link::commit_held(PreparedFrame& frame) {
    commit_frame(frame, frame.bytes);
    drop_held(frame);
}

// Removes the parked reply from the frame.
void Link::drop_held(PreparedFrame& frame) {
    const auto clear = [&frame](std::size_t at, std::size_t bytes) {
        std::ranges::fill(MutableBytes(frame.bytes).subspan(at, bytes), std::byte{0});
    };
    for (const PreparedDatagram& d : frame.datagrams)
        clear(d.offset + wire::kDatagramHeaderBytes, d.bytes + wire::kWorkingCounterBytes);
    for (const PreparedReading& r : frame.readings) {
        const std::size_t data = r.offset + wire::kDatagramHeaderBytes;
        // BRD combines the sent octets and the registers of the slaves by OR, so the data must be 0. The data of a time
        // is already the next time.
        if (frame.bytes[r.offset] == static_cast<std::byte>(Command::BRD)) clear(data, r.bytes);
        clear(data + r.bytes, wire::kWorkingCounterBytes);
    }
    frame.parked = false;
    frame.no_time = false;
    frame.settle_form();
}

bool Link::receive_one(Time now, List<Waiter>& ready) {
    const std::size_t length = nic_.receive(buffer_);
    if (length == 0) return false;
    accept_frame(Bytes(buffer_.data(), length), now, ready);
    return true;
}

}  // namespace margay
