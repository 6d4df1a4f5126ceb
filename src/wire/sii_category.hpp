// The content of the categories of an SII (ETG.1000.6 and ETG.2010, the tables of the category structures). Every
// reader gets the content of one category without its header, and never reads past its end.
#pragma once

#include "wire/sii.hpp"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace margay::wire::sii {

// The number of a string in the strings category, from 1; 0: no string.
using StringNumber = std::uint8_t;

// The octets of string `number`; empty for number 0. Faults: string_missing, string_past_end. The standard does not
// specify the encoding: it is mostly ASCII, sometimes ISO 8859-1; see to_utf8().
[[nodiscard]] Parsed<Bytes> string(Bytes strings, StringNumber number);

// The number of strings that the category announces.
[[nodiscard]] std::uint8_t string_count(Bytes strings);

// Whether the octets are valid UTF-8.
[[nodiscard]] bool is_utf8(Bytes octets);

// Writes the octets of a string as UTF-8 into `out` and returns the written part. Valid UTF-8 is not changed; other
// octets are converted from ISO 8859-1. Control characters become '?', and spaces and zeros at the end are removed. The
// result never ends within a character.
std::string_view to_utf8(Bytes octets, std::span<char> out);

// General (30).
struct General {
    StringNumber group = 0;
    StringNumber image = 0;
    StringNumber order = 0;
    StringNumber name = 0;
    std::uint8_t coe_details = 0;  // margay::coe_detail bits
    std::uint8_t foe_details = 0;  // bit 0: FoE is supported
    std::uint8_t eoe_details = 0;  // bit 0: EoE is supported
    std::uint8_t soe_channels = 0;
    std::uint8_t ds402_channels = 0;
    std::uint8_t sysman_class = 0;
    std::uint8_t flags = 0;                    // general_flag bits
    std::int16_t ebus_current_ma = 0;          // current taken from the E-bus; negative: current supplied to the E-bus
    std::uint16_t physical_ports = 0;          // four bits per port, see physical_port()
    std::uint16_t identification_address = 0;  // ESC address of the explicit device id; see general_flag::kIdentMemory
    friend constexpr bool operator==(const General&, const General&) = default;
};

namespace general_flag {
inline constexpr std::uint8_t kEnableSafeOp = 0x01;
inline constexpr std::uint8_t kNotLrw = 0x02;           // LRW is not supported
inline constexpr std::uint8_t kMailboxDataLink = 0x04;  // supports the mailbox data link layer (repeat)
inline constexpr std::uint8_t kIdentAlStatus = 0x08;    // explicit device ID by AL status code
inline constexpr std::uint8_t kIdentMemory = 0x10;      // explicit device ID at identification_address
}  // namespace general_flag

enum class PhysicalPort : std::uint8_t { unused = 0, mii = 1, reserved = 2, ebus = 3, fast_hot_connect = 4 };
[[nodiscard]] constexpr PhysicalPort physical_port(const General& general, unsigned port) {
    return static_cast<PhysicalPort>((general.physical_ports >> (4 * port)) & 0x0F);
}

inline constexpr std::size_t kGeneralBytes = 32;

// Fault truncated when `content` is shorter than kGeneralBytes; the value contains the fields that exist.
[[nodiscard]] Parsed<General> parse_general(Bytes content);

// Iterates over entries of a fixed size. `Load` converts one entry to a value.
//
//     SyncManagers managers(content);
//     while (auto manager = managers.next()) …;
//     if (managers.fault() != Fault::none) …;
template <auto Load, std::size_t EntryBytes>
class Entries {
  public:
    using Value = decltype(Load(Bytes{}));
    static constexpr std::size_t kEntryBytes = EntryBytes;

    explicit constexpr Entries(Bytes content) : left_(content) {}

    // Number of remaining whole entries.
    [[nodiscard]] constexpr std::size_t count() const { return left_.size() / EntryBytes; }
    // `trailing` when the content is not a whole number of entries.
    [[nodiscard]] constexpr Fault fault() const {
        return left_.size() % EntryBytes != 0 ? Fault::trailing : Fault::none;
    }
    constexpr std::optional<Value> next() {
        if (left_.size() < EntryBytes) return std::nullopt;
        const auto entry = left_.first(EntryBytes);
        left_ = left_.subspan(EntryBytes);
        return Load(entry);
    }

  private:
    Bytes left_;
};

// FMMU (40): one octet per FMMU. 0x00 and 0xFF mean unused; the last octet may only be padding to a word.
[[nodiscard]] constexpr FmmuUse load_fmmu_use(Bytes at) {
    const auto octet = load_le<std::uint8_t>(at);
    return octet <= static_cast<std::uint8_t>(FmmuUse::mailbox_status) ? static_cast<FmmuUse>(octet) : FmmuUse::unused;
}
using FmmuUses = Entries<load_fmmu_use, 1>;

// SyncManager (41). The status octet of the table is ignored. A type that the standard does not define keeps its value.
namespace sm_enable {
inline constexpr std::uint8_t kEnable = 0x01;
inline constexpr std::uint8_t kFixedContent = 0x02;
inline constexpr std::uint8_t kVirtual = 0x04;  // without a SyncManager in the ESC
inline constexpr std::uint8_t kOpOnly = 0x08;   // to be activated in OP only
}  // namespace sm_enable

inline constexpr std::size_t kSyncManagerBytes = 8;
[[nodiscard]] constexpr SmInfo load_sm_info(Bytes at) {
    return {.start = load_le<std::uint16_t>(at, 0),
            .length_bytes = load_le<std::uint16_t>(at, 2),
            .control = load_le<std::uint8_t>(at, 4),
            .enable = load_le<std::uint8_t>(at, 6),
            .type = load_le<SmType>(at, 7)};
}
using SyncManagers = Entries<load_sm_info, kSyncManagerBytes>;

// One entry of a PDO. Index 0: a gap.
struct PdoEntry {
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    StringNumber name = 0;
    std::uint8_t data_type = 0;  // index of a basic data type of CoE (ETG.1000.6, "Base data types")
    std::uint8_t bit_length = 0;
    std::uint16_t flags = 0;
    friend constexpr bool operator==(const PdoEntry&, const PdoEntry&) = default;
};

inline constexpr std::size_t kPdoEntryBytes = 8;
[[nodiscard]] constexpr PdoEntry load_pdo_entry(Bytes at) {
    return {.index = load_le<std::uint16_t>(at, 0),
            .subindex = load_le<std::uint8_t>(at, 2),
            .name = load_le<std::uint8_t>(at, 3),
            .data_type = load_le<std::uint8_t>(at, 4),
            .bit_length = load_le<std::uint8_t>(at, 5),
            .flags = load_le<std::uint16_t>(at, 6)};
}
using PdoEntries = Entries<load_pdo_entry, kPdoEntryBytes>;

// TxPDO (50) and RxPDO (51).
struct Pdo {
    static constexpr std::uint8_t kNoSyncManager = 0xFF;

    std::uint16_t index = 0;
    std::uint8_t entry_count = 0;
    std::uint8_t sync_manager = kNoSyncManager;  // default assignment
    std::uint8_t synchronization = 0;
    StringNumber name = 0;
    std::uint16_t flags = 0;  // pdo_flag bits and others
    Bytes entries;            // to be read with PdoEntries

    // Whether the PDO is part of the process data by default.
    [[nodiscard]] constexpr bool assigned() const { return sync_manager != kNoSyncManager; }
};

namespace pdo_flag {
inline constexpr std::uint16_t kMandatory = 0x0001;
inline constexpr std::uint16_t kDefault = 0x0002;
inline constexpr std::uint16_t kFixedContent = 0x0010;
inline constexpr std::uint16_t kVirtual = 0x0020;
}  // namespace pdo_flag

inline constexpr std::size_t kPdoBytes = 8;  // without its entries
[[nodiscard]] constexpr Pdo load_pdo(Bytes at) {
    return {.index = load_le<std::uint16_t>(at, 0),
            .entry_count = load_le<std::uint8_t>(at, 2),
            .sync_manager = load_le<std::uint8_t>(at, 3),
            .synchronization = load_le<std::uint8_t>(at, 4),
            .name = load_le<std::uint8_t>(at, 5),
            .flags = load_le<std::uint16_t>(at, 6),
            .entries = {}};
}

// Faults: category_overlap when a PDO has more entries than fit into the category (this PDO is not returned), trailing
// when the rest is too short for a PDO.
class Pdos {
  public:
    explicit constexpr Pdos(Bytes content) : left_(content) {}

    [[nodiscard]] constexpr Fault fault() const { return fault_; }
    constexpr std::optional<Pdo> next() {
        if (fault_ != Fault::none || left_.empty()) return std::nullopt;
        if (left_.size() < kPdoBytes) {
            fault_ = Fault::trailing;
            return std::nullopt;
        }
        auto pdo = load_pdo(left_);
        const std::size_t entries_bytes = pdo.entry_count * kPdoEntryBytes;
        if (entries_bytes > left_.size() - kPdoBytes) {
            fault_ = Fault::category_overlap;
            return std::nullopt;
        }
        pdo.entries = left_.subspan(kPdoBytes, entries_bytes);
        left_ = left_.subspan(kPdoBytes + entries_bytes);
        return pdo;
    }

  private:
    Bytes left_;
    Fault fault_ = Fault::none;
};

// DC (60): one structure for each operation mode.
struct DcOpMode {
    std::uint32_t sync0_cycle_time_ns = 0;  // 0: the bus cycle time multiplied by the factor
    std::int32_t sync0_shift_time_ns = 0;
    std::int32_t sync1_shift_time_ns = 0;
    std::int16_t sync1_cycle_factor = 0;
    std::uint16_t assign_activate = 0;  // for 0x0980 (cyclic unit control, SYNC activation)
    std::int16_t sync0_cycle_factor = 0;
    StringNumber name = 0;
    StringNumber description = 0;
    friend constexpr bool operator==(const DcOpMode&, const DcOpMode&) = default;
};

inline constexpr std::size_t kDcOpModeBytes = 24;
[[nodiscard]] constexpr DcOpMode load_dc_op_mode(Bytes at) {
    return {.sync0_cycle_time_ns = load_le<std::uint32_t>(at, 0),
            .sync0_shift_time_ns = load_le<std::int32_t>(at, 4),
            .sync1_shift_time_ns = load_le<std::int32_t>(at, 8),
            .sync1_cycle_factor = load_le<std::int16_t>(at, 12),
            .assign_activate = load_le<std::uint16_t>(at, 14),
            .sync0_cycle_factor = load_le<std::int16_t>(at, 16),
            .name = load_le<std::uint8_t>(at, 18),
            .description = load_le<std::uint8_t>(at, 19)};
}
using DcOpModes = Entries<load_dc_op_mode, kDcOpModeBytes>;

}  // namespace margay::wire::sii
