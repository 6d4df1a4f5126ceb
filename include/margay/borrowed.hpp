// A list in the memory of the caller.
#pragma once

#include <margay/detail/ranges.hpp>

#include <concepts>
#include <cstddef>
#include <initializer_list>
#include <span>
#include <type_traits>

namespace margay {

// Points to a list in the caller's memory: a constant array, a std::array, a std::vector. The list must live as long as
// the library may use it; the comment at each use says how long that is. The compiler refuses a temporary list, also
// one in braces: {{…}}.
template <class T>
class Borrowed : public std::span<const T> {
  public:
    using Base = std::span<const T>;

    constexpr Borrowed() = default;
    constexpr Borrowed(Base list) : Base(list) {}
    template <std::size_t N>
    constexpr Borrowed(const T (&list)[N]) : Base(list) {}
    template <std::size_t N>
    constexpr Borrowed(const T (&&list)[N]) = delete;  // the list would end with the statement
    // For a list in braces, GCC selects the constructor of an array that stays, although the deleted one above is the
    // better match. So this one is deleted too.
    constexpr Borrowed(std::initializer_list<T>) = delete;
    constexpr Borrowed(const T* first, std::size_t count) : Base(first, count) {}
    template <std::ranges::contiguous_range R>
    requires(std::ranges::borrowed_range<R>&& std::convertible_to<R, Base>) constexpr Borrowed(R&& list) : Base(list) {}
    template <std::ranges::contiguous_range R>
    requires(!std::ranges::borrowed_range<R>) constexpr Borrowed(R&& list) = delete;  // the same
};

// A borrowed list that names the part of the library which works with such lists. The linker leaves out a part that no
// list of the program names.
template <class T, class Part, const Part* kPart>
class ListWithPart : public Borrowed<T> {
  public:
    constexpr ListWithPart() : part_(nullptr) {}
    using Borrowed<T>::Borrowed;
    // nullptr: there was never a list.
    [[nodiscard]] constexpr const Part* part() const { return part_; }

  private:
    const Part* part_ = kPart;
};

}  // namespace margay

template <class T>
inline constexpr bool std::ranges::enable_borrowed_range<margay::Borrowed<T>> = true;
template <class T>
inline constexpr bool std::ranges::enable_view<margay::Borrowed<T>> = true;
template <class T, class Part, const Part* kPart>
inline constexpr bool std::ranges::enable_borrowed_range<margay::ListWithPart<T, Part, kPart>> = true;
template <class T, class Part, const Part* kPart>
inline constexpr bool std::ranges::enable_view<margay::ListWithPart<T, Part, kPart>> = true;
