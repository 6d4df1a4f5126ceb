// The mailbox of the slave at the level of its SyncManagers: single messages with chosen headers, and a record of
// everything in the slave's messages that the standard does not allow.
#pragma once

#include "subdevice_check/bench.hpp"
#include "wire/mailbox.hpp"

#include <set>

namespace margay::samples::conformance {

struct Mail {
    wire::MailboxHeader header{};
    std::vector<std::byte> data{};  // as long as the header says; empty when that is more than the mailbox has
    std::vector<std::byte> raw{};   // the whole mailbox
};

// The faults of messages of the slave, during the whole run.
enum class Oddity : std::uint8_t {
    counter_zero,        // the counter of a message is 0
    counter_order,       // it does not follow that of the message before
    too_long,            // the length in the header is larger than the mailbox
    too_short,           // shorter than the header of its protocol
    surplus,             // longer than its content
    other_station,       // the address is not that of the request
    unasked_reply,       // a reply that no request asked for
    protocol_unknown,    // a protocol that the SII does not announce
    repeated_emergency,  // the same emergency again, without a new cause
    channel,             // the channel of a message is not 0
    coe_number,          // the number in a CoE header is not 0, and the message is no PDO
    reserved_bit,        // bit 7 of the octet with type and counter is not 0
    complete_bit,        // the bit Complete Access of an SDO response is not that of the request
    abort_service,       // an abort of an SDO is no SDO request by its CoE header
};
inline constexpr std::size_t kOddities = 14;

class MailBench {
  public:
    explicit MailBench(Bench& bench) : bench_(bench) {}

    [[nodiscard]] Bench& bench() { return bench_; }
    // Throws NotJudged when the slave has no mailbox, when no frame can carry its mailboxes, or when an earlier check
    // has found that it does not answer.
    void needs_mailbox();
    void needs_protocol(std::uint16_t protocol, std::string_view name);
    void set_dead(std::string why) { dead_ = std::move(why); }
    [[nodiscard]] bool dead() const { return !dead_.empty(); }

    // The slave has left INIT: its mailboxes are empty, and its counter starts again.
    void restarted();

    [[nodiscard]] std::size_t out_bytes() const { return bench_.slave().mailbox.out_bytes; }
    [[nodiscard]] std::size_t in_bytes() const { return bench_.slave().mailbox.in_bytes; }
    // The counter of the next message; send() uses it when the header has none.
    [[nodiscard]] std::uint8_t next_counter();

    // Writes a message as it is, whatever its header says, if the slave's mailbox takes it now. False: it was full.
    [[nodiscard]] bool try_put(const wire::MailboxHeader& header, Bytes data);
    // The same with the counter and the length that belong to it; waits while the mailbox is full.
    void put(wire::MailboxType type, Bytes data);
    // The next message of the slave, whatever it is; nullopt after `patience`.
    [[nodiscard]] std::optional<Mail> take(Duration patience);
    // Reads everything that waits in the slave, as messages that no check asked for. Returns how many there were.
    std::size_t drain(Duration quiet);

    // A message, and the reply for which `is_reply` returns true. Other messages are recorded. Throws NotJudged when
    // there is none.
    [[nodiscard]] Mail ask(wire::MailboxType type, Bytes data, const std::function<bool(const Mail&)>& is_reply);
    // The same; nullopt when there is no reply. A message with the address of another station is no reply.
    [[nodiscard]] std::optional<Mail> ask_if(wire::MailboxType type, Bytes data,
                                             const std::function<bool(const Mail&)>& is_reply, Duration patience);

    // A request that every slave with this protocol answers, for checks of the mailbox itself.
    struct Ping {
        wire::MailboxType type{};
        std::vector<std::byte> data{};
    };
    [[nodiscard]] Ping ping() const;
    [[nodiscard]] bool answers_ping(const Mail& mail) const;
    // Sends the ping and waits for its reply.
    bool ping_works(Duration patience);

    // A message that no check asked for.
    void unasked(const Mail& mail);
    void note(Oddity oddity, std::string example);

    struct Record {
        std::size_t count = 0;
        std::string example{};
    };
    [[nodiscard]] const Record& record(Oddity oddity) const { return records_[static_cast<std::size_t>(oddity)]; }
    // The longest time from a message to its reply.
    [[nodiscard]] Duration slowest_reply() const { return slowest_reply_; }
    [[nodiscard]] bool any_reply() const { return replies_ != 0; }
    // Of the whole run.
    [[nodiscard]] std::size_t messages() const { return messages_; }
    [[nodiscard]] std::size_t emergencies() const { return emergency_count_; }
    // Why the last ask_if() had no reply: the last message that it did not take as the reply, if there was one.
    [[nodiscard]] std::string no_reply_text() const;

    // Time that a slave may take for a reply, and to take a message (ETG.2000, defaults of the ESI element
    // Mailbox/Timeout).
    static constexpr Duration kResponse = std::chrono::seconds(2);
    static constexpr Duration kRequest = std::chrono::milliseconds(100);

  private:
    void judge(const Mail& mail);

    Bench& bench_;
    std::string dead_;
    std::uint8_t counter_ = 0;
    std::optional<std::uint8_t> last_received_;
    std::array<Record, kOddities> records_{};
    std::set<std::string> emergencies_;  // hexadecimal; since the mailboxes are new, or an error reset
    std::optional<Mail> other_;          // came in the place of a reply
    std::size_t messages_ = 0;
    std::size_t replies_ = 0;
    std::size_t emergency_count_ = 0;
    Duration slowest_reply_{};
};

[[nodiscard]] std::string hex(Bytes octets, std::size_t most = 16);

}  // namespace margay::samples::conformance
