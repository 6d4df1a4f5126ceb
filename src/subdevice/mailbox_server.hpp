// The interface for mailbox protocols of a device: a protocol is a MailboxServer and one line in the table of
// MailboxProtocol.
#pragma once

#include "wire/mailbox.hpp"

#include <margay/al_state.hpp>
#include <margay/time.hpp>

#include <optional>

namespace margay::subdevice {

// Accepts replies. They are sent in the order of commit(); each is written to the send mailbox after the master has
// read the previous one.
class Outbox {
  public:
    // Returns the data part of the next free slot (the send mailbox without its header), or an empty span while no slot
    // is free. Nothing is sent before commit(); a second open() before commit() returns the same slot.
    [[nodiscard]] virtual MutableBytes open() = 0;

    // Sends the first `bytes` octets of the slot that open() returned. When a function of the author has ended the
    // mailbox during this call of the server, the octets are dropped.
    virtual void commit(wire::MailboxType type, std::size_t bytes, std::uint16_t address) = 0;

  protected:
    ~Outbox() = default;
};

// Size of the data (without the mailbox header) in the two mailboxes.
struct MailboxRoom {
    std::size_t receive_bytes = 0;  // master to slave
    std::size_t send_bytes = 0;
};

class MailboxServer {
  public:
    // The mailbox works from now on; `state` is PREOP or BOOT. The server must discard unfinished transfers of an
    // earlier master.
    virtual void start(AlState state, const MailboxRoom& room) = 0;

    // The mailbox has stopped (the device goes to INIT). The server must end unfinished transfers.
    virtual void stop() {}

    // AL status reports a new state (PREOP, SAFEOP or OP).
    virtual void state_changed(AlState state) { (void)state; }

    // A message arrived; its octets are valid until the call returns. At least one slot of the outbox is free. A
    // returned error code is sent as mailbox error reply; in this case the server must not have called commit().
    virtual std::optional<wire::MailboxErrorCode> receive(const wire::MailboxMessage& message, Outbox& out,
                                                          Time now) = 0;

    // True while the server cannot accept another message. Messages for other servers are passed on in the meantime
    // when a slot of the outbox can keep the message; with MailboxMemory of two slots they wait.
    [[nodiscard]] virtual bool busy() const { return false; }

    // Called after receive() and in every step of the device, for delayed replies and unsolicited messages. Returns the
    // latest time for the next call. It is also called when a slot becomes free.
    virtual Time step(Outbox& out, Time now) {
        (void)out, (void)now;
        return kNever;
    }

  protected:
    ~MailboxServer() = default;
};

// A device has a table of these lines, one for each protocol.
struct MailboxProtocol {
    wire::MailboxType type;
    MailboxServer* server;
    bool in_boot = false;  // the protocol is also available in BOOT
};

}  // namespace margay::subdevice
