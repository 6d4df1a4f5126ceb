// Values of the dictionary as SDO services carry them: one subindex, or all of an object at once (complete
// access). Who may, how long, within which bounds.
#pragma once

#include "subdevice/object_dictionary.hpp"

namespace margay::subdevice {

// Room for a value that is a constant of the table.
using Scratch = std::array<std::byte, 8>;

// Strings and domains: a download may be shorter than the entry.
[[nodiscard]] constexpr bool varies(DataType type) {
    return type == DataType::visible_string || type == DataType::octet_string || type == DataType::unicode_string ||
           type == DataType::domain;
}

// May the entry be read, or written, in this state?
[[nodiscard]] Abort check_readable(const Entry& entry, AlState state);
[[nodiscard]] Abort check_writable(const Entry& entry, AlState state);

// One value at its present length, where it lies or in `scratch`.
[[nodiscard]] Bytes view_value(const ObjectAccess& access, const Entry& entry, Scratch& scratch);

// Is `data` a legal value for the entry: length and bounds.
[[nodiscard]] Abort check_value(const ObjectAccess& access, const Entry& entry, Bytes data);

// Puts a checked value in its place; what it leaves of a string becomes zero.
void store_value(const ObjectAccess& access, const Entry& entry, Bytes data);

// Complete access, from access.subindex (0 or 1) up to what subindex 0 says. Subindex 0 takes 16 bits,
// entries of 8 bits and more begin at an octet, smaller ones are packed (ETG.1000.6, "SDO complete access").
// Where an upload would not fit `into`, `bytes` is 0 and the code Abort::out_of_memory.
struct Gathered {
    Abort abort = Abort::none;
    std::size_t bytes = 0;
};
[[nodiscard]] Gathered gather(const ObjectAccess& access, MutableBytes into);

// Octets that a complete access of the object with this many subindices takes.
[[nodiscard]] std::size_t complete_bytes(const Object& object, unsigned from, unsigned top);

// Entries that may not be written are passed over; when there is no other, that is the abort.
[[nodiscard]] Abort check_complete(const ObjectAccess& access, Bytes data);
void scatter(const ObjectAccess& access, Bytes data);

}  // namespace margay::subdevice
