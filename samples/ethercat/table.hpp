// The commands of `ethercat`, with their arguments and options. The accepted arguments, --help, the man page and the
// completion are derived from this table.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

namespace margay::ethercat {

class Call;

struct Option {
    char letter = 0;  // 0: the option has no short form
    std::string_view name;
    std::string_view value;  // what the user writes behind it, for --help; empty: a flag
    std::string_view text;
    std::string_view words{};  // the values that the completion offers; "FILE": files; "SOURCE": sources
    bool common = false;       // of all commands
};

struct Argument {
    std::string_view name;
    std::string_view text;
    std::string_view words{};  // as Option::words
};

struct Command {
    std::string_view name;
    std::string_view summary;                 // one sentence
    std::vector<std::string_view> forms{""};  // the arguments of each form of the call
    std::vector<std::string_view> text{};     // paragraphs; one that begins with spaces is printed as it is
    std::vector<Argument> arguments{};
    std::vector<std::string_view> options{};  // names of options that are not common
    std::size_t least = 0;                    // number of arguments
    std::size_t most = 0;
    int (*run)(Call& call) = nullptr;
    bool without_master = false;  // the command needs no source
    // Whether the command has the option. A command for a file has no options that concern a segment.
    [[nodiscard]] bool has_option(const Option& option) const;
};

[[nodiscard]] std::span<const Command> commands();
[[nodiscard]] std::span<const Option> options();
// nullptr: there is none.
[[nodiscard]] const Command* find_command(std::string_view name);
[[nodiscard]] const Option* find_option(std::string_view name);

}  // namespace margay::ethercat
