// EtherCAT frames of type 5, as clients send and get them: the frame header, then mailbox messages.
#pragma once

#include "wire/ethernet.hpp"
#include "wire/mailbox.hpp"

#include <optional>
#include <vector>

namespace margay::gateway {

using Octets = std::vector<std::byte>;

inline constexpr std::uint8_t kFrameTypeMailbox = 5;
inline constexpr std::size_t kMostFrameBytes = 0x07FF;  // the length has 11 bits
inline constexpr std::size_t kMostDataBytes = kMostFrameBytes - wire::kMailboxHeaderBytes;

// A mailbox message. `complete` is false when the frame has ended before the end that the header announces.
struct Mail {
    wire::MailboxHeader header;
    Octets data{};
    bool complete = true;
};

// The octets of the first frame, header included; 0: more octets are needed to know them. nullopt: this is no frame of
// a mailbox gateway.
[[nodiscard]] std::optional<std::size_t> frame_bytes(Bytes from);

// The messages of one complete frame. Octets at the end that are shorter than a mailbox header are padding.
[[nodiscard]] std::vector<Mail> messages_of(Bytes frame);

// A frame with one message. `data` has at most kMostDataBytes octets; the length in `header` is not used.
[[nodiscard]] Octets frame_of(wire::MailboxHeader header, Bytes data);

}  // namespace margay::gateway
