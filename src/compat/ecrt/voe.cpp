// VoE handlers: a program sends vendor messages, and waits for them cycle by cycle.
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/requests.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>

using namespace margay;
using namespace margay::compat::ecrt;

namespace {

constexpr Duration kLook = std::chrono::milliseconds(2);
constexpr Duration kPatience = std::chrono::milliseconds(1000);  // for a message of the slave

// Sets the number of the slave in the inbox of a configuration. For the owner.
void attach(Context& ctx, VoeInbox& inbox, std::uint16_t number) {
    if (inbox.listening()) (void)unlisten(ctx, inbox);
    if (number == 0) return;
    inbox.only_slave = number;
    inbox.look_every = kLook;
    (void)listen(ctx, inbox);
}

}  // namespace

namespace margay::compat::ecrt {

void Bus::attach_mail() {
    for (const auto& config : configs)
        if (!config->voe_handlers.empty()) attach(*ctx, config->voe_handlers.front()->mail->inbox, config->number);
}

}  // namespace margay::compat::ecrt

namespace {

ec_request_state_t failed(ec_voe_handler& voe, const Error& error) {
    note_failure(voe.config, voe, error, "VoE message");
    return EC_REQUEST_ERROR;
}

}  // namespace

extern "C" {

ec_voe_handler_t* ecrt_slave_config_create_voe_handler(ec_slave_config_t* sc, size_t size) {
    if (!may_have(*sc, size)) return nullptr;
    Bus& bus = sc->bus;
    const std::lock_guard lock(bus.config_mutex);
    if (refuse_active(*sc)) return nullptr;
    const bool first = sc->voe_handlers.empty();
    auto handler =
        std::make_unique<ec_voe_handler>(*sc, first ? std::make_shared<VoeMail>() : sc->voe_handlers.front()->mail);
    handler->memory.resize(std::max<std::size_t>(size, 1486));  // the longest message that a mailbox can have
    Slave slave;
    if (first && bus.slave_of(*sc, slave)) bus.as_owner([&] { attach(*bus.ctx, handler->mail->inbox, slave.number); });
    sc->voe_handlers.push_back(std::move(handler));
    return sc->voe_handlers.back().get();
}

int ecrt_voe_handler_send_header(ec_voe_handler_t* voe, uint32_t vendor_id, uint16_t vendor_type) {
    voe->header = {vendor_id, vendor_type};
    return 0;
}

int ecrt_voe_handler_received_header(const ec_voe_handler_t* voe, uint32_t* vendor_id, uint16_t* vendor_type) {
    if (vendor_id != nullptr) *vendor_id = voe->received.vendor_id;
    if (vendor_type != nullptr) *vendor_type = voe->received.vendor_type;
    return 0;
}

uint8_t* ecrt_voe_handler_data(const ec_voe_handler_t* voe) {
    return reinterpret_cast<std::uint8_t*>(const_cast<std::byte*>(voe->memory.data()));
}

size_t ecrt_voe_handler_data_size(const ec_voe_handler_t* voe) { return voe->size; }

int ecrt_voe_handler_write(ec_voe_handler_t* voe, size_t size) {
    if (size > voe->memory.size()) return -ENOBUFS;
    if (voe->send.busy()) return -EBUSY;
    voe->waiting = false;
    voe->size = size;
    voe->send.header = voe->header;
    voe->send.data = Borrowed<std::byte>(voe->memory.data(), size);
    begin_or_later(*voe, voe->send, Transfer::write);
    return 0;
}

int ecrt_voe_handler_read(ec_voe_handler_t* voe) {
    if (voe->send.busy()) return -EBUSY;
    voe->last = Transfer::read;
    voe->waiting = true;
    voe->give_up = voe->config.bus.source->osal().now() + kPatience;
    return 0;
}

// The library always checks the mailbox first.
int ecrt_voe_handler_read_nosync(ec_voe_handler_t* voe) { return ecrt_voe_handler_read(voe); }

ec_request_state_t ecrt_voe_handler_execute(ec_voe_handler_t* voe) {
    switch (voe->last) {
        case Transfer::none:
        case Transfer::exchange:  // only other requests use these three values
        case Transfer::exchange_later:
        case Transfer::beginning: return EC_REQUEST_UNUSED;
        case Transfer::refused: return failed(*voe, voe->refusal);
        case Transfer::write:
            if (voe->send.state() == RequestState::error) return failed(*voe, voe->send.error());
            return to_ec(voe->send.state());
        case Transfer::read_later: return EC_REQUEST_BUSY;
        case Transfer::write_later: begin_or_later(*voe, voe->send, Transfer::write); return EC_REQUEST_BUSY;
        case Transfer::read: break;
    }
    if (!voe->waiting) return voe->read_state;
    if (const auto message = voe->mail->inbox.take(voe->memory)) {
        voe->waiting = false;
        voe->said = 0;
        voe->received = message->header;
        voe->size = std::min(message->bytes, voe->memory.size());
        return voe->read_state = EC_REQUEST_SUCCESS;
    }
    if (voe->config.bus.source->osal().now() < voe->give_up) return EC_REQUEST_BUSY;
    voe->waiting = false;
    return voe->read_state = failed(*voe, {.code = Errc::timeout});
}

}  // extern "C"
