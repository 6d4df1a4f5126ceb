// The values of a device as a struct. The tables name its members; their offsets follow from the struct at compile
// time:
//
//     struct Values {
//         Le<std::uint16_t> lamps;
//         std::array<Le<std::int16_t>, 3> currents;
//         std::uint8_t limit;
//         std::array<char, 20> label;
//     };
//     value<&Values::lamps>(0, "Lamps", od::kReadWrite), value<&Values::currents>(1, "Current", od::kReadOnly) …
//     values.lamps = 5;  if (values.currents[2] > values.limit) …
//
// A struct may be a member, also in an array. Then the name of a value has the members and the places in arrays that
// lead to it:
//
//     struct Axis { Le<std::int32_t> target; Le<std::int32_t> actual; };
//     struct Values { std::array<Axis, 2> axes; };
//     value<&Values::axes, 1, &Axis::target>(0, "Target of the second axis", …)
//
// The octets of the struct are the image of the dictionary, image_of(values). The image has the octet order of the wire
// on every processor, so a number of more than one octet is a Le.
#pragma once

#include "util/bytes.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <type_traits>

namespace margay::subdevice {

// A number in the octet order of the wire (little-endian). It needs no alignment, so a struct of such numbers has no
// gaps.
template <std::integral T>
class Le {
  public:
    constexpr Le() = default;
    constexpr Le(T value) { store_le<T>(octets_, 0, value); }
    constexpr operator T() const { return load_le<T>(octets_); }

  private:
    std::array<std::byte, sizeof(T)> octets_{};
};

// The offset of a member in its struct. All members must be numbers, Le, or arrays and structs of them: without
// pointers, references and bool. The struct has no base class: the offset of a member of a base is that in the base.
template <class Struct, class Member>
[[nodiscard]] consteval std::size_t offset_of(Member Struct::*member) {
    static_assert(std::is_trivially_copyable_v<Struct> && sizeof(Struct) <= 0x10000);
    std::size_t offset = 0;
    // Each octet of the struct has the number of its place: first the low octet of the number, then the high one.
    for (const unsigned shift : {0U, 8U}) {
        std::array<unsigned char, sizeof(Struct)> places{};
        for (std::size_t n = 0; n < places.size(); ++n) places[n] = static_cast<unsigned char>(n >> shift);
        const auto marked = std::bit_cast<Struct>(places);
        const auto octets = std::bit_cast<std::array<unsigned char, sizeof(Member)>>(marked.*member);
        offset |= std::size_t{octets[0]} << shift;
    }
    return offset;
}

namespace members {
// The number behind a member, and how many of them follow each other.
template <class Member>
struct Number {
    static_assert(!std::is_same_v<Member, bool>, "a flag is a std::uint8_t: the master may write any octet");
    static_assert(sizeof(Member) == 1 && std::is_integral_v<Member>,
                  "a number of more than one octet is a Le: the image has the octet order of the wire");
    using Type = Member;
    static constexpr std::size_t count = 1;
};
template <class T>
struct Number<Le<T>> {
    using Type = T;
    static constexpr std::size_t count = 1;
};
template <class Element, std::size_t N>
struct Number<std::array<Element, N>> {
    using Type = typename Number<Element>::Type;
    static constexpr std::size_t count = N * Number<Element>::count;
};

template <class Struct, class Member>
Member member_of(Member Struct::*);
template <class Struct, class Member>
Struct struct_of(Member Struct::*);

// The result of the steps of a path in a T: the type of the member, and its offset in the T.
template <class T, auto... Path>
struct Inside {
    using Type = T;
    static constexpr std::size_t offset = 0;
};
template <class T, auto Step, auto... Path>
struct Inside<T, Step, Path...> {  // an element of an array
    static_assert(static_cast<std::size_t>(Step) < std::tuple_size_v<T>, "the array has no such element");
    using Rest = Inside<typename T::value_type, Path...>;
    using Type = typename Rest::Type;
    static constexpr std::size_t offset = Step * sizeof(typename T::value_type) + Rest::offset;
};
template <class T, auto Step, auto... Path>
requires std::is_member_object_pointer_v<decltype(Step)>
struct Inside<T, Step, Path...> {
    static_assert(std::is_same_v<T, decltype(struct_of(Step))>, "the member belongs to another struct");
    using Rest = Inside<decltype(member_of(Step)), Path...>;
    using Type = typename Rest::Type;
    static constexpr std::size_t offset = offset_of(Step) + Rest::offset;
};

template <auto... Path>
struct Place;
template <auto Member, auto... Path>
struct Place<Member, Path...> {
    using Reached = Inside<decltype(struct_of(Member)), Member, Path...>;
    using Type = typename Reached::Type;
    static constexpr std::size_t offset = Reached::offset;
};
}  // namespace members

template <class Struct>
[[nodiscard]] MutableBytes image_of(Struct& values) {
    static_assert(std::is_trivially_copyable_v<Struct>);
    return std::as_writable_bytes(std::span(&values, 1));
}

// Copies a struct of values, for example of a module (Modules::values()), from the octets of an image or into them.
template <class Struct>
[[nodiscard]] Struct values_in(Bytes octets) {
    Struct values{};
    std::ranges::copy(octets.first(sizeof(Struct)), image_of(values).begin());
    return values;
}
template <class Struct>
void store_values(MutableBytes octets, Struct values) {
    std::ranges::copy(image_of(values), octets.begin());
}

// The type of a member, and the Field of the number in it, or of the first one.
template <auto... Path>
using MemberType = typename members::Place<Path...>::Type;
template <auto... Path>
using MemberField = Field<typename members::Number<MemberType<Path...>>::Type, members::Place<Path...>::offset>;

}  // namespace margay::subdevice
