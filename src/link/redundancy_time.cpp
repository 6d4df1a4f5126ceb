// The times of reference clocks in a ring with two NICs. While the ring is whole, the copy of the head brings the time
// of the reference to all slaves, and the other copy carries none. In a broken ring the other copy carries the time of
// the second reference to the slaves behind the break.
#include "link/cycle.hpp"
#include "link/redundancy.hpp"
#include "wire/esc.hpp"

#include <algorithm>

namespace margay {
namespace {

constexpr std::size_t kAdp = 2;

bool carries_time(const wire::DatagramView& d) {
    const bool is_multiple = d.header.command == wire::Command::FRMW || d.header.command == wire::Command::ARMW;
    return is_multiple && d.header.address.ado() == wire::reg::kSystemTime.address && d.data.size() >= 4;
}

// The command that reads the same register of the same slave, and writes to no other slave.
constexpr wire::Command reading(wire::Command command) {
    return command == wire::Command::ARMW ? wire::Command::APRD : wire::Command::FPRD;
}

std::uint32_t time_in(Bytes frame, const TimeDatagram& time) {
    return load_le<std::uint32_t>(frame, time.offset + wire::kDatagramHeaderBytes);
}
std::uint16_t slaves_in(Bytes frame, const TimeDatagram& time) {
    return load_le<std::uint16_t>(frame, time.offset + wire::kDatagramHeaderBytes + time.bytes);
}

}  // namespace

// Finds the datagrams with a time, and gives `out` the form of the copy that is not sent by the head.
void Redundancy::divide_times(FramePair& pair) const noexcept {
    const std::uint32_t second = second_.load(std::memory_order_relaxed);
    const auto reference = static_cast<std::uint16_t>(second >> 16);
    pair.second_is_first = reference != 0;
    const bool open = opening_.load(std::memory_order_relaxed) != Opening::none;
    pair.times_held = times_held_.load(std::memory_order_relaxed) ||
                      (open && without_times_.load(std::memory_order_relaxed));
    pair.second_slaves = 0;
    pair.times = {};
    std::size_t found = 0;
    const auto out = MutableBytes(pair.out).first(pair.size);
    wire::DatagramReader reader(out);
    while (const auto d = reader.next()) {
        if (!carries_time(*d) || found == pair.times.size()) continue;
        TimeDatagram& time = pair.times[found++];
        time.offset = static_cast<std::uint16_t>(d->offset);
        time.bytes = static_cast<std::uint16_t>(d->data.size());
        auto& [original, head, other] = time.forms;
        std::ranges::copy(out.subspan(d->offset, original.size()), original.begin());
        head = other = original;
        // If the reference has changed and the second reference was not chosen again yet, the copies carry no time.
        const bool other_reference = reference != 0 && d->header.command == wire::Command::FRMW &&
                                     load_le<std::uint16_t>(original, kAdp) != reference;
        const bool none = static_cast<std::uint16_t>(second) == 0 || other_reference;
        // The reference is behind the break, and the slaves before the break would take the time that was sent.
        if (pair.second_is_first) head[0] = static_cast<std::byte>(wire::Command::NOP);
        other[0] = static_cast<std::byte>(none ? wire::Command::NOP : wire::Command::FRMW);
        store_le<std::uint16_t>(other, kAdp, static_cast<std::uint16_t>(second));
        if (!pair.times_held) continue;
        head[0] = static_cast<std::byte>(reading(d->header.command));
        other[0] = static_cast<std::byte>(pair.second_is_first ? wire::Command::FPRD : wire::Command::NOP);
    }
    set_times(pair, out, TimeDatagram::of_other);
}

void Redundancy::set_times(const FramePair& pair, MutableBytes frame, TimeDatagram::Form form) noexcept {
    for (const TimeDatagram& time : pair.times)
        if (time.offset != 0) std::ranges::copy(time.forms[form], frame.begin() + time.offset);
}

// Whether the datagrams of the reply belong to the copy that was sent by `from`.
bool Redundancy::is_reply_to(const FramePair& pair, Bytes reply, unsigned from) noexcept {
    const auto sent = Bytes(pair.out).first(pair.size);
    if (reply.size() < sent.size()) return false;
    wire::DatagramReader reader(sent);
    while (const auto d = reader.next()) {
        std::array<std::byte, wire::kDatagramHeaderBytes> head{};
        std::ranges::copy(sent.subspan(d->offset, head.size()), head.begin());
        for (const TimeDatagram& time : pair.times)
            if (time.offset == d->offset)
                std::ranges::copy(time.forms[from == pair.head ? TimeDatagram::of_head : TimeDatagram::of_other],
                                  head.begin());
        if (!cycle::same_datagram(head.data(), &reply[d->offset])) return false;
    }
    return true;
}

// Gives a copy that was not sent by the head the form of the copy of the head. The time of the second reference is kept
// beside it, unless it is the only time.
void Redundancy::take_second_time(FramePair& pair, MutableBytes frame, unsigned from) noexcept {
    set_times(pair, frame, TimeDatagram::original);
    if (from == pair.head || pair.second_is_first) return;
    for (const TimeDatagram& time : pair.times) {
        if (time.offset == 0) continue;
        pair.second_slaves = slaves_in(frame, time);
        pair.second_ns = time_in(frame, time);
        std::uint32_t unanswered = load_le<std::uint16_t>(time.forms[TimeDatagram::of_other], kAdp);
        if (pair.second_slaves != 0 && pair.second_ns == time_in(pair.out, time)) {
            // The second reference is lost: all slaves behind the break have taken the time that was sent. The next
            // copies do not use it any more.
            pair.second_slaves = 0;
            (void)second_.compare_exchange_strong(unanswered, 0, std::memory_order_relaxed);
        }
        const std::size_t data = time.offset + wire::kDatagramHeaderBytes;
        std::copy_n(pair.out.begin() + static_cast<std::ptrdiff_t>(data), time.bytes,
                    frame.begin() + static_cast<std::ptrdiff_t>(data));
        store_le<std::uint16_t>(frame, data + time.bytes, std::uint16_t{0});
    }
}

// `frame` is the merged reply.
void Redundancy::compare_times(const FramePair& pair, Bytes frame) noexcept {
    const TimeDatagram& time = pair.times[0];
    if (time.offset == 0 || pair.second_slaves == 0 || slaves_in(frame, time) == 0) return;
    // The reference has not answered: the time that was sent came back.
    if (time_in(frame, time) == time_in(pair.out, time)) return;
    const auto ns = static_cast<std::int32_t>(pair.second_ns - time_in(frame, time));
    const bool first = difference_.count++ == 0;
    difference_.sum_ns += ns;
    difference_.least_ns = first ? ns : std::min(difference_.least_ns, ns);
    difference_.most_ns = first ? ns : std::max(difference_.most_ns, ns);
}

}  // namespace margay
