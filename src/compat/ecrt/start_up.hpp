// The steps of each start-up of a slave between PREOP and SAFEOP, except those for its process data.
#pragma once

#include "compat/ecrt/slave_config.hpp"

#include <margay/hooked_slave.hpp>

namespace margay::compat::ecrt {

// After a scan, for the slave of the configuration. `config` outlives the use of the slave.
void prepare_start_up(const Slave& slave, ec_slave_config& config);

// Whether the lists of the configuration contain all entries of their PDOs. Then neither the scan nor the mapping waits
// for the slave: the supervision starts it together with all other slaves. A slave that does not respond then delays no
// other slave.
[[nodiscard]] bool has_whole_lists(const ec_slave_config& config);

// The downloads of the start-up of such a slave are executed once, by the supervision. hold_downloads() removes them
// until then, and give_downloads() adds them again.
void hold_downloads(ec_slave_config& config);
void give_downloads(ec_slave_config& config);

// Before a mapping: lays out the process data of a slave from the lists of its configuration, so that the mapping
// neither reads nor starts the slave. Returns false if the lists are not sufficient.
[[nodiscard]] bool place_by_lists(const Slave& slave, ec_slave_config& config);
// After all mappings: the supervision may start the slave.
void allow_start(const Slave& slave, ec_slave_config& config);
// Stores the progress of the start-up of the slave. For the owner.
void note_start(const Slave& slave, ec_slave_config& config);

// Sets the IP parameters of a slave with EoE (ip_stack.cpp).
[[nodiscard]] Task<> set_ip(HookedSlave slave, const ec_slave_config& config);

}  // namespace margay::compat::ecrt
