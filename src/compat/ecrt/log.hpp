// What the facade says on stderr. Not for the cycle, except where a thing is said once.
#pragma once

#include <string>

#include <margay/error.hpp>

namespace margay::compat::ecrt {

// One line, in the manner of printf.
[[gnu::format(printf, 1, 2)]] void say(const char* format, ...);

// The error in words, without the names of functions of the library, which a program for ecrt.h does not have.
[[nodiscard]] std::string words_of(const Error& error);

// "MASTER: WHAT: the error in words".
void say_error(unsigned master, const char* what, const Error& error);

}  // namespace margay::compat::ecrt
