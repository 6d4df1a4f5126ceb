// Merging of the two replies of a frame in a ring with two NICs, and the reply of which only one copy has come.
#include "link/redundancy.hpp"

#include <algorithm>
#include <cstring>

namespace margay {
namespace {

// A bit that was sent as 0 is 1 if either reply has 1; a bit that was sent as 1 is 0 if either reply has 0.
template <class Word>
Word merged(Word a, Word b, Word sent) {
    return static_cast<Word>(sent ^ ((a ^ sent) | (b ^ sent)));
}

void merge_data(std::byte* into, const std::byte* other, const std::byte* sent, std::size_t bytes) {
    for (; bytes >= sizeof(std::uint64_t); bytes -= sizeof(std::uint64_t)) {
        std::uint64_t words[3];
        std::memcpy(&words[0], into, sizeof words[0]);
        std::memcpy(&words[1], other, sizeof words[1]);
        std::memcpy(&words[2], sent, sizeof words[2]);
        words[0] = merged(words[0], words[1], words[2]);
        std::memcpy(into, &words[0], sizeof words[0]);
        into += sizeof words[0];
        other += sizeof words[0];
        sent += sizeof words[0];
    }
    for (std::size_t n = 0; n < bytes; ++n) into[n] = merged(into[n], other[n], sent[n]);
}

}  // namespace

void merge_replies(MutableBytes into, Bytes other, Bytes sent) noexcept {
    constexpr std::size_t kIrq = 8;  // in the header
    wire::DatagramReader reader(sent);
    while (const auto d = reader.next()) {
        const std::size_t data = d->offset + wire::kDatagramHeaderBytes;
        const std::size_t counter = data + d->data.size();
        merge_data(&into[data], &other[data], &sent[data], d->data.size());
        const auto wkc = load_le<std::uint16_t>(Bytes(into), counter) + load_le<std::uint16_t>(other, counter);
        store_le<std::uint16_t>(into, counter, static_cast<std::uint16_t>(wkc));
        for (std::size_t n = d->offset + kIrq; n < data; ++n) into[n] |= other[n];
    }
}

// A mailbox gives each message once, and accepts a message once until the slave has read it. So it is empty or full for
// the complete copy, if the other copy was processed before it.
void Redundancy::take_messages(FramePair& pair, MutableBytes last, bool last_is_complete) noexcept {
    const auto back = MutableBytes(pair.back).first(pair.size);
    const auto complete = last_is_complete ? last : back;
    const auto other = last_is_complete ? Bytes(back) : Bytes(last);
    wire::DatagramReader reader(Bytes(pair.out).first(pair.size));
    while (const auto d = reader.next()) {
        if (d->header.command != wire::Command::FPRD && d->header.command != wire::Command::FPWR) continue;
        const std::size_t data = d->offset + wire::kDatagramHeaderBytes;
        const std::size_t counter = data + d->data.size();
        if (load_le<std::uint16_t>(complete, counter) != 0 || load_le<std::uint16_t>(other, counter) == 0) continue;
        const auto from = other.subspan(data, d->data.size() + sizeof(std::uint16_t));
        std::ranges::copy(from, complete.begin() + static_cast<std::ptrdiff_t>(data));
    }
}

// Whether the positions of one copy were moved by another number of slaves than the other copy has passed: then the
// ring has changed meanwhile.
bool Redundancy::is_misplaced(const FramePair& pair, unsigned processed) noexcept {
    if (!pair.positions || ((processed >> (1U - pair.front)) & 1U) == 0) return false;
    const bool passed = ((processed >> pair.front) & 1U) != 0;
    return pair.shift != (passed ? pair.count[pair.front] : 0);
}

// For a cable of a NIC that is broken, and whose NIC still reports a link: the copies of this NIC are lost, and the
// copies of the other NIC have passed all slaves. In other cases, a copy that comes back alone has passed only some
// slaves. In a broken ring with missing slaves this cannot be distinguished, because the slaves of both parts may have
// the same working counter.
std::size_t Redundancy::half(const PreparedFrame& frame, std::uint8_t index, MutableBytes into) noexcept {
    FramePair* const pair = pair_of(index);
    if (pair == nullptr || !hold(*pair)) return 0;
    const unsigned came = pair->came & static_cast<unsigned>(~pair->idle);
    const auto reply = Bytes(pair->back).first(pair->size);
    const auto is_complete = [reply](const PreparedDatagram& d) {
        const std::uint16_t accepted = d.status->accepted;
        return load_le<std::uint16_t>(reply, d.offset + wire::kDatagramHeaderBytes + d.bytes) == accepted;
    };
    // Whether the reading has the same number of slaves as before.
    const auto has_all = [&frame, reply](const PreparedReading& r) {
        return frame.bytes[r.offset] != static_cast<std::byte>(wire::Command::BRD) ||
               load_le<std::uint16_t>(reply, r.offset + wire::kDatagramHeaderBytes + r.bytes) == r.into->slaves;
    };
    const bool whole = pair->index == index && came != 0 && frame.size <= pair->size && !is_misplaced(*pair, came) &&
                       !frame.datagrams.empty() && (!frame.degraded || by_head_.load(std::memory_order_relaxed)) &&
                       std::ranges::all_of(frame.datagrams, is_complete) &&
                       std::ranges::all_of(frame.readings, has_all);
    if (whole) std::ranges::copy(reply, into.begin());
    pair->state.store(FramePair::open, std::memory_order_release);
    return whole ? reply.size() : 0;
}

}  // namespace margay
