// A slave in the ring without a known station address: its own address while it is identified, its identity, and which
// slave of the network it is.
#pragma once

#include "network/network.hpp"

namespace margay {

// The station address of the newcomer that is being identified. Each newcomer gets another one: a slave that was
// disconnected as a newcomer and comes back must not be taken for the present one.
[[nodiscard]] StationAddress newcomer_address(const Network& network);

// Whether the slave is lost. A slave that answers at its own station address is not lost: the supervision reads its
// state and readmits it.
[[nodiscard]] bool is_lost(const Network& network, const Slave& slave);

// Whether the guest has the identity that the application expects at the place of the slave.
[[nodiscard]] bool is_the_wanted_one(const Slave& slave, const Slave& guest);

// Changes the station address of the slave at `from`. If two slaves have that address, both become newcomers, and the
// error is working_counter.
[[nodiscard]] Task<Result<>> rename(Network& network, StationAddress from, std::uint16_t to);

// Clears the FMMUs of a slave that is not known: it must not receive the outputs of a slave that is lost, and its
// working counter must not stand for that slave.
[[nodiscard]] Task<Result<>> unmap(Station station);

// Gives newcomer_address() to the slave at place `n` of the ring, counted from 0. The same frame checks that the ring
// is as it was read: the number of slaves, the address of the newcomer and that of the slave above it, which may be the
// first slave of its group; and that no slave has the newcomer's address. Otherwise the slave gets its previous address
// back. Errors: unstable.
[[nodiscard]] Task<Result<>> address_newcomer(Network& network, std::uint16_t n);

// Reads the identity of the newcomer into Network::guest. The whole SII is read only if a lost slave is recognised by
// its device id.
[[nodiscard]] Task<Result<>> read_newcomer(Network& network);

// Whether the identity of the slave is known: the slave was read. A slave with another revision must be read again.
[[nodiscard]] inline bool is_known(const Slave& slave) { return slave.seen || slave.identity != Identity{}; }
// An expected slave that is there, and whose EEPROM could not be read yet: it is held like another slave, and the next
// mapping and the supervision read it again.
[[nodiscard]] inline bool is_unread(const Slave& slave) {
    return slave.ring_position != 0 && slave.wanted != nullptr && !slave.sii_read && !is_known(slave);
}

// The EEPROM of a slave that is there does not answer.
[[nodiscard]] inline bool is_unreadable(const Error& error) {
    return error.code == Errc::sii_nack || error.code == Errc::sii_busy;
}

// What the guest can be, by its identity alone:
// - this slave, or the wanted one in its place;
[[nodiscard]] bool fits_guest(const Network& network, const Slave& slave);
// - the same, and its alias does not contradict, and the guest is not exactly the expected device of another lost
//   slave;
[[nodiscard]] bool guest_may_be(Network& network, const Slave& slave);
// - the device with the serial number or the alias of this slave.
[[nodiscard]] bool is_guest_by_number(const Network& network, const Slave& slave);
// - the device with the serial number of this slave, which was seen before: at any place.
[[nodiscard]] bool is_guest_by_serial(const Network& network, const Slave& slave);

// The result of the identification. `slave`: the newcomer is this slave. `instead_of` alone: the newcomer is no slave
// of the table, and it is at the place of this slave. Both: the newcomer is one of several lost slaves, of these two at
// least, and cannot be identified.
struct Verdict {
    Slave* slave = nullptr;
    Slave* instead_of = nullptr;
    std::array<const Slave*, 2> rivals{};
};

// Identifies the guest at place `n` by the expected slaves: by the alias or device id of a lost slave, or as a member
// of the hot connect group above the place. Neither `slave` nor `instead_of`: nothing is expected.
[[nodiscard]] Verdict identify_as_expected(Network& network, std::uint16_t n);

// The station addresses of unknown slaves, below Network::stranger_address, which is the address of a slave that was
// reported.
namespace stranger_address {
inline constexpr std::uint16_t kSuspect = 0x0100;  // was found once
// The slave is identified as soon as its neighbour is known, or as soon as the other lost slaves are present.
inline constexpr std::uint16_t kUndecided = 0x0300;
}  // namespace stranger_address

// Finds the slave that the newcomer at place `n` is. A ring that changes while it is read shows a slave twice, or in a
// place that the slave has left; and a slave may be readmitted while the newcomer is read. The newcomer is that slave
// if no slave answers at the address of the slave.
[[nodiscard]] Task<Result<Verdict>> verify_newcomer(Network& network, std::uint16_t n);

// Reads alias and identity of the slave that answers at the address of `slave`, and compares them with what is known of
// it. Errors besides the errors of reading: other_slave.
[[nodiscard]] Task<Result<>> compare_identity(Network& network, Slave& slave);

// The first difference between two identities, the revision last; code none if there is none, or if the identity of
// the slave is not known.
[[nodiscard]] Error identity_difference(const Slave& slave, const Identity& there, std::uint16_t alias);

}  // namespace margay
