// Creates an SII image from the description of a device, for simulated slaves, slave stacks and tests.
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
    DcOpMode mode = {};  // its members name and description are ignored
    std::string_view name = {};
    std::string_view description = {};
};

// The octets of a category; an odd number is padded to a word.
struct RawCategory {
    std::uint16_t type = category::kNop;
    Bytes content = {};
};

// Empty categories are left out, except General, which every device has. Texts are stored in the strings category,
// equal texts only once; string numbers in `general` are ignored. Spans and texts must be valid during the call only.
struct Description {
    Configuration configuration = {};  // the checksum is calculated
    Identity identity = {};
    MailboxInfo mailbox = {};
    MailboxInfo boot_mailbox = {};  // its protocols are ignored
    std::uint16_t version = 1;
    std::string_view group = {};
    std::string_view group_name = {};
    std::string_view image = {};
    std::string_view order = {};
    std::string_view name = {};
    General general = {};
    std::span<const RawCategory> device_specific = {};  // written before the strings
    std::span<const FmmuUse> fmmus = {};
    std::span<const SmInfo> sync_managers = {};
    std::span<const PdoDescription> tx_pdos = {};
    std::span<const PdoDescription> rx_pdos = {};
    std::span<const DcDescription> dc = {};
    std::span<const RawCategory> others = {};  // written after all other categories
};

// Writes the image into `eeprom`. The size of `eeprom` is the size of the EEPROM: a multiple of 128 octets, because the
// size word has this unit. The unused rest is filled with 0xFF, as in an erased EEPROM. Returns the number of used
// octets including the end mark. Faults: odd_length (not a multiple of 128), no_room, too_long; the content of `eeprom`
// is invalid then. No allocation; the time grows with the square of the number of different texts.
[[nodiscard]] Parsed<std::size_t> write_image(const Description& device, MutableBytes eeprom);

}  // namespace margay::wire::sii
