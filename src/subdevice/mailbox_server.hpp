// The door through which a mailbox protocol comes into a device: a server, and one line of a table that names
// it.
#pragma once

#include "wire/mailbox.hpp"

#include <margay/al_state.hpp>
#include <margay/time.hpp>

#include <optional>

namespace margay::subdevice {

// Where replies go. They leave in the order of commit(), each once the master has fetched the one before.
class Outbox {
  public:
    // The data part of the next free slot (the send mailbox without the header), empty while none is free.
    // Nothing is sent before commit(); opening again without it gives the same slot.
    [[nodiscard]] virtual MutableBytes open() = 0;

    // Sends the first `bytes` octets of the slot that open() gave.
    virtual void commit(wire::MailboxType type, std::size_t bytes, std::uint16_t address) = 0;

  protected:
    ~Outbox() = default;
};

// Room for data, header not counted, in the two mailboxes.
struct MailboxRoom {
    std::size_t receive_bytes = 0;  // master to slave
    std::size_t send_bytes = 0;
};

class MailboxServer {
  public:
    // The mailbox works from now on: `state` is PREOP or BOOT. Whatever an earlier master left open is to be
    // forgotten.
    virtual void start(AlState state, const MailboxRoom& room) = 0;

    // AL status tells another state (of PREOP, SAFEOP and OP).
    virtual void state_changed(AlState state) { (void)state; }

    // A message came; its bytes stay until the call returns. At least one slot of the outbox is free. An
    // error code returned is sent as mailbox error reply, and then nothing may have been committed.
    virtual std::optional<wire::MailboxErrorCode> receive(const wire::MailboxMessage& message, Outbox& out,
                                                          Time now) = 0;

    // True while another message cannot be taken: it waits then in the receive mailbox.
    [[nodiscard]] virtual bool busy() const { return false; }

    // Called after receive() and at every step of the device: replies that take their time, messages nobody
    // asked for. Returns when it wants to be called at the latest; slots that become free call it anyway.
    virtual Time step(Outbox& out, Time now) {
        (void)out, (void)now;
        return kNever;
    }

  protected:
    ~MailboxServer() = default;
};

// The table of a device: one line a protocol.
struct MailboxProtocol {
    wire::MailboxType type;
    MailboxServer* server;
    bool in_boot = false;  // also served in BOOT
};

}  // namespace margay::subdevice
