// The part of an EoePort between its queues and the mailbox channel: cuts frames into fragments, and puts fragments
// together. Without bus and time, so that it is easy to test and to fuzz.
#pragma once

#include "mailbox/exchange.hpp"
#include "wire/eoe_assembly.hpp"

#include <margay/eoe.hpp>
#include <margay/mail_listener.hpp>

namespace margay {

// The functions by which the relay informs its sequence.
class EoeRelayWatch {
  public:
    // A fragment is sent now.
    virtual void composing() = 0;
    // A fragment has arrived. `more`: it belongs to a frame that is not complete.
    virtual void arrived(bool more) = 0;

  protected:
    ~EoeRelayWatch() = default;
};

class EoeRelay final : public MailListener, public MailClient {
  public:
    // `port` and `watch` outlive the relay.
    EoeRelay(std::uint16_t slave, EoePort& port, EoeRelayWatch& watch);

    // Frames to the slave. True: a fragment waits to be sent, and compose() writes it.
    [[nodiscard]] bool has_fragment();
    std::size_t compose(MutableBytes data) override;
    Taken accept(const wire::MailboxMessage&) override { return Taken::no; }
    // Call it when the fragment was sent. `taken` false: the slave has not accepted it, and the rest of its frame is
    // not sent.
    void sent(bool taken);
    // Call it when the mailbox was opened again: drops the frames from the slave that are not complete, and sends the
    // frame that is being sent from its beginning. If a fragment waited, sent() has dropped this frame before.
    void begin_again();
    // The same, and drops the frames that wait for the slave.
    void drop_all();

    // Frames from the slave.
    bool take(const UnaskedMail& mail) override;

  private:
    using Assembly = wire::eoe::Assembly;

    [[nodiscard]] Assembly* place_for(const wire::eoe::Header& header);
    void drop_old(const wire::eoe::Header& header);
    [[nodiscard]] std::size_t oldest() const;
    // Returns whether more fragments of the frame are expected.
    [[nodiscard]] bool take_fragment(const wire::eoe::Header& header, Bytes data);
    void drop(const wire::eoe::Header& header, EoePort::Count why);
    void deliver(std::uint8_t port, const Assembly& whole);
    void end_frame(EoePort::Count outcome);

    EoePort& port_;
    EoeRelayWatch& watch_;
    // The frame that is being sent; 0 octets: none.
    std::size_t frame_bytes_ = 0;
    std::size_t offset_ = 0;
    std::size_t composed_ = 0;  // octets of the fragment that compose() has written
    std::uint8_t fragment_ = 0;
    std::uint8_t frame_number_ = 0;
    bool wants_time_ = false;
    // The frames that are being received.
    std::array<Assembly, EoePort::kMostAtOnce> assemblies_;
    std::array<std::uint32_t, EoePort::kMostAtOnce> begun_{};  // the order in which the frames have begun
    std::uint32_t begun_last_ = 0;
    std::size_t slots_ = 0;
    std::uint16_t dropped_ = 0;  // bits of the frame numbers whose further fragments are ignored
};

}  // namespace margay
