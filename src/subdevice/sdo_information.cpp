#include "subdevice/sdo_information.hpp"

#include <algorithm>

namespace margay::subdevice {

namespace coe = wire::coe;
using coe::InfoLayout;
using coe::InfoOpcode;
using coe::ListType;
using wire::MailboxErrorCode;

std::optional<MailboxErrorCode> SdoInformation::receive(Bytes data, std::uint16_t address, Outbox& out) {
    if (data.size() < coe::kListRequestBytes) return MailboxErrorCode::size_too_short;
    if (out.open().size() < coe::kInfoErrorBytes) return MailboxErrorCode::no_more_memory;
    address_ = address;
    switch (static_cast<InfoOpcode>(InfoLayout::opcode::load(data) & ~coe::kInfoIncomplete)) {
        case InfoOpcode::list_request: list(InfoLayout::list_type::load(data), out); break;
        case InfoOpcode::object_request: object(InfoLayout::index::load(data), out); break;
        case InfoOpcode::entry_request:
            if (data.size() < coe::kEntryRequestBytes) return MailboxErrorCode::size_too_short;
            entry(InfoLayout::index::load(data), InfoLayout::entry_subindex::load(data),
                  InfoLayout::entry_value_info::load(data), out);
            break;
        default: fail(Abort::unknown_command, out);
    }
    return std::nullopt;
}

bool SdoInformation::belongs(const Object& object, ListType type) const {
    if (!dictionary_.exists(object)) return false;
    const auto wanted = [type] {
        switch (type) {
            case ListType::rx_mappable: return od::kRxMappable;
            case ListType::tx_mappable: return od::kTxMappable;
            case ListType::backup: return od::kBackup;
            case ListType::settings: return od::kSettings;
            case ListType::all:
            case ListType::lengths: break;
        }
        return std::uint16_t{0};
    }();
    if (wanted == 0) return true;
    for (const Entry& entry : object.entries)  // without std::any_of(), which GCC unrolls
        if ((entry.access & wanted) != 0) return true;
    return false;
}

std::size_t SdoInformation::count(ListType type) const {
    std::size_t n = 0;
    for (const auto& object : dictionary_.objects()) n += belongs(object, type) ? 1 : 0;
    return n;
}

void SdoInformation::list(std::uint16_t type, Outbox& out) {
    if (type > coe::kLastListType) return fail(Abort::unsupported_access, out);
    if (dictionary_.from(0) == nullptr) return fail(Abort::no_dictionary, out);
    head_bytes_ = 0;
    append(type, 2);
    list_ = static_cast<ListType>(type);
    next_index_ = 0;
    std::size_t indices = 0;
    if (list_ == ListType::lengths) {
        for (std::uint16_t each = 1; each <= coe::kLastListType; ++each) append(count(static_cast<ListType>(each)), 2);
    } else {
        indices = count(list_);
    }
    begin(InfoOpcode::list_response, head_bytes_ + 2 * indices, out);
}

void SdoInformation::object(std::uint16_t index, Outbox& out) {
    const auto* const object = dictionary_.find(index);
    if (object == nullptr || !dictionary_.exists(*object)) return fail(Abort::no_object, out);
    head_bytes_ = 0;
    append(object->index, 2);
    append(static_cast<std::uint16_t>(object->type), 2);
    append(object->max_subindex(), 1);
    append(static_cast<std::uint8_t>(object->code), 1);
    text_ = object->name;
    begin(InfoOpcode::object_response, head_bytes_ + text_.size(), out);
}

void SdoInformation::entry(std::uint16_t index, std::uint8_t subindex, std::uint8_t value_info, Outbox& out) {
    const auto* const object = dictionary_.find(index);
    if (object == nullptr || !dictionary_.exists(*object)) return fail(Abort::no_object, out);
    const auto* const entry = object->entry(subindex);
    if (entry == nullptr) return fail(Abort::no_subindex, out);
    const bool number = entry->bits <= 64 && entry->storage != Storage::text && !entry->is_text();
    std::uint8_t contents = 0;
    if (number && (entry->storage == Storage::image || entry->storage == Storage::constant))
        contents |= coe::value_info::kDefault;
    if (number && entry->is_limited()) contents |= coe::value_info::kMinimum | coe::value_info::kMaximum;
    contents &= value_info;

    head_bytes_ = 0;
    append(index, 2);
    append(subindex, 1);
    append(contents, 1);
    append(static_cast<std::uint16_t>(entry->type), 2);
    append(entry->bits > 0xFFFF ? 0 : entry->bits, 2);  // 0: the size does not fit into the field
    append(entry->access, 2);
    if ((contents & coe::value_info::kDefault) != 0) append(dictionary_.initial(*object, *entry), entry->bytes());
    if ((contents & coe::value_info::kMinimum) != 0)
        append(static_cast<std::uint64_t>(entry->limits().minimum), entry->bytes());
    if ((contents & coe::value_info::kMaximum) != 0)
        append(static_cast<std::uint64_t>(entry->limits().maximum), entry->bytes());
    text_ = entry->name;
    if (entry->count > 1) {
        // Without TextWriter, whose division of 64 bits is large on a microcontroller.
        constexpr std::string_view kPattern = "SubIndex 000";
        std::copy(kPattern.begin(), kPattern.end(), made_up_.begin());
        unsigned rest = subindex;
        for (std::size_t digit = kPattern.size(); rest != 0; rest /= 10)
            made_up_[--digit] = static_cast<char>('0' + rest % 10);
        text_ = {made_up_.data(), kPattern.size()};
    }
    begin(InfoOpcode::entry_response, head_bytes_ + text_.size(), out);
}

void SdoInformation::append(std::uint64_t value, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; ++i) head_[head_bytes_++] = static_cast<std::byte>(value >> (8 * i));
}

void SdoInformation::begin(InfoOpcode opcode, std::size_t bytes, Outbox& out) {
    opcode_ = opcode;
    sent_ = 0;
    left_ = bytes;
    (void)send_fragment(out);
}

void SdoInformation::step(Outbox& out) {
    while (left_ != 0 && send_fragment(out)) {
    }
}

bool SdoInformation::send_fragment(Outbox& out) {
    const auto at = out.open();
    if (at.empty()) return false;
    const auto room = (at.size() - coe::kInfoHeaderBytes) & ~std::size_t{1};  // an index must not be split
    const auto bytes = std::min(left_, room);
    const auto behind = (left_ - bytes + room - 1) / room;
    coe::store_header(at, {0, coe::Service::sdo_information});
    InfoLayout::opcode::store(
        at, static_cast<std::uint8_t>(static_cast<unsigned>(opcode_) | (behind != 0 ? coe::kInfoIncomplete : 0u)));
    at[3] = std::byte{0};
    InfoLayout::fragments_left::store(at, static_cast<std::uint16_t>(behind));
    fill(at.subspan(coe::kInfoHeaderBytes, bytes));
    out.commit(wire::MailboxType::coe, coe::kInfoHeaderBytes + bytes, address_);
    left_ -= bytes;
    return true;
}

// Copies the octets of the response from sent_ on into `to`.
void SdoInformation::fill(MutableBytes to) {
    std::size_t n = 0;
    for (; n < to.size() && sent_ < head_bytes_; ++n) to[n] = head_[sent_++];
    if (opcode_ == InfoOpcode::list_response) {
        for (; n < to.size(); n += 2, sent_ += 2) {
            const auto* object = dictionary_.from(next_index_);
            while (object != nullptr && !belongs(*object, list_)) object = dictionary_.from(object->index + 1U);
            // If an object disappears while its list is sent, the list ends with zeros.
            const auto index = object != nullptr ? object->index : std::uint16_t{0};
            store_le(to, n, index);
            next_index_ = object != nullptr ? index + 1U : 0x10000U;
        }
    } else {
        for (; n < to.size(); ++n) to[n] = static_cast<std::byte>(text_[sent_++ - head_bytes_]);
    }
}

void SdoInformation::fail(Abort why, Outbox& out) {
    const auto at = out.open();
    coe::store_header(at, {0, coe::Service::sdo_information});
    InfoLayout::opcode::store(at, static_cast<std::uint8_t>(InfoOpcode::error));
    at[3] = std::byte{0};
    InfoLayout::fragments_left::store(at, 0);
    InfoLayout::abort::store(at, why);
    out.commit(wire::MailboxType::coe, coe::kInfoErrorBytes, address_);
    left_ = 0;
}

}  // namespace margay::subdevice
