// PDO assignment (0x1C12, 0x1C13) and PDO mapping (0x16xx, 0x1Axx). Converts them to a list of bits to copy, and checks
// the rules for a master that changes them (ETG.1000.6 "PDO mapping", "Sync manager PDO assignment").
#pragma once

#include "subdevice/object_dictionary.hpp"

namespace margay::subdevice {

inline constexpr std::uint16_t kOutputAssignment = 0x1C12;
inline constexpr std::uint16_t kInputAssignment = 0x1C13;

// The 32 bits of one mapping entry.
struct MappingEntry {
    std::uint16_t index = 0;  // 0: a gap (padding)
    std::uint8_t subindex = 0;
    std::uint8_t bits = 0;
    [[nodiscard]] static constexpr MappingEntry of(std::uint32_t word) {
        return {static_cast<std::uint16_t>(word >> 16), static_cast<std::uint8_t>(word >> 8),
                static_cast<std::uint8_t>(word)};
    }
    [[nodiscard]] constexpr std::uint32_t word() const {
        return (std::uint32_t{index} << 16) | (std::uint32_t{subindex} << 8) | bits;
    }
};

// Iterates over the mapping entries of all PDOs in the object `assignment`, with the current values of the dictionary.
class MappingReader {
  public:
    MappingReader(const ObjectDictionary& dictionary, std::uint16_t assignment)
        : dictionary_(dictionary), assignment_(assignment), pdos_(dictionary.number(assignment, 0)) {}

    // Returns false at the end.
    bool next();
    [[nodiscard]] std::uint16_t pdo() const { return pdo_; }
    [[nodiscard]] const MappingEntry& entry() const { return entry_; }

  private:
    const ObjectDictionary& dictionary_;
    std::uint16_t assignment_;
    std::uint64_t pdos_;
    unsigned nth_pdo_ = 0;
    std::uint16_t pdo_ = 0;
    std::uint64_t entries_ = 0;
    unsigned nth_entry_ = 0;
    MappingEntry entry_{};
};

// Checks whether an object can be mapped into a PDO of this direction. Returns cannot_be_mapped, length_mismatch,
// no_object, no_subindex, or none if it can. The value must be in the image, or ObjectHooks::memory must return memory
// that has at least the size of the entry and stays valid as long as the value is mapped.
[[nodiscard]] Abort check_mappable(ObjectDictionary& dictionary, MappingEntry entry, bool outputs);

// Checks the PDOs of an assignment: each one exists and belongs to this direction (0x1600 to 0x17FF outputs, 0x1A00 to
// 0x1BFF inputs). Returns no_object, cannot_be_mapped, or none if they do. The number 0 is no PDO.
[[nodiscard]] Abort check_assigned(ObjectDictionary& dictionary, std::uint16_t assignment, bool outputs);

// One entry of the process image.
struct MappedEntry {
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    std::uint8_t bits = 0;
    std::byte* octets = nullptr;   // memory of the value; nullptr: a gap
    const Entry* entry = nullptr;  // contains the initial value
};

class PdoMapping {
  public:
    // The size of `memory` limits the number of entries of a mapping.
    explicit PdoMapping(std::span<MappedEntry> memory) : memory_(memory) {}

    // Removes all entries.
    void clear() { count_ = bits_ = 0; }
    // Adds the entries of one assignment, from the next octet on. Abort::out_of_memory: the mapping has more entries
    // than the memory can hold (SAFEOP is refused with 0x0002 "no memory"). Abort::exceeds_pdo: the assignment has more
    // octets than `max_bytes`. Unused bits of the octet before use an entry.
    [[nodiscard]] Abort add(ObjectDictionary& dictionary, std::uint16_t assignment, std::size_t max_bytes);
    // The same, for a mapping with one assignment.
    [[nodiscard]] Abort build(ObjectDictionary& dictionary, std::uint16_t assignment, std::size_t max_bytes) {
        clear();
        return add(dictionary, assignment, max_bytes);
    }

    [[nodiscard]] std::uint16_t bytes() const { return static_cast<std::uint16_t>((bits_ + 7) / 8); }
    [[nodiscard]] bool maps(std::uint16_t index, unsigned subindex) const;

    // Copy between the process image (bytes() octets) and the memory of the mapped values. unpack() leaves out values
    // outside of the limits of their entries, and returns their number.
    unsigned unpack(Bytes from) const;
    void pack(MutableBytes to) const;
    // Sets the mapped values to their initial values in the tables.
    void reset() const;

  private:
    std::span<MappedEntry> memory_;
    std::size_t count_ = 0;
    std::size_t bits_ = 0;
};

// --- Objects of a device whose PDOs the master may change ---
// Subindex 0 is the count (one octet in the image), the other subindices are values of equal size in the image. The
// hooks check each download: kPdoMappingHooks belongs to the objects 0x16xx and 0x1Axx, kPdoAssignmentHooks to 0x1C10
// to 0x1C1F. Without an application, the hooks do not know the largest size of the process data, and do not check it;
// then 0x1C12 belongs to the outputs, and the other assignments belong to inputs.
namespace pdo_rules {
[[nodiscard]] HookAnswer mapping(const ObjectAccess& access, Bytes data);
[[nodiscard]] HookAnswer assignment(const ObjectAccess& access, Bytes data);
}  // namespace pdo_rules
inline constexpr ObjectHooks kPdoMappingHooks{.before_write = pdo_rules::mapping};
inline constexpr ObjectHooks kPdoAssignmentHooks{.before_write = pdo_rules::assignment};

// Entries of objects that no master changes: mapping entry and assigned PDO are constants of the table.
[[nodiscard]] constexpr Entry mapped(std::uint8_t n, std::uint16_t index, std::uint8_t subindex, std::uint8_t bits) {
    return constant(n, "Mapping entry", MappingEntry{index, subindex, bits}.word());
}
[[nodiscard]] constexpr Entry assigned(std::uint8_t n, std::uint16_t pdo) { return constant(n, "Assigned PDO", pdo); }

}  // namespace margay::subdevice
