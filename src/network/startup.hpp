// The start-up commands of a slave (SlaveSetup::startup).
#pragma once

#include "network/network.hpp"

namespace margay {

// Executes the commands in their order. Stops at the first failure of a command that must not fail; its error contains
// the transition (step), the place in the list, and the object or register. Other failures are reported in errors().
[[nodiscard]] Task<Result<>> run_commands(Network& network, Slave& slave, Transition which, Moment moment);

struct detail::StartupPart {
    // Whether there are commands for this moment of the transition.
    bool (*has)(std::span<const StartupCommand> commands, Transition which, Moment moment);
    // The error of the first command that no slave can execute: invalid_argument (actual: the Argument), named as by
    // run_commands(). Commands that may fail are left out: run_commands() reports their errors.
    Error (*invalid)(const Slave& slave);
    Task<Result<>> (*run)(Network& network, Slave& slave, Transition which, Moment moment);
    // A check value of the commands of the transition IP and of the data that they write.
    std::uint32_t (*check)(std::span<const StartupCommand> commands);
};

[[nodiscard]] inline bool has_commands(const Slave& slave, Transition which, Moment moment) {
    const auto commands = slave.config.startup();
    return !commands.empty() && slave.config.setup->startup.part()->has(commands, which, moment);
}

// This value changes when the slave has other commands of the transition IP; 0: the slave has no list.
[[nodiscard]] inline std::uint32_t check_of_ip_commands(const Slave& slave) {
    const auto commands = slave.config.startup();
    return commands.empty() ? 0 : slave.config.setup->startup.part()->check(commands);
}

}  // namespace margay
