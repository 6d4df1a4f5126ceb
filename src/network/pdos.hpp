// Finds the process data that a slave exchanges, from the source that has precedence.
#pragma once

#include "mailbox/found_sms.hpp"
#include "network/network.hpp"

namespace margay {

class EntryMatcher;

// Configures the slave's PDOs as `slave.config.pdos` wants, then fills `slave.config.sms`, unless the application has
// set them: from the lists, otherwise from the object dictionary or the drives, otherwise from the SII. When sources
// differ, this is reported in warnings() once, and is no failure. For a slave that refuses to answer the SII is used.
// Errors: the lists are contradictory, the slave refuses them, or it does not answer although its SII says that it can;
// then its process data is unknown. pdo_unknown: an assigned PDO that the slave does not describe. If the SII contains
// the size, the error is only noted, and the size of the SII is used. Entries that the application wants
// (GroupConfiguration::entries) are matched meanwhile.
[[nodiscard]] Task<Result<>> discover_pdos(Network& network, Slave& slave);

// Passes the entries of a slave to `entries`, found as by discover_pdos(), without changing anything. `entries`
// outlives the task.
[[nodiscard]] Task<Result<>> find_entries(Network& network, Slave& slave, EntryMatcher& entries);

// The first part of discover_pdos(), for a slave in PREOP that comes back.
[[nodiscard]] Task<Result<>> write_pdos(Network& network, Slave& slave);

// How long to wait for replies to mail during the start-up of the slave.
[[nodiscard]] MailPatience startup_patience(const Slave& slave);

}  // namespace margay
