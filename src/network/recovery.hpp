// Brings one slave back to its wanted state. The necessary steps follow from the state that the slave is in.
#pragma once

#include "network/network.hpp"

namespace margay {

// Reports the change of a slave's state at its end, also when the sequence that changes the state is destroyed.
class ChangeReport {
  public:
    ChangeReport(Network& network, Slave& slave) : network_(network), slave_(slave), before_(slave.al) {}
    ChangeReport(const ChangeReport&) = delete;
    ChangeReport& operator=(const ChangeReport&) = delete;
    ~ChangeReport();

  private:
    Network& network_;
    Slave& slave_;
    AlStatus before_;
};

// Reads a slave that is there now and was not read by the scan. Errors: other_slave, the errors of the SII and its
// registers.
[[nodiscard]] Task<Result<>> read_missing_slave(Network& network, Slave& slave);

// Brings a slave to INIT, clears its earlier configuration, and brings it to PREOP.
[[nodiscard]] Task<Result<>> restart(Network& network, Slave& slave);

// The whole start-up of a slave that answers at its station address, from INIT to SAFEOP: mailboxes, start-up commands,
// the hook, process data. The slave takes part in no cycle meanwhile. A slave whose group is not mapped, or that is not
// wanted in SAFEOP, ends in PREOP. Errors besides the errors of the steps: no_place (the image has no place for the
// slave), pdo_size (its place has another size). See reconfigure_slave().
[[nodiscard]] Task<Result<>> reconfigure(Network& network, Slave& slave);

// Brings a slave that answers at its station address to its goal(), up or down. Acknowledges an error, and executes the
// whole start-up when the slave has lost its configuration or refuses.
[[nodiscard]] Task<Result<>> bring_back(Network& network, Slave& slave);

// Ends a start-up when the target of the slave has become lower: a hook of the start-up must not hold the slave.
void end_work_upwards(Network& network, const Slave& slave);

// Call it when the identity of a slave in doubt could not be compared. True if the slave did not answer, for the first
// time since it was in doubt: then the next reading of its state shows whether it is lost, or it is compared again.
// Until then it keeps its FMMUs, because the replies of one part of a ring may be missing for a moment.
[[nodiscard]] bool is_first_silence(Network& network, const Slave& slave, const Error& error);

// Reports by an event that the state of the slave has changed from `before` to slave.al; NONE: that it is lost.
void note_change(Network& network, Slave& slave, const AlStatus& before);

// Stores `now` as the state of the slave; reports an event when the state has changed.
void note_state(Network& network, Slave& slave, const AlStatus& now);

// A slave that has lost its power, its station address or its own program may have other PDOs: PDOs that the
// application has written by mail are lost, and a spare part may contain other PDOs, or another master may have stored
// other PDOs. The PDOs are read and compared before the slave takes part again.
void doubt_pdos(Network& network, const Slave& slave);

}  // namespace margay
