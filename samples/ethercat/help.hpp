// The texts that are made from the table of commands.
#pragma once

#include "ethercat/table.hpp"

#include <string>

namespace margay::ethercat {

// --help of the program, or of a command.
[[nodiscard]] std::string help_text(const Command* command);
// The manual page, for man(1).
[[nodiscard]] std::string man_page();
// The completion for bash.
[[nodiscard]] std::string bash_completion();

}  // namespace margay::ethercat
