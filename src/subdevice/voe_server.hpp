// Vendor specific profile over EtherCAT: the server for mailbox type VoE (ETG.1000.6 "Vendor specific protocol").
#pragma once

#include "subdevice/mailbox_server.hpp"
#include "wire/voe.hpp"

namespace margay::subdevice {

struct VoeHeader {
    std::uint32_t vendor_id = 0;
    std::uint16_t vendor_type = 0;
};

class VoeServer;

// The interface that the author of a device implements. All calls come from Device::step().
class VoeApplication {
  public:
    // A message has arrived; `data` is valid during the call. To answer, call server.send(). False: the device does not
    // know this vendor or type; the server then sends a mailbox error.
    [[nodiscard]] virtual bool received(VoeServer& server, const VoeHeader& header, Bytes data, Time now) = 0;

    // Called in every step of the device while the mailbox works, for messages that the device sends on its own.
    // Returns the latest time for the next call.
    virtual Time step(VoeServer& server, Time now) {
        (void)server, (void)now;
        return kNever;
    }

  protected:
    ~VoeApplication() = default;
};

class VoeServer final : public MailboxServer {
  public:
    // `memory` keeps messages until the master fetches them; each needs 8 octets beside its data.
    VoeServer(VoeApplication& application, MutableBytes memory) : application_(application), memory_(memory) {}

    // Sends a message to the master, at any time. False: the memory is full, the message is longer than the mailbox, or
    // the mailbox does not work; the message is then counted as lost.
    bool send(const VoeHeader& header, Bytes data);
    [[nodiscard]] std::uint32_t lost() const { return lost_; }

    void start(AlState state, const MailboxRoom& room) override;
    void stop() override;
    std::optional<wire::MailboxErrorCode> receive(const wire::MailboxMessage& message, Outbox& out, Time now) override;
    // The memory has no space for an answer of the length of a mailbox.
    [[nodiscard]] bool busy() const override;
    Time step(Outbox& out, Time now) override;

  private:
    static constexpr std::size_t kLengthBytes = 2;

    VoeApplication& application_;
    MutableBytes memory_;   // messages one behind the other: the length in two octets, header and data
    std::size_t used_ = 0;  // octets of memory_ in use
    std::size_t room_ = 0;  // octets of a message; 0: the mailbox does not work
    std::uint32_t lost_ = 0;
};

}  // namespace margay::subdevice
