// The datagram of a cycle that carries the time of the reference clock.
#pragma once

#include "network/process_data.hpp"

namespace margay {

// The datagram of the time as it is sent: the reference may have changed, or be lost, since the frames were built.
struct SentTime {
    static constexpr std::size_t kAddress = 2;  // in the header, behind command and index
    wire::Command command{};
    std::array<std::byte, 4> address{};
    std::array<std::byte, 8> data{};
    std::uint16_t standby = 0;
    bool known = false;
};

// For frames that are built again: what the old ones send, and that the new ones send the same.
[[nodiscard]] SentTime sent_time(ProcessGroup& group);
void send_time_as(ProcessGroup& group, const SentTime& sent);

}  // namespace margay
