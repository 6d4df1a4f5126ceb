// Vendor specific profile over EtherCAT (VoE, ETG.1000.6 "Vendor specific protocol"): messages with the ID of a vendor
// and a type that the vendor chooses. VoE has no answers: master and slave send messages independently of each other.
//
//     std::array<std::byte, 2048> memory;
//     margay::VoeInbox inbox(memory);                  // collects the messages of the slave
//     inbox.only_slave = 3;
//     inbox.vendor_id = 0x1234;
//     inbox.look_every = std::chrono::milliseconds(5);
//     margay::listen(ctx, inbox);
//     margay::VOEsend(ctx, 3, {.vendor_id = 0x1234, .vendor_type = 1}, octets);          // waits
//     const auto answer = margay::VOEreceive(ctx, inbox, buffer);                        // waits
//     while (auto message = inbox.take(buffer)) use(*message, buffer);                   // from the cycle
#pragma once

#include <margay/borrowed.hpp>
#include <margay/detail/octet_ring.hpp>
#include <margay/mail_listener.hpp>
#include <margay/request.hpp>

#include <atomic>
#include <optional>

namespace margay {

struct VoeHeader {
    std::uint32_t vendor_id = 0;
    std::uint16_t vendor_type = 0;
    friend constexpr bool operator==(const VoeHeader&, const VoeHeader&) = default;
};

// A received message.
struct VoeMessage {
    std::uint16_t slave = 0;
    VoeHeader header;
    std::size_t bytes = 0;  // size of the data; a buffer that is smaller contains the first octets
    Time at{};              // when the master has fetched the message
};

// Sends a message. Success: the mailbox of the slave has accepted it. Errors: invalid_argument (the data is longer than
// the mailbox of the slave), unsupported (no VoE), timeout, mailbox_full …
struct VoeSend : MailRequest {
    VoeSend();
    VoeHeader header;
    Borrowed<std::byte> data;  // the caller's memory
};

// The messages that slaves have sent, in memory of the caller, oldest first. A program may have any number of inboxes:
// a message goes to the first one, in the order of listen(), that accepts its slave, vendor and type. When the memory
// is full, new messages are dropped and counted.
//
// Threads: poll() writes. One other thread may read (take(), empty()). `lost()` and `count()` from any thread.
class VoeInbox final : public MailListener {
  public:
    // A message needs 20 octets of the memory beside its data.
    explicit VoeInbox(std::span<std::byte> memory) : MailListener(MailboxType::voe), ring_(memory) {}

    // The messages that the inbox accepts; empty: any.
    std::optional<std::uint32_t> vendor_id;
    std::optional<std::uint16_t> vendor_type;

    // Removes the oldest message and copies its data to `into`, as far as it fits. Callable from the cycle.
    std::optional<VoeMessage> take(std::span<std::byte> into);
    [[nodiscard]] bool empty() const { return ring_.empty(); }

    // Messages that were dropped because the memory was full.
    [[nodiscard]] std::uint32_t lost() const { return lost_.load(std::memory_order_relaxed); }
    // Messages that were received, the lost ones included.
    [[nodiscard]] std::uint32_t count() const { return count_.load(std::memory_order_relaxed); }

  private:
    bool take(const UnaskedMail& mail) override;

    OctetRing ring_;
    std::atomic<std::uint32_t> lost_{0};
    std::atomic<std::uint32_t> count_{0};
};

// Waits for the next message in an inbox, and takes it. A message that is in the inbox already ends the request at
// once. While the request waits, it looks for mail of the slave of the inbox once a millisecond. For an inbox of all
// slaves, it looks for mail of one slave with VoE after the other. The inbox must not be destroyed meanwhile, and no
// thread may take messages from it. `timeout` zero: no limit. Errors: invalid_argument (no inbox, or it does not listen
// in this context), timeout, capacity (the message is longer than `data`, and `message.bytes` is its size; the octets
// that do not fit are lost), mailbox_closed (unlisten() was called).
struct VoeReceive : Request {
    VoeReceive();
    VoeInbox* inbox = nullptr;
    std::span<std::byte> data;  // the caller's memory
    VoeMessage message;         // result
};

// Submit the request of the same name and wait for it.
Result<> VOEsend(Context& ctx, std::uint16_t slave, const VoeHeader& header, std::span<const std::byte> data,
                 Duration timeout = Duration{0});
Result<VoeMessage> VOEreceive(Context& ctx, VoeInbox& inbox, std::span<std::byte> into,
                              Duration timeout = std::chrono::seconds(3));

}  // namespace margay
