// Reads and writes of parameters by the client, independent of the bus: the next message, and the meaning of a reply
// (ETG.1000.6 "Servo drive profile over EtherCAT": read, write, their fragments).
//
// Mail that does not belong to the transfer is ignored (a notification, a late reply to another request). Mail that
// belongs to the transfer and breaks its rules ends it. Fragments count down, so a transfer ends after as many
// fragments as the first one announces.
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
    Taken accept(const wire::MailboxMessage& mail) final;

    [[nodiscard]] bool over() const { return over_; }
    // The error without slave and step; code none on success.
    [[nodiscard]] const Error& error() const { return error_; }
    [[nodiscard]] const SoeTarget& target() const { return target_; }
    // Distinguishes exchanges of different drives; see MailExchange::Options. A fragment contains no IDN, so the key
    // does not contain it either.
    [[nodiscard]] std::uint64_t key() const { return key(answer_, target_.drive); }
    [[nodiscard]] static constexpr std::uint64_t key(wire::soe::Opcode answer, std::uint8_t drive) {
        return mail_key::of(mail_key::Kind::soe, static_cast<std::uint16_t>(answer), drive);
    }

  protected:
    SoeTransfer(const SoeTarget& target, wire::soe::Opcode answer) : target_(target), answer_(answer) {}
    ~SoeTransfer() = default;

    virtual Taken read_answer(const wire::soe::Header& header, Bytes data) = 0;
    // Whether an error reply may contain another number in place of the IDN, because it answers a fragment, which has
    // no IDN.
    [[nodiscard]] virtual bool in_fragments() const = 0;
    void begin_again() {
        over_ = false;
        error_ = {};
    }
    Taken fail(Errc code, std::size_t expected = 0, std::size_t actual = 0);

    SoeTarget target_;
    bool over_ = false;

  private:
    wire::soe::Opcode answer_;
    Error error_;
};

class SoeReadTransfer final : public SoeTransfer {
  public:
    // `into` outlives the transfer. When the value is larger than `into`, only its length is determined:
    // Errc::capacity.
    SoeReadTransfer(const SoeTarget& target, MutableBytes into)
        : SoeTransfer(target, wire::soe::Opcode::read_response), into_(into) {}
    std::size_t compose(MutableBytes data) override;
    // Starts again with the first message.
    void restart() {
        begin_again();
        done_ = left_ = 0;
    }
    // Octets received.
    [[nodiscard]] std::size_t bytes() const { return done_; }

  private:
    Taken read_answer(const wire::soe::Header& header, Bytes data) override;
    Taken take_fragment(const wire::soe::Header& header, Bytes data);
    [[nodiscard]] bool in_fragments() const override { return left_ != 0; }

    MutableBytes into_;
    std::size_t done_ = 0;
    std::uint16_t left_ = 0;  // fragments that will follow
};

class SoeWriteTransfer final : public SoeTransfer {
  public:
    // `value` outlives the transfer; `room`: octets of data in one message, SoE header included.
    SoeWriteTransfer(const SoeTarget& target, Bytes value, std::size_t room)
        : SoeTransfer(target, wire::soe::Opcode::write_response),
          value_(value),
          room_(room > wire::soe::kHeaderBytes ? room - wire::soe::kHeaderBytes : 0) {}
    std::size_t compose(MutableBytes data) override;
    // Starts again with the first message.
    void restart() {
        begin_again();
        done_ = 0;
    }
    // Whether the next message is the last one. The slave replies only to the last message.
    [[nodiscard]] bool at_last() const { return value_.size() - done_ <= room_; }
    // The slave has accepted a fragment.
    void advance() { done_ += room_; }

  private:
    Taken read_answer(const wire::soe::Header& header, Bytes data) override;
    [[nodiscard]] bool in_fragments() const override { return done_ != 0; }

    Bytes value_;
    std::size_t room_;
    std::size_t done_ = 0;
};

}  // namespace margay
