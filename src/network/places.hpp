// Which lost slave of the line a newcomer is. A newcomer that is taken for another slave is driven as the wrong
// machine, which is worse than a machine that stands still. So the rules are, in this order:
//
// 1. One lost slave, known or expected, has the serial number or the alias of the newcomer: the newcomer is this slave.
// 2. Equal slaves are distinguished by the neighbour in the direction of the NIC. Where frames come from the master,
//    the newcomer is the slave that was seen last at this port of the slave above it. Between a break of the ring and
//    the second NIC the neighbour is the slave below it: the newcomer is the slave that was above that slave, or that
//    was at the second NIC.
// 3. As many newcomers as lost slaves are between the same two known slaves: all are there, in the order of their
//    numbers. Where rule 2 says something else, the other newcomers are asked first: not all of them may belong there.
// 4. Several lost slaves were at this neighbour, because one of them was bridged while the others went on, and not all
//    of them are there: it is not known which of them the newcomer is. The same holds where no slave was seen last at
//    this neighbour, and where config_init() would take the newcomer for an equal slave with a lower number that was
//    never there.
// 5. A newcomer that one lost slave alone can be is that slave. Of equal slaves that were never there it is the first.
//
// A newcomer beside an unknown slave, in the direction of the NIC, is not identified before that slave is.
#pragma once

#include "network/newcomer.hpp"

namespace margay {

// Remembers for each slave of the ring where it is. Call it when the ring was read without an error and its slaves are
// known.
void remember_places(Network& network);

// Whether the slave was seen last at the place `n` of the ring, counted from 0.
[[nodiscard]] bool was_at_place(Network& network, std::size_t n, const Slave& slave);

// Whether all slaves above the place `n` of the ring, counted from 0, are known; between a break and the second NIC,
// the slave below it. If not, the place does not say which slave is there.
[[nodiscard]] bool neighbour_is_known(const Network& network, std::size_t n);

// Applies the rules to Network::guest at the place `n` of the ring, counted from 0.
[[nodiscard]] Verdict choose_by_place(Network& network, std::size_t n);

}  // namespace margay
