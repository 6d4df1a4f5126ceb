#include "subdevice/voe_server.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace voe = wire::voe;

void VoeServer::start(AlState, const MailboxRoom& room) {
    room_ = room.send_bytes;
    used_ = 0;
}

void VoeServer::stop() { room_ = used_ = 0; }

bool VoeServer::send(const VoeHeader& header, Bytes data) {
    const std::size_t bytes = voe::kHeaderBytes + data.size();
    if (bytes > room_ || kLengthBytes + bytes > memory_.size() - used_) {
        ++lost_;
        return false;
    }
    const auto at = memory_.subspan(used_, kLengthBytes + bytes);
    store_le(at, 0, static_cast<std::uint16_t>(bytes));
    const auto message = at.subspan(kLengthBytes);
    voe::Layout::vendor_id::store(message, header.vendor_id);
    voe::Layout::vendor_type::store(message, header.vendor_type);
    std::ranges::copy(data, message.begin() + voe::kHeaderBytes);
    used_ += at.size();
    return true;
}

std::optional<wire::MailboxErrorCode> VoeServer::receive(const wire::MailboxMessage& message, Outbox&, Time now) {
    if (message.data.size() < voe::kHeaderBytes) return wire::MailboxErrorCode::size_too_short;
    const VoeHeader header{voe::Layout::vendor_id::load(message.data), voe::Layout::vendor_type::load(message.data)};
    if (application_.received(*this, header, message.data.subspan(voe::kHeaderBytes), now)) return std::nullopt;
    return wire::MailboxErrorCode::service_not_supported;
}

bool VoeServer::busy() const { return used_ != 0 && kLengthBytes + room_ > memory_.size() - used_; }

Time VoeServer::step(Outbox& out, Time now) {
    const Time next = application_.step(*this, now);
    while (used_ != 0) {
        const auto slot = out.open();
        const std::size_t bytes = load_le<std::uint16_t>(memory_);
        if (slot.size() < bytes) break;
        std::copy_n(memory_.begin() + kLengthBytes, bytes, slot.begin());
        out.commit(wire::MailboxType::voe, bytes, 0);
        const std::size_t gone = kLengthBytes + bytes;
        std::copy(memory_.begin() + static_cast<std::ptrdiff_t>(gone),
                  memory_.begin() + static_cast<std::ptrdiff_t>(used_), memory_.begin());
        used_ -= gone;
    }
    return next;
}

}  // namespace margay::subdevice
