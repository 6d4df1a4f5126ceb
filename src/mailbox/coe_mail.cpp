#include "mailbox/coe_mail.hpp"

#include "mailbox/channel.hpp"
#include "mailbox/mailboxes.hpp"
#include "wire/coe.hpp"

#include <algorithm>

namespace margay {

namespace coe = wire::coe;

namespace {

bool store_emergency(MailboxChannel& channel, Bytes data) {
    if (data.size() < coe::kEmergencyBytes) return false;
    Emergency emergency{.code = coe::EmergencyLayout::error_code::load(data),
                        .error_register = coe::EmergencyLayout::error_register::load(data)};
    std::ranges::copy(data.subspan(coe::EmergencyLayout::data, coe::kEmergencyDataBytes), emergency.data.begin());
    emergency.at = channel.engine().now();
    channel.emergencies().add(emergency);
    const Mailboxes::Listener& listener = channel.mailboxes().listener;
    if (listener.emergency != nullptr) listener.emergency(listener.user, channel.slave().number, emergency);
    return true;
}

}  // namespace

bool coe_unasked(MailboxChannel& channel, const wire::MailboxMessage& mail) {
    if (mail.data.size() < coe::kHeaderBytes) return false;
    const auto header = coe::load_header(mail.data);
    if (header.service == coe::Service::emergency) return store_emergency(channel, mail.data);
    const auto& hooks = channel.slave().hooks;
    if (header.service == coe::Service::tx_pdo && hooks.mailbox_pdo != nullptr) {
        hooks.mailbox_pdo(channel.slave().number, header.number, mail.data.subspan(coe::kHeaderBytes),
                          hooks.mailbox_pdo_user);
        return true;
    }
    if (header.service == coe::Service::rx_pdo_remote_request && hooks.mailbox_pdo_wanted != nullptr) {
        hooks.mailbox_pdo_wanted(channel.slave().number, header.number, hooks.mailbox_pdo_user);
        return true;
    }
    return false;
}

}  // namespace margay
