// The object dictionary: constexpr tables that describe the objects, and one image of octets per device that contains
// the values.
//
// A table is written once for a type of device and is placed in flash; all devices of the type share it. Values are
// stored in the image in the byte order of the wire (little-endian). Therefore an application accesses them through
// a struct of values (values.hpp) or through Field, an SDO copies them without conversion, and the PDO mapping copies
// bits:
//
//     struct Values {
//         std::uint8_t outputs;
//         Le<std::int16_t> limit;
//     };
//     constexpr Entry kOutputs[] = {value<&Values::outputs>(0, "Outputs", od::kReadWrite | od::kRxMappable)};
//     constexpr Entry kLimit[] = {value<&Values::limit>(0, "Limit", od::kReadWrite, 100).within(kLimits<-500, 500>)};
//     constexpr Object kObjects[] = {variable(0x7000, "Outputs", kOutputs), variable(0x8000, "Limit", kLimit)};
//     static_assert(well_formed(kObjects, sizeof(Values)));
#pragma once

#include "subdevice/description.hpp"
#include "subdevice/esc_access.hpp"
#include "subdevice/object.hpp"
#include "subdevice/values.hpp"
#include "util/bytes.hpp"

#include <algorithm>
#include <array>
#include <concepts>
#include <span>
#include <string_view>
#include <type_traits>

namespace margay::subdevice {

// ------------------------------------------------------------------ functions to build tables

// By size and sign: which of int and long is std::int32_t depends on the compiler.
template <std::integral T>
inline constexpr DataType kTypeOf = [] {
    constexpr bool kSigned = static_cast<T>(-1) < T{0};
    switch (sizeof(T)) {
        case 1: return kSigned ? DataType::integer8 : DataType::unsigned8;
        case 2: return kSigned ? DataType::integer16 : DataType::unsigned16;
        case 4: return kSigned ? DataType::integer32 : DataType::unsigned32;
        default: return kSigned ? DataType::integer64 : DataType::unsigned64;
    }
}();

// A number in the image.
template <class F>
[[nodiscard]] constexpr Entry value(std::uint8_t subindex, const char* name, std::uint16_t access,
                                    typename F::Type initial = 0) {
    return Entry{.subindex = subindex,
                 .storage = Storage::image,
                 .type = kTypeOf<typename F::Type>,
                 .access = access,
                 .bits = sizeof(typename F::Type) * 8,
                 .offset = F::offset,
                 .name = name}
        .beginning(static_cast<std::uint64_t>(initial));
}

// The same for a member of a struct of values (values.hpp). An array has a subindex for each element.
template <auto... Path>
[[nodiscard]] constexpr Entry value(std::uint8_t subindex, const char* name, std::uint16_t access,
                                    typename MemberField<Path...>::Type initial = 0) {
    constexpr auto kCount = members::Number<MemberType<Path...>>::count;
    static_assert(kCount <= 255);
    return value<MemberField<Path...>>(subindex, name, access, initial).times(static_cast<std::uint8_t>(kCount));
}

// A number of `bits` bits (1 to 8) that uses one octet of the image: BOOLEAN, BIT2 and so on.
template <class F>
requires std::same_as<typename F::Type, std::uint8_t>
[[nodiscard]] constexpr Entry flag(std::uint8_t subindex, const char* name, std::uint16_t access, unsigned bits = 1,
                                   std::uint8_t initial = 0) {
    Entry e = value<F>(subindex, name, access, initial);
    e.type = bits == 1 ? DataType::boolean : static_cast<DataType>(static_cast<unsigned>(DataType::bit1) + bits - 1);
    e.bits = bits;
    return e;
}

template <auto... Path>
[[nodiscard]] constexpr Entry flag(std::uint8_t subindex, const char* name, std::uint16_t access, unsigned bits = 1,
                                   std::uint8_t initial = 0) {
    constexpr auto kCount = members::Number<MemberType<Path...>>::count;
    static_assert(kCount <= 255);
    return flag<MemberField<Path...>>(subindex, name, access, bits, initial).times(static_cast<std::uint8_t>(kCount));
}

// Octets in the image: strings (padded with zeros), domains and other types.
[[nodiscard]] constexpr Entry octets(std::uint8_t subindex, const char* name, DataType type, std::uint16_t access,
                                     std::size_t offset, std::size_t bytes, std::string_view initial = {}) {
    const Entry e{.subindex = subindex,
                  .storage = Storage::image,
                  .type = type,
                  .access = access,
                  .bits = static_cast<std::uint32_t>(bytes * 8),
                  .offset = static_cast<std::uint32_t>(offset),
                  .name = name};
    return initial.empty() ? e : e.beginning(initial);
}

template <auto... Path>
[[nodiscard]] constexpr Entry octets(std::uint8_t subindex, const char* name, DataType type, std::uint16_t access,
                                     std::string_view initial = {}) {
    return octets(subindex, name, type, access, members::Place<Path...>::offset, sizeof(MemberType<Path...>), initial);
}

template <class T>
[[nodiscard]] constexpr Entry constant(std::uint8_t subindex, const char* name, T initial,
                                       std::uint16_t access = od::kReadOnly) {
    return Entry{.subindex = subindex,
                 .storage = Storage::constant,
                 .type = kTypeOf<T>,
                 .access = access,
                 .bits = sizeof(T) * 8,
                 .name = name}
        .beginning(static_cast<std::uint64_t>(initial));
}

[[nodiscard]] constexpr Entry text(std::uint8_t subindex, const char* name, std::string_view content,
                                   std::uint16_t access = od::kReadOnly) {
    return Entry{.subindex = subindex,
                 .storage = Storage::text,
                 .type = DataType::visible_string,
                 .access = access,
                 .bits = static_cast<std::uint32_t>(content.size() * 8),
                 .name = name}
        .beginning(content);
}

// A value that ObjectHooks::memory returns. `bits` is its usual size; 0 if the size varies.
[[nodiscard]] constexpr Entry provided(std::uint8_t subindex, const char* name, DataType type, std::uint32_t bits,
                                       std::uint16_t access) {
    return {
        .subindex = subindex, .storage = Storage::provided, .type = type, .access = access, .bits = bits, .name = name};
}

[[nodiscard]] constexpr Entry padding(std::uint8_t subindex, std::uint32_t bits) {
    return {.subindex = subindex, .access = od::kReadOnly, .bits = bits};
}

// Subindex 0 of an array or a record.
[[nodiscard]] constexpr Entry entry_count(std::uint8_t n) { return constant<std::uint8_t>(0, "SubIndex 000", n); }

[[nodiscard]] constexpr Object variable(std::uint16_t index, std::string_view name, std::span<const Entry> entry,
                                        const ObjectHooks* hooks = nullptr) {
    return {index, ObjectCode::variable, 0, entry.front().type, 0, name, entry, hooks};
}
[[nodiscard]] constexpr Object array(std::uint16_t index, std::string_view name, std::span<const Entry> entries,
                                     const ObjectHooks* hooks = nullptr) {
    return {index, ObjectCode::array, 0, entries.back().type, 0, name, entries, hooks};
}
[[nodiscard]] constexpr Object record(std::uint16_t index, std::string_view name, std::span<const Entry> entries,
                                      const ObjectHooks* hooks = nullptr, DataType type = DataType::none) {
    return {index, ObjectCode::record, 0, type, 0, name, entries, hooks};
}

// Whether the index of an object of a module depends on the slot of the module (PDOs have a distance of their own).
[[nodiscard]] constexpr bool moves_with_slot(std::uint16_t index) { return index >= 0x2000 && index < 0xF000; }

// Two tables as one, ascending by index.
template <std::size_t N, std::size_t M>
[[nodiscard]] constexpr std::array<Object, N + M> joined(const std::array<Object, N>& a,
                                                         const std::array<Object, M>& b) {
    std::array<Object, N + M> all{};
    std::ranges::copy(b, std::ranges::copy(a, all.begin()).out);
    std::ranges::sort(all, {}, &Object::index);
    return all;
}
template <std::size_t N, std::size_t M>
[[nodiscard]] constexpr std::array<Object, N + M> joined(const Object (&a)[N], const std::array<Object, M>& b) {
    return joined(std::to_array(a), b);
}

// Whether an entry that has limits begins within them: a master may write what it has read. A provided value has no
// initial value in the table: its limits must be possible for its data type.
[[nodiscard]] constexpr bool begins_within_limits(const Entry& e) {
    const auto [minimum, maximum] = e.limits();
    const auto begin = e.storage == Storage::provided ? static_cast<std::uint64_t>(minimum) : e.initial();
    const auto initial = static_cast<std::int64_t>(begin);
    if (e.bits > 64) return false;
    if (is_signed(e.type)) return minimum <= initial && initial <= maximum;
    const auto mask = e.bits < 64 ? (std::uint64_t{1} << e.bits) - 1 : ~std::uint64_t{0};
    const auto number = begin & mask;
    return static_cast<std::uint64_t>(minimum) <= number && number <= static_cast<std::uint64_t>(maximum);
}

// With -fsanitize=undefined, GCC 12 does not know in a constant expression that the address of a variable is not null.
[[nodiscard]] constexpr bool provides_memory(const Object& o) {
    if (!std::is_constant_evaluated()) return o.hooks != nullptr && o.hooks->memory != nullptr;
    if (__builtin_constant_p(o.hooks == nullptr) && o.hooks == nullptr) return false;
    return !(__builtin_constant_p(o.hooks->memory == nullptr) && o.hooks->memory == nullptr);
}

// Whether subindex 0 of each array and record begins with a count of subindices that the table has.
[[nodiscard]] constexpr bool counts_what_is_there(std::span<const Object> objects) {
    for (const Object& o : objects)
        if (o.code != ObjectCode::variable && o.entries.front().initial() > o.max_subindex()) return false;
    return true;
}

// Checks a table: indices ascending, values inside the image, each subindex unique, counts that do not exceed them,
// initial values within their limits, a memory hook for each provided value.
[[nodiscard]] constexpr bool well_formed(std::span<const Object> objects, std::size_t image_bytes) {
    for (std::size_t i = 0; i < objects.size(); ++i) {
        const auto& o = objects[i];
        if (i > 0 && o.index <= objects[i - 1].index) return false;
        if (o.entries.empty() || o.entries.front().subindex != 0) return false;
        if (o.code == ObjectCode::variable && o.max_subindex() != 0) return false;
        unsigned next = 0;
        for (const auto& e : o.entries) {
            if (e.count == 0 || e.subindex < next || e.last() > 255) return false;
            next = e.last() + 1;
            if (e.is_limited() && !begins_within_limits(e)) return false;
            if (e.storage == Storage::image && e.offset + std::size_t{e.bytes()} * e.count > image_bytes) return false;
            if (e.storage == Storage::provided && !provides_memory(o)) return false;
        }
        if (o.code != ObjectCode::variable && (o.entries.front().count != 1 || o.entries.front().bits != 8))
            return false;
    }
    return counts_what_is_there(objects);
}

// The largest value that an SDO transfers in segments: a subindex, or a whole object by complete access. Values of
// hooks do not count.
constexpr std::size_t largest_value(std::span<const Object> objects) {
    std::size_t most = 0;
    for (const Object& object : objects) {
        std::size_t all = 2;  // subindex 0
        for (const Entry& entry : object.entries) {
            most = std::max<std::size_t>(most, entry.bytes());
            all += std::size_t{entry.bytes()} * entry.count;
        }
        most = std::max(most, all);
    }
    return most;
}

// ------------------------------------------------------------------ at run time

// The objects of a dictionary, ascending by index: from the table and from the modules.
class ObjectRange {
  public:
    class Iterator {
      public:
        Iterator(const ObjectDictionary& dictionary, const Object* at) : dictionary_(dictionary), at_(at) {}
        [[nodiscard]] const Object& operator*() const { return *at_; }
        Iterator& operator++();
        [[nodiscard]] bool operator==(const Iterator& other) const { return at_ == other.at_; }

      private:
        const ObjectDictionary& dictionary_;
        const Object* at_;
    };
    explicit ObjectRange(const ObjectDictionary& dictionary) : dictionary_(dictionary) {}
    [[nodiscard]] Iterator begin() const;
    [[nodiscard]] Iterator end() const { return {dictionary_, nullptr}; }

  private:
    const ObjectDictionary& dictionary_;
};

class ObjectDictionary {
  public:
    // All arguments must outlive the dictionary. The dictionary passes the application to the hooks.
    ObjectDictionary(std::span<const Object> objects, MutableBytes image, Application* application = nullptr)
        : objects_(objects), image_(image), application_(application) {
        restore_defaults();
    }

    [[nodiscard]] ObjectRange objects() const { return ObjectRange(*this); }
    [[nodiscard]] MutableBytes image() const { return image_; }
    [[nodiscard]] Application* application() const { return application_; }
    [[nodiscard]] const Object* find(std::uint16_t index) const;  // nullptr: there is no such object
    // The first object with this index or a higher one; nullptr: there is none.
    [[nodiscard]] const Object* from(std::uint32_t index) const;
    // False: the hook of the object says that the device does not have it.
    [[nodiscard]] bool exists(const Object& object);

    // Sets entries in the image to their initial values: all, or only entries with these access bits (od::kBackup).
    void restore_defaults(std::uint16_t access = 0);
    void restore_defaults(const Object& object, std::uint16_t access = 0);

    // The objects of the modules, ascending by index, the distance between the indices of two slots, and the idents of
    // the modules in the slots. Modules calls it. Other objects of modules must not be in use meanwhile.
    void set_modules(std::span<const Object> objects, std::uint16_t distance, std::span<const std::uint32_t> idents) {
        const Guard guard(lock_);
        modules_ = objects;
        module_distance_ = distance;
        module_idents_ = idents;
    }
    // The objects of the device itself (slot 0), or of all modules, and the number of slots.
    [[nodiscard]] std::span<const Object> objects_of(unsigned slot) const { return slot == 0 ? objects_ : modules_; }
    [[nodiscard]] unsigned slots() const { return static_cast<unsigned>(module_idents_.size()); }
    // Of the module that has the object; 0: the object belongs to the device.
    [[nodiscard]] std::uint32_t module_ident(const Object& object) const;
    // Memory of a value in the image; empty for another storage.
    [[nodiscard]] MutableBytes in_image(const Object& object, const Entry& entry, unsigned subindex) const;
    // The constant or initial value of a number; in the PDO of a module, the objects of the module have its slot.
    [[nodiscard]] std::uint64_t initial(const Object& object, const Entry& entry) const;

    // A number of up to 8 octets; 0 if there is no such entry. For the objects of the stack; applications use Field.
    [[nodiscard]] std::uint64_t number(std::uint16_t index, unsigned subindex) const;

    // While the outputs of a mapping are applied, downloads to the mapped entries are refused. nullptr: no mapping is
    // active.
    void block_downloads(const PdoMapping* outputs) { blocked_ = outputs; }
    [[nodiscard]] bool blocked(std::uint16_t index, unsigned subindex) const;

    // The lock that is held while a value is copied, because an interrupt handler may change the value; nullptr: none.
    // ProcessData sets it.
    void set_lock(EscAccess* lock) { lock_ = lock; }
    [[nodiscard]] EscAccess* lock() const { return lock_; }

  private:
    std::span<const Object> objects_;
    std::span<const Object> modules_{};
    std::uint16_t module_distance_ = 0;
    std::span<const std::uint32_t> module_idents_{};
    MutableBytes image_;
    Application* application_;
    const PdoMapping* blocked_ = nullptr;
    EscAccess* lock_ = nullptr;
};

// ------------------------------------------------------------------ objects generated from the description

// Entries of 0x1018, a record with DataType::identity, and of 0x1C00, an array of UNSIGNED8.
[[nodiscard]] constexpr std::array<Entry, 5> identity_entries(const DeviceDescription& d) {
    return {entry_count(4), constant(1, "Vendor ID", d.vendor_id), constant(2, "Product code", d.product_code),
            constant(3, "Revision", d.revision), constant(4, "Serial number", d.serial)};
}

// The SyncManagers of a device: 4, or more when an area of process data has a higher number.
[[nodiscard]] constexpr std::size_t sync_manager_count(const DeviceDescription& d) {
    std::size_t count = 4;
    for (const bool outputs : {true, false})
        for_each_area(d, outputs, [&](const ProcessDataArea& area, std::size_t) {
            count = std::max(count, std::size_t{area.sync_manager} + 1);
        });
    return count;
}

// Types of the SyncManagers from SM0 on: 1 mailbox out, 2 mailbox in, 3 outputs, 4 inputs; 0 if the device does not use
// the SyncManager. `Count` is sync_manager_count() of the description.
template <std::size_t Count = 4>
[[nodiscard]] constexpr std::array<Entry, Count + 1> sync_manager_type_entries(const DeviceDescription& d) {
    std::array<Entry, Count + 1> entries{};
    entries[0] = entry_count(static_cast<std::uint8_t>(Count));
    for (std::size_t n = 1; n <= Count; ++n)
        entries[n] = constant<std::uint8_t>(static_cast<std::uint8_t>(n), "SyncManager type", 0);
    if (d.mailbox.present()) entries[1].low = 1, entries[2].low = 2;
    for (const bool outputs : {true, false})
        for_each_area(d, outputs, [&](const ProcessDataArea& area, std::size_t) {
            if (area.sync_manager < Count) entries[area.sync_manager + 1u].low = outputs ? 3 : 4;
        });
    return entries;
}

}  // namespace margay::subdevice
