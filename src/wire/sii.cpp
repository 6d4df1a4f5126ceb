#include "wire/sii.hpp"

#include "wire/datagram.hpp"
#include "wire/esc.hpp"

#include <algorithm>

namespace margay::wire::sii {

std::string_view to_text(Fault fault) {
    switch (fault) {
        case Fault::none: return "no fault";
        case Fault::blank: return "the EEPROM is blank (every octet is 0xFF)";
        case Fault::odd_length: return "the image is not a whole number of words";
        case Fault::truncated: return "the content ends too early";
        case Fault::no_end: return "the categories have no end mark";
        case Fault::category_past_end: return "a category reaches past the end of the EEPROM";
        case Fault::category_overlap: return "what a category describes reaches into the next category";
        case Fault::category_repeated: return "a category comes twice";
        case Fault::trailing: return "a category has a rest behind its last whole entry";
        case Fault::checksum: return "the checksum of the configuration area is wrong";
        case Fault::size_mismatch: return "the size word is not the size of the image";
        case Fault::mailbox_without_size: return "a mailbox protocol is announced, but the mailboxes have no size";
        case Fault::mailbox_one_sided: return "only one of the two mailboxes has a size";
        case Fault::mailbox_too_short: return "a mailbox is too short for a message";
        case Fault::mailbox_too_large: return "a mailbox is larger than a frame carries (1486 octets)";
        case Fault::mailbox_outside: return "a mailbox is outside of the process RAM";
        case Fault::mailbox_overlap: return "the two mailboxes overlap";
        case Fault::cycle_limits: return "the shortest SYNC0 cycle time is above the longest";
        case Fault::sync_manager_outside: return "a SyncManager is outside of the process RAM";
        case Fault::sync_manager_overlap:
            return "two SyncManagers have the same number or share memory (three buffers take three times the length)";
        case Fault::string_past_end: return "a string reaches past the end of its category";
        case Fault::string_missing: return "there is no string of this number";
        case Fault::unknown_value: return "a value that the standard does not have";
        case Fault::no_room: return "the image does not fit into its EEPROM";
        case Fault::too_long: return "a text, list or category is longer than can be counted";
    }
    return "unknown fault";
}

Errc to_errc(Fault fault) {
    switch (fault) {
        case Fault::none: return Errc::none;
        case Fault::blank: return Errc::sii_blank;
        case Fault::checksum: return Errc::sii_checksum;
        case Fault::truncated:
        case Fault::no_end:
        case Fault::category_past_end:
        case Fault::string_past_end: return Errc::sii_truncated;
        case Fault::no_room: return Errc::capacity;
        case Fault::too_long: return Errc::invalid_argument;
        default: return Errc::sii_format;
    }
}

namespace category {

std::string_view name(std::uint16_t type) {
    switch (type) {
        case kNop: return "NOP";
        case kStrings: return "strings";
        case kDataTypes: return "data types";
        case kGeneral: return "general";
        case kFmmu: return "FMMU";
        case kSyncManager: return "SyncManager";
        case kFmmuExtended: return "FMMU extended";
        case kSyncUnit: return "SyncUnit";
        case kTxPdo: return "TxPDO";
        case kRxPdo: return "RxPDO";
        case kDc: return "DC";
        case kEnd: return "end";
        default: break;
    }
    if (type <= kLastDeviceSpecific) return "device specific";
    const bool vendor_specific =
        (type >= kFirstVendorSpecific && type <= kLastVendorSpecific) || (type & kVendorSpecificBit) != 0;
    return vendor_specific ? "vendor specific" : "unknown";
}

}  // namespace category

Fault mailbox_fault(const MailboxInfo& mailbox) {
    constexpr std::uint32_t kMailboxHeaderBytes = 6;
    const std::uint32_t out_end = std::uint32_t{mailbox.out_start} + mailbox.out_bytes;
    const std::uint32_t in_end = std::uint32_t{mailbox.in_start} + mailbox.in_bytes;
    if (mailbox.out_bytes == 0 && mailbox.in_bytes == 0)
        return mailbox.protocols != 0 ? Fault::mailbox_without_size : Fault::none;
    if (mailbox.out_bytes == 0 || mailbox.in_bytes == 0) return Fault::mailbox_one_sided;
    if (mailbox.out_bytes < kMailboxHeaderBytes || mailbox.in_bytes < kMailboxHeaderBytes)
        return Fault::mailbox_too_short;
    if (mailbox.out_bytes > kMaxDatagramData || mailbox.in_bytes > kMaxDatagramData) return Fault::mailbox_too_large;
    if (mailbox.out_start < reg::kProcessRam || mailbox.in_start < reg::kProcessRam || out_end > 0x10000 ||
        in_end > 0x10000)
        return Fault::mailbox_outside;
    if (mailbox.out_start < in_end && mailbox.in_start < out_end) return Fault::mailbox_overlap;
    return Fault::none;
}

OversizedMailbox oversized_mailbox(const MailboxInfo& mailbox) {
    if (mailbox.out_bytes > kMaxDatagramData) return {1, mailbox.out_bytes};
    return {3, mailbox.in_bytes};
}

Parsed<FixedPart> load_fixed_part(Bytes image) {
    if (image.size() < kFixedBytes) return {{}, Fault::truncated};
    FixedPart fixed;
    fixed.configuration = load_configuration(image);
    fixed.identity = load_identity(image.subspan(word::kIdentity * kWordBytes));
    fixed.mailboxes = load_mailboxes(image.subspan(word::kBootMailbox * kWordBytes));
    fixed.eeprom_bytes = eeprom_bytes(load_le<std::uint16_t>(image, word::kSize * kWordBytes));
    fixed.version = load_le<std::uint16_t>(image, word::kVersion * kWordBytes);
    return {fixed, checksum_right(image) ? Fault::none : Fault::checksum};
}

bool is_blank(Bytes image) {
    return !image.empty() && std::all_of(image.begin(), image.end(), [](std::byte b) { return b == std::byte{0xFF}; });
}

std::optional<Bytes> find_category(Bytes image, std::uint16_t type) {
    CategoryWalker walker(image);
    while (const auto found = walker.next())
        if (found->place.type == type) return found->content;
    return std::nullopt;
}

}  // namespace margay::wire::sii
