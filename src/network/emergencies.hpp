// The emergencies of all slaves (ETG.1000.6 "Emergency"): stored in the ring of the slave, and reported as an event.
#pragma once

#include <margay/mail_listener.hpp>

namespace margay {

struct Network;

class EmergencyListener final : public MailListener {
  public:
    explicit EmergencyListener(Network& network);

  private:
    bool take(const UnaskedMail& mail) override;
    Network& network_;
};

}  // namespace margay
