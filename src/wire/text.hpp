// Texts for commands, registers and datagrams, for traces and error messages. No allocation. Callable from any thread
// and from the cycle.
#pragma once

#include "util/text_writer.hpp"
#include "wire/datagram.hpp"

#include <string_view>

namespace margay::wire {

// "FPRD"; "unknown" for an undefined command number. Static.
[[nodiscard]] std::string_view to_text(Command command);
[[nodiscard]] std::string_view to_text(FrameFault fault);

// Appends the name of an ESC address: a register ("AL status"), an element of an array ("SM 1 status", "FMMU 3"), an
// octet within a register of several octets ("SII data +4"), or RAM ("process RAM"). Appends nothing for an unknown
// address.
void describe_register(TextWriter& to, std::uint16_t address);

// Appends command, address and length: "FPRD 0x1001 AL status (0x0130), 2 octets"; "APRD position 2 …"; "LRW logical
// 0x00010000, 12 octets". The address is interpreted as that of a request: the position in a reply is too large by the
// number of slaves that the datagram has passed.
void describe_request(TextWriter& to, const DatagramHeader& header);

// Writes a datagram into `out` as one line without end-of-line character and returns the written part: index, command,
// address, register, length, working counter, the event request if it is not 0, and the first octets of the data. The
// columns of successive lines are aligned.
std::string_view describe(const DatagramView& datagram, std::span<char> out);

}  // namespace margay::wire
