// Mail that no request waits for: a slave sends it on its own (a notification, a PDO by mailbox, a VoE message), or it
// is the late answer to a request that was given up. A listener receives such mail of one slave, or of all slaves, and
// of one protocol.
//
//     struct Homed final : margay::SoeListener {
//         void notified(std::uint16_t slave, const margay::SoeNotification& notification) override { … }
//     };
//     Homed homed;                                     // lives in the caller's memory
//     homed.only_slave = 2;
//     homed.look_every = std::chrono::milliseconds(5);
//     margay::listen(ctx, homed);
//
// The protocols have listeners of their own: MailPdoListener (coe.hpp), SoeListener (soe.hpp), VoeInbox (voe.hpp),
// AoeListener (aoe.hpp). Emergencies go to emergencies() only. Mail that no listener takes is counted as unexpected
// (mailbox_statistics()). A listener of type `error` gets the mailbox errors that are probably not the answer to a
// waiting request.
#pragma once

#include <margay/detail/list.hpp>
#include <margay/mailbox_type.hpp>
#include <margay/result.hpp>
#include <margay/time.hpp>

#include <cstddef>
#include <cstdint>
#include <span>

namespace margay {

class Context;
class Mailboxes;

struct UnaskedMail {
    std::uint16_t slave = 0;
    MailboxType type{};
    std::span<const std::byte> data;  // behind the mailbox header; valid until take() returns
    Time at{};                        // when the master fetched it
};

// The base of all listeners. The members may be changed while the object does not listen.
class MailListener : private ListNode {
  public:
    // The number of the slave; 0: all slaves. A listener stays after a scan, and then listens to the slave that has
    // the number.
    std::uint16_t only_slave = 0;
    // How often the library looks for mail of the slave while no request waits for an answer. Zero: the listener gets
    // only mail that is found by other means (requests, watch_mailboxes()). The library looks by a datagram of 3
    // octets, and sends none while the mapped mailbox status bit of the slave (SlaveConfiguration::mailbox_status)
    // reports no mail. These datagrams and the mail are acyclic datagrams: during a cycle they use the budget of the
    // group (GroupConfiguration::acyclic_bytes), and a slave has at most one of them on the wire. So a slave that
    // always has mail delays neither process data nor other slaves for longer than one message.
    Duration look_every{0};

    MailListener(const MailListener&) = delete;
    MailListener& operator=(const MailListener&) = delete;

    [[nodiscard]] MailboxType type() const { return type_; }
    [[nodiscard]] bool listening() const { return mailboxes_ != nullptr; }

  protected:
    explicit MailListener(MailboxType type) : type_(type) {}
    // Ends the listening. For the thread that owns the context, or after the end of the context.
    ~MailListener();

    // Called by poll() for each mail of this slave and type. Returns whether the listener accepts the mail; if not, the
    // next listener is called, in the order of listen(). The function must not wait; an exception that leaves it ends
    // the program. It may submit requests, and listeners may be added (they get later mail), removed and destroyed.
    virtual bool take(const UnaskedMail& mail) = 0;

  private:
    friend class Mailboxes;
    template <class T>
    friend class List;

    Mailboxes* mailboxes_ = nullptr;
    Time look_at_{};
    MailboxType type_;
};

// Starts listening. For the owner, also in a callback; before the first scan too. Errors: not_owner, wrong_state before
// init(), busy (the object listens already), invalid_argument (`look_every` is negative, or the type is above 15),
// unknown_slave (more than Limits::slaves), capacity (no memory to look regularly).
Result<> listen(Context& ctx, MailListener& listener);

// Ends listening; an object that does not listen here is ignored. For the owner, also in a callback. Errors: not_owner.
Result<> unlisten(Context& ctx, MailListener& listener);

}  // namespace margay
