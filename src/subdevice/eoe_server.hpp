// Ethernet over EtherCAT: the server for mailbox type EoE (ETG.1000.6 "Ethernet over EtherCAT").
#pragma once

#include "subdevice/mailbox_server.hpp"
#include "wire/eoe_assembly.hpp"

namespace margay::subdevice {

class EoeServer;

// The interface that the author of a device implements. All calls come from Device::step().
class EoeApplication {
  public:
    // A frame has arrived from the master, complete; its octets are valid during the call.
    virtual void received(EoeServer& server, Bytes frame, Time now) = 0;

    // The parameters of the IP stack of the device, and the filter for the frames that it sends to the master. `ip` has
    // a value for each parameter that the master sets.
    [[nodiscard]] virtual EoeResult set_ip(const EoeIp& ip) {
        (void)ip;
        return EoeResult::no_ip_support;
    }
    [[nodiscard]] virtual EoeResult get_ip(EoeIp& ip) {
        (void)ip;
        return EoeResult::no_ip_support;
    }
    [[nodiscard]] virtual EoeResult set_filter(const EoeFilter& filter) {
        (void)filter;
        return EoeResult::no_filter_support;
    }
    [[nodiscard]] virtual EoeResult get_filter(EoeFilter& filter) {
        (void)filter;
        return EoeResult::no_filter_support;
    }

    // Called in every step of the device while the mailbox works. Returns the latest time for the next call.
    virtual Time step(EoeServer& server, Time now) {
        (void)server, (void)now;
        return kNever;
    }
    // The mailbox has stopped, and the waiting frames were discarded.
    virtual void stopped() {}
    // The time stamp for frames: the lower 32 bits of the system time in nanoseconds.
    [[nodiscard]] virtual std::uint32_t time_stamp(Time now) {
        return static_cast<std::uint32_t>(now.time_since_epoch().count());
    }

  protected:
    ~EoeApplication() = default;
};

class EoeServer final : public MailboxServer {
  public:
    struct Counters {
        std::uint32_t received = 0;  // frames
        std::uint32_t dropped = 0;   // frames of the master of which a fragment was missing or wrong
        std::uint32_t sent = 0;
        std::uint32_t lost = 0;  // frames of send() that were dropped
    };

    // `receive` keeps a frame until it is complete: the longest frame is as long. `send` keeps frames until the master
    // has fetched them; each needs 3 more octets.
    EoeServer(EoeApplication& application, MutableBytes receive, MutableBytes send)
        : application_(application), memory_(send) {
        assembly_.use(receive);
    }

    // Sends a frame to the master, at any time. `port`: the Ethernet port at which it arrived, the first is 1; 0: none.
    // False: the memory is full, the frame has a size that EoE cannot carry, or the mailbox does not work; the frame is
    // then counted as lost.
    bool send(Bytes frame, std::uint8_t port = 0);
    // A frame of this size can be sent.
    [[nodiscard]] bool has_room(std::size_t bytes) const;
    [[nodiscard]] const Counters& counters() const { return counters_; }

    // Whether sent frames have a time stamp. The master can ask for it (EoeIp::append_time_stamp).
    bool append_time_stamp = false;

    void start(AlState state, const MailboxRoom& room) override;
    void stop() override;
    std::optional<wire::MailboxErrorCode> receive(const wire::MailboxMessage& message, Outbox& out, Time now) override;
    Time step(Outbox& out, Time now) override;

  private:
    void receive_fragment(const wire::eoe::Header& header, Bytes data, Outbox& out, Time now);
    [[nodiscard]] EoeResult execute(wire::eoe::Type type, Bytes parameters, MutableBytes answer, std::size_t& bytes);
    [[nodiscard]] bool send_fragment(Outbox& out, Time now);

    EoeApplication& application_;
    wire::eoe::Assembly assembly_;
    MutableBytes memory_;     // frames one behind the other: size in two octets, port, octets
    std::size_t used_ = 0;    // octets of memory_ in use
    std::size_t room_ = 0;    // octets of a message; 0: the mailbox does not work
    std::size_t offset_ = 0;  // octets of the first frame that are sent
    std::uint8_t fragment_ = 0;
    std::uint8_t frame_number_ = 0;
    Counters counters_;
};

}  // namespace margay::subdevice
