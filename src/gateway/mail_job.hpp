// A message of a client as a request of the library, and the mail that answers it.
#pragma once

#include "gateway/frame.hpp"
#include "gateway/slave_table.hpp"
#include "gateway/transaction.hpp"

#include <margay/detail/octet_ring.hpp>
#include <margay/mailbox.hpp>

#include <atomic>
#include <optional>

namespace margay::gateway {

class Client;

[[nodiscard]] Rooms rooms_of(const SlaveFacts& slave);

class MailJob final : public RawMail {
  public:
    // Sends the message of a client.
    MailJob(const SlaveFacts& slave, Mail mail, const Transaction& transaction, Client& client);
    // Sends no message. Accepts the mail of this protocol that no exchange and no listener accepts.
    MailJob(const SlaveFacts& slave, MailboxType protocol);

    // The mail before the last mail, in the order of arrival. Callable also while the request is busy.
    [[nodiscard]] std::optional<Octets> earlier();
    // After success: the last mail; empty: the message is not answered.
    [[nodiscard]] Bytes last() const { return Bytes(answer_).first(std::min(bytes, answer_.size())); }
    // Whether earlier mail was lost, because the thread of the gateway has not removed it in time.
    [[nodiscard]] bool lost() const { return lost_.load(std::memory_order_acquire); }

    Mail mail{};
    Transaction transaction{};
    Rooms rooms{};
    Client* client = nullptr;  // nullptr: the client has closed its connection
    Moment begun{};
    bool again = false;  // submitted for the second time, with newer facts of the slaves

  private:
    void take(const SlaveFacts& slave, std::size_t ring_bytes);
    void keep(Bytes earlier) const;

    Octets answer_{};
    mutable Octets memory_{};
    mutable std::optional<OctetRing> ring_{};
    mutable std::atomic<bool> lost_{false};
};

}  // namespace margay::gateway
