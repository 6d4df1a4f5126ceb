// Ethernet over EtherCAT: the data of a mailbox message of type EoE (ETG.1000.6 "Ethernet over EtherCAT coding").
#pragma once

#include "util/bytes.hpp"

#include <margay/eoe_parameters.hpp>

#include <optional>
#include <string_view>

namespace margay::wire::eoe {

enum class Type : std::uint8_t {
    fragment = 0,
    time_stamp_response = 1,
    set_ip_request = 2,
    set_ip_response = 3,
    set_filter_request = 4,
    set_filter_response = 5,
    get_ip_request = 6,
    get_ip_response = 7,
    get_filter_request = 8,
    get_filter_response = 9,
};

inline constexpr std::size_t kHeaderBytes = 4;       // all messages: followed by the octets of the frame, or parameters
inline constexpr std::size_t kTimeStampBytes = 4;    // behind the octets of the last fragment, or alone in a response
inline constexpr std::size_t kBlockBytes = 32;       // unit of offsets and sizes of fragments
inline constexpr std::size_t kLeastFrameBytes = 14;  // the Ethernet header
// A fragment carries whole blocks, and the header counts offsets in blocks. So a mailbox needs room for one of them.
inline constexpr std::size_t kLeastRoom = kHeaderBytes + kBlockBytes;

// The members after `time_requested` belong to fragments; other messages have `result` in their place.
struct Header {
    Type type = Type::fragment;
    std::uint8_t port = 0;  // 4 bits; 0: no particular port
    bool last = true;       // of the frame; always set in other messages
    bool time_appended = false;
    bool time_requested = false;
    std::uint8_t fragment = 0;      // 6 bits, from 0
    std::uint8_t blocks = 0;        // 6 bits; fragment 0: size of the whole frame, others: offset in the frame
    std::uint8_t frame_number = 0;  // 4 bits
    friend constexpr bool operator==(const Header&, const Header&) = default;
};

struct Layout {
    using flags = Field<std::uint16_t, 0>;   // type (4), port (4), last, time stamp appended, time stamp requested
    using number = Field<std::uint16_t, 2>;  // fragments: fragment (6), blocks (6), frame number (4)
    using result = Field<EoeResult, 2>;      // responses
};

// `at` must have kHeaderBytes octets.
[[nodiscard]] Header load_header(Bytes at);
void store_header(MutableBytes at, const Header& header);
// The header of a request (result 0) or response.
void store_header(MutableBytes at, Type type, EoeResult result);

[[nodiscard]] constexpr std::size_t blocks_of(std::size_t bytes) { return (bytes + kBlockBytes - 1) / kBlockBytes; }

// How many of the `left` octets of a frame the next fragment carries, if a message has `room` octets for header and
// data, and the last fragment has `appended` octets behind the frame. `room` must be at least kLeastRoom + `appended`.
[[nodiscard]] std::size_t fragment_bytes(std::size_t left, std::size_t room, std::size_t appended = 0);

// ------------------------------------------------------------------ parameters (behind the header)

// Octets of the IP parameters: flags (4), MAC address (6), IP address, subnet mask, default gateway, DNS server (4
// each, least significant octet first), host name (32). Parameters that are not included occupy their octets too.
inline constexpr std::size_t kIpBytes = 58;
// Number of addresses (bits 0 to 3), of masks (4, 5), no broadcasts (7); 16 addresses, 4 masks.
inline constexpr std::size_t kFilterBytes = 122;

// Writes kIpBytes octets; `compact`: parameters that are not included occupy no octets. Returns the number of octets.
std::size_t store_ip(MutableBytes at, const EoeIp& ip, bool compact = false);
// Both forms are read: the compact one is recognised by its length. nullopt: octets are missing.
[[nodiscard]] std::optional<EoeIp> load_ip(Bytes at);

// Writes kFilterBytes octets. The numbers of `filter` must not be larger than its arrays.
void store_filter(MutableBytes at, const EoeFilter& filter);
// nullopt: octets are missing.
[[nodiscard]] std::optional<EoeFilter> load_filter(Bytes at);

// Text of a result code; unknown values have a text that says so. The strings are static. Callable from any thread and
// from the cycle.
[[nodiscard]] std::string_view to_text(EoeResult result);

}  // namespace margay::wire::eoe
