// File access over EtherCAT: the data of a mailbox message of type FoE (ETG.1000.6 "File access over EtherCAT coding").
#pragma once

#include "util/bytes.hpp"

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace margay::wire::foe {

enum class Opcode : std::uint8_t { read = 1, write = 2, data = 3, acknowledge = 4, error = 5, busy = 6 };

enum class ErrorCode : std::uint32_t {
    undefined = 0x8000,
    not_found = 0x8001,
    access_denied = 0x8002,
    disk_full = 0x8003,
    illegal = 0x8004,
    wrong_packet_number = 0x8005,
    already_exists = 0x8006,
    no_user = 0x8007,
    bootstrap_only = 0x8008,
    not_in_bootstrap = 0x8009,
    no_rights = 0x800A,
    program_error = 0x800B,
    wrong_checksum = 0x800C,
    firmware_does_not_fit = 0x800D,
    no_file_to_read = 0x800F,
    no_file_header = 0x8010,
    flash_problem = 0x8011,
    file_incompatible = 0x8012,
};

struct Layout {
    using opcode = Field<Opcode, 0>;
    using password = Field<std::uint32_t, 2>;       // read, write: the file name follows, without terminator
    using packet_number = Field<std::uint32_t, 2>;  // data (from 1), acknowledge (0 acknowledges a write request)
    using error_code = Field<ErrorCode, 2>;         // error: a text follows
    using done = Field<std::uint16_t, 2>;           // busy: progress, a text may follow
    using entire = Field<std::uint16_t, 4>;
};
inline constexpr std::size_t kHeaderBytes = 6;  // all messages: followed by the name, the data or the text

// Text of a code; unknown values have a text that says so. The strings are static. Callable from any thread and from
// the cycle.
[[nodiscard]] std::string_view to_text(ErrorCode code);

}  // namespace margay::wire::foe
