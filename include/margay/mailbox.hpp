// Mailbox messages of any protocol, for gateways and for protocols that the library does not know. The message is what
// follows the mailbox header; the library adds the header with its counter, repeats lost messages, and keeps the order.
//
//     margay::RawMail request;                         // lives in the caller's memory
//     request.slave = 3;
//     request.type = margay::MailboxType::voe;
//     request.message = octets;
//     request.answer = buffer;
//     margay::submit(ctx, request);                    // from any thread, beside the cycle
//
// After a timeout or cancel() the slave may still answer, and the library does not know which message an answer belongs
// to. The next request of this protocol waits for the late answer for 100 ms; after cancel(), until the `timeout` of
// the cancelled request is over (3 s if it is zero). It also fetches the mail that has come since. CoE: the library
// reads an object of its own choice from the slave, as SDO requests do (coe.hpp). An answer of another protocol that
// comes later cannot be distinguished from the answer to the next message: the next request can then succeed with the
// answer to the message before it. So set a `timeout` longer than the slave needs, or let `is_answer` compare the
// octets that a message and its answer have in common.
#pragma once

#include <margay/address.hpp>
#include <margay/borrowed.hpp>
#include <margay/mail_listener.hpp>
#include <margay/request.hpp>

namespace margay {

// Sends a message, receives an answer, or both. Only one RawMail with message and answer, or one transfer of the
// library, uses a protocol of a slave at a time; the others wait. Errors: invalid_argument (the message is longer than
// the mailbox of the slave; neither message nor answer; the protocol is none), mailbox_error (the slave has answered
// with a mailbox error), capacity (the answer is longer than `answer`; expected: its size), timeout, unsupported (the
// slave has no mailbox), wrong_state (the slave has not reached PREOP), unknown_slave (no slave has the number, or the
// slave has another address than `station`; detail: the wanted address, actual: the slave's address) …
struct RawMail : MailRequest {
    RawMail();
    // Any protocol from 1 to 15. A message of the type `error` cannot be sent.
    MailboxType type = MailboxType::voe;
    // The octets behind the mailbox header; empty: nothing is sent. The caller's memory.
    Borrowed<std::byte> message;
    // The address in the mailbox header: 0 is the master; a gateway sets the address of the sender. A slave sends its
    // answer to this address, and the request receives it. Other mail to the address of a slave goes to that slave.
    std::uint16_t address = 0;
    // The station address that the slave must have when the request begins; 0: any. For a thread that has read the
    // facts of the slaves (visit.hpp): after a new scan the number may belong to another slave.
    StationAddress station{};
    // Destination of the answer; empty: the request ends when the slave has accepted the message. Without a message,
    // the request waits for mail of this type that no other request and no listener accepts.
    std::span<std::byte> answer;
    // Decides whether a mail of this type is the answer; nullptr: any mail is. poll() calls the function: it must
    // neither wait nor call the library. A derived class can keep what the function needs. Mail that is not the answer
    // goes to the other requests and to the listeners.
    bool (*is_answer)(const RawMail& request, std::span<const std::byte> mail) = nullptr;
    // Whether more mail of the answer follows this mail without a message (fragments); nullptr: the answer is one mail.
    // Called as is_answer, for mail that is the answer. The function must copy the octets of the mail that it needs,
    // because only the last mail stays in `answer`. The whole answer must arrive within `timeout`; zero: each mail
    // within 3 s after the one before.
    bool (*more_follows)(const RawMail& request, std::span<const std::byte> mail) = nullptr;
    std::size_t bytes = 0;  // result: size of the last mail of the answer in octets
};

// Submits a RawMail and waits for it. Returns the size of the answer. `timeout` zero: 3 s. Errors as of RawMail.
Result<std::size_t> raw_mail(Context& ctx, std::uint16_t slave, MailboxType type, std::span<const std::byte> message,
                             std::span<std::byte> answer, Duration timeout = Duration{0});

}  // namespace margay
