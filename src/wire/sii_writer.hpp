// Makes an SII image from a description of a device: for simulated slaves, slave stacks and tests.
#pragma once

#include "wire/sii_category.hpp"

#include <span>
#include <string_view>

namespace margay::wire::sii {

struct PdoEntryDescription {
    std::uint16_t index = 0;  // 0: a gap
    std::uint8_t subindex = 0;
    std::string_view name = {};
    std::uint8_t data_type = 0;
    std::uint8_t bit_length = 0;
    std::uint16_t flags = 0;
};

struct PdoDescription {
    std::uint16_t index = 0;
    std::uint8_t sync_manager = Pdo::kNoSyncManager;
    std::uint8_t synchronization = 0;
    std::string_view name = {};
    std::uint16_t flags = 0;
    std::span<const PdoEntryDescription> entries = {};
};

struct DcDescription {
    DcOpMode mode = {};  // name and description are not looked at
    std::string_view name = {};
    std::string_view description = {};
};

// A category as its octets; an odd one is filled up to a word.
struct RawCategory {
    std::uint16_t type = category::kNop;
    Bytes content = {};
};

// What is empty is left out, but for General, which every device has. Texts become strings of the strings
// category, equal ones become one; string numbers in `general` are not looked at. All spans and texts are
// only borrowed, for the time of the call.
struct Description {
    Configuration configuration = {};  // checksum is computed
    Identity identity = {};
    MailboxInfo mailbox = {};
    MailboxInfo boot_mailbox = {};  // its protocols are not looked at
    std::uint16_t version = 1;
    std::string_view group = {};
    std::string_view image = {};
    std::string_view order = {};
    std::string_view name = {};
    General general = {};
    std::span<const RawCategory> device_specific = {};  // before the strings
    std::span<const FmmuUse> fmmus = {};
    std::span<const SmInfo> sync_managers = {};
    std::span<const PdoDescription> tx_pdos = {};
    std::span<const PdoDescription> rx_pdos = {};
    std::span<const DcDescription> dc = {};
    std::span<const RawCategory> others = {};  // behind all the others
};

// Writes the image into `eeprom`, whose size is that of the EEPROM: a multiple of 128 octets, which is what
// the size word can tell. What is not needed is filled with 0xFF, as in an erased EEPROM. Returns the octets
// that are in use, the end mark included. Faults: odd_length (not a multiple of 128), no_room, too_long;
// `eeprom` is worth nothing then. No allocation; its time grows with the square of the number of different
// texts.
[[nodiscard]] Parsed<std::size_t> write_image(const Description& device, MutableBytes eeprom);

}  // namespace margay::wire::sii
