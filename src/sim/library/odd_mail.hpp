// A mailbox server with quirks: it forwards messages to a correct server and changes requests and replies as the quirks
// require.
#pragma once

#include "sim/library/quirk.hpp"
#include "subdevice/mailbox_server.hpp"
#include "wire/coe.hpp"

#include <array>
#include <vector>

namespace margay::sim {

class OddMail final : public subdevice::MailboxServer, private subdevice::Outbox {
  public:
    // `most` is the size of the largest mailbox. `inner` must outlive this object.
    OddMail(subdevice::MailboxServer& inner, wire::MailboxType type, std::size_t most);
    void set_quirks(Quirks quirks) { quirks_ = quirks; }

    void start(AlState state, const subdevice::MailboxRoom& room) override;
    void state_changed(AlState state) override { inner_.state_changed(state); }
    std::optional<wire::MailboxErrorCode> receive(const wire::MailboxMessage& message, subdevice::Outbox& out,
                                                  Time now) override;
    [[nodiscard]] bool busy() const override;
    Time step(subdevice::Outbox& out, Time now) override;

  private:
    struct Letter {
        wire::MailboxType type{};
        std::uint16_t address = 0;
        std::size_t bytes = 0;
        std::vector<std::byte> data;
    };

    [[nodiscard]] MutableBytes open() override;
    void commit(wire::MailboxType type, std::size_t bytes, std::uint16_t address) override;

    std::optional<wire::MailboxErrorCode> forward(const wire::MailboxMessage& message, Time now);
    bool answer_for_quirk(Bytes request, std::uint16_t address);
    bool serve_segment(std::uint8_t command, std::uint16_t address);
    void refuse(Bytes request, wire::coe::Abort why, std::uint16_t address);
    void spoil(MutableBytes data, std::size_t& bytes);
    void spoil_upload(MutableBytes data, std::size_t& bytes);
    void hold_back(MutableBytes data, std::size_t& bytes);
    void before_reply();
    void queue(wire::MailboxType type, Bytes data, std::uint16_t address);
    void flush(subdevice::Outbox& out);

    subdevice::MailboxServer& inner_;
    wire::MailboxType type_;
    Quirks quirks_;
    std::array<Letter, 8> letters_;  // waiting messages, from index first_ on
    std::size_t first_ = 0;
    std::size_t waiting_ = 0;
    std::vector<std::byte> draft_;  // buffer for the replies of the inner server
    std::size_t room_ = 0;
    Letter late_;  // a request that is processed later
    Time late_until_ = kNever;
    std::vector<std::byte> held_;  // a value that is sent in segments
    std::size_t held_bytes_ = 0;
    std::size_t held_at_ = 0;
    bool holding_ = false;
    bool toggle_ = false;
    unsigned segments_ = 0;
};

}  // namespace margay::sim
