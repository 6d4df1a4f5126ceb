// A record or an array as a whole: its values by subindices, in the form in which complete access has them.
#pragma once

#include "subdevice_check/check.hpp"

namespace margay::samples::conformance {

// A subindex that exists.
struct SubindexValue {
    std::uint8_t subindex = 0;
    std::size_t bits = 0;                             // by its description, or of its data
    std::optional<std::vector<std::byte>> data = {};  // nullopt: not compared
};

// The objects with more than subindex 0 by the dictionary; without a dictionary, usual ones that exist.
[[nodiscard]] std::vector<std::uint16_t> whole_objects(const Session& session);

// What the descriptions of the entries say about an object.
struct ObjectSummary {
    bool varies = false;      // a string, a domain, or an entry without a size
    bool unreadable = false;  // an entry that cannot be read in PREOP
    bool writable = false;    // all entries in PREOP
    bool parameters = false;  // all entries behind subindex 0 are values that a master stores and writes back
    std::size_t bits = 0;     // of complete access, at most
};
[[nodiscard]] ObjectSummary summary_of(const Session& session, std::uint16_t index);

[[nodiscard]] bool is_pdo_assignment(std::uint16_t index);  // of SyncManagers 2 to 31
// Objects that may be written in PREOP with the value that they have: communication, expected modules, and parameters
// that a master stores and writes back. All their entries are writable. A few of each kind.
[[nodiscard]] std::vector<std::uint16_t> writable_objects(const Session& session);

// The values of subindices 0 to the number in subindex 0. nullopt: they cannot be read.
[[nodiscard]] std::optional<std::vector<SubindexValue>> read_values(Session& session, std::uint16_t index);
// Values that differ in a second reading are not compared any more. False: other subindices exist now.
[[nodiscard]] bool leave_out_changes(std::vector<SubindexValue>& values, const std::vector<SubindexValue>& again);

// What `data`, by complete access from subindex 0 or 1 on, has against the values: "12 octets (…), its subindices have
// 14 (…)". Subindex 0 has 16 bits. The standard leaves open whether a number of whole octets behind single bits starts
// at an octet, and whether a string is as long as it is now: all forms are right.
[[nodiscard]] std::optional<std::string> difference(const std::vector<SubindexValue>& values, std::uint8_t from,
                                                    Bytes data);

}  // namespace margay::samples::conformance
