// The mailbox header (6 octets) and the mailbox error reply (ETG.1000.4 "Mailbox", ETG.1000.6 table "Mailbox error
// reply").
#pragma once

#include "util/bytes.hpp"

#include <margay/mailbox_type.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace margay::wire {

using margay::MailboxType;

inline constexpr std::size_t kMailboxHeaderBytes = 6;
inline constexpr std::uint8_t kLastMailboxCounter = 7;

struct MailboxHeader {
    std::uint16_t length = 0;   // octets of data after the header
    std::uint16_t address = 0;  // station address of the communication partner, 0 for the master
    std::uint8_t channel = 0;   // 6 bits, reserved: 0
    std::uint8_t priority = 0;  // 2 bits
    MailboxType type = MailboxType::error;
    std::uint8_t counter = 0;  // 3 bits: 1 to 7 in turn; 0 when the sender does not use the counter
    friend constexpr bool operator==(const MailboxHeader&, const MailboxHeader&) = default;
};

// Returns the next counter: 1 after 7, and after 0.
[[nodiscard]] constexpr std::uint8_t next_mailbox_counter(std::uint8_t counter) {
    return counter >= kLastMailboxCounter ? std::uint8_t{1} : static_cast<std::uint8_t>(counter + 1);
}

// `at` must have kMailboxHeaderBytes octets.
[[nodiscard]] constexpr MailboxHeader load_mailbox_header(Bytes at) {
    const auto channel = load_le<std::uint8_t>(at, 4);
    const auto type = load_le<std::uint8_t>(at, 5);
    return {.length = load_le<std::uint16_t>(at, 0),
            .address = load_le<std::uint16_t>(at, 2),
            .channel = static_cast<std::uint8_t>(channel & 0x3F),
            .priority = static_cast<std::uint8_t>(channel >> 6),
            .type = static_cast<MailboxType>(type & 0x0F),
            .counter = static_cast<std::uint8_t>((type >> 4) & 7)};
}

constexpr void store_mailbox_header(MutableBytes at, const MailboxHeader& h) {
    store_le<std::uint16_t>(at, 0, h.length);
    store_le<std::uint16_t>(at, 2, h.address);
    store_le<std::uint8_t>(at, 4, static_cast<std::uint8_t>((h.channel & 0x3F) | (h.priority << 6)));
    store_le<std::uint8_t>(at, 5,
                           static_cast<std::uint8_t>((static_cast<unsigned>(h.type) & 0x0F) | ((h.counter & 7u) << 4)));
}

// A whole message: the header, and as many octets of data as the header announces. `from` may be longer. Returns
// nullopt when `from` is shorter than the header announces.
struct MailboxMessage {
    MailboxHeader header;
    Bytes data;
};
[[nodiscard]] constexpr std::optional<MailboxMessage> load_mailbox_message(Bytes from) {
    if (from.size() < kMailboxHeaderBytes) return std::nullopt;
    const auto header = load_mailbox_header(from);
    if (header.length > from.size() - kMailboxHeaderBytes) return std::nullopt;
    return MailboxMessage{header, from.subspan(kMailboxHeaderBytes, header.length)};
}

// Detail code of a mailbox error reply.
enum class MailboxErrorCode : std::uint16_t {
    syntax = 0x0001,
    unsupported_protocol = 0x0002,
    invalid_channel = 0x0003,
    service_not_supported = 0x0004,
    invalid_header = 0x0005,
    size_too_short = 0x0006,
    no_more_memory = 0x0007,
    invalid_size = 0x0008,
    service_in_work = 0x0009,
};

// Data of a message of type error.
struct MailboxErrorLayout {
    using type = Field<std::uint16_t, 0>;  // 1: mailbox command
    using detail = Field<MailboxErrorCode, 2>;
};
inline constexpr std::size_t kMailboxErrorBytes = 4;
inline constexpr std::uint16_t kMailboxErrorTypeCommand = 1;

// Text of a detail code, and the name of a protocol. The strings are static. Callable from any thread and from the
// cycle.
[[nodiscard]] std::string_view to_text(MailboxErrorCode code);
[[nodiscard]] std::string_view to_text(MailboxType type);

}  // namespace margay::wire
