// The slave information interface: the content of the EEPROM of a slave, by word address (ETG.1000.6 and ETG.2010,
// "Slave information interface"). This file contains the fixed part, words 0x00–0x3F, and the chain of categories that
// follows it. sii_category.hpp contains the content of the categories, sii_check.hpp the check of a whole image.
//
// A master that reads over the wire never has a whole image in memory: it loads the words it needs with load_…(),
// follows the chain with CategoryChain, and reads the content of the categories it needs.
#pragma once

#include "util/bytes.hpp"

#include <margay/error.hpp>
#include <margay/sii.hpp>
#include <margay/slave.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace margay::wire::sii {

inline constexpr std::size_t kWordBytes = 2;

// Word addresses.
namespace word {
inline constexpr std::uint32_t kPdiControl = 0x00;  // the ESC loads words 0x00–0x07 itself
inline constexpr std::uint32_t kAlias = 0x04;
inline constexpr std::uint32_t kChecksum = 0x07;
inline constexpr std::uint32_t kIdentity = 0x08;  // vendor, product, revision, serial number, two words each
inline constexpr std::uint32_t kBootMailbox = 0x14;
inline constexpr std::uint32_t kMailbox = 0x18;
inline constexpr std::uint32_t kMailboxProtocols = 0x1C;
inline constexpr std::uint32_t kSize = 0x3E;
inline constexpr std::uint32_t kVersion = 0x3F;
inline constexpr std::uint32_t kCategories = 0x40;  // header of the first category
}  // namespace word

inline constexpr std::size_t kConfigurationBytes = 16;  // words 0x00–0x07
inline constexpr std::size_t kIdentityBytes = 16;       // words 0x08–0x0F
inline constexpr std::size_t kMailboxesBytes = 18;      // words 0x14–0x1C
inline constexpr std::size_t kFixedBytes = word::kCategories * kWordBytes;
inline constexpr std::size_t kCategoryHeaderBytes = 4;

// Errors of an image or of a part of it.
enum class Fault : std::uint8_t {
    none,
    blank,                 // erased: every octet is 0xFF
    odd_length,            // not a whole number of words
    truncated,             // shorter than its own length field
    no_end,                // the chain of categories reaches the end of the EEPROM without an end mark
    category_past_end,     // a category is longer than the rest of the EEPROM
    category_overlap,      // the content of a category exceeds its end and reaches into the next category
    category_repeated,     // a category that may occur only once occurs twice
    trailing,              // octets after the last whole entry of a category
    checksum,              // the CRC of words 0x00–0x06 differs from word 0x07
    size_mismatch,         // word 0x3E contains another size than that of the image
    mailbox_without_size,  // a protocol is announced, but a mailbox has no size
    mailbox_one_sided,     // only one of the two mailboxes has a size
    mailbox_too_short,     // shorter than a mailbox header; from the writer: than the shortest message
    mailbox_too_large,     // larger than the data of one datagram
    mailbox_outside,       // not in the process RAM of an ESC
    mailbox_overlap,       // the two mailboxes share memory
    sync_manager_outside,  // from the writer: a SyncManager is not in the process RAM of an ESC
    sync_manager_overlap,  // from the writer: two SyncManagers share memory (three buffers take three times the length)
    string_past_end,       // a string is longer than its category
    string_missing,        // a string number above the number of strings
    unknown_value,         // the standard does not define the value of an enumeration
    no_room,               // from the writer: the image does not fit
    cycle_limits,          // from the writer: the shortest SYNC0 cycle time of the device is above the longest
    too_long,              // from the writer: a text, list or category has too many elements for its counter
};

// Text of a fault, and its error code. The strings are static. Callable from any thread and from the cycle.
[[nodiscard]] std::string_view to_text(Fault fault);
[[nodiscard]] Errc to_errc(Fault fault);

// A value and its fault. With a fault, the value contains everything that could be read.
template <class T>
struct Parsed {
    T value{};
    Fault fault = Fault::none;
    [[nodiscard]] constexpr bool ok() const { return fault == Fault::none; }
};

// Words 0x00–0x07: the values that the ESC loads into its registers when it starts.
struct Configuration {
    std::uint16_t pdi_control = 0;                 // for register 0x0140
    std::uint16_t pdi_configuration = 0;           // for register 0x0150
    std::uint16_t sync_pulse_length_10ns = 0;      // for register 0x0982
    std::uint16_t extended_pdi_configuration = 0;  // for register 0x0152
    std::uint16_t alias = 0;                       // for register 0x0012
    std::array<std::uint16_t, 2> reserved{};
    std::uint16_t checksum = 0;  // low octet
    friend constexpr bool operator==(const Configuration&, const Configuration&) = default;
};

struct ConfigurationLayout {
    using pdi_control = Field<std::uint16_t, 0x00>;
    using pdi_configuration = Field<std::uint16_t, 0x02>;
    using sync_pulse_length = Field<std::uint16_t, 0x04>;
    using extended_pdi_configuration = Field<std::uint16_t, 0x06>;
    using alias = Field<std::uint16_t, 0x08>;
    using reserved0 = Field<std::uint16_t, 0x0A>;
    using reserved1 = Field<std::uint16_t, 0x0C>;
    using checksum = Field<std::uint16_t, 0x0E>;
    static_assert(checksum::end == kConfigurationBytes);
};

// `at` must have kConfigurationBytes octets, from word 0 on.
[[nodiscard]] constexpr Configuration load_configuration(Bytes at) {
    using L = ConfigurationLayout;
    return {.pdi_control = L::pdi_control::load(at),
            .pdi_configuration = L::pdi_configuration::load(at),
            .sync_pulse_length_10ns = L::sync_pulse_length::load(at),
            .extended_pdi_configuration = L::extended_pdi_configuration::load(at),
            .alias = L::alias::load(at),
            .reserved = {L::reserved0::load(at), L::reserved1::load(at)},
            .checksum = L::checksum::load(at)};
}

// The CRC of words 0x00–0x06. `at` must have at least these 14 octets.
[[nodiscard]] constexpr std::uint8_t checksum(Bytes at) {
    return sii_checksum(at.first<ConfigurationLayout::checksum::offset>());
}

// Whether the low octet of word 7 is the CRC of the previous words. `at` must have kConfigurationBytes octets. Report a
// wrong checksum, but continue: the ESC exists and communication is possible.
[[nodiscard]] constexpr bool checksum_right(Bytes at) {
    return static_cast<std::uint8_t>(ConfigurationLayout::checksum::load(at)) == checksum(at);
}

// Stores all words with a newly calculated checksum; `c.checksum` is ignored. `at` must have kConfigurationBytes
// octets.
constexpr void store_configuration(MutableBytes at, const Configuration& c) {
    using L = ConfigurationLayout;
    L::pdi_control::store(at, c.pdi_control);
    L::pdi_configuration::store(at, c.pdi_configuration);
    L::sync_pulse_length::store(at, c.sync_pulse_length_10ns);
    L::extended_pdi_configuration::store(at, c.extended_pdi_configuration);
    L::alias::store(at, c.alias);
    L::reserved0::store(at, c.reserved[0]);
    L::reserved1::store(at, c.reserved[1]);
    L::checksum::store(at, checksum(at));
}

// `at` must have kIdentityBytes octets, from word::kIdentity on.
[[nodiscard]] constexpr Identity load_identity(Bytes at) {
    return {load_le<std::uint32_t>(at, 0), load_le<std::uint32_t>(at, 4), load_le<std::uint32_t>(at, 8),
            load_le<std::uint32_t>(at, 12)};
}

constexpr void store_identity(MutableBytes at, const Identity& identity) {
    store_le(at, 0, identity.vendor);
    store_le(at, 4, identity.product);
    store_le(at, 8, identity.revision);
    store_le(at, 12, identity.serial);
}

// The mailboxes of the states PREOP to OP, and the mailboxes of BOOT. The receive mailbox of the standard is the
// mailbox that the slave receives with; for the master it is `out`.
struct Mailboxes {
    MailboxInfo boot;  // its protocols are as in `standard`
    MailboxInfo standard;
};

struct MailboxesLayout {  // from word::kBootMailbox on
    using boot_receive_offset = Field<std::uint16_t, 0x00>;
    using boot_receive_size = Field<std::uint16_t, 0x02>;
    using boot_send_offset = Field<std::uint16_t, 0x04>;
    using boot_send_size = Field<std::uint16_t, 0x06>;
    using receive_offset = Field<std::uint16_t, 0x08>;
    using receive_size = Field<std::uint16_t, 0x0A>;
    using send_offset = Field<std::uint16_t, 0x0C>;
    using send_size = Field<std::uint16_t, 0x0E>;
    using protocols = Field<std::uint16_t, 0x10>;
    static_assert(protocols::end == kMailboxesBytes);
};

// `at` must have kMailboxesBytes octets, from word::kBootMailbox on. The values are not checked; see mailbox_fault().
[[nodiscard]] constexpr Mailboxes load_mailboxes(Bytes at) {
    using L = MailboxesLayout;
    const auto protocols = L::protocols::load(at);
    return {.boot = {L::boot_receive_offset::load(at), L::boot_receive_size::load(at), L::boot_send_offset::load(at),
                     L::boot_send_size::load(at), protocols},
            .standard = {L::receive_offset::load(at), L::receive_size::load(at), L::send_offset::load(at),
                         L::send_size::load(at), protocols}};
}

constexpr void store_mailboxes(MutableBytes at, const Mailboxes& m) {
    using L = MailboxesLayout;
    L::boot_receive_offset::store(at, m.boot.out_start);
    L::boot_receive_size::store(at, m.boot.out_bytes);
    L::boot_send_offset::store(at, m.boot.in_start);
    L::boot_send_size::store(at, m.boot.in_bytes);
    L::receive_offset::store(at, m.standard.out_start);
    L::receive_size::store(at, m.standard.out_bytes);
    L::send_offset::store(at, m.standard.in_start);
    L::send_size::store(at, m.standard.in_bytes);
    L::protocols::store(at, m.standard.protocols);
}

// The reason why a pair of mailboxes of the SII is not usable; none when it is usable, or when there is no mailbox. The
// boot mailboxes may be absent although a protocol is announced: call the function with protocols 0 for them.
[[nodiscard]] Fault mailbox_fault(const MailboxInfo& mailbox);

// For Fault::mailbox_too_large: the oversized mailbox (the receive mailbox of the slave is checked first). `word` is
// the word of its size, counted from the first word of the pair.
struct OversizedMailbox {
    std::uint32_t word = 0;
    std::uint16_t bytes = 0;
};
[[nodiscard]] OversizedMailbox oversized_mailbox(const MailboxInfo& mailbox);

// The size of the EEPROM from word 0x3E, which contains the number of KiBit minus one.
[[nodiscard]] constexpr std::uint32_t eeprom_bytes(std::uint16_t size_word) {
    return (size_word + std::uint32_t{1}) * 128;
}
[[nodiscard]] constexpr std::uint16_t size_word(std::uint32_t eeprom_bytes) {
    return static_cast<std::uint16_t>(eeprom_bytes / 128 - 1);
}

// The content of an SII is not read beyond this size. The size word has 16 bits and may announce 8 MiB, which take
// minutes to read. The largest common EEPROMs with two address octets have 64 KiB.
inline constexpr std::uint32_t kMostContentBytes = 0x10000;
// End of the words that the chain of categories may use in an EEPROM of this size.
[[nodiscard]] constexpr std::uint32_t content_end_word(std::uint32_t eeprom_bytes) {
    return static_cast<std::uint32_t>((eeprom_bytes < kMostContentBytes ? eeprom_bytes : kMostContentBytes) /
                                      kWordBytes);
}

// The whole fixed part.
struct FixedPart {
    Configuration configuration;
    Identity identity;
    Mailboxes mailboxes;
    std::uint32_t eeprom_bytes = 0;
    std::uint16_t version = 0;
};

// Reads the fixed part of an image. Faults: truncated when the image is shorter than kFixedBytes (the value is empty),
// checksum when the checksum is wrong.
[[nodiscard]] Parsed<FixedPart> load_fixed_part(Bytes image);

[[nodiscard]] bool is_blank(Bytes image);  // every octet is 0xFF; an empty image is not blank

// Category types: the first word of a category header.
namespace category {
inline constexpr std::uint16_t kNop = 0;
inline constexpr std::uint16_t kLastDeviceSpecific = 9;  // 1–9
inline constexpr std::uint16_t kStrings = 10;
inline constexpr std::uint16_t kDataTypes = 20;
inline constexpr std::uint16_t kGeneral = 30;
inline constexpr std::uint16_t kFmmu = 40;
inline constexpr std::uint16_t kSyncManager = 41;
inline constexpr std::uint16_t kFmmuExtended = 42;
inline constexpr std::uint16_t kSyncUnit = 43;
inline constexpr std::uint16_t kTxPdo = 50;  // inputs: the slave transmits
inline constexpr std::uint16_t kRxPdo = 51;  // outputs
inline constexpr std::uint16_t kDc = 60;
inline constexpr std::uint16_t kFirstVendorSpecific = 0x0800;
inline constexpr std::uint16_t kLastVendorSpecific = 0x0FFF;
inline constexpr std::uint16_t kVendorSpecificBit = 0x8000;
inline constexpr std::uint16_t kEnd = 0xFFFF;

[[nodiscard]] std::string_view name(std::uint16_t type);  // "SyncManager"; "unknown" for an undefined type. Static
}  // namespace category

// Location of the content of a category.
struct CategoryPlace {
    std::uint16_t type = category::kEnd;
    std::uint16_t words = 0;  // size of the content
    std::uint32_t word = 0;   // word address of the content
};

// Follows the chain of categories by their headers. The caller reads the headers from any source:
//
//     CategoryChain chain(end_word);
//     while (chain.more()) {
//         … read kCategoryHeaderBytes from word chain.header_word() …
//         const auto place = chain.step(header);
//         if (!place) break;                      // the end, or chain.fault()
//         … read the needed words of place->words at place->word …
//     }
//
// The loop ends for any content, because each step goes at least two words forward. A header of two zero words is
// treated as memory that was never written (Fault::no_end), so that a cleared EEPROM is not read to its end.
class CategoryChain {
  public:
    // `end_word`: the size of the EEPROM in words, as far as it is known.
    explicit constexpr CategoryChain(std::uint32_t end_word) : end_word_(end_word) { look_ahead(); }

    [[nodiscard]] constexpr bool more() const { return more_; }
    [[nodiscard]] constexpr std::uint32_t header_word() const { return at_; }
    [[nodiscard]] constexpr Fault fault() const { return fault_; }

    // `header` must have kCategoryHeaderBytes octets. When the end mark is the last word of the EEPROM, the second word
    // of the header is ignored. Returns nullopt at the end mark and on a fault.
    constexpr std::optional<CategoryPlace> step(Bytes header) {
        if (!more_) return std::nullopt;
        const CategoryPlace place{load_le<std::uint16_t>(header, 0), load_le<std::uint16_t>(header, 2), at_ + 2};
        if (place.type == category::kEnd) return stop(Fault::none);
        if (place.type == category::kNop && place.words == 0) return stop(Fault::no_end);
        if (place.word > end_word_ || place.words > end_word_ - place.word) return stop(Fault::category_past_end);
        at_ = place.word + place.words;
        look_ahead();
        return place;
    }

  private:
    constexpr void look_ahead() {
        more_ = at_ < end_word_;
        if (!more_) fault_ = Fault::no_end;
    }
    constexpr std::nullopt_t stop(Fault fault) {
        more_ = false;
        fault_ = fault;
        return std::nullopt;
    }

    std::uint32_t end_word_;
    std::uint32_t at_ = word::kCategories;
    bool more_ = false;
    Fault fault_ = Fault::none;
};

struct Category {
    CategoryPlace place;
    Bytes content;
};

// The same for an image in memory.
//
//     CategoryWalker walker(image);
//     while (auto category = walker.next()) …;
//     if (walker.fault() != Fault::none) …;   // the categories before the fault are valid
class CategoryWalker {
  public:
    explicit constexpr CategoryWalker(Bytes image)
        : image_(image), chain_(static_cast<std::uint32_t>(image.size() / kWordBytes)) {}

    constexpr std::optional<Category> next() {
        if (!chain_.more()) return std::nullopt;
        const auto rest = image_.subspan(chain_.header_word() * kWordBytes);
        std::array<std::byte, kCategoryHeaderBytes> header{};
        for (std::size_t i = 0; i < header.size() && i < rest.size(); ++i) header[i] = rest[i];
        const auto place = chain_.step(header);
        if (!place) return std::nullopt;
        return Category{*place, image_.subspan(place->word * kWordBytes, place->words * kWordBytes)};
    }
    [[nodiscard]] constexpr Fault fault() const { return chain_.fault(); }
    // The word address of the end mark, or of the header with the fault.
    [[nodiscard]] constexpr std::uint32_t stopped_at() const { return chain_.header_word(); }

  private:
    Bytes image_;
    CategoryChain chain_;
};

// The content of the first category of a type; nullopt when the image has none.
[[nodiscard]] std::optional<Bytes> find_category(Bytes image, std::uint16_t type);

}  // namespace margay::wire::sii
