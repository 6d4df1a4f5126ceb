// Reads and writes of parameters from the client's side, without a bus: which message comes next, and what a reply
// means (ETG.1000.6 "Servo drive profile over EtherCAT": read, write, their fragments).
//
// What does not fit the transfer is left alone (a notification, a late reply to another request); what belongs to it
// and breaks the rules ends it. Fragments count down, so that a transfer is over after as many as the first one says.
#pragma once

#include "mailbox/exchange.hpp"
#include "wire/soe.hpp"

namespace margay {

struct SoeTarget {
    Idn idn;
    std::uint8_t drive = 0;
    std::uint8_t elements = soe_element::kValue;
    friend constexpr bool operator==(const SoeTarget&, const SoeTarget&) = default;
};

class SoeTransfer : public MailClient {
  public:
    Taken take(const wire::MailboxMessage& mail) final;

    [[nodiscard]] bool over() const { return over_; }
    // What went wrong, without slave and step; code none when all went well.
    [[nodiscard]] const Error& error() const { return error_; }
    [[nodiscard]] const SoeTarget& target() const { return target_; }
    // Tells the exchanges of one drive from those of another; see MailExchange::Options. A fragment says no more.
    [[nodiscard]] std::uint64_t key() const {
        return std::uint64_t{5} << 32 | static_cast<std::uint64_t>(answer_) << 8 | target_.drive;
    }

  protected:
    SoeTransfer(const SoeTarget& target, wire::soe::Opcode answer) : target_(target), answer_(answer) {}
    ~SoeTransfer() = default;

    virtual Taken take_answer(const wire::soe::Header& header, Bytes data) = 0;
    // Whether an error may name another number: it answers a fragment, which has no IDN.
    [[nodiscard]] virtual bool in_fragments() const = 0;
    Taken fail(Errc code, std::size_t expected = 0, std::size_t actual = 0);

    SoeTarget target_;
    bool over_ = false;

  private:
    wire::soe::Opcode answer_;
    Error error_;
};

class SoeReadTransfer final : public SoeTransfer {
  public:
    // `into` outlives the transfer. Of a value that is larger only the length is found out: Errc::capacity.
    SoeReadTransfer(const SoeTarget& target, MutableBytes into)
        : SoeTransfer(target, wire::soe::Opcode::read_response), into_(into) {}
    std::size_t compose(MutableBytes data) override;
    // Begins anew, with the first message.
    void restart() { done_ = left_ = 0; }
    // Octets that came.
    [[nodiscard]] std::size_t bytes() const { return done_; }

  private:
    Taken take_answer(const wire::soe::Header& header, Bytes data) override;
    [[nodiscard]] bool in_fragments() const override { return left_ != 0; }

    MutableBytes into_;
    std::size_t done_ = 0;
    std::uint16_t left_ = 0;  // fragments that are still to come
};

class SoeWriteTransfer final : public SoeTransfer {
  public:
    // `value` outlives the transfer; `room`: octets of data that a message has, the SoE header included.
    SoeWriteTransfer(const SoeTarget& target, Bytes value, std::size_t room)
        : SoeTransfer(target, wire::soe::Opcode::write_response),
          value_(value),
          room_(room > wire::soe::kHeaderBytes ? room - wire::soe::kHeaderBytes : 0) {}
    std::size_t compose(MutableBytes data) override;
    // Begins anew, with the first message.
    void restart() { done_ = 0; }
    // The next message is the last one, which the slave answers; the others it only takes.
    [[nodiscard]] bool at_last() const { return value_.size() - done_ <= room_; }
    // A fragment has arrived.
    void advance() { done_ += room_; }

  private:
    Taken take_answer(const wire::soe::Header& header, Bytes data) override;
    [[nodiscard]] bool in_fragments() const override { return done_ != 0; }

    Bytes value_;
    std::size_t room_;
    std::size_t done_ = 0;
};

}  // namespace margay
