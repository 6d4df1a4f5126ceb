// What was found against what was expected.
#pragma once

#include "network/wanted.hpp"

#include <margay/expected.hpp>

namespace margay {

// Errors: invalid_argument; actual: which of the list, 1 the first.
[[nodiscard]] Result<> check_expected(std::span<const ExpectedSlave> expected);

// Gives each slave found its number, as <margay/expected.hpp> tells, and each expected one that is not there an entry.
// Before, the table and network.ring are in the order of the ring, with their topology. Says whether any has another
// number now. Errors: capacity.
[[nodiscard]] Result<bool> number_slaves(Network& network);

// Gives each slave the configuration that is wanted in its place and notes what is wrong: other_slave, unsupported (the
// slave tells no device id), missing_slave (of a slave that may not be missing) and, when anything is expected at all,
// unexpected_slave. A slave that is not the wanted one, and not tolerated, is held.
void compare_with_expected(Network& network, FirstFault& faults);

// The first thing about the slave that is not as expected; code none when all is.
[[nodiscard]] Error difference(const Slave& slave, const ExpectedSlave& wanted);

// `wanted`, of `list`, may be anywhere: the head of a group, or one for itself.
[[nodiscard]] bool is_located(std::span<const ExpectedSlave> list, const ExpectedSlave& wanted);
// What is set on this slave is what `wanted` is known by.
[[nodiscard]] bool locates(const ExpectedSlave& wanted, const Slave& slave);

// The hot connect group that the slave at a place of the ring hangs in, by those above it; 0: none.
[[nodiscard]] std::uint8_t group_above(Network& network, std::uint16_t place);

}  // namespace margay
