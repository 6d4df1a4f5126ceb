// The messages of the facade on stderr. Not for the cycle, except for messages that are printed once.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include <margay/error.hpp>

namespace margay::compat::ecrt {

class Bus;

// Prints one line; the format is that of printf(). A line of more than 4095 characters is cut and ends with "...".
[[gnu::format(printf, 1, 2)]] void say(const char* format, ...);

// The text of the error for a program for ecrt.h, which does not know the functions of the library and the numbers of
// slaves. `place` names the slave of the error for the program; empty: it has no name.
[[nodiscard]] std::string words_of(const Error& error, std::string_view place);

// Replaces each "slave N" in the text by the name that the program has for the slave with number N.
[[nodiscard]] std::string with_positions(std::string words, const std::function<std::string(std::uint16_t)>& place_of);

// Prints "MASTER: WHAT: text of the error".
void say_error(Bus& bus, const char* what, const Error& error);

}  // namespace margay::compat::ecrt
