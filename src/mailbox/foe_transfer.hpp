// Reading and writing of a file by the client, independent of the bus: the next message, and the meaning of a reply
// (ETG.1000.6 "File access over EtherCAT").
//
// Packets. The first packet has the number 1; a packet that is not full, also one of 0 octets, is the last one. The
// number has 32 bits. Some slaves count with 16 bits, so a number that fits 16 bits is compared with the lower half of
// the expected number.
//
// Repetitions. A busy slave answers "busy", and the client sends its last message again. Some slaves then answer twice,
// once when they are no longer busy and once to the repeated message. So a reply to one of the last messages is
// ignored; only a reply that cannot be such a reply ends the transfer. A second answer may also come after the
// transfer: the next transfer waits for it (foe.cpp).
//
// Late replies. While a reply to an earlier transfer may come, a file of one packet is read again, and the request of a
// write is sent again: see asks_again().
//
// Hostile slaves. At most one packet of the size of the mailbox is stored of the octets that a slave sends. Ignored
// mail does not prolong the wait for an answer, and foe.cpp limits how long a slave may be busy.
#pragma once

#include "mailbox/exchange.hpp"
#include "wire/foe.hpp"

#include <margay/foe.hpp>

#include <array>
#include <utility>

namespace margay {

struct FoeAccess {
    static void set_bytes(FoeRequest& request, std::size_t bytes) {
        request.bytes_.store(bytes, std::memory_order_relaxed);
    }
    static void set_text(FoeRequest& request, Bytes text);
};

class FoeTransfer : public MailClient {
  public:
    static constexpr std::size_t kAbortBytes = 14;

    // Moves content between the packet and the application. False: the application is not ready; try again later. May
    // end the transfer.
    [[nodiscard]] virtual bool prepare() = 0;
    std::size_t compose(MutableBytes data) final;
    Taken accept(const wire::MailboxMessage& mail) final;

    // False: the message that compose() writes now ends the transfer in the slave, which does not reply to it. When it
    // has been sent, call finish(). The transfer may then begin again.
    [[nodiscard]] bool awaits_reply() const { return phase_ != Phase::farewell; }
    void finish() { phase_ = std::exchange(begins_again_, false) ? Phase::request : Phase::over; }
    // The last reply was "busy": send the message again after a while.
    [[nodiscard]] bool is_busy() const { return busy_; }
    [[nodiscard]] bool over() const { return phase_ == Phase::over; }
    // The error without slave and step; code none on success.
    [[nodiscard]] const Error& error() const { return error_; }
    // Call it when a message is sent again: the slave may answer it twice, and the second answer may come after the
    // transfer.
    void repeats() { repeated_ = true; }
    [[nodiscard]] bool has_repeated() const { return repeated_; }
    // `late`: how many earlier requests there are whose late replies may be the first replies to this transfer.
    void doubt(unsigned late) {
        if (!std::exchange(doubtful_, true)) late_ = late;
    }
    // After a transfer that has not ended well: how many first replies may still come, to earlier requests or to the
    // request of this transfer.
    [[nodiscard]] unsigned late() const { return late_ - (overtaken_ ? 1U : 0U); }
    // Call it for mail of the slave that no exchange has accepted.
    void overhear(Bytes data);
    // Whether the reply to the next message looks like the first reply to another transfer. The acknowledgement of
    // packet 1 does not: before packet 1, a write sends its request once for each acknowledgement that may be late.
    [[nodiscard]] bool is_like_first() const {
        const std::uint32_t first = answer_ == wire::foe::Opcode::data ? 1 : 0;
        return phase_ == Phase::request || (number_ & 0xFFFF) <= first;
    }
    // Whether an error message must be sent to the slave, because the transfer has ended early.
    [[nodiscard]] bool must_abort() const { return slave_open_; }
    [[nodiscard]] std::array<std::byte, kAbortBytes> abort_message() const;
    [[nodiscard]] FoeRequest& request() const { return request_; }

  protected:
    // request: the first message; packets: data is transferred; farewell: the message that ends it in the slave.
    enum class Phase : std::uint8_t { request, packets, farewell, over };

    // `packet`: memory for the data of one packet; both outlive the transfer.
    FoeTransfer(FoeRequest& request, wire::foe::Opcode asks, wire::foe::Opcode answer, MutableBytes packet)
        : request_(request), packet_(packet), asks_(asks), answer_(answer) {}
    ~FoeTransfer() = default;

    virtual std::size_t compose_packet(MutableBytes data) = 0;
    virtual void read_answer(Bytes body) = 0;
    [[nodiscard]] virtual std::size_t total() const = 0;
    void fail(const Error& error, wire::foe::ErrorCode said = wire::foe::ErrorCode::undefined);
    void report_progress(FoeProgress progress);

    FoeRequest& request_;
    MutableBytes packet_;
    std::size_t filled_ = 0;    // octets of the packet
    std::size_t done_ = 0;      // octets transferred and acknowledged
    std::uint32_t number_ = 0;  // of the packet that the next reply contains or acknowledges
    std::uint32_t heard_ = 0;   // the number in the last reply, as the slave counts
    Phase phase_ = Phase::request;
    bool slave_open_ = false;
    unsigned late_ = 0;          // how many of the next first replies may be late ones
    bool begins_again_ = false;  // the transfer begins again after the farewell
    bool asked_again_ = false;   // more than one reply to the request may come

  private:
    [[nodiscard]] bool is_answered(std::uint32_t number) const;
    [[nodiscard]] bool is_old(std::uint32_t number) const;
    [[nodiscard]] bool is_first_again(std::uint32_t number) const;
    void end_out_of_order(std::uint32_t number);
    Taken end_by_slave(Bytes data);
    Taken wait_for_slave(Bytes data);

    wire::foe::Opcode asks_;
    wire::foe::Opcode answer_;
    // The error code with which the client has ended the transfer.
    wire::foe::ErrorCode said_ = wire::foe::ErrorCode::undefined;
    bool busy_ = false;
    bool repeated_ = false;
    bool doubtful_ = false;
    bool overtaken_ = false;  // two first replies have come: one was late, and the other one may be late, too
    Error error_;
};

class FoeReadTransfer final : public FoeTransfer {
  public:
    // `sink` outlives the transfer. Without a sink in the request, it is a MemorySink.
    FoeReadTransfer(FoeRead& request, ByteSink& sink, MutableBytes packet);
    [[nodiscard]] bool prepare() override;

  private:
    std::size_t compose_packet(MutableBytes data) override;
    void read_answer(Bytes body) override;
    [[nodiscard]] bool asks_again();
    [[nodiscard]] std::size_t total() const override { return 0; }

    ByteSink& sink_;
    std::size_t pushed_ = 0;  // octets of the packet that the sink has accepted
    bool to_memory_;          // `sink` is the memory of the request
    bool fresh_ = false;      // the packet has not been pushed as a whole
};

class FoeWriteTransfer final : public FoeTransfer {
  public:
    // `source` outlives the transfer.
    FoeWriteTransfer(FoeWrite& request, ByteSource& source, MutableBytes packet);
    [[nodiscard]] bool prepare() override;

  private:
    std::size_t compose_packet(MutableBytes data) override;
    void read_answer(Bytes body) override;
    [[nodiscard]] std::size_t total() const override { return total_; }

    [[nodiscard]] bool asks_again();

    ByteSource& source_;
    std::size_t total_;
    bool pulled_ = false;  // the source has been asked
    bool at_end_ = false;  // the source has given its last octet
};

// A source and a sink in memory.
class MemorySource final : public ByteSource {
  public:
    explicit MemorySource(Bytes content) : left_(content) {}
    Piece pull(MutableBytes into) override;

  private:
    Bytes left_;
};
class MemorySink final : public ByteSink {
  public:
    static constexpr std::uint32_t kFull = 0xFFFF'FFFF;
    explicit MemorySink(MutableBytes memory) : left_(memory) {}
    Taken push(Bytes octets) override;

  private:
    MutableBytes left_;
};

}  // namespace margay
