// Commands, registers and datagrams in words, for traces and error messages. No allocation; callable from
// anywhere.
#pragma once

#include "util/text_writer.hpp"
#include "wire/datagram.hpp"

#include <string_view>

namespace margay::wire {

// "FPRD"; "unknown" for a number without a command. Static.
[[nodiscard]] std::string_view to_text(Command command);
[[nodiscard]] std::string_view to_text(FrameFault fault);

// Appends the name of what lies at an ESC address: a register ("AL status"), an element of an array ("SM 1
// status", "FMMU 3"), an octet within a wider register ("SII data +4"), RAM ("process RAM"), or nothing where
// nothing is known.
void describe_register(TextWriter& to, std::uint16_t address);

// Appends command, address and length: "FPRD 0x1001 AL status (0x0130), 2 octets"; "APRD position 2 …";
// "LRW logical 0x00010000, 12 octets". The address is read as that of a request: the position of a reply is
// off by the number of slaves it has passed.
void describe_request(TextWriter& to, const DatagramHeader& header);

// Writes a datagram into `out` as one line without an end of line and returns the part written: index,
// command, address, register, length, working counter, event request when there is one, and the first octets
// of the data. Columns line up from line to line.
std::string_view describe(const DatagramView& datagram, std::span<char> out);

}  // namespace margay::wire
