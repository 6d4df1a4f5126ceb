#include "subdevice/modules.hpp"

#include "subdevice/esc_access.hpp"

namespace margay::subdevice {

void Modules::detect(unsigned slot, std::uint32_t ident) {
    if (!has(slot)) return;
    detected_[slot - 1] = ident;
    if (dictionary_ != nullptr) show_detected();
}

std::uint32_t Modules::detected(unsigned slot) const { return has(slot) ? detected_[slot - 1] : 0; }

const ModuleKind* Modules::in_use(unsigned slot) const {
    return has(slot) && used_[slot - 1] != 0 ? device_.kind(used_[slot - 1]) : nullptr;
}

MutableBytes Modules::values(unsigned slot) const {
    if (!has(slot) || dictionary_ == nullptr) return {};
    return dictionary_->image().subspan(values_ + (slot - 1) * slot_bytes_, slot_bytes_);
}

// Writes a number of a list of the dictionary; its count for `nth` 0.
void Modules::show_list(std::uint16_t list, unsigned nth, std::uint32_t number) {
    const auto& object = *dictionary_->find(list);
    const auto memory = dictionary_->in_image(object, *object.entry(nth), nth);
    for (std::size_t i = 0; i < memory.size(); ++i) memory[i] = static_cast<std::byte>(number >> (8 * i));
}

// The list ends with the last slot that is not empty. An interrupt handler may call detect() between two sections.
void Modules::show_detected() {
    for (unsigned slot = 1; slot <= device_.slots; ++slot) {
        const Guard guard(dictionary_->lock());
        show_list(kDetectedModules, slot, detected_[slot - 1]);
    }
    const Guard guard(dictionary_->lock());
    unsigned count = device_.slots;
    while (count != 0 && detected_[count - 1] == 0) --count;
    show_list(kDetectedModules, 0, count);
}

void Modules::lay_out(ObjectDictionary& dictionary) {
    const bool first = dictionary_ != &dictionary;
    dictionary_ = &dictionary;
    count_ = 0;
    hidden_ = false;
    unsigned last = 0;
    dictionary.set_modules({}, device_.index_distance, {});
    for (unsigned slot = 1; slot <= device_.slots; ++slot) {
        const auto ident = detected_[slot - 1];
        const bool anew = first || used_[slot - 1] != ident;
        used_[slot - 1] = ident;
        const auto* const kind = in_use(slot);
        if (anew) std::ranges::fill(values(slot), std::byte{0});
        if (kind != nullptr) place(slot, *kind, anew);
        if (ident != 0) last = slot;
        show_list(kModuleProfileList, slot, kind != nullptr ? kind->profile : 0);
    }
    show_list(kModuleProfileList, 0, last);
    show_detected();
    dictionary.set_modules(objects_.first(count_), device_.index_distance, used_);
    assign(kOutputAssignment, device_.own_rx_pdos, true);
    assign(kInputAssignment, device_.own_tx_pdos, false);
}

// Adds the objects of a module, ascending by index.
void Modules::place(unsigned slot, const ModuleKind& kind, bool anew) {
    for (const Object& pattern : kind.objects) {
        Object object = pattern;
        object.index = static_cast<std::uint16_t>(device_.index_in(pattern.index, slot));
        if (dictionary_->find(object.index) != nullptr) hidden_ = true;  // the dictionary has no modules yet
        object.slot = static_cast<std::uint8_t>(slot);
        object.image_start = static_cast<std::uint16_t>(values_ + (slot - 1) * slot_bytes_);
        if (anew) dictionary_->restore_defaults(object);
        std::size_t at = count_++;
        for (; at > 0 && objects_[at - 1].index > object.index; --at) objects_[at] = objects_[at - 1];
        objects_[at] = object;
    }
}

// PDOs of the slots in their order.
void Modules::assign(std::uint16_t list, std::span<const std::uint16_t> own, bool outputs) {
    unsigned count = 0;
    for (const auto pdo : own) show_list(list, ++count, pdo);
    for (unsigned slot = 1; slot <= device_.slots; ++slot)
        for (const Object& object : objects_.first(count_))
            if (object.slot == slot &&
                (outputs ? module_rules::is_rx_pdo(object.index) : module_rules::is_tx_pdo(object.index)))
                show_list(list, ++count, object.index);
    show_list(list, 0, count);
}

// An empty list is no expectation. The address of a module is the number of its slot.
bool Modules::matches(std::uint16_t list, bool addresses) const {
    const auto count = static_cast<unsigned>(dictionary_->number(list, 0));
    for (unsigned slot = 1; count != 0 && slot <= device_.slots; ++slot) {
        const auto written = slot <= count ? dictionary_->number(list, slot) : 0;
        const auto ident = detected(slot);
        if (written != (addresses && ident != 0 ? slot : ident)) return false;
    }
    return true;
}

AlStatusCode Modules::check() const {
    if (dictionary_ == nullptr) return AlStatusCode::needs_init;
    if (hidden_) return AlStatusCode::unspecified;
    if (!matches(kConfiguredAddresses, true) || !matches(kConfiguredModules, false))
        return AlStatusCode::module_list_mismatch;
    return std::ranges::equal(detected_, used_) ? AlStatusCode::none : AlStatusCode::needs_init;
}

}  // namespace margay::subdevice
