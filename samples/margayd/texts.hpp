// The options of margayd, and the texts that are made from them and from the keys of the configuration.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace margay::service {

struct ProgramOption {
    std::string_view name;
    std::string_view value;  // what the user writes behind it; empty: a flag
    std::string_view text;
};
[[nodiscard]] std::span<const ProgramOption> program_options();

[[nodiscard]] std::string help_text();
// margayd(8), for man(1).
[[nodiscard]] std::string man_page();
// The completion for bash.
[[nodiscard]] std::string bash_completion();

}  // namespace margay::service
