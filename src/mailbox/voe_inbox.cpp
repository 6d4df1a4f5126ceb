// A VoeInbox stores a message as its length, slave, vendor type, vendor ID and time, and its data.
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

bool VoeInbox::take(const UnaskedMail& mail) {
    if (mail.data.size() < wire::voe::kHeaderBytes) return false;
    const auto id = wire::voe::Layout::vendor_id::load(mail.data);
    const auto type = wire::voe::Layout::vendor_type::load(mail.data);
    if (vendor_id.value_or(id) != id || vendor_type.value_or(type) != type) return false;
    const auto data = mail.data.subspan(wire::voe::kHeaderBytes);
    count_.store(count() + 1, std::memory_order_relaxed);
    std::array<std::byte, kRecordBytes> record{};
    RecordLayout::bytes::store(record, static_cast<std::uint32_t>(data.size()));
    RecordLayout::slave::store(record, mail.slave);
    RecordLayout::vendor_type::store(record, type);
    RecordLayout::vendor_id::store(record, id);
    RecordLayout::at::store(record, mail.at.time_since_epoch().count());
    if (!ring_.add(record, data)) lost_.store(lost() + 1, std::memory_order_relaxed);
    return true;
}

std::optional<VoeMessage> VoeInbox::take(std::span<std::byte> into) {
    if (ring_.empty()) return std::nullopt;
    std::array<std::byte, kRecordBytes> record{};
    ring_.peek(0, record);
    const VoeMessage message{.slave = RecordLayout::slave::load(record),
                             .header = {.vendor_id = RecordLayout::vendor_id::load(record),
                                        .vendor_type = RecordLayout::vendor_type::load(record)},
                             .bytes = RecordLayout::bytes::load(record),
                             .at = Time(Duration(RecordLayout::at::load(record)))};
    ring_.peek(kRecordBytes, into.first(std::min(into.size(), message.bytes)));
    ring_.drop(kRecordBytes + message.bytes);
    return message;
}

}  // namespace margay
