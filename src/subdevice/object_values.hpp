// Reads and writes values of the dictionary for the SDO services: one subindex, or all subindices of an object
// (complete access). Checks access rights, length and limits.
#pragma once

#include "subdevice/object_dictionary.hpp"

namespace margay::subdevice {

// Buffer for a value that is a constant of the table.
using Scratch = std::array<std::byte, 8>;

// Strings and domains: a download may be shorter than the entry.
[[nodiscard]] constexpr bool varies(DataType type) {
    return type == DataType::visible_string || type == DataType::octet_string || type == DataType::unicode_string ||
           type == DataType::domain;
}

// Check whether the entry may be read or written in this state.
[[nodiscard]] Abort check_readable(const Entry& entry, AlState state);
[[nodiscard]] Abort check_writable(const Entry& entry, AlState state);

// Returns one value with its current length. The value is in its own memory or in `scratch`.
[[nodiscard]] Bytes view_value(const ObjectAccess& access, const Entry& entry, Scratch& scratch);

// Checks length and limits of `data` for the entry.
[[nodiscard]] Abort check_value(const ObjectAccess& access, const Entry& entry, Bytes data);

// Checks the limits only. `data` has the octets of the entry.
[[nodiscard]] Abort check_limits(const Entry& entry, Bytes data);

// Stores a checked value. The unused rest of a string is filled with zeros.
void store_value(const ObjectAccess& access, const Entry& entry, Bytes data);

// Complete access, from access.subindex (0 or 1) up to the number in subindex 0. Subindex 0 uses 16 bits. Entries of 8
// bits and more start at an octet, smaller entries are packed (ETG.1000.6, "SDO complete access"). When an upload does
// not fit into `into`, `bytes` is 0 and the code is Abort::out_of_memory. The lock is held for one value at a time: an
// interrupt handler may execute between two values, so that they belong to different updates.
struct Gathered {
    Abort abort = Abort::none;
    std::size_t bytes = 0;
};
[[nodiscard]] Gathered gather(const ObjectAccess& access, MutableBytes into);

// Octets of a complete access to the object with subindices `from` to `top`.
[[nodiscard]] std::size_t complete_bytes(const Object& object, unsigned from, unsigned top);

// Entries that may not be written are skipped. If no entry may be written, the access is aborted with the abort code of
// these entries.
[[nodiscard]] Abort check_complete(const ObjectAccess& access, Bytes data);
void scatter(const ObjectAccess& access, Bytes data);

}  // namespace margay::subdevice
