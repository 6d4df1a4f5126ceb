#include "subdevice/stored_values.hpp"

#include "subdevice/application.hpp"
#include "subdevice/object_values.hpp"

#include <algorithm>
#include <utility>

namespace margay::subdevice {
namespace {

// The head of a block. `layout` is a CRC of the table of the device: values of another table are not loaded. The limits
// of the values are no part of it: a firmware with other limits loads the values that it allows. The values of the
// device itself follow, then a part for each module that has stored values.
struct Head {
    using layout = Field<std::uint32_t, 0>;
    using size = Field<std::uint32_t, 4>;
    using values = Field<std::uint32_t, 8>;  // a CRC of all that follows
    static constexpr std::size_t bytes = kStoredHeadBytes;
};

// The head of the part of a module. `layout` is a CRC of the kind of module and of its table in this slot.
struct PartHead {
    using layout = Field<std::uint32_t, 0>;
    using slot = Field<std::uint16_t, 4>;
    using size = Field<std::uint16_t, 6>;
    static constexpr std::size_t bytes = kStoredPartHeadBytes;
};

// CRC-32 (IEEE 802.3), bit by bit: no table in flash, and these blocks are small.
class Crc {
  public:
    void add(std::byte octet) {
        value_ ^= std::to_integer<std::uint32_t>(octet);
        for (int bit = 0; bit < 8; ++bit) value_ = (value_ >> 1) ^ ((value_ & 1) != 0 ? 0xEDB88320U : 0U);
    }
    void add(Bytes octets) {
        for (const std::byte octet : octets) add(octet);
    }
    void add(std::uint32_t number) {
        for (unsigned n = 0; n < 4; ++n) add(static_cast<std::byte>(number >> (8 * n)));
    }
    [[nodiscard]] std::uint32_t value() const { return ~value_; }

  private:
    std::uint32_t value_ = 0xFFFFFFFF;
};

// Calls visit(object, entry) for the lines of the table that have stored values, of the module in a slot or of the
// device itself (slot 0).
template <class Visit>
void for_each_line(const ObjectDictionary& dictionary, unsigned slot, Visit visit) {
    for (const Object& object : dictionary.objects_of(slot))
        for (const Entry& entry : object.entries)
            if (object.slot == slot && is_stored(entry)) visit(object, entry);
}

// Visits each stored value: visit(object, entry, subindex, its memory).
template <class Visit>
void for_each_value(const ObjectDictionary& dictionary, unsigned slot, Visit visit) {
    for_each_line(dictionary, slot, [&](const Object& object, const Entry& entry) {
        for (unsigned n = entry.subindex; n <= entry.last(); ++n)
            visit(object, entry, static_cast<std::uint8_t>(n), dictionary.in_image(object, entry, n));
    });
}

struct Part {
    std::uint32_t layout = 0;
    std::size_t bytes = 0;  // of the values
};
Part part_of(const ObjectDictionary& dictionary, unsigned slot) {
    Part part;
    Crc crc;
    for_each_line(dictionary, slot, [&](const Object& object, const Entry& entry) {
        // Two kinds of modules may have the same objects.
        if (slot != 0) crc.add(dictionary.module_ident(object));
        crc.add(std::uint32_t{object.index} << 16 | std::uint32_t{entry.subindex} << 8 | entry.count);
        crc.add(std::uint32_t{static_cast<std::uint16_t>(entry.type)} << 16 | entry.bits);
        part.bytes += stored_bytes(entry);
    });
    part.layout = crc.value();
    return part;
}

std::size_t block_bytes(const ObjectDictionary& dictionary) {
    std::size_t bytes = Head::bytes + part_of(dictionary, 0).bytes;
    for (unsigned slot = 1; slot <= dictionary.slots(); ++slot)
        if (const auto part = part_of(dictionary, slot); part.bytes != 0) bytes += PartHead::bytes + part.bytes;
    return bytes;
}

std::uint32_t checksum_of(Bytes values) {
    Crc crc;
    crc.add(values);
    return crc.value();
}

}  // namespace

// The values of a block for this table: the values of the device itself, and of the parts of modules. Empty: the block
// has no values for it.
Bytes StoredValues::block(std::size_t own_bytes, std::uint32_t layout) {
    if (buffer_.size() < Head::bytes) return {};
    outdated_ = std::exchange(collected_, false) || outdated_;
    const std::size_t size = store_.load(buffer_);
    if (size < Head::bytes + own_bytes || size > buffer_.size() || Head::size::load(buffer_) != size) return {};
    const Bytes values = Bytes(buffer_).first(size).subspan(Head::bytes);
    if (Head::layout::load(buffer_) != layout || Head::values::load(buffer_) != checksum_of(values)) return {};
    return Bytes(buffer_).first(size);
}

void StoredValues::load_part(unsigned slot, Bytes values) {
    for_each_value(dictionary_, slot,
                   [&](const Object& object, const Entry& entry, std::uint8_t subindex, MutableBytes memory) {
                       const auto value = values.first(memory.size());
                       values = values.subspan(memory.size());
                       const ObjectAccess access{.object = object, .subindex = subindex, .dictionary = dictionary_};
                       if (check_value(access, entry, value) == Abort::none) std::ranges::copy(value, memory.begin());
                   });
}

// The parts of all modules, or the part of one slot. False: the slot has no part, or a part of another kind of module.
bool StoredValues::load_parts(Bytes parts, unsigned only) {
    bool any = false;
    while (parts.size() >= PartHead::bytes) {
        const unsigned slot = PartHead::slot::load(parts);
        const std::size_t bytes = PartHead::size::load(parts);
        const auto layout = PartHead::layout::load(parts);
        parts = parts.subspan(PartHead::bytes);
        if (slot == 0 || bytes > parts.size()) return any;
        const auto part = part_of(dictionary_, slot);
        if ((only == 0 || slot == only) && part.bytes == bytes && part.layout == layout) {
            load_part(slot, parts.first(bytes));
            any = true;
        }
        parts = parts.subspan(bytes);
    }
    return any;
}

bool StoredValues::load() {
    const auto own = part_of(dictionary_, 0);
    const auto all = block(own.bytes, own.layout);
    if (all.empty()) return false;
    load_part(0, all.subspan(Head::bytes, own.bytes));
    (void)load_parts(all.subspan(Head::bytes + own.bytes), 0);
    return true;
}

bool StoredValues::load_module(unsigned slot) {
    const auto own = part_of(dictionary_, 0);
    const auto all = block(own.bytes, own.layout);
    return slot != 0 && !all.empty() && load_parts(all.subspan(Head::bytes + own.bytes), slot);
}

// Values are copied under the lock in pieces, and the CRC is computed without the lock.
std::uint32_t StoredValues::checksum() {
    Crc crc;
    std::array<std::byte, 64> piece{};
    const auto add = [&](const Object&, const Entry&, std::uint8_t, Bytes memory) {
        while (!memory.empty()) {
            const auto bytes = std::min(memory.size(), piece.size());
            {
                const Guard guard(dictionary_.lock());
                std::copy_n(memory.begin(), bytes, piece.begin());
            }
            crc.add(Bytes(piece).first(bytes));
            memory = memory.subspan(bytes);
        }
    };
    for (unsigned slot = 0; slot <= dictionary_.slots(); ++slot) for_each_value(dictionary_, slot, add);
    return crc.value();
}

void StoredValues::collect() {
    std::size_t at = Head::bytes;
    for (unsigned slot = 0; slot <= dictionary_.slots(); ++slot) {
        const auto part = part_of(dictionary_, slot);
        if (slot == 0) Head::layout::store(buffer_, part.layout);
        if (slot != 0 && part.bytes != 0) {
            const auto head = buffer_.subspan(at, PartHead::bytes);
            PartHead::layout::store(head, part.layout);
            PartHead::slot::store(head, static_cast<std::uint16_t>(slot));
            PartHead::size::store(head, static_cast<std::uint16_t>(part.bytes));
            at += PartHead::bytes;
        }
        for_each_value(dictionary_, slot, [&](const Object&, const Entry&, std::uint8_t, Bytes memory) {
            const Guard guard(dictionary_.lock());
            std::ranges::copy(memory, buffer_.begin() + static_cast<std::ptrdiff_t>(at));
            at += memory.size();
        });
    }
    Head::size::store(buffer_, static_cast<std::uint32_t>(at));
    Head::values::store(buffer_, checksum_of(Bytes(buffer_).first(at).subspan(Head::bytes)));
}

HookAnswer StoredValues::save(Time now, bool again) {
    const std::size_t size = block_bytes(dictionary_);
    if (buffer_.size() < size) return Abort::out_of_memory;
    // The block that is being stored may belong to an earlier command that the master has given up.
    if (!again) outdated_ = unfinished_;
    if (!std::exchange(collected_, true)) collect();
    HookAnswer answer = store_.save(Bytes(buffer_).first(size), now);
    const bool stored = !answer.waits() && answer.abort == Abort::none;
    if (stored && std::exchange(outdated_, false)) {
        collect();
        answer = store_.save(Bytes(buffer_).first(size), now);
    }
    collected_ = unfinished_ = answer.waits();
    return answer;
}

HookAnswer StoredValues::restore(Time now) {
    outdated_ = std::exchange(collected_, false) || outdated_;
    HookAnswer answer = store_.save({}, now);
    const bool erased = !answer.waits() && answer.abort == Abort::none;
    if (erased && std::exchange(outdated_, false)) answer = store_.save({}, now);
    unfinished_ = answer.waits();
    if (answer.waits() || answer.abort != Abort::none) return answer;
    dictionary_.restore_defaults(od::kBackup);
    return answer;
}

MutableBytes StoredValues::show(std::uint32_t number) {
    store_le(MutableBytes(shown_), 0, number);
    return shown_;
}

namespace stored_values {

namespace {
StoredValues* of(const ObjectAccess& access) {
    return access.application == nullptr ? nullptr : access.application->stored_values();
}
std::uint32_t command_in(const ObjectAccess& access, Bytes data) {
    // A complete access begins with subindex 0, in 16 bits.
    const Bytes value =
        access.complete && access.subindex == 0 ? data.subspan(std::min<std::size_t>(2, data.size())) : data;
    return value.size() < 4 ? 0 : load_le<std::uint32_t>(value);
}
}  // namespace

bool exists(const ObjectAccess& access) { return of(access) != nullptr; }

// The application may remove its stored values while a command waits, or between two segments of a transfer.
HookAnswer before_save(const ObjectAccess& access, Bytes data) {
    auto* const stored = of(access);
    if (stored == nullptr) return Abort::no_object;
    return command_in(access, data) == kSave ? stored->save(access.now, access.again) : HookAnswer(Abort::cannot_store);
}

HookAnswer before_restore(const ObjectAccess& access, Bytes data) {
    auto* const stored = of(access);
    if (stored == nullptr) return Abort::no_object;
    return command_in(access, data) == kRestore ? stored->restore(access.now) : HookAnswer(Abort::cannot_store);
}

MutableBytes command(const ObjectAccess& access) {
    auto* const stored = of(access);
    return stored == nullptr ? MutableBytes() : stored->show(1);
}

// The CRC is computed before the value is copied under the lock, because the CRC of all values takes long.
HookAnswer before_checksum(const ObjectAccess& access) {
    auto* const stored = of(access);
    if (stored == nullptr) return Abort::no_object;
    (void)stored->show(stored->checksum());
    return Abort::none;
}

MutableBytes checksum(const ObjectAccess& access) {
    auto* const stored = of(access);
    return stored == nullptr ? MutableBytes() : stored->shown();
}

}  // namespace stored_values
}  // namespace margay::subdevice
