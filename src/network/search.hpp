// Finds lost slaves that are back without their station address: by their place in the ring and their identity.
#pragma once

#include "network/network.hpp"

namespace margay {

// Reads the whole ring: the slave and the neighbours of each place. Then identifies the newcomers. A newcomer gets a
// station address of its own, its identity is read, and it is taken as one of these slaves, if vendor and product equal
// that slave and its entry in the list of expect() (a slave with another revision is read again):
// - the lost slave with the alias or device id that is set on the newcomer, at any place;
// - in a hot connect group: the next lost member of the group, or another lost member that it can be;
// - a lost slave of the line whose number is between those of the slaves of the line before it and behind it in the
//   ring. Below a slave that is not known there is no slave of the line. See places.hpp for equal slaves.
//
// A newcomer that is taken as a slave gets the station address of that slave, and is reported as found. All others are
// reported once, as other_slave or as stranger, and not used. Returns the number of slaves found. Only one search
// executes at a time. Errors: unstable (the ring has changed meanwhile).
[[nodiscard]] Task<Result<std::uint16_t>> find_lost(Network& network);

// When the states of all slaves are read again, even if the roll (`al_status`) does not change; `begun`: when they were
// read.
[[nodiscard]] Time next_look(Network& network, const SuperviseRequest& wanted, Time begun, unsigned al_status);

// A slave does not answer any more: reports it, and removes it from the cycle.
void note_lost(Network& network, Slave& slave);

// Keeps a reading of the AL status that a request has made. While the segment is supervised, changes are reported by
// events, a slave that answers again is left to the supervision, and so is a slave that the supervision works on.
// `own`: the request that works on the slave has read.
void note_reading(Network& network, Slave& slave, const Result<AlStatus>& seen, bool own = false);

// Reads the AL status of a slave that a request is for. While the segment is supervised, a lost slave stays lost: the
// supervision readmits it.
[[nodiscard]] Task<Result<AlStatus>> read_anew(Network& network, Slave& slave);

// Compares the identity of the slave that answers at the address of `slave` with the known identity. For a member of a
// hot connect group that was away, also checks that it is behind the first slave of its group. If another slave
// answers, it loses its FMMUs and its station address, so that find_lost() identifies it, and `slave` is lost. Errors:
// other_slave, the errors of reading the SII.
[[nodiscard]] Task<Result<>> prove(Network& network, Slave& slave);

// The same as prove() before a request of the application changes the state of the slave, where the identity is not
// certain. The identity of a slave in BOOT is not read, because its firmware may use the EEPROM.
[[nodiscard]] Task<Result<>> prove_before_request(Network& network, Slave& slave, AlState wanted);

// A lost slave, whose token is free, answers at its station address: checks whether it is the same slave. If so, the
// slave is reported as found, and it takes part in the cycle again if it has kept its FMMUs; see prove().
[[nodiscard]] Task<Result<>> readmit_slave(Network& network, Slave& slave, AlStatus now);
// The same for a slave that may be lost and may answer.
[[nodiscard]] Task<Result<>> readmit_if_there(Network& network, Slave& slave);

}  // namespace margay
