// The ring of octets of a VoeInbox. A message is stored as its length, slave, vendor type, vendor ID and time, and its
// data.
#include "util/bytes.hpp"
#include "wire/voe.hpp"

#include <margay/voe.hpp>

#include <algorithm>
#include <array>

namespace margay {
namespace {

struct RecordLayout {
    using bytes = Field<std::uint32_t, 0>;
    using slave = Field<std::uint16_t, 4>;
    using vendor_type = Field<std::uint16_t, 6>;
    using vendor_id = Field<std::uint32_t, 8>;
    using at = Field<std::int64_t, 12>;
};
constexpr std::size_t kRecordBytes = RecordLayout::at::end;

}  // namespace

std::size_t VoeInbox::used(std::size_t written, std::size_t taken) const {
    return written >= taken ? written - taken : written + 2 * memory_.size() - taken;
}

std::size_t VoeInbox::advanced(std::size_t at, std::size_t octets) const {
    const std::size_t next = at + octets;
    return next >= 2 * memory_.size() ? next - 2 * memory_.size() : next;
}

bool VoeInbox::empty() const {
    return written_.load(std::memory_order_acquire) == taken_.load(std::memory_order_acquire);
}

void VoeInbox::put(std::size_t& at, std::span<const std::byte> octets) {
    for (const std::byte octet : octets) {
        memory_[at < memory_.size() ? at : at - memory_.size()] = octet;
        at = advanced(at, 1);
    }
}

void VoeInbox::get(std::size_t& at, std::span<std::byte> octets) const {
    for (std::byte& octet : octets) {
        octet = memory_[at < memory_.size() ? at : at - memory_.size()];
        at = advanced(at, 1);
    }
}

bool VoeInbox::take(const UnaskedMail& mail) {
    if (mail.data.size() < wire::voe::kHeaderBytes) return false;
    const auto id = wire::voe::Layout::vendor_id::load(mail.data);
    const auto type = wire::voe::Layout::vendor_type::load(mail.data);
    if (vendor_id.value_or(id) != id || vendor_type.value_or(type) != type) return false;
    const auto data = mail.data.subspan(wire::voe::kHeaderBytes);
    count_.store(count() + 1, std::memory_order_relaxed);
    std::size_t at = written_.load(std::memory_order_relaxed);
    if (kRecordBytes + data.size() > memory_.size() - used(at, taken_.load(std::memory_order_acquire))) {
        lost_.store(lost() + 1, std::memory_order_relaxed);
        return true;
    }
    std::array<std::byte, kRecordBytes> record{};
    RecordLayout::bytes::store(record, static_cast<std::uint32_t>(data.size()));
    RecordLayout::slave::store(record, mail.slave);
    RecordLayout::vendor_type::store(record, type);
    RecordLayout::vendor_id::store(record, id);
    RecordLayout::at::store(record, mail.at.time_since_epoch().count());
    put(at, record);
    put(at, data);
    written_.store(at, std::memory_order_release);
    return true;
}

std::optional<VoeMessage> VoeInbox::take(std::span<std::byte> into) {
    std::size_t at = taken_.load(std::memory_order_relaxed);
    if (at == written_.load(std::memory_order_acquire)) return std::nullopt;
    std::array<std::byte, kRecordBytes> record{};
    get(at, record);
    const VoeMessage message{.slave = RecordLayout::slave::load(record),
                             .header = {.vendor_id = RecordLayout::vendor_id::load(record),
                                        .vendor_type = RecordLayout::vendor_type::load(record)},
                             .bytes = RecordLayout::bytes::load(record),
                             .at = Time(Duration(RecordLayout::at::load(record)))};
    std::size_t from = at;
    get(from, into.first(std::min(into.size(), message.bytes)));
    taken_.store(advanced(at, message.bytes), std::memory_order_release);
    return message;
}

}  // namespace margay
