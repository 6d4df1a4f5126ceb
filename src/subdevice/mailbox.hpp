// The mailbox of a device: fetches messages from SM0, hands each to the server of its protocol, and puts
// replies into SM1 in order, repeating the last one when the master asks (ETG.1000.4 "Mailbox", ETG.1000.6
// "Mailbox").
#pragma once

#include "subdevice/esc_access.hpp"
#include "subdevice/mailbox_server.hpp"
#include "wire/sync_manager.hpp"

#include <array>
#include <span>

namespace margay::subdevice {

// Memory of a mailbox. `Bytes` is the largest mailbox of any state, `Slots` the replies that may wait, one of
// which is always the last one fetched, kept to be repeated.
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
        std::uint32_t duplicates = 0;  // requests with the counter of the one before, dropped
        std::uint32_t repeats = 0;     // replies repeated
    };

    // Everything outlives the mailbox.
    template <std::size_t Bytes, std::size_t Slots>
    Mailbox(EscAccess& esc, MailboxMemory<Bytes, Slots>& memory, std::span<const MailboxProtocol> protocols)
        : Mailbox(esc, memory.receive, memory.send, protocols) {}

    // `send` holds as many slots as `receive` fits into it, at least two.
    Mailbox(EscAccess& esc, MutableBytes receive, MutableBytes send, std::span<const MailboxProtocol> protocols)
        : esc_(esc), protocols_(protocols), rx_(receive), tx_(send), slots_(send.size() / receive.size()) {}

    // Do the mailboxes fit the memory, as the sync managers are configured now?
    [[nodiscard]] bool fits();
    // The sync managers are on, and fit.
    void start(AlState state);
    void stop();
    void state_changed(AlState state);

    // Serves both mailboxes. `events` is the AL event request as just read. Returns when it wants to be
    // called at the latest though no event comes.
    Time step(Time now, std::uint32_t events);

    [[nodiscard]] MutableBytes open() override;
    void commit(wire::MailboxType type, std::size_t bytes, std::uint16_t address) override;

    [[nodiscard]] bool running() const { return running_; }
    // The master took a sync manager away, which the state machine may not have seen yet.
    [[nodiscard]] bool sync_manager_lost() const { return lost_; }
    [[nodiscard]] const Counters& counters() const { return counters_; }

  private:
    void watch_repeat();
    void watch_fetched();
    void put_next();
    bool fetch();
    void dispatch(Time now);
    void reply_error(wire::MailboxErrorCode code);
    void forget();
    [[nodiscard]] MailboxServer* server_of(wire::MailboxType type) const;
    [[nodiscard]] bool serves(const MailboxProtocol& line) const { return state_ != AlState::boot || line.in_boot; }
    [[nodiscard]] std::size_t used() const { return kept_ + boxed_ + queued_; }
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
    // The slots in use, from first_ on: kept_ (fetched last), boxed_ (in SM1), queued_.
    std::size_t first_ = 0;
    std::size_t kept_ = 0;
    std::size_t boxed_ = 0;
    std::size_t queued_ = 0;
    std::size_t received_bytes_ = 0;  // in rx_; 0: nothing waits there
    std::uint8_t last_received_ = 0;  // counters
    std::uint8_t last_sent_ = 0;
    bool running_ = false;
    bool silent_ = false;  // the master switched the SMs' PDI interrupts off: poll
    bool lost_ = false;
    Counters counters_;
};

}  // namespace margay::subdevice
