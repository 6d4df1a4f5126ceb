// What each start-up of a slave does between PREOP and SAFEOP, beside its process data.
#pragma once

#include "compat/ecrt/slave_config.hpp"

#include <margay/hooked_slave.hpp>

namespace margay::compat::ecrt {

// After a scan, for the slave of the configuration. `config` outlives the use of the slave.
void prepare_start_up(const Slave& slave, ec_slave_config& config);

// Whether the lists of the configuration tell all entries of the process data that they name. Then neither the scan nor
// the mapping waits for the slave: the supervision starts it, beside all others. A slave that does not answer delays no
// other one.
[[nodiscard]] bool has_whole_lists(const ec_slave_config& config);

// The downloads of the start-up of such a slave are executed once, by the supervision: until then they are held back.
void hold_downloads(ec_slave_config& config);
void give_downloads(ec_slave_config& config);

// Before a mapping: places the process data of a slave by the lists of its configuration, so that the mapping neither
// asks nor starts the slave. Returns false if its lists do not tell enough.
[[nodiscard]] bool place_by_lists(const Slave& slave, ec_slave_config& config);
// After all mappings: the supervision may start the slave.
void allow_start(const Slave& slave, ec_slave_config& config);
// Notes what the slave has reached. For the owner.
void note_start(const Slave& slave, ec_slave_config& config);

// Sets the IP parameters of a slave with EoE (ip_stack.cpp).
[[nodiscard]] Task<> set_ip(HookedSlave slave, const ec_slave_config& config);

}  // namespace margay::compat::ecrt
