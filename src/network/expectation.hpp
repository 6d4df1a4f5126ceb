// Comparison of the slaves found with the slaves expected.
#pragma once

#include "network/wanted.hpp"

#include <margay/expected.hpp>

namespace margay {

struct Verdict;

// What a scan and a search need when slaves are expected.
struct Expectation {
    Result<bool> (*number)(Network& network);
    void (*compare)(Network& network, FirstFault& faults);
    Task<Result<>> (*read_id)(Network& network, Slave& slave);
    Task<Result<>> (*compare_group)(Network& network, const Slave& slave);
    Verdict (*identify)(Network& network, std::uint16_t n);
};
extern const Expectation kExpectation;

// Errors: invalid_argument; actual: the number of the list entry, 1 is the first.
[[nodiscard]] Result<> check_expected(std::span<const ExpectedSlave> expected);

// Gives each slave found its number by the rules of <margay/expected.hpp>, and each missing expected slave an entry.
// Before the call the table and network.ring are in the order of the ring, with their topology. Returns whether the
// station address of any slave has changed. Errors: capacity.
[[nodiscard]] Result<bool> number_slaves(Network& network);

// Gives each slave the configuration of its expected slave and notes the differences: other_slave, unsupported (the
// slave has no readable device id), missing_slave (a slave that must not be missing) and, when slaves are expected at
// all, unexpected_slave. A slave that is not the expected one, and not tolerated, is held.
void compare_with_expected(Network& network, FirstFault& faults);

// The first difference between the slave and the expected one; code none when there is none.
[[nodiscard]] Error difference(const Slave& slave, const ExpectedSlave& wanted);

// Whether `wanted`, an element of `list`, may be at any place of the ring: the first slave of a group, or a slave that
// is known by its alias or device id.
[[nodiscard]] bool is_located(std::span<const ExpectedSlave> list, const ExpectedSlave& wanted);
// Whether the slave may be absent: the list says so, or its configuration, which the application may have set anew
// since the scan. A member of a hot connect group may be absent with the first slave of the group.
[[nodiscard]] inline bool is_optional(const Slave& slave) {
    return slave.config.optional ||
           (slave.wanted != nullptr && (slave.wanted->optional || slave.wanted->hot_connect != 0));
}
// Whether the slave has the alias or device id that `wanted` is recognised by.
[[nodiscard]] bool locates(const ExpectedSlave& wanted, const Slave& slave);

// The hot connect group that the slave at a place of the ring belongs to, found through its parents; 0: none.
[[nodiscard]] std::uint8_t group_above(Network& network, std::uint16_t place);

// Checks whether a slave that was away is still in its hot connect group. The slave keeps its station address as long
// as it has power, and may have been connected behind the first slave of another group meanwhile. Errors besides the
// errors of reading the ring: other_slave, unstable.
[[nodiscard]] Task<Result<>> compare_group(Network& network, const Slave& slave);

}  // namespace margay
