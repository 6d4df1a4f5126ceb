// What process data a slave exchanges: whose word counts.
#pragma once

#include "network/network.hpp"

namespace margay {

// Makes the slave's PDOs what `slave.config.pdos` wants, then fills `slave.config.sms`, unless the application has said
// them: by the lists, else by the object dictionary, else by the SII. That sources differ is told in warnings(), once,
// and is no failure. Errors: the lists cannot be, the slave does not take them, or it cannot be asked; then it has no
// process data.
[[nodiscard]] Task<Result<>> discover_pdos(Network& network, Slave& slave);

// The first part of it, for a slave in PREOP that comes back.
[[nodiscard]] Task<Result<>> write_pdos(Network& network, Slave& slave);

// How long the slave may take to answer mail at its start-up.
[[nodiscard]] MailPatience startup_patience(const Slave& slave);

}  // namespace margay
