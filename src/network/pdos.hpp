// What process data a slave exchanges: whose word counts.
#pragma once

#include "mailbox/found_sms.hpp"
#include "network/network.hpp"

namespace margay {

// Makes the slave's PDOs what `slave.config.pdos` wants, then fills `slave.config.sms`, unless the application has said
// them: by the lists, else by the object dictionary, else by the SII. That sources differ is told in errors(), once,
// and is no failure. A slave that refuses to tell is known by its SII. Errors: the lists cannot be, the slave does not
// take them, or it cannot be asked although its SII says that it can; then nothing is known of its process data.
// Entries that the application wants (GroupConfiguration::entries) are matched meanwhile.
[[nodiscard]] Task<Result<>> discover_pdos(Network& network, Slave& slave);

// Walks over the entries of a slave as discover_pdos() does, and changes nothing. `entries` outlives the task.
[[nodiscard]] Task<Result<>> find_entries(Network& network, Slave& slave, EntrySink& entries);

// The first part of discover_pdos(), for a slave in PREOP that comes back.
[[nodiscard]] Task<Result<>> write_pdos(Network& network, Slave& slave);

// How long the slave may take to answer mail at its start-up.
[[nodiscard]] MailPatience startup_patience(const Slave& slave);

}  // namespace margay
