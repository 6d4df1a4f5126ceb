// Checks of what the application has set: values that no slave and no image can have.
#pragma once

#include "network/network.hpp"

namespace margay {

inline constexpr std::uint16_t kDividerFor100us = 2498;

// The unit in which an ESC counts the times of its watchdogs.
[[nodiscard]] Duration watchdog_unit(const SlaveTimes& times);

// The error of config_map() for a setting; slave 0: of the group.
[[nodiscard]] Error invalid_mapping(Argument argument, std::uint16_t slave = 0);

// The values that SlaveConfiguration::highest may have.
[[nodiscard]] inline bool is_highest(AlState state) {
    return state == AlState::preop || state == AlState::safeop || state == AlState::op;
}
[[nodiscard]] inline Error invalid_highest(const Slave& slave) {
    return invalid_mapping(Argument::highest, slave.number);
}

// Errors of `slave.config`: invalid_argument (detail: the Argument), and the errors of the start-up commands.
[[nodiscard]] Error invalid_setting(const Slave& slave);

// Errors of GroupConfiguration before the image is laid out: invalid_argument (detail: the Argument).
[[nodiscard]] Error invalid_setting(const Network& network, const ProcessGroup& group);

}  // namespace margay
