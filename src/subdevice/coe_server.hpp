// CANopen over EtherCAT: the server for mailbox type CoE. It combines the servers for SDO, SDO information and
// emergencies, which have files of their own.
#pragma once

#include "subdevice/emergency.hpp"
#include "subdevice/sdo_information.hpp"
#include "subdevice/sdo_server.hpp"

namespace margay::subdevice {

class CoeServer final : public MailboxServer {
  public:
    // All arguments must outlive the server. For `staging` see SdoServer.
    CoeServer(ObjectDictionary& dictionary, MutableBytes staging, bool complete_access,
              Emergencies* emergencies = nullptr)
        : sdo_(dictionary, staging, complete_access), information_(dictionary), emergencies_(emergencies) {}

    void start(AlState state, const MailboxRoom& room) override;
    void stop() override;
    void state_changed(AlState state) override { sdo_.state_changed(state); }
    std::optional<wire::MailboxErrorCode> receive(const wire::MailboxMessage& message, Outbox& out, Time now) override;
    // SDO and SDO information share one order of messages.
    [[nodiscard]] bool busy() const override { return sdo_.busy() || information_.busy(); }
    Time step(Outbox& out, Time now) override;

  private:
    SdoServer sdo_;
    SdoInformation information_;
    Emergencies* emergencies_;
};

}  // namespace margay::subdevice
