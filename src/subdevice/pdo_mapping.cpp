#include "subdevice/pdo_mapping.hpp"

#include "subdevice/application.hpp"
#include "subdevice/bits.hpp"
#include "subdevice/object_values.hpp"

#include <algorithm>
#include <array>

namespace margay::subdevice {

namespace {

constexpr bool is_output_pdo(std::uint16_t index) { return index >= 0x1600 && index < 0x1800; }
constexpr bool is_input_pdo(std::uint16_t index) { return index >= 0x1A00 && index < 0x1C00; }

// Dummy mapping (CiA 301, ETG.1000.6 "PDO Mapping"): an entry with the index of a basic data type, BOOLEAN (0x0001) to
// UNSIGNED32 (0x0007), is a gap of the size of the type. Index 0 is a gap of any size.
constexpr unsigned kLastDummy = 0x0007;
constexpr bool is_gap(std::uint16_t index) { return index <= kLastDummy; }
constexpr bool right_gap(MappingEntry entry) {
    constexpr std::array<std::uint8_t, kLastDummy + 1> kBits{0, 1, 8, 16, 32, 8, 16, 32};
    return entry.index == 0 || (entry.subindex == 0 && entry.bits == kBits[entry.index]);
}

std::size_t mapped_bits(const ObjectDictionary& dictionary, std::uint16_t pdo) {
    std::size_t bits = 0;
    const auto count = static_cast<unsigned>(dictionary.number(pdo, 0));
    for (unsigned n = 1; n <= count; ++n)
        bits += MappingEntry::of(static_cast<std::uint32_t>(dictionary.number(pdo, n))).bits;
    return bits;
}

// The content of a mapping or assignment object after a write: each value comes from the data of the write if they
// contain it, otherwise from the dictionary.
class AfterWrite {
  public:
    AfterWrite(const ObjectAccess& access, Bytes data, std::size_t value_bytes)
        : access_(access), data_(data), value_bytes_(value_bytes) {}

    [[nodiscard]] unsigned count() const {
        // A count that cannot be written now stays as it is, whatever the data of a complete access say.
        const bool written = check_writable(access_.object.entries.front(), access_.state) == Abort::none;
        if (access_.subindex == 0 && written) return std::to_integer<unsigned>(data_[0]);
        return static_cast<unsigned>(access_.dictionary.number(access_.object.index, 0));
    }
    [[nodiscard]] std::uint32_t value(unsigned n) const {
        const std::size_t head = access_.subindex == 0 ? 2 : 0;
        if (!access_.complete && access_.subindex != n)
            return static_cast<std::uint32_t>(access_.dictionary.number(access_.object.index, n));
        const auto from = access_.complete ? head + (n - 1) * value_bytes_ : 0;
        return value_bytes_ == 4 ? load_le<std::uint32_t>(data_, from) : load_le<std::uint16_t>(data_, from);
    }

  private:
    const ObjectAccess& access_;
    Bytes data_;
    std::size_t value_bytes_;
};

// Values may be changed only while the count (subindex 0) is 0, or together with the count by complete access.
Abort check_order(const ObjectAccess& access) {
    if (access.subindex == 0) return Abort::none;
    return access.dictionary.number(access.object.index, 0) == 0 ? Abort::none : Abort::subindex_needs_zero;
}

// A PDO of this direction can be assigned to any area of it.
std::size_t max_bits(const ObjectAccess& access, bool outputs) {
    if (access.application == nullptr) return SIZE_MAX;
    std::size_t most = 0;
    for_each_area(access.application->description(), outputs, [&](const ProcessDataArea& area, std::size_t) {
        most = std::max<std::size_t>(most, area.max_bytes);
    });
    return most * 8;
}

// What an assignment object belongs to.
struct AssignedArea {
    bool outputs = false;
    std::size_t max_bits = 0;
};
AssignedArea area_of(const ObjectAccess& access) {
    const auto index = access.object.index;
    if (access.application == nullptr) return {index == kOutputAssignment, SIZE_MAX};
    AssignedArea found{index == kOutputAssignment};
    for (const bool outputs : {true, false})
        for_each_area(access.application->description(), outputs, [&](const ProcessDataArea& area, std::size_t) {
            if (area.assignment() == index) found = {outputs, std::size_t{area.max_bytes} * 8};
        });
    return found;
}

// Memory of the value; empty when it has none.
MutableBytes memory_of(ObjectDictionary& dictionary, const Object& object, const Entry& entry, std::uint8_t subindex) {
    if (entry.storage != Storage::provided) return dictionary.in_image(object, entry, subindex);
    return object.hooks->memory(
        {.object = object, .subindex = subindex, .dictionary = dictionary, .application = dictionary.application()});
}

}  // namespace

bool MappingReader::next() {
    while (nth_entry_ >= entries_) {
        if (nth_pdo_ >= pdos_) return false;
        pdo_ = static_cast<std::uint16_t>(dictionary_.number(assignment_, ++nth_pdo_));
        entries_ = dictionary_.number(pdo_, 0);
        nth_entry_ = 0;
    }
    entry_ = MappingEntry::of(static_cast<std::uint32_t>(dictionary_.number(pdo_, ++nth_entry_)));
    return true;
}

Abort check_mappable(ObjectDictionary& dictionary, MappingEntry entry, bool outputs) {
    if (is_gap(entry.index)) return right_gap(entry) ? Abort::none : Abort::length_mismatch;
    const auto* const object = dictionary.find(entry.index);
    if (object == nullptr || !dictionary.exists(*object)) return Abort::no_object;
    const auto* const found = object->entry(entry.subindex);
    if (found == nullptr) return Abort::no_subindex;
    const auto wanted = outputs ? od::kRxMappable : od::kTxMappable;
    if ((found->access & wanted) == 0 || found->bits == 0) return Abort::cannot_be_mapped;
    if (memory_of(dictionary, *object, *found, entry.subindex).size() < found->bytes()) return Abort::cannot_be_mapped;
    return found->bits == entry.bits ? Abort::none : Abort::length_mismatch;
}

Abort check_assigned(ObjectDictionary& dictionary, std::uint16_t assignment, bool outputs) {
    const auto count = static_cast<unsigned>(dictionary.number(assignment, 0));
    for (unsigned n = 1; n <= count; ++n) {
        const auto pdo = static_cast<std::uint16_t>(dictionary.number(assignment, n));
        if (pdo == 0) continue;
        const auto* const object = dictionary.find(pdo);
        if (object == nullptr || !dictionary.exists(*object)) return Abort::no_object;
        if (outputs ? !is_output_pdo(pdo) : !is_input_pdo(pdo)) return Abort::cannot_be_mapped;
    }
    return Abort::none;
}

namespace {
MutableBytes octets_of(const MappedEntry& mapped) {
    return {mapped.octets, mapped.octets != nullptr ? (std::size_t{mapped.bits} + 7) / 8 : 0};
}
bool is_within_limits(const MappedEntry& mapped, Bytes from, std::size_t bit) {
    Scratch scratch{};
    if (!mapped.entry->is_limited() || mapped.bits > 8 * scratch.size()) return true;
    copy_bits(scratch, 0, from, bit, mapped.bits);
    return check_limits(*mapped.entry, Bytes(scratch).first(octets_of(mapped).size())) == Abort::none;
}
}  // namespace

Abort PdoMapping::add(ObjectDictionary& dictionary, std::uint16_t assignment, std::size_t max_bytes) {
    if (const auto rest = (8 - bits_ % 8) % 8; rest != 0) {
        if (count_ == memory_.size()) return Abort::out_of_memory;
        memory_[count_++] = {0, 0, static_cast<std::uint8_t>(rest)};
        bits_ += rest;
    }
    const auto end = bits_ + max_bytes * 8;
    MappingReader reader(dictionary, assignment);
    while (reader.next()) {
        const auto& entry = reader.entry();
        const auto wrong = check_mappable(dictionary, entry, is_output_pdo(reader.pdo()));
        if (wrong != Abort::none) return wrong;
        if (count_ == memory_.size()) return Abort::out_of_memory;
        if (bits_ + entry.bits > end) return Abort::exceeds_pdo;
        MappedEntry mapped{entry.index, entry.subindex, entry.bits};
        if (!is_gap(entry.index)) {
            const auto& object = *dictionary.find(entry.index);
            mapped.entry = object.entry(entry.subindex);
            mapped.octets = memory_of(dictionary, object, *mapped.entry, entry.subindex).data();
        }
        memory_[count_++] = mapped;
        bits_ += entry.bits;
    }
    return Abort::none;
}

bool PdoMapping::maps(std::uint16_t index, unsigned subindex) const {
    // Without std::any_of(), which GCC unrolls.
    for (const auto& m : memory_.first(count_))
        if (m.index == index && m.subindex == subindex) return true;
    return false;
}

unsigned PdoMapping::unpack(Bytes from) const {
    unsigned refused = 0;
    std::size_t bit = 0;
    for (const auto& m : memory_.first(count_)) {
        const auto octets = octets_of(m);
        if (m.octets != nullptr && is_within_limits(m, from, bit))
            copy_bits(octets, 0, from, bit, m.bits);
        else if (m.octets != nullptr)
            ++refused;
        bit += m.bits;
    }
    return refused;
}

void PdoMapping::pack(MutableBytes to) const {
    std::fill(to.begin(), to.end(), std::byte{0});
    std::size_t bit = 0;
    for (const auto& m : memory_.first(count_)) {
        if (m.octets != nullptr) copy_bits(to, bit, octets_of(m), 0, m.bits);
        bit += m.bits;
    }
}

void PdoMapping::reset() const {
    for (const auto& m : memory_.first(count_)) {
        const auto octets = octets_of(m);
        for (std::size_t i = 0; i < octets.size(); ++i) octets[i] = m.entry->initial_octet(i);
    }
}

namespace pdo_rules {

HookAnswer mapping(const ObjectAccess& access, Bytes data) {
    const bool outputs = is_output_pdo(access.object.index);
    if (const auto wrong = check_order(access); wrong != Abort::none) return wrong;
    const AfterWrite after(access, data, 4);
    if (access.subindex != 0 && !access.complete)
        return check_mappable(access.dictionary, MappingEntry::of(after.value(access.subindex)), outputs);
    const auto count = access.subindex == 0 ? after.count() : static_cast<unsigned>(data.size() / 4);
    if (count > access.object.max_subindex()) return Abort::value_too_high;
    std::size_t bits = 0;
    for (unsigned n = 1; n <= count; ++n) {
        const auto entry = MappingEntry::of(after.value(n));
        if (const auto wrong = check_mappable(access.dictionary, entry, outputs); wrong != Abort::none) return wrong;
        bits += entry.bits;
    }
    return bits > max_bits(access, outputs) ? Abort::exceeds_pdo : Abort::none;
}

HookAnswer assignment(const ObjectAccess& access, Bytes data) {
    const auto [outputs, most_bits] = area_of(access);
    if (const auto wrong = check_order(access); wrong != Abort::none) return wrong;
    const AfterWrite after(access, data, 2);
    const auto check = [&, is_output = outputs](std::uint32_t value) {
        const auto pdo = static_cast<std::uint16_t>(value);
        const bool right = is_output ? is_output_pdo(pdo) : is_input_pdo(pdo);
        return right && access.dictionary.find(pdo) != nullptr ? Abort::none : Abort::value_range;
    };
    if (access.subindex != 0 && !access.complete) return check(after.value(access.subindex));
    const auto count = access.subindex == 0 ? after.count() : static_cast<unsigned>(data.size() / 2);
    if (count > access.object.max_subindex()) return Abort::value_too_high;
    std::size_t bits = 0;
    for (unsigned n = 1; n <= count; ++n) {
        if (const auto wrong = check(after.value(n)); wrong != Abort::none) return wrong;
        bits += mapped_bits(access.dictionary, static_cast<std::uint16_t>(after.value(n)));
    }
    return bits > most_bits ? Abort::exceeds_pdo : Abort::none;
}

}  // namespace pdo_rules

}  // namespace margay::subdevice
