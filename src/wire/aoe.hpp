// Automation device specification over EtherCAT: the data of a mailbox message of type AoE (ETG.1020 "AoE"), which is
// an ADS command with its AMS header.
#pragma once

#include "util/bytes.hpp"

#include <margay/aoe_address.hpp>

#include <algorithm>
#include <string_view>

namespace margay::wire::aoe {

enum class Command : std::uint16_t {
    read_device_info = 1,
    read = 2,
    write = 3,
    read_state = 4,
    write_control = 5,
    add_notification = 6,
    delete_notification = 7,
    notification = 8,
    read_write = 9,
};

namespace state_flag {
inline constexpr std::uint16_t kResponse = 0x0001;
inline constexpr std::uint16_t kNoReturn = 0x0002;  // the sender wants no response
inline constexpr std::uint16_t kAdsCommand = 0x0004;
}  // namespace state_flag

// Error codes that the server of the slave stack uses. error_text() knows more.
enum class ErrorCode : std::uint32_t {
    none = 0,
    target_port_not_found = 0x06,
    target_machine_not_found = 0x07,
    unknown_command = 0x08,
    invalid_length = 0x0E,
    service_not_supported = 0x701,
    invalid_group = 0x702,
    invalid_offset = 0x703,
    access_denied = 0x704,
    invalid_size = 0x705,
    invalid_data = 0x706,
    device_busy = 0x708,
    no_memory = 0x70A,
    invalid_state = 0x712,
    transmission_not_supported = 0x713,
    unknown_handle = 0x714,
    no_more_handles = 0x716,
};

struct Layout {
    static constexpr std::size_t target = 0;
    static constexpr std::size_t source = 8;
    using command = Field<Command, 16>;
    using flags = Field<std::uint16_t, 18>;
    using data_bytes = Field<std::uint32_t, 20>;
    using error_code = Field<std::uint32_t, 24>;
    using invoke_id = Field<std::uint32_t, 28>;
};
inline constexpr std::size_t kHeaderBytes = 32;  // followed by the data of the command

struct Header {
    AoeAddress target;
    AoeAddress source;
    Command command{};
    std::uint16_t flags = state_flag::kAdsCommand;
    std::uint32_t data_bytes = 0;
    std::uint32_t error_code = 0;
    std::uint32_t invoke_id = 0;
};

[[nodiscard]] Header load_header(Bytes at);
void store_header(MutableBytes at, const Header& header);

// The data of the commands. Requests of read, write and read_write begin with index group and index offset.
struct IndexLayout {
    using group = Field<std::uint32_t, 0>;
    using offset = Field<std::uint32_t, 4>;
    using bytes = Field<std::uint32_t, 8>;           // read, read_write: wanted octets; write: octets that follow
    using written_bytes = Field<std::uint32_t, 12>;  // read_write: octets that follow
};
inline constexpr std::size_t kIndexBytes = 12;
inline constexpr std::size_t kReadWriteBytes = 16;

struct ControlLayout {
    using ads_state = Field<AdsState, 0>;
    using device_state = Field<std::uint16_t, 2>;
    using bytes = Field<std::uint32_t, 4>;
};
inline constexpr std::size_t kControlBytes = 8;

struct NotificationLayout {
    using length = Field<std::uint32_t, 8>;
    using transmission = Field<AoeTransmission, 12>;
    using longest_delay = Field<std::uint32_t, 16>;  // 100 ns
    using cycle_time = Field<std::uint32_t, 20>;     // 100 ns
};
inline constexpr std::size_t kNotificationBytes = 40;

// Responses: the result, then for read and read_write the number of octets that follow.
inline constexpr std::size_t kResultBytes = 4;
inline constexpr std::size_t kStateBytes = 4;        // ADS state, device state
inline constexpr std::size_t kDeviceInfoBytes = 20;  // version, revision, build (2), name (16)
inline constexpr std::size_t kDeviceNameBytes = 16;

// A notification: length of what follows these four octets, number of stamps; each stamp: time stamp (8), number of
// samples (4); each sample: handle (4), size (4), data.
inline constexpr std::size_t kStampBytes = 12;
inline constexpr std::size_t kSampleBytes = 8;

// Text of an error code or result; unknown values have a text that says so. The strings are static. Callable from any
// thread and from the cycle.
[[nodiscard]] std::string_view error_text(std::uint32_t code);

}  // namespace margay::wire::aoe
