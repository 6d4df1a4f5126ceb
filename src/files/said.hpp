// The sentence of an error, for messages of the readers and writers of files.
#pragma once

#include <margay/error.hpp>

#include <array>
#include <string>

namespace margay::files {

[[nodiscard]] inline std::string said(const Error& error) {
    std::array<char, 256> text{};
    return std::string(describe(error, text));
}

}  // namespace margay::files
