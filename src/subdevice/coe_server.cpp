#include "subdevice/coe_server.hpp"

namespace margay::subdevice {

namespace coe = wire::coe;
using wire::MailboxErrorCode;

void CoeServer::start(AlState state, const MailboxRoom& room) {
    (void)room;
    sdo_.start();
    sdo_.state_changed(state);
    information_.start();
    if (emergencies_ != nullptr) emergencies_->clear_queue();
}

void CoeServer::stop() {
    sdo_.start();
    information_.start();
}

std::optional<MailboxErrorCode> CoeServer::receive(const wire::MailboxMessage& message, Outbox& out, Time now) {
    const auto data = message.data;
    if (data.size() < coe::kHeaderBytes) return MailboxErrorCode::size_too_short;
    switch (coe::load_header(data).service) {
        case coe::Service::sdo_request: return sdo_.receive(data, message.header.address, out, now);
        case coe::Service::sdo_information: return information_.receive(data, message.header.address, out);
        case coe::Service::emergency:
        case coe::Service::sdo_response:
        case coe::Service::tx_pdo:
        case coe::Service::rx_pdo:
        case coe::Service::tx_pdo_remote_request:
        case coe::Service::rx_pdo_remote_request: return MailboxErrorCode::service_not_supported;
    }
    return MailboxErrorCode::invalid_header;
}

Time CoeServer::step(Outbox& out, Time now) {
    // Emergencies do not wait: neither for a hook that delays an SDO, nor for the fragments of an information service.
    if (emergencies_ != nullptr) emergencies_->step(out);
    information_.step(out);
    return sdo_.step(out, now);
}

}  // namespace margay::subdevice
