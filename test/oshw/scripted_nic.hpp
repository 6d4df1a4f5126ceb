// A NIC for tests of NIC filters: it records the sent frames and delivers the frames of the test.
#pragma once

#include "osal/virtual/virtual_osal.hpp"
#include "oshw/nic.hpp"

#include <algorithm>
#include <deque>
#include <vector>

namespace margay {

using Frame = std::vector<std::byte>;

// A frame filled with one octet value, which identifies the frame.
inline Frame frame_of(int value, std::size_t size = 60) { return Frame(size, static_cast<std::byte>(value)); }

class ScriptedNic final : public Nic {
  public:
    explicit ScriptedNic(Osal& clock) : clock_(clock) {}

    void arrive(Time at, Frame frame) { arriving.push_back({at, std::move(frame)}); }

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (status == SendStatus::sent) sent.emplace_back(frame.begin(), frame.end());
        return status;
    }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        if (arriving.empty() || arriving.front().first > clock_.now()) return 0;
        const auto frame = arriving.front().second;
        arriving.pop_front();
        const auto length = std::min(frame.size(), into.size());
        std::copy_n(frame.begin(), length, into.begin());
        return length;
    }
    LinkState link_state() noexcept override { return link; }
    MacAddress source_mac() const noexcept override { return {1, 2, 3, 4, 5, 6}; }
    int wait_handle() const noexcept override { return 77; }
    Time next_arrival() const noexcept override { return arriving.empty() ? kNever : arriving.front().first; }
    int last_error() const noexcept override { return 99; }

    SendStatus status = SendStatus::sent;
    LinkState link = LinkState::up;
    std::vector<Frame> sent;
    std::deque<std::pair<Time, Frame>> arriving;

  private:
    Osal& clock_;
};

// All frames that are available now.
inline std::vector<Frame> receive_all(Nic& nic) {
    std::vector<Frame> all;
    Frame buffer(2000);
    while (const auto length = nic.receive(buffer))
        all.emplace_back(buffer.begin(), buffer.begin() + static_cast<long>(length));
    return all;
}

// Advances time to each next arrival until no frame is left. Returns the received frames with their times.
inline std::vector<std::pair<Time, Frame>> run_dry(Nic& nic, Osal& clock) {
    std::vector<std::pair<Time, Frame>> all;
    for (;;) {
        for (auto& frame : receive_all(nic)) all.emplace_back(clock.now(), std::move(frame));
        if (nic.next_arrival() == kNever) return all;
        clock.wait(nic.next_arrival(), -1);
    }
}

}  // namespace margay
