// CANopen over EtherCAT: the data of a mailbox message of type CoE (ETG.1000.6 "CANopen over EtherCAT coding"). Offsets
// count from the CoE header. The user of a layout must check the length of the data.
#pragma once

#include "util/bytes.hpp"

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace margay::wire::coe {

enum class Service : std::uint8_t {
    emergency = 1,
    sdo_request = 2,
    sdo_response = 3,
    tx_pdo = 4,
    rx_pdo = 5,
    tx_pdo_remote_request = 6,
    rx_pdo_remote_request = 7,
    sdo_information = 8,
};

struct Header {
    std::uint16_t number = 0;  // number of a PDO, otherwise 0; 9 bits
    Service service{};
    friend constexpr bool operator==(const Header&, const Header&) = default;
};
inline constexpr std::size_t kHeaderBytes = 2;

[[nodiscard]] constexpr Header load_header(Bytes at) {
    const auto word = load_le<std::uint16_t>(at);
    return {static_cast<std::uint16_t>(word & 0x01FF), static_cast<Service>(word >> 12)};
}
constexpr void store_header(MutableBytes at, Header h) {
    store_le<std::uint16_t>(at, 0,
                            static_cast<std::uint16_t>((h.number & 0x01FF) | (static_cast<unsigned>(h.service) << 12)));
}

// ------------------------------------------------------------------ SDO transfers

// The command specifier: the upper three bits of the first octet of an SDO.
namespace request {
inline constexpr std::uint8_t kDownloadSegment = 0;
inline constexpr std::uint8_t kDownload = 1;
inline constexpr std::uint8_t kUpload = 2;
inline constexpr std::uint8_t kUploadSegment = 3;
}  // namespace request
namespace response {
inline constexpr std::uint8_t kUploadSegment = 0;
inline constexpr std::uint8_t kDownloadSegment = 1;
inline constexpr std::uint8_t kUpload = 2;
inline constexpr std::uint8_t kDownload = 3;
}  // namespace response
inline constexpr std::uint8_t kAbortSpecifier = 4;  // in both directions

// The other bits of the first octet. The unused octets of an expedited transfer (of 4) and of a short segment (of 7)
// are counted.
namespace sdo {
inline constexpr std::uint8_t kSizeIndicated = 0x01;
inline constexpr std::uint8_t kExpedited = 0x02;
inline constexpr unsigned kExpeditedUnusedShift = 2;  // 2 bits
inline constexpr std::uint8_t kCompleteAccess = 0x10;
inline constexpr std::uint8_t kLastSegment = 0x01;
inline constexpr unsigned kSegmentUnusedShift = 1;  // 3 bits
inline constexpr std::uint8_t kToggle = 0x10;
[[nodiscard]] constexpr std::uint8_t command(std::uint8_t specifier, unsigned bits = 0) {
    return static_cast<std::uint8_t>((unsigned{specifier} << 5) | bits);
}
[[nodiscard]] constexpr std::uint8_t specifier(std::uint8_t command) { return static_cast<std::uint8_t>(command >> 5); }
}  // namespace sdo

// Upload and download requests and responses, and aborts.
struct SdoLayout {
    using command = Field<std::uint8_t, 2>;
    using index = Field<std::uint16_t, 3>;
    using subindex = Field<std::uint8_t, 5>;
    using complete_size = Field<std::uint32_t, 6>;  // normal transfers; expedited transfers have their data here
    static constexpr std::size_t expedited_data = 6;
    static constexpr std::size_t normal_data = 10;
};
inline constexpr std::size_t kSdoBytes = 10;            // everything except the data of a normal transfer
inline constexpr std::size_t kExpeditedBytes = 4;       // maximum data of an expedited transfer
inline constexpr std::size_t kSegmentHeaderBytes = 3;   // CoE header and command
inline constexpr std::size_t kMinSegmentDataBytes = 7;  // shorter segment data is padded to this size

enum class Abort : std::uint32_t {
    none = 0,
    toggle_not_changed = 0x05030000,
    timeout = 0x05040000,
    unknown_command = 0x05040001,
    out_of_memory = 0x05040005,
    unsupported_access = 0x06010000,
    write_only = 0x06010001,
    read_only = 0x06010002,
    subindex_needs_zero = 0x06010003,  // the subindex cannot be written, because subindex 0 must be 0 for write access
    complete_access_unsupported = 0x06010004,
    exceeds_mailbox = 0x06010005,
    mapped_to_rx_pdo = 0x06010006,
    no_object = 0x06020000,
    cannot_be_mapped = 0x06040041,
    exceeds_pdo = 0x06040042,
    parameter_incompatible = 0x06040043,
    internal_incompatibility = 0x06040047,
    hardware_error = 0x06060000,
    length_mismatch = 0x06070010,
    length_too_high = 0x06070012,
    length_too_low = 0x06070013,
    no_subindex = 0x06090011,
    value_range = 0x06090030,
    value_too_high = 0x06090031,
    value_too_low = 0x06090032,
    max_less_than_min = 0x06090036,
    general = 0x08000000,
    cannot_store = 0x08000020,
    local_control = 0x08000021,
    device_state = 0x08000022,
    no_dictionary = 0x08000023,
};

// ------------------------------------------------------------------ SDO information

enum class InfoOpcode : std::uint8_t {
    list_request = 1,
    list_response = 2,
    object_request = 3,
    object_response = 4,
    entry_request = 5,
    entry_response = 6,
    error = 7,
};

struct InfoLayout {
    using opcode = Field<std::uint8_t, 2>;  // 7 bits, and the bit "incomplete": more fragments follow
    using fragments_left = Field<std::uint16_t, 4>;
    using list_type = Field<std::uint16_t, 6>;  // only in the first fragment of a list
    using index = Field<std::uint16_t, 6>;
    using data_type = Field<std::uint16_t, 8>;  // object response
    using max_subindex = Field<std::uint8_t, 10>;
    using object_code = Field<std::uint8_t, 11>;
    using entry_subindex = Field<std::uint8_t, 8>;  // entry request and response
    using entry_value_info = Field<std::uint8_t, 9>;
    using entry_data_type = Field<std::uint16_t, 10>;
    using entry_bit_length = Field<std::uint16_t, 12>;
    using entry_access = Field<std::uint16_t, 14>;
    using abort = Field<Abort, 6>;  // error
};
inline constexpr std::size_t kInfoHeaderBytes = 6;
inline constexpr std::uint8_t kInfoIncomplete = 0x80;
inline constexpr std::size_t kListRequestBytes = 8;
inline constexpr std::size_t kObjectRequestBytes = 8;
inline constexpr std::size_t kObjectResponseBytes = 12;  // the name follows
inline constexpr std::size_t kEntryRequestBytes = 10;
inline constexpr std::size_t kEntryResponseBytes =
    16;  // followed by unit, default, minimum and maximum as requested, then the description
inline constexpr std::size_t kInfoErrorBytes = 10;

enum class ListType : std::uint16_t {
    lengths = 0,
    all = 1,
    rx_mappable = 2,
    tx_mappable = 3,
    backup = 4,
    settings = 5
};
inline constexpr std::uint16_t kLastListType = 5;

// Value info of an entry request: the values that the response must contain.
namespace value_info {
inline constexpr std::uint8_t kUnit = 0x08;
inline constexpr std::uint8_t kDefault = 0x10;
inline constexpr std::uint8_t kMinimum = 0x20;
inline constexpr std::uint8_t kMaximum = 0x40;
}  // namespace value_info

// Object access of an entry description, 16 bits. The object dictionary uses the same bits.
namespace access {
inline constexpr std::uint16_t kReadPreop = 0x0001;
inline constexpr std::uint16_t kReadSafeop = 0x0002;
inline constexpr std::uint16_t kReadOp = 0x0004;
inline constexpr std::uint16_t kRead = 0x0007;
inline constexpr std::uint16_t kWritePreop = 0x0008;
inline constexpr std::uint16_t kWriteSafeop = 0x0010;
inline constexpr std::uint16_t kWriteOp = 0x0020;
inline constexpr std::uint16_t kWrite = 0x0038;
inline constexpr std::uint16_t kRxMappable = 0x0040;
inline constexpr std::uint16_t kTxMappable = 0x0080;
inline constexpr std::uint16_t kBackup = 0x0100;
inline constexpr std::uint16_t kSettings = 0x0200;
}  // namespace access

enum class ObjectCode : std::uint8_t {
    null = 0,
    domain = 2,
    deftype = 5,
    defstruct = 6,
    variable = 7,
    array = 8,
    record = 9
};

// Data types by their index in the type area of the dictionary (ETG.1000.6 and ETG.1020, "Base data types").
enum class DataType : std::uint16_t {
    none = 0x0000,
    boolean = 0x0001,
    integer8 = 0x0002,
    integer16 = 0x0003,
    integer32 = 0x0004,
    unsigned8 = 0x0005,
    unsigned16 = 0x0006,
    unsigned32 = 0x0007,
    real32 = 0x0008,
    visible_string = 0x0009,
    octet_string = 0x000A,
    unicode_string = 0x000B,
    time_of_day = 0x000C,
    time_difference = 0x000D,
    domain = 0x000F,
    integer24 = 0x0010,
    real64 = 0x0011,
    integer40 = 0x0012,
    integer48 = 0x0013,
    integer56 = 0x0014,
    integer64 = 0x0015,
    unsigned24 = 0x0016,
    unsigned40 = 0x0018,
    unsigned48 = 0x0019,
    unsigned56 = 0x001A,
    unsigned64 = 0x001B,
    guid = 0x001D,
    byte = 0x001E,
    word = 0x001F,
    dword = 0x0020,
    pdo_mapping = 0x0021,
    identity = 0x0023,
    command = 0x0025,
    sync_parameter = 0x0029,
    bit1 = 0x0030,
    bit2 = 0x0031,
    bit3 = 0x0032,
    bit4 = 0x0033,
    bit5 = 0x0034,
    bit6 = 0x0035,
    bit7 = 0x0036,
    bit8 = 0x0037,
};

// ------------------------------------------------------------------ emergency

struct EmergencyLayout {
    using error_code = Field<std::uint16_t, 2>;
    using error_register = Field<std::uint8_t, 4>;
    static constexpr std::size_t data = 5;
};
inline constexpr std::size_t kEmergencyDataBytes = 5;
inline constexpr std::size_t kEmergencyBytes = 10;

// Text of a code or type; unknown values have a text that says so. The strings are static. Callable from any thread and
// from the cycle.
[[nodiscard]] std::string_view to_text(Abort code);
[[nodiscard]] std::string_view to_text(DataType type);

}  // namespace margay::wire::coe
