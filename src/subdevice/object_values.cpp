#include "subdevice/object_values.hpp"

#include "subdevice/bits.hpp"

#include <algorithm>
#include <type_traits>

namespace margay::subdevice {

namespace {

Abort check_access(std::uint16_t access, std::uint16_t all, AlState state, Abort never) {
    if ((access & all) == 0) return never;
    const unsigned place = state == AlState::op ? 2 : state == AlState::safeop ? 1 : 0;
    const unsigned lowest = all & (~all + 1u);
    return (access & (lowest << place)) != 0 ? Abort::none : Abort::device_state;
}

// A number of one to seven bits has an octet of its own: the bits above it are not part of the value.
constexpr bool is_small(const Entry& entry) { return entry.bits > 0 && entry.bits < 8; }
constexpr std::byte bits_of(const Entry& entry) { return static_cast<std::byte>((1u << entry.bits) - 1u); }

// BOOLEAN is 1 or 0xFF (ETG.1000.6, coding of a Boolean) when it is true.
bool fits(const Entry& entry, std::byte octet) {
    return (octet & ~bits_of(entry)) == std::byte{0} || (entry.bits == 1 && octet == std::byte{0xFF});
}

ObjectAccess at(const ObjectAccess& access, unsigned subindex) {
    ObjectAccess one = access;
    one.subindex = static_cast<std::uint8_t>(subindex);
    return one;
}

// First bit of an entry after `bit` bits: entries of one octet and more start at an octet boundary.
constexpr std::size_t aligned(std::size_t bit, const Entry& entry) { return entry.bits >= 8 ? (bit + 7) / 8 * 8 : bit; }

using CompleteVisit = void (*)(void* function, const Entry& entry, unsigned subindex, std::size_t bit);

// One loop for all functions: each instance would need its code again.
std::size_t visit_complete(const Object& object, unsigned from, unsigned top, CompleteVisit visit, void* function) {
    std::size_t bit = 0;
    for (const auto& entry : object.entries)
        for (unsigned n = std::max<unsigned>(from, entry.subindex); n <= std::min(top, entry.last()); ++n) {
            bit = aligned(bit, entry);
            visit(function, entry, n, bit);
            bit += n == 0 ? 16 : entry.bits;
        }
    return bit;
}

// Calls f(entry, subindex, first bit) for every subindex from `from` to `top`. Returns the total number of bits.
template <class F>
std::size_t for_each_complete(const Object& object, unsigned from, unsigned top, F&& f) {
    const auto visit = [](void* function, const Entry& entry, unsigned subindex, std::size_t bit) {
        (*static_cast<std::remove_reference_t<F>*>(function))(entry, subindex, bit);
    };
    return visit_complete(object, from, top, visit, &f);
}

unsigned count_of(const ObjectAccess& access) {
    Scratch scratch{};
    const auto count = view_value(at(access, 0), access.object.entries.front(), scratch);
    return count.empty() ? 0 : std::min(std::to_integer<unsigned>(count[0]), access.object.max_subindex());
}

bool count_is_writable(const ObjectAccess& access) {
    return check_writable(access.object.entries.front(), access.state) == Abort::none;
}

// The last subindex that a complete access can write: the announced one, or any that is in the data.
unsigned last_written(const ObjectAccess& access, Bytes data) {
    if (!count_is_writable(access)) return count_of(access);
    return access.subindex == 0 ? load_le<std::uint16_t>(data) : access.object.max_subindex();
}

MutableBytes provided_for_writing(ObjectAccess access) {
    access.write = true;
    return access.object.hooks->memory(access);
}

}  // namespace

Abort check_readable(const Entry& entry, AlState state) {
    return check_access(entry.access, od::kRead, state, Abort::write_only);
}

Abort check_writable(const Entry& entry, AlState state) {
    return check_access(entry.access, od::kWrite, state, Abort::read_only);
}

Bytes view_value(const ObjectAccess& access, const Entry& entry, Scratch& scratch) {
    switch (entry.storage) {
        case Storage::nothing:  // it may have the value of the entry before
            scratch = {};
            return Bytes(scratch).first(std::min<std::size_t>(entry.bytes(), scratch.size()));
        case Storage::constant:
            store_le(MutableBytes(scratch), 0, access.dictionary.initial(access.object, entry));
            return Bytes(scratch).first(entry.bytes());
        case Storage::text: return std::as_bytes(std::span(entry.content()));
        case Storage::provided: return access.object.hooks->memory(access);
        case Storage::image: break;
    }
    const Bytes memory = access.dictionary.in_image(access.object, entry, access.subindex);
    if (is_small(entry)) {
        scratch[0] = memory[0] & bits_of(entry);
        return Bytes(scratch).first(1);
    }
    if (entry.type != DataType::visible_string) return memory;
    const auto end = std::find(memory.begin(), memory.end(), std::byte{0});
    return memory.first(static_cast<std::size_t>(end - memory.begin()));
}

Abort check_value(const ObjectAccess& access, const Entry& entry, Bytes data) {
    std::size_t room = entry.bytes();
    if (entry.storage == Storage::provided) room = provided_for_writing(access).size();
    if (data.size() > room) return Abort::length_too_high;
    if (data.size() < room && !varies(entry.type)) return Abort::length_too_low;
    if (is_small(entry) && !data.empty() && !fits(entry, data[0])) return Abort::value_too_high;
    return check_limits(entry, data);
}

Abort check_limits(const Entry& entry, Bytes data) {
    Scratch value{};
    if (!entry.is_limited() || data.size() > value.size()) return Abort::none;
    const bool negative = is_signed(entry.type) && !data.empty() && (data.back() & std::byte{0x80}) != std::byte{};
    if (negative) value.fill(std::byte{0xFF});
    std::copy(data.begin(), data.end(), value.begin());
    // With the sign bit inverted, signed numbers have the order of unsigned ones.
    const std::uint64_t sign = is_signed(entry.type) ? std::uint64_t{1} << 63 : 0;
    const auto in_order = [sign](std::int64_t number) { return static_cast<std::uint64_t>(number) ^ sign; };
    const std::uint64_t number = in_order(load_le<std::int64_t>(Bytes(value), 0));
    if (number < in_order(entry.limits().minimum)) return Abort::value_too_low;
    return number > in_order(entry.limits().maximum) ? Abort::value_too_high : Abort::none;
}

void store_value(const ObjectAccess& access, const Entry& entry, Bytes data) {
    const auto memory = entry.storage == Storage::provided
                            ? provided_for_writing(access)
                            : access.dictionary.in_image(access.object, entry, access.subindex);
    const auto bytes = std::min(memory.size(), data.size());
    // Data of a segmented transfer may already be in the memory.
    if (memory.data() != data.data()) std::copy_n(data.begin(), bytes, memory.begin());
    std::fill(memory.begin() + static_cast<std::ptrdiff_t>(bytes), memory.end(), std::byte{0});
    if (is_small(entry) && !memory.empty()) memory[0] &= bits_of(entry);
}

std::size_t complete_bytes(const Object& object, unsigned from, unsigned top) {
    return (for_each_complete(object, from, top, [](const Entry&, unsigned, std::size_t) {}) + 7) / 8;
}

Gathered gather(const ObjectAccess& access, MutableBytes into) {
    const auto top = count_of(access);
    const auto bytes = complete_bytes(access.object, access.subindex, top);
    for (const auto& entry : access.object.entries)
        if (entry.subindex <= top && entry.storage == Storage::provided && entry.bits == 0)
            return {Abort::complete_access_unsupported};
    if (bytes > into.size()) return {Abort::out_of_memory};
    std::fill_n(into.begin(), bytes, std::byte{0});
    bool any = false;
    auto why = Abort::none;
    for_each_complete(access.object, access.subindex, top, [&](const Entry& entry, unsigned n, std::size_t bit) {
        if (entry.is_padding()) return;
        const auto refused = check_readable(entry, access.state);
        if (refused != Abort::none) {
            why = why == Abort::none ? refused : why;
            return;  // the value in the response is zero
        }
        any = true;
        Scratch scratch{};
        const Guard guard(access.dictionary.lock());
        const auto value = view_value(at(access, n), entry, scratch);
        copy_bits(into, bit, value, 0, std::min<std::size_t>(entry.bits, value.size() * 8));
    });
    return {any ? Abort::none : why, bytes};
}

namespace {

// The value of an entry in the data of complete access.
Bytes part_of(Bytes data, std::size_t bit, const Entry& entry, Scratch& scratch) {
    if (entry.bits >= 8) return data.subspan(bit / 8, entry.bytes());
    copy_bits(scratch, 0, data, bit, entry.bits);
    return Bytes(scratch).first(1);
}

}  // namespace

Abort check_complete(const ObjectAccess& access, Bytes data) {
    const auto& object = access.object;
    if (access.subindex == 0 && data.size() < 2) return Abort::length_too_low;
    unsigned top = last_written(access, data);
    if (top > object.max_subindex()) return Abort::value_too_high;
    // The data determine the number of entries.
    const auto reaches = [&](unsigned n) { return complete_bytes(object, 1, n); };
    if (access.subindex != 0 && count_is_writable(access))
        while (top != 0 && reaches(top) > data.size() && reaches(top - 1) >= data.size()) --top;
    const auto bytes = complete_bytes(object, access.subindex, top);
    if (data.size() > bytes) return Abort::length_too_high;
    if (data.size() < bytes) return Abort::length_too_low;

    bool any = false;
    auto why = Abort::none;
    auto wrong = Abort::none;
    for_each_complete(object, access.subindex, top, [&](const Entry& entry, unsigned n, std::size_t bit) {
        if (entry.is_padding() || wrong != Abort::none) return;
        const auto refused = check_writable(entry, access.state);
        if (refused != Abort::none) {
            why = why == Abort::none ? refused : why;
            return;
        }
        any = true;
        Scratch scratch{};
        if (!varies(entry.type)) wrong = check_value(at(access, n), entry, part_of(data, bit, entry, scratch));
    });
    if (wrong == Abort::none && !any) wrong = why;
    return wrong;
}

void scatter(const ObjectAccess& access, Bytes data) {
    for_each_complete(access.object, access.subindex, last_written(access, data),
                      [&](const Entry& entry, unsigned n, std::size_t bit) {
                          if (entry.is_padding() || check_writable(entry, access.state) != Abort::none) return;
                          if (bit + (n == 0 ? 16 : entry.bits) > data.size() * 8) return;
                          Scratch scratch{};
                          const Guard guard(access.dictionary.lock());
                          store_value(at(access, n), entry, part_of(data, bit, entry, scratch));
                      });
}

}  // namespace margay::subdevice
