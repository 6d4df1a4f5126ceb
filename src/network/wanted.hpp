// What is wanted of each slave, what it may be, and what stands in the way.
#pragma once

#include "network/network.hpp"

namespace margay {

// Takes over what is tolerated: says of each slave whether it is held. To be called when the slaves were compared with
// what is expected, and when the tolerance has changed.
void hold_back(Network& network);

// Why a slave is held; code none when it is not.
[[nodiscard]] Error held_error(const Slave& slave, Step step);

// The error of a slave that is not there; code none when it may be missing, or when nobody wants it.
[[nodiscard]] Error missing_error(Network& network, const Slave& slave);

// The group of the slave is mapped.
[[nodiscard]] bool is_mapped(const Network& network, const Slave& slave);
// What the slave shall exchange, if anything, is in the image.
[[nodiscard]] bool has_place(const Slave& slave);
[[nodiscard]] inline bool exchanges(const Slave& slave) {
    return slave.image.outputs.bits != 0 || slave.image.inputs.bits != 0;
}

// The state that the application wants: its target, and no more than SlaveConfiguration::highest.
[[nodiscard]] AlState wanted_state(const Network& network, const Slave& slave);

// The state that the slave is brought to: the wanted one, but PREOP while its group is not mapped or has no place for
// it, and PREOP or INIT while it is held.
[[nodiscard]] AlState goal(const Network& network, const Slave& slave);

// The slave has no place in the image because nobody could ask it what it exchanges, which may be nothing.
[[nodiscard]] bool is_to_be_asked(const Network& network, const Slave& slave);

// The working counter shall count the slave whether it takes part or not.
[[nodiscard]] bool is_wanted_in_exchange(const Network& network, const Slave& slave);

// Why the slave is not where it is wanted, by what is known of it; code none when all is right.
[[nodiscard]] Error trouble(Network& network, const Slave& slave);

// Why an application's request for this state is refused; code none when it is not: above_highest, other_slave or
// unexpected_slave (it is held), supervised.
[[nodiscard]] Error refusal(const Network& network, const Slave& slave, AlState state);

// The states that a slave can be brought to and kept in.
[[nodiscard]] inline bool can_be_target(AlState state) {
    return state == AlState::init || state == AlState::preop || state == AlState::safeop || state == AlState::op;
}

// Sets the target of one slave, or of all (0), whose own targets end with that.
void set_targets(Network& network, std::uint16_t slave, AlState state);

// Of the faults of many slaves, which come in any order, the one of the slave with the lowest number; of one slave the
// first.
class FirstFault {
  public:
    // Keeps it, in the slave and in errors() too.
    void note(Network& network, Slave& slave, const Error& error) {
        Error named = error;
        named.slave = slave.position;  // a hook need not say so
        network.note(slave, named);
        keep(named);
    }
    void keep(const Error& error) {
        if (error.code != Errc::none && (error_.code == Errc::none || error.slave < error_.slave)) error_ = error;
    }
    [[nodiscard]] const Error& error() const { return error_; }

  private:
    Error error_;
};

}  // namespace margay
