// A NIC whose far end is the test: it stores the sent frames and receives the frames of the test.
#pragma once

#include "oshw/nic.hpp"
#include "wire/datagram.hpp"

#include <algorithm>
#include <deque>
#include <vector>

namespace margay {

using Octets = std::vector<std::byte>;

class ScriptedNic final : public Nic {
  public:
    std::vector<Octets> sent;
    std::deque<Octets> incoming;
    SendStatus answer = SendStatus::sent;
    LinkState link = LinkState::up;
    std::size_t most_frames_at_once = SIZE_MAX;  // number of frames that the NIC accepts before it is busy
    std::size_t taken = 0;
    bool hides_own = false;

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (answer == SendStatus::sent && taken++ >= most_frames_at_once) return SendStatus::busy;
        if (answer == SendStatus::sent) sent.emplace_back(frame.begin(), frame.end());
        return answer;
    }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        if (incoming.empty()) return 0;
        const Octets frame = std::move(incoming.front());
        incoming.pop_front();
        const std::size_t length = std::min(into.size(), frame.size());
        std::copy_n(frame.begin(), length, into.begin());
        return length;
    }
    LinkState link_state() noexcept override { return link; }
    bool hides_own_frames() const noexcept override { return hides_own; }
};

// The frame as a segment returns it: with the mark of the first ESC, and with `wkc` in every datagram.
inline Octets reply_to(Octets frame, std::uint16_t wkc = 1) {
    frame[wire::kSourceMacOffset] |= wire::kPassedEscBit;
    std::vector<std::size_t> wkc_at;
    wire::DatagramReader reader(frame);
    while (auto d = reader.next()) wkc_at.push_back(d->offset + wire::kDatagramHeaderBytes + d->header.length);
    for (const std::size_t at : wkc_at) store_le<std::uint16_t>(frame, at, wkc);
    return frame;
}

}  // namespace margay
