#include "network/emergencies.hpp"

#include "network/network.hpp"
#include "wire/coe.hpp"

#include <algorithm>

namespace margay {

namespace coe = wire::coe;

EmergencyListener::EmergencyListener(Network& network) : MailListener(MailboxType::coe), network_(network) {
    network.mailboxes.listen(*this);
}

bool EmergencyListener::take(const UnaskedMail& mail) {
    if (mail.data.size() < coe::kEmergencyBytes || coe::load_header(mail.data).service != coe::Service::emergency)
        return false;
    Emergency emergency{.code = coe::EmergencyLayout::error_code::load(mail.data),
                        .error_register = coe::EmergencyLayout::error_register::load(mail.data)};
    std::ranges::copy(mail.data.subspan(coe::EmergencyLayout::data, coe::kEmergencyDataBytes), emergency.data.begin());
    emergency.at = mail.at;
    network_.mailboxes.channel(mail.slave).emergencies().add(emergency);
    Event event{.kind = EventKind::emergency, .slave = mail.slave};
    event.actual = emergency.error_register;
    event.detail = emergency.code;
    network_.report(event);
    return true;
}

}  // namespace margay
