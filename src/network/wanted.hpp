// What is wanted of each slave (target state, exchange of process data), what the slave may do, and what prevents it.
#pragma once

#include "network/network.hpp"

namespace margay {

// Applies the tolerance: sets for each slave whether it is held. Call it after the comparison with the expected slaves,
// and when the tolerance has changed.
void update_held(Network& network);

// The reason why a slave is held; code none when it is not.
[[nodiscard]] Error held_error(const Slave& slave, Step step);

// See margay/missing.hpp.
[[nodiscard]] bool may_be_missing(const Network& network, const Slave& slave);
// The error of a slave that is missing; code none when it may be missing, or when it is not wanted.
[[nodiscard]] Error missing_error(Network& network, const Slave& slave);

// Whether the group of the slave is mapped.
[[nodiscard]] bool is_mapped(const Network& network, const Slave& slave);
// Whether config_map() is executing for the group of the slave, or for the group that it is to belong to.
[[nodiscard]] bool is_being_mapped(const Network& network, const Slave& slave);
// Whether all process data of the slave has a place in the image.
[[nodiscard]] bool has_place(const Slave& slave);
// Whether the configuration of the slave was changed since the mapping, or its PDOs by an SDO of the application.
[[nodiscard]] bool needs_mapping(const Network& network, const Slave& slave);
// Whether the slave takes part, or can. True while its process data is being found, or while a hook is executing,
// because both may change the configuration.
[[nodiscard]] bool may_be_exchanged(const Network& network, const Slave& slave);
[[nodiscard]] inline bool exchanges(const Slave& slave) {
    return slave.image.outputs.bits != 0 || slave.image.inputs.bits != 0;
}

// The state that the application wants: the target of the slave, at most SlaveConfiguration::highest.
[[nodiscard]] AlState wanted_state(const Network& network, const Slave& slave);

// The state that the library brings the slave to: the wanted state, but PREOP while its group is not mapped or has no
// place for it or has another place than its configuration, and PREOP or INIT while it is held.
[[nodiscard]] AlState goal(const Network& network, const Slave& slave);

// Whether the slave has no place in the image because its process data could not be read. The slave may have no process
// data.
[[nodiscard]] bool is_to_be_asked(const Network& network, const Slave& slave);

// The slave is in BOOT, where it may receive other firmware: its identity is compared when it is in PREOP again, and
// its PDOs are read again.
void note_boot(Network& network, const Slave& slave);

// Whether the expected working counter includes the slave, even if it does not take part.
[[nodiscard]] bool is_wanted_in_exchange(const Network& network, const Slave& slave);

// The reason why the slave is not in its wanted state, as far as known; code none when it is.
[[nodiscard]] Error state_error(Network& network, const Slave& slave);

// The reason why the slave must not be brought to SAFEOP or OP now: the error of its hook, of its PDOs, or of the
// commands and the hook after its last transition; code none when there is none.
[[nodiscard]] Error start_up_refusal(const Network& network, const Slave& slave);

// The reason why this state cannot be the target of the slave: above_highest, other_slave or unexpected_slave (the
// slave is held), unsupported (BOOT, and the slave has no bootstrap mailboxes); code none when it can.
[[nodiscard]] Error target_refusal(const Network& network, const Slave& slave, AlState state);

// The reason why an application's request for this state is refused; code none when it is allowed: that of
// target_refusal(), that of start_up_refusal(), supervised.
[[nodiscard]] Error refusal(const Network& network, const Slave& slave, AlState state);
// The part of refusal() that does not depend on the present state: supervised, because the supervision keeps the slave
// in another state.
[[nodiscard]] Error contradiction(const Network& network, const Slave& slave, AlState state);

// The states that can be the target of a slave.
[[nodiscard]] inline bool can_be_target(AlState state) {
    return state == AlState::init || state == AlState::preop || state == AlState::safeop || state == AlState::op;
}

// The target of all slaves, also if the supervision has not read its request yet.
[[nodiscard]] AlState target_of_all(const Network& network);

// Sets the target of all slaves that have none of their own. It replaces the present SuperviseRequest::target.
void set_target_of_all(Network& network, AlState state);

// Sets the target of one slave, or of all (0). With 0 the own targets of all slaves are removed. `of_all`: the target
// of all slaves, see target_of_all().
void set_targets(Network& network, std::uint16_t slave, AlState state, AlState of_all);

// Keeps the error of the slave with the lowest number, for errors of many slaves in any order; for one slave the first.
class FirstFault {
  public:
    // Keeps the error, and notes it in the slave and in errors().
    void note(Network& network, Slave& slave, const Error& error) {
        Error named = error;
        named.slave = slave.number;  // a hook need not fill it in
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
