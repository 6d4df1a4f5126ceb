// The rules of the mailbox protocols for the gateway: which messages of a client are answered, which mail is the
// answer, and whether the conversation continues after it. Independent of bus and time.
#pragma once

#include "wire/mailbox.hpp"

#include <cstdint>

namespace margay::gateway {

// Octets of data in a message, mailbox header not counted.
struct Rooms {
    std::size_t to_slave = 0;
    std::size_t from_slave = 0;
};

// One message of a client, and the kind of answer that it has.
struct Transaction {
    enum class Kind : std::uint8_t {
        refused,     // the gateway answers with `refusal`
        unanswered,  // the slave sends no reply
        answered,
        listening,  // whether and how often the slave answers is not known (VoE)
    };
    Kind kind = Kind::refused;
    wire::MailboxErrorCode refusal{};
    wire::MailboxType type{};
    bool changes = false;  // it may change the slave
    // An SDO download, which may be refused by an abort.
    bool download = false;
    // Parts of the message: its service, opcode, command or type; its specifier or opcode; its index, IDN or number.
    std::uint16_t service = 0;
    std::uint8_t specifier = 0;
    std::uint32_t object = 0;
    std::uint32_t invoke_id = 0;
    // For an unanswered message: whether the conversation continues.
    bool goes_on = false;
};

// `over`: the slave has sent the last packet of a file in this conversation, so that the acknowledgement is not
// answered.
[[nodiscard]] Transaction transaction_of(wire::MailboxType type, Bytes data, bool over);

// Whether mail of the slave is the answer.
[[nodiscard]] bool answers(const Transaction& message, Bytes mail);
// Whether the answer continues with another mail, without a message of the client.
[[nodiscard]] bool more_follows(const Transaction& message, Bytes mail);

// Whether the client will send another message that belongs to this one, for example the next segment. `data` is the
// message of the client.
[[nodiscard]] bool goes_on(const Transaction& message, Bytes data, Bytes answer, const Rooms& rooms);
// Whether this mail has the last packet of a file.
[[nodiscard]] bool ends_file(const Transaction& message, Bytes answer, const Rooms& rooms);

}  // namespace margay::gateway
