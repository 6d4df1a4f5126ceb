// The mailbox of a device. It reads messages from SM0, passes each message to the server of its protocol, and writes
// the replies into SM1 in order. It repeats the last reply when the master requests a repeat (ETG.1000.4 "Mailbox",
// ETG.1000.6 "Mailbox").
#pragma once

#include "subdevice/esc_access.hpp"
#include "subdevice/mailbox_server.hpp"
#include "wire/sync_manager.hpp"

#include <array>
#include <span>

namespace margay::subdevice {

// Memory of a mailbox. `Bytes` is the size of the largest mailbox of any state. `Slots` is the number of stored
// replies; one slot always keeps the reply that the master read last, for a repeat. With three slots and more, one slot
// can keep a request whose server is busy, so that the other servers go on.
template <std::size_t Bytes, std::size_t Slots>
struct MailboxMemory {
    static_assert(Slots >= 2, "one reply is kept for repetition, so that one slot would never be free");
    std::array<std::byte, Bytes> receive{};
    std::array<std::byte, Bytes * Slots> send{};
};

class Mailbox final : public Outbox {
  public:
    struct Counters {
        std::uint32_t received = 0;
        std::uint32_t sent = 0;
        std::uint32_t errors = 0;      // error replies
        std::uint32_t duplicates = 0;  // discarded requests that had the same counter as the previous request
        std::uint32_t repeats = 0;     // repeated replies
    };

    // All arguments must outlive the mailbox.
    template <std::size_t Bytes, std::size_t Slots>
    Mailbox(EscAccess& esc, MailboxMemory<Bytes, Slots>& memory, std::span<const MailboxProtocol> protocols)
        : Mailbox(esc, memory.receive, memory.send, protocols) {}

    // `send` must have room for at least two slots of the size of `receive`.
    Mailbox(EscAccess& esc, MutableBytes receive, MutableBytes send, std::span<const MailboxProtocol> protocols)
        : esc_(esc), protocols_(protocols), rx_(receive), tx_(send), slots_(send.size() / receive.size()) {}

    // Reads the settings of both sync managers. True: they fit into the memory.
    [[nodiscard]] bool fits();
    // Precondition: fits() was true, and the sync managers are activated. When the master has changed them since then,
    // the mailbox does not run, and sync_manager_lost() is true.
    void start(AlState state);
    void stop();
    void state_changed(AlState state);

    // Serves both mailboxes. `events` is the value just read from the AL event request. Returns the latest time for the
    // next call; call it earlier when an AL event occurs.
    Time step(Time now, std::uint32_t events);

    [[nodiscard]] MutableBytes open() override;
    void commit(wire::MailboxType type, std::size_t bytes, std::uint16_t address) override;

    // The AL events that step() needs now: SM0 unless no message can be taken (its event stays active until the message
    // is read), SM1 while a reply waits for the master (its event stays active until the next reply is written).
    [[nodiscard]] std::uint32_t events() const;

    [[nodiscard]] bool running() const { return running_; }
    // The master has deactivated a sync manager, or changed its place or size. The state machine may not have noticed
    // it yet.
    [[nodiscard]] bool sync_manager_lost() const { return lost_; }
    [[nodiscard]] const Counters& counters() const { return counters_; }

  private:
    void watch_repeat();
    void watch_fetched();
    void put_next();
    bool fetch();
    void deliver(Time now);
    void dispatch(Time now);
    void park();
    void pass_on(MutableBytes message, MailboxServer* server, Time now);
    void reply_error(wire::MailboxErrorCode code, Bytes request);
    void forget();
    [[nodiscard]] MailboxServer* server_of(wire::MailboxType type) const;
    [[nodiscard]] bool serves(const MailboxProtocol& line) const {
        return running_ && (state_ != AlState::boot || line.in_boot);
    }
    [[nodiscard]] std::size_t used() const { return kept_ + boxed_ + queued_; }
    [[nodiscard]] bool full() const { return used() + (parked_bytes_ != 0 ? 1 : 0) == slots_; }
    [[nodiscard]] MutableBytes slot(std::size_t n) const {
        return tx_.subspan((first_ + n) % slots_ * rx_.size(), rx_.size());
    }
    [[nodiscard]] std::uint8_t status(unsigned sync_manager);

    EscAccess& esc_;
    std::span<const MailboxProtocol> protocols_;
    MutableBytes rx_;
    MutableBytes tx_;
    std::size_t slots_;
    wire::SyncManager receive_{};
    wire::SyncManager send_{};
    AlState state_ = AlState::init;
    // The used slots in order, from first_ on: kept_ (read by the master last), boxed_ (in SM1), queued_.
    std::size_t first_ = 0;
    std::size_t kept_ = 0;
    std::size_t boxed_ = 0;
    std::size_t queued_ = 0;
    std::size_t received_bytes_ = 0;  // octets of the message in rx_; 0: no message
    // Octets of the message in the last free slot, which waits until its server is not busy; 0: no message.
    std::size_t parked_bytes_ = 0;
    std::uint8_t last_received_ = 0;  // mailbox counters of the last messages
    std::uint8_t last_sent_ = 0;
    bool running_ = false;
    bool silent_ = false;  // the master disabled the PDI interrupts of the sync managers, so the stack polls them
    // This step reads the status of SM0, because a message has arrived or its event is switched off.
    bool looks_ = false;
    bool repeated_ = false;  // SM1 was emptied and written again; the next step checks that it contains the reply
    bool lost_ = false;
    Counters counters_;
};

}  // namespace margay::subdevice
