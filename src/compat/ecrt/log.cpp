#include "compat/ecrt/log.hpp"

#include <array>
#include <cstdarg>
#include <cstdio>

namespace margay::compat::ecrt {

void say(const char* format, ...) {
    std::array<char, 512> line{};
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(line.data(), line.size(), format, arguments);
    va_end(arguments);
    std::fprintf(stderr, "margay ecrt: %s\n", line.data());
}

void say_error(unsigned master, const char* what, const Error& error) {
    std::array<char, 256> text{};
    const auto words = describe(error, text);
    say("master %u: %s: %.*s", master, what, static_cast<int>(words.size()), words.data());
}

}  // namespace margay::compat::ecrt
