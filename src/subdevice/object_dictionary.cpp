#include "subdevice/object_dictionary.hpp"

#include "subdevice/esc_access.hpp"
#include "subdevice/pdo_mapping.hpp"

#include <algorithm>

namespace margay::subdevice {

static_assert(sizeof(void*) != 4 || sizeof(Entry) == 28, "the table of a device has an entry for each line");

const Object* ObjectDictionary::from(std::uint32_t index) const {
    const Object* first = nullptr;
    for (const auto objects : {objects_, modules_}) {
        const auto at = std::lower_bound(objects.begin(), objects.end(), index,
                                         [](const Object& o, std::uint32_t wanted) { return o.index < wanted; });
        if (at != objects.end() && (first == nullptr || at->index < first->index)) first = &*at;
    }
    return first;
}

const Object* ObjectDictionary::find(std::uint16_t index) const {
    const auto* const object = from(index);
    return object != nullptr && object->index == index ? object : nullptr;
}

ObjectRange::Iterator ObjectRange::begin() const { return {dictionary_, dictionary_.from(0)}; }

ObjectRange::Iterator& ObjectRange::Iterator::operator++() {
    at_ = dictionary_.from(at_->index + 1U);
    return *this;
}

bool ObjectDictionary::exists(const Object& object) {
    if (object.hooks == nullptr || object.hooks->exists == nullptr) return true;
    return object.hooks->exists({.object = object, .dictionary = *this, .application = application_});
}

void ObjectDictionary::restore_defaults(std::uint16_t access) {
    for (const auto& object : objects()) restore_defaults(object, access);
}

void ObjectDictionary::restore_defaults(const Object& object, std::uint16_t access) {
    for (const auto& entry : object.entries) {
        if (entry.storage != Storage::image || (access != 0 && (entry.access & access) == 0)) continue;
        for (unsigned n = entry.subindex; n <= entry.last(); ++n) {
            const auto memory = in_image(object, entry, n);
            const Guard guard(lock_);
            for (std::size_t i = 0; i < memory.size(); ++i) memory[i] = entry.initial_octet(i);
        }
    }
}

std::uint32_t ObjectDictionary::module_ident(const Object& object) const {
    return object.slot != 0 && object.slot <= module_idents_.size() ? module_idents_[object.slot - 1U] : 0;
}

MutableBytes ObjectDictionary::in_image(const Object& object, const Entry& entry, unsigned subindex) const {
    if (entry.storage != Storage::image) return {};
    const auto first = std::size_t{object.image_start} + entry.offset;
    return image_.subspan(first + std::size_t{subindex - entry.subindex} * entry.bytes(), entry.bytes());
}

std::uint64_t ObjectDictionary::initial(const Object& object, const Entry& entry) const {
    const bool pdo = object.index >= 0x1600 && object.index < 0x1C00;
    const auto mapped = MappingEntry::of(static_cast<std::uint32_t>(entry.initial())).index;
    if (object.slot <= 1 || !pdo || entry.subindex == 0 || !moves_with_slot(mapped)) return entry.initial();
    return entry.initial() + (std::uint32_t{module_distance_} << 16) * (object.slot - 1U);
}

std::uint64_t ObjectDictionary::number(std::uint16_t index, unsigned subindex) const {
    const auto* const object = find(index);
    const auto* const entry = object != nullptr ? object->entry(subindex) : nullptr;
    if (entry == nullptr) return 0;
    if (entry->storage == Storage::constant) return initial(*object, *entry);
    std::uint64_t value = 0;
    const auto memory = in_image(*object, *entry, subindex);
    for (std::size_t i = 0; i < std::min<std::size_t>(memory.size(), 8); ++i)
        value |= std::uint64_t{std::to_integer<std::uint8_t>(memory[i])} << (8 * i);
    return value;
}

bool ObjectDictionary::blocked(std::uint16_t index, unsigned subindex) const {
    return blocked_ != nullptr && blocked_->maps(index, subindex);
}

}  // namespace margay::subdevice
