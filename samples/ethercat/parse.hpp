// Reads the arguments of a call of `ethercat` by the table of commands.
#pragma once

#include "ethercat/selection.hpp"
#include "ethercat/table.hpp"

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace margay::ethercat {

// The arguments that the user has written.
struct Arguments {
    const Command* command = nullptr;  // nullptr: none, and `options` has help, version, man or completion
    std::vector<std::string> words{};  // the arguments of the command
    std::vector<std::pair<std::string, std::string>> options{};  // by their long names

    [[nodiscard]] bool has(std::string_view option) const;
    // The last value; empty: the option is not given.
    [[nodiscard]] std::string value(std::string_view option) const;
    [[nodiscard]] std::vector<std::string> values(std::string_view option) const;
};

// A problem has exit code 2. Options may stand everywhere; names of commands and long options may be shortened as long
// as they are unambiguous; "-5" is a number, and words after "--" are not options.
[[nodiscard]] Answer<Arguments> parse(const std::vector<std::string>& words);

}  // namespace margay::ethercat
