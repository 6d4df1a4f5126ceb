// The slave information interface: what stands in the EEPROM of a slave, by word address (ETG.1000.6 and
// ETG.2010, "Slave information interface"). Here: the fixed part, words 0x00–0x3F, and the chain of
// categories behind it. What is in a category is in sii_category.hpp, what can be wrong with a whole image in
// sii_check.hpp.
//
// A master that reads over the wire never holds a whole image: it loads the words it needs with load_…(),
// follows the chain with CategoryChain, and reads the contents of the categories it wants.
#pragma once

#include "util/bytes.hpp"

#include <margay/error.hpp>
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
inline constexpr std::uint32_t kPdiControl = 0x00;  // words 0x00–0x07 are what the ESC itself loads
inline constexpr std::uint32_t kAlias = 0x04;
inline constexpr std::uint32_t kChecksum = 0x07;
inline constexpr std::uint32_t kIdentity = 0x08;  // vendor, product, revision, serial, two words each
inline constexpr std::uint32_t kBootMailbox = 0x14;
inline constexpr std::uint32_t kMailbox = 0x18;
inline constexpr std::uint32_t kMailboxProtocols = 0x1C;
inline constexpr std::uint32_t kSize = 0x3E;
inline constexpr std::uint32_t kVersion = 0x3F;
inline constexpr std::uint32_t kCategories = 0x40;  // the first category's header
}  // namespace word

inline constexpr std::size_t kConfigurationBytes = 16;  // words 0x00–0x07
inline constexpr std::size_t kIdentityBytes = 16;       // words 0x08–0x0F
inline constexpr std::size_t kMailboxesBytes = 18;      // words 0x14–0x1C
inline constexpr std::size_t kFixedBytes = word::kCategories * kWordBytes;
inline constexpr std::size_t kCategoryHeaderBytes = 4;

// What is wrong with an image or a part of it.
enum class Fault : std::uint8_t {
    none,
    blank,                 // erased: every octet is 0xFF
    odd_length,            // not a whole number of words
    truncated,             // ends before its own description says so
    no_end,                // the chain of categories leads to the end of the EEPROM without an end mark
    category_past_end,     // a category is longer than what is left of the EEPROM
    category_overlap,      // what a category describes reaches past its end, into the next one
    category_repeated,     // a category that there is only one of comes twice
    trailing,              // octets behind the last whole entry of a category
    checksum,              // CRC of words 0x00–0x06 is not what word 0x07 says
    size_mismatch,         // word 0x3E tells another size than the image has
    mailbox_without_size,  // a protocol is announced, but a mailbox has no size
    mailbox_one_sided,     // only one of the two mailboxes has a size
    mailbox_too_short,     // no room for a mailbox header
    mailbox_too_large,     // more octets than a frame carries in one datagram
    mailbox_outside,       // not in the process RAM of an ESC
    mailbox_overlap,       // the two mailboxes share memory
    string_past_end,       // a string is longer than its category
    string_missing,        // a string number above the number of strings
    unknown_value,         // an enumeration with a value that the standard does not have
    no_room,               // for the writer: the image does not fit
    too_long,              // for the writer: a text, a list or a category with more elements than can be counted
};

// A fault in words, and the kind of error it is. Static; callable from anywhere.
[[nodiscard]] std::string_view to_text(Fault fault);
[[nodiscard]] Errc to_errc(Fault fault);

// A value and what is wrong with it. Where there is a fault the value holds what could be read.
template <class T>
struct Parsed {
    T value{};
    Fault fault = Fault::none;
    [[nodiscard]] constexpr bool ok() const { return fault == Fault::none; }
};

// Words 0x00–0x07: what the ESC loads into its registers when it starts.
struct Configuration {
    std::uint16_t pdi_control = 0;                 // to 0x0140
    std::uint16_t pdi_configuration = 0;           // to 0x0150
    std::uint16_t sync_pulse_length_10ns = 0;      // to 0x0982
    std::uint16_t extended_pdi_configuration = 0;  // to 0x0152
    std::uint16_t alias = 0;                       // to 0x0012
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

// `at` holds kConfigurationBytes, from word 0 on.
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

// The CRC over words 0x00–0x06: polynomial x⁸ + x² + x + 1, start value 0xFF. `at` holds those 14 octets or
// more.
[[nodiscard]] constexpr std::uint8_t checksum(Bytes at) {
    unsigned crc = 0xFF;
    for (const auto octet : at.first(ConfigurationLayout::checksum::offset)) {
        crc ^= std::to_integer<unsigned>(octet);
        for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x80) != 0 ? ((crc << 1) ^ 0x07) & 0xFF : crc << 1;
    }
    return static_cast<std::uint8_t>(crc);
}

// Whether the low octet of word 7 is the CRC of the words before it. `at` holds kConfigurationBytes. To be
// reported when it is not, but no reason to stop: the ESC is there and can be talked to.
[[nodiscard]] constexpr bool checksum_right(Bytes at) {
    return static_cast<std::uint8_t>(ConfigurationLayout::checksum::load(at)) == checksum(at);
}

// Stores all of it with the checksum computed; `c.checksum` is not looked at. `at` holds kConfigurationBytes.
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

// `at` holds kIdentityBytes, from word::kIdentity on.
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

// The mailboxes of states PREOP to OP and those of BOOT. What the standard calls the receive mailbox is what
// the slave receives with: the master's `out`.
struct Mailboxes {
    MailboxInfo boot;  // protocols: those of standard
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

// `at` holds kMailboxesBytes, from word::kBootMailbox on. Values as they stand there; see mailbox_fault().
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

// Why a pair of mailboxes cannot be used as the SII has it; none when it can, or when there is no mailbox at
// all. For the boot mailboxes, which may be absent while a protocol is announced, call it with protocols 0.
[[nodiscard]] Fault mailbox_fault(const MailboxInfo& mailbox);

// Fault::mailbox_too_large: which of the two it is (the slave's receive mailbox first), as the word of its size,
// counted from the first word of the pair.
struct OversizedMailbox {
    std::uint32_t word = 0;
    std::uint16_t bytes = 0;
};
[[nodiscard]] OversizedMailbox oversized_mailbox(const MailboxInfo& mailbox);

// The size of the EEPROM by word 0x3E, which counts KiBit less one.
[[nodiscard]] constexpr std::uint32_t eeprom_bytes(std::uint16_t size_word) {
    return (size_word + std::uint32_t{1}) * 128;
}
[[nodiscard]] constexpr std::uint16_t size_word(std::uint32_t eeprom_bytes) {
    return static_cast<std::uint16_t>(eeprom_bytes / 128 - 1);
}

// No content of an SII is followed beyond this size, whatever the size word says: it has 16 bits and may tell 8 MiB,
// which take minutes to read. The largest EEPROMs of common two-octet addressing have 64 KiB.
inline constexpr std::uint32_t kMostContentBytes = 0x10000;
// The words that the chain of categories may have in an EEPROM of this size.
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

// From an image; truncated when it holds less than kFixedBytes (the value is empty then), checksum when that
// is wrong.
[[nodiscard]] Parsed<FixedPart> load_fixed_part(Bytes image);

[[nodiscard]] bool is_blank(Bytes image);  // every octet is 0xFF; an empty image is not blank

// Category types, the first word of a category's header.
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

[[nodiscard]] std::string_view name(std::uint16_t type);  // "SyncManager"; "unknown" where there is none. Static
}  // namespace category

// Where a category's content is.
struct CategoryPlace {
    std::uint16_t type = category::kEnd;
    std::uint16_t words = 0;  // of the content
    std::uint32_t word = 0;   // address of the content
};

// Follows the chain of categories by their headers, wherever those come from:
//
//     CategoryChain chain(end_word);
//     while (chain.more()) {
//         … read kCategoryHeaderBytes from word chain.header_word() …
//         const auto place = chain.step(header);
//         if (!place) break;                      // the end, or chain.fault()
//         … read what is wanted of place->words at place->word …
//     }
//
// It comes to an end on any content: each step is at least two words forward. A header of two zero words is
// taken for memory that nobody wrote (Fault::no_end), so that a cleared EEPROM is not walked to its end.
class CategoryChain {
  public:
    // `end_word`: the size of the EEPROM in words, as far as known.
    explicit constexpr CategoryChain(std::uint32_t end_word) : end_word_(end_word) { look_ahead(); }

    [[nodiscard]] constexpr bool more() const { return more_; }
    [[nodiscard]] constexpr std::uint32_t header_word() const { return at_; }
    [[nodiscard]] constexpr Fault fault() const { return fault_; }

    // `header` holds kCategoryHeaderBytes; where the end mark is the last word of the EEPROM, its length does
    // not matter. Nothing at the end mark, and at a fault.
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

// The same over an image in memory.
//
//     CategoryWalker walker(image);
//     while (auto category = walker.next()) …;
//     if (walker.fault() != Fault::none) …;   // the categories before it are good
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
    // Where it stopped: the word of the end mark, or of the header that is at fault.
    [[nodiscard]] constexpr std::uint32_t stopped_at() const { return chain_.header_word(); }

  private:
    Bytes image_;
    CategoryChain chain_;
};

// The content of the first category of a type; nothing when the image has none.
[[nodiscard]] std::optional<Bytes> find_category(Bytes image, std::uint16_t type);

}  // namespace margay::wire::sii
