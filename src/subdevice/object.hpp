// One object of the dictionary: its entries, and its hooks. object_dictionary.hpp has the functions that build tables.
#pragma once

#include "util/bytes.hpp"
#include "wire/coe.hpp"

#include <margay/al_state.hpp>
#include <margay/time.hpp>

#include <cstdint>
#include <span>
#include <string_view>

namespace margay::subdevice {

using wire::coe::Abort;
using wire::coe::DataType;
using wire::coe::ObjectCode;

[[nodiscard]] constexpr bool is_signed(DataType type) {
    using enum DataType;
    return type == integer8 || type == integer16 || type == integer24 || type == integer32 || type == integer40 ||
           type == integer48 || type == integer56 || type == integer64;
}

// Access bits of entries. wire::coe::access has more.
namespace od {
using namespace wire::coe::access;
inline constexpr std::uint16_t kReadOnly = kRead;
inline constexpr std::uint16_t kReadWrite = kRead | kWrite;
// For settings that must not change in SAFEOP and OP.
inline constexpr std::uint16_t kReadWritePreop = kRead | kWritePreop;
}  // namespace od

enum class Storage : std::uint8_t {
    nothing,   // padding; reads as zero
    constant,  // the value is Entry::initial()
    text,      // the value is Entry::content()
    image,     // the value is in the image of the device
    provided,  // ObjectHooks::memory returns the value
};

// The smallest and the largest value that a master may write.
struct ValueLimits {
    std::int64_t minimum = 0;
    std::int64_t maximum = 0;
};
template <std::int64_t Minimum, std::int64_t Maximum>
inline constexpr ValueLimits kLimits{Minimum, Maximum};

// The constant or initial value of an entry.
enum class InitialKind : std::uint8_t {
    number,
    limited_number,  // a number of 32 bits, with limits for writes
    text,
};

// One subindex, or several consecutive subindices with equal properties. 28 octets on a processor of 32 bits: a table
// has one for each line, so limits are behind a pointer, in the place of the high half of the initial value.
struct Entry {
    std::uint8_t subindex = 0;
    std::uint8_t count = 1;  // number of subindices from `subindex` on; their values are adjacent in the image
    Storage storage = Storage::nothing;
    InitialKind kind = InitialKind::number;
    DataType type = DataType::none;
    std::uint16_t access = 0;
    std::uint32_t bits = 0;    // size of one value
    std::uint32_t offset = 0;  // of the first value, in octets from the start of the image
    const char* name = "";     // ends with a zero
    std::uint32_t low = 0;     // of a number: its low 32 bits; of a text: its octets
    union More {
        std::uint32_t high = 0;  // of a number that has no limits
        const char* text;
        const ValueLimits* limits;
    } more{};

    [[nodiscard]] constexpr std::uint32_t bytes() const { return (bits + 7) / 8; }
    [[nodiscard]] constexpr unsigned last() const { return unsigned{subindex} + count - 1u; }
    [[nodiscard]] constexpr bool is_padding() const { return storage == Storage::nothing; }
    [[nodiscard]] constexpr bool is_text() const { return kind == InitialKind::text; }
    [[nodiscard]] constexpr bool is_limited() const { return kind == InitialKind::limited_number; }
    [[nodiscard]] constexpr const ValueLimits& limits() const { return *more.limits; }  // valid if is_limited()
    // The constant or initial value of a number, of which the low bytes() octets are valid; 0 for a text.
    [[nodiscard]] constexpr std::uint64_t initial() const {
        if (is_text()) return 0;
        if (is_limited()) return static_cast<std::uint64_t>(std::int64_t{static_cast<std::int32_t>(low)});
        return std::uint64_t{more.high} << 32 | low;
    }
    // The constant or initial value of a string; empty for a number.
    [[nodiscard]] constexpr std::string_view content() const {
        return is_text() ? std::string_view(more.text, low) : std::string_view();
    }
    // Octet `n` of the initial value.
    [[nodiscard]] constexpr std::byte initial_octet(std::size_t n) const {
        if (is_text()) return n < low ? static_cast<std::byte>(more.text[n]) : std::byte{0};
        return n < 8 ? static_cast<std::byte>(initial() >> (8 * n)) : std::byte{0};
    }

    // Return a copy of the entry with another constant or initial value: a number, or a text, which must exist as long
    // as the table.
    [[nodiscard]] constexpr Entry beginning(std::uint64_t number) const {
        Entry e = *this;
        e.low = static_cast<std::uint32_t>(number);
        if (e.is_text()) e.kind = InitialKind::number;
        if (!e.is_limited()) e.more.high = static_cast<std::uint32_t>(number >> 32);
        if (e.is_limited() && bits > 32 && e.initial() != number) the_initial_value_needs_more_than_32_bits();
        return e;
    }
    [[nodiscard]] constexpr Entry beginning(std::string_view content) const {
        Entry e = *this;
        e.kind = InitialKind::text;
        e.low = static_cast<std::uint32_t>(content.size());
        e.more.text = content.data();
        return e;
    }
    // Return a copy of the entry: with limits (numbers only), with another data type, or for `n` subindices. A download
    // of a value outside of its limits is refused; one in the outputs of the process data is not applied, so that the
    // value before stays (ProcessData::Counters::refused_values). The limits must exist as long as the table:
    // kLimits<0, 100>, or a constant of the author. A number of 64 bits with limits begins with a signed one of 32
    // bits.
    [[nodiscard]] constexpr Entry within(const ValueLimits& allowed) const {
        Entry e = *this;
        if (is_text() || bits > 64) limits_are_for_numbers();
        e.kind = InitialKind::limited_number;
        e.more.limits = &allowed;
        if (bits > 32 && e.initial() != initial()) the_initial_value_needs_more_than_32_bits();
        return e;
    }
    Entry within(const ValueLimits&&) const = delete;
    [[nodiscard]] constexpr Entry as(DataType other) const {
        Entry e = *this;
        e.type = other;
        return e;
    }
    [[nodiscard]] constexpr Entry times(std::uint8_t n) const {
        Entry e = *this;
        e.count = n;
        return e;
    }

  private:
    // No constant expressions: the table does not compile.
    static void the_initial_value_needs_more_than_32_bits() {}
    static void limits_are_for_numbers() {}
};

struct Object;
class Application;
class ObjectDictionary;
class PdoMapping;

// The arguments of a hook.
struct ObjectAccess {
    const Object& object;
    std::uint8_t subindex = 0;
    bool complete = false;  // complete access: all subindices from `subindex` on
    bool write = false;
    std::size_t bytes = 0;  // size of the data of a write
    AlState state = AlState::none;
    Time now{};
    ObjectDictionary& dictionary;
    Application* application = nullptr;
    bool again = false;  // a hook has answered later() to this access before
};

// The answer of a hook. Abort::none continues the access, another code aborts it, later() calls the hook again at that
// time. later(kNever) has no time of its own: the hook is called again in each step() that something else causes, and
// 10 s after its first answer the access is aborted with Abort::timeout.
struct HookAnswer {
    constexpr HookAnswer(Abort code = Abort::none) : abort(code) {}
    [[nodiscard]] static constexpr HookAnswer later(Time when) {
        HookAnswer answer(kLater);
        answer.again = when;
        return answer;
    }
    [[nodiscard]] constexpr bool waits() const { return abort == kLater; }
    static constexpr auto kLater = static_cast<Abort>(1);  // content of `abort` after later(); never sent
    Abort abort;
    Time again{};  // when waits()
};

// Hooks of an object. They are called from Device::step() in the order of the members. Each may be nullptr.
struct ObjectHooks {
    // False: the device does not have the object. SDO and SDO information answer Abort::no_object, lists leave the
    // object out, and it cannot be mapped. Of the access, only object, dictionary and application are set.
    bool (*exists)(const ObjectAccess&) = nullptr;
    HookAnswer (*before_read)(const ObjectAccess&) = nullptr;  // may update the value
    HookAnswer (*before_write)(const ObjectAccess&,
                               Bytes data) = nullptr;    // `data`: one value, or the data of a complete access
    void (*after_write)(const ObjectAccess&) = nullptr;  // the value is stored
    // Storage::provided: returns the value with its current length; for a write it returns all available memory. It is
    // also called with the lock of EscAccess held, so it only returns memory: before_read computes a value.
    MutableBytes (*memory)(const ObjectAccess&) = nullptr;
    // Values larger than the staging buffer are read from the memory of the object, and written into it, segment by
    // segment; before_write is called after that. false: they are refused.
    bool in_pieces = false;
};

struct Object {
    std::uint16_t index = 0;
    ObjectCode code = ObjectCode::null;
    std::uint8_t slot = 0;  // the object belongs to the module in this slot, from 1 on; 0: to the device (modules.hpp)
    DataType type = DataType::none;
    std::uint16_t image_start = 0;  // added to the offsets of the entries: the values of the module
    std::string_view name{};
    std::span<const Entry> entries{};  // ascending by subindex
    const ObjectHooks* hooks = nullptr;

    [[nodiscard]] constexpr const Entry* entry(unsigned subindex) const {
        for (const auto& e : entries)
            if (subindex >= e.subindex && subindex <= e.last()) return &e;
        return nullptr;
    }
    [[nodiscard]] constexpr unsigned max_subindex() const { return entries.empty() ? 0 : entries.back().last(); }
};

}  // namespace margay::subdevice
