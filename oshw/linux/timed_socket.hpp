// A packet socket whose frames leave at a time (SO_TXTIME): it only sends, through the queueing discipline of the
// interface, which holds the frames (qdisc.hpp).
#pragma once

#include "oshw/linux/qdisc.hpp"

#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

class TimedSocket {
  public:
    TimedSocket() noexcept = default;
    ~TimedSocket() { close(); }
    TimedSocket(const TimedSocket&) = delete;
    TimedSocket& operator=(const TimedSocket&) = delete;

    // Opens it in the network namespace of the calling thread. Returns the refused step, and errno has the reason;
    // empty: success. Not callable from the cycle.
    [[nodiscard]] std::string_view open(int interface_index, const TimedWay& way, unsigned priority) noexcept;
    void close() noexcept;
    [[nodiscard]] bool is_open() const noexcept { return socket_ >= 0; }
    [[nodiscard]] int handle() const noexcept { return socket_; }

    // Whether the time has passed, or is so near that the frame would be too late for the queueing discipline.
    [[nodiscard]] bool is_late(Time at) const noexcept;
    // One system call. False: errno says why.
    [[nodiscard]] bool send(std::span<const std::byte> frame, Time at) noexcept;

    // Counts the frames that the queueing discipline has dropped, from a message of the error queue of the socket.
    // False: the message is no such report.
    bool take_report(const void* control_message) noexcept;
    [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

  private:
    int socket_ = -1;
    std::int32_t clock_ = 0;
    Duration early_{0};
    std::uint64_t dropped_ = 0;
};

}  // namespace margay
