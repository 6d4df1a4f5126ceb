// The messages of the facade on stderr. Not for the cycle, except for messages that are printed once.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include <margay/error.hpp>

namespace margay::compat::ecrt {

class Bus;

// One line, in the manner of printf. Of a line with more than 4095 characters the end is missing, and ... stands there.
[[gnu::format(printf, 1, 2)]] void say(const char* format, ...);

// The error in words of a program for ecrt.h, which has no functions of the library and no numbers of slaves. `place`
// is what the program calls the slave of the error; empty: it has no name for it.
[[nodiscard]] std::string words_of(const Error& error, std::string_view place);

// The words with each "slave N" as the program calls the slave with number N.
[[nodiscard]] std::string with_positions(std::string words, const std::function<std::string(std::uint16_t)>& place_of);

// "MASTER: WHAT: the error in words".
void say_error(Bus& bus, const char* what, const Error& error);

}  // namespace margay::compat::ecrt
