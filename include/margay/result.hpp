// Result<T>: a value or an Error, for code without exceptions.
#pragma once

#include <margay/error.hpp>

#include <type_traits>
#include <utility>

namespace margay {

struct Nothing {};  // the value of a Result that only says success or error

template <class T = Nothing>
class [[nodiscard]] Result {
  public:
    static_assert(std::is_default_constructible_v<T>);

    constexpr Result() = default;  // success with a default value
    constexpr Result(T value) : value_(std::move(value)) {}
    constexpr Result(const Error& error) : error_(error) {}
    using Value = T;

    [[nodiscard]] constexpr bool ok() const { return error_.code == Errc::none; }
    [[nodiscard]] constexpr explicit operator bool() const { return ok(); }

    // The value; valid only if ok().
    [[nodiscard]] constexpr T& operator*() { return value_; }
    [[nodiscard]] constexpr const T& operator*() const { return value_; }
    [[nodiscard]] constexpr T* operator->() { return &value_; }
    [[nodiscard]] constexpr const T* operator->() const { return &value_; }

    // The error; its code is Errc::none if ok().
    [[nodiscard]] constexpr const Error& error() const { return error_; }

  private:
    Error error_{};
    [[no_unique_address]] T value_{};  // Nothing takes no memory
};

}  // namespace margay
