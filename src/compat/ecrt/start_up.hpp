// What each start-up of a slave does between PREOP and SAFEOP, beside its process data.
#pragma once

#include "compat/ecrt/slave_config.hpp"

#include <margay/hooked_slave.hpp>

namespace margay::compat::ecrt {

// After a scan, for the slave of the configuration. `config` outlives the use of the slave.
void prepare_start_up(const Slave& slave, ec_slave_config& config);

// Sets the IP parameters of a slave with EoE (ip_stack.cpp).
[[nodiscard]] Task<> set_ip(HookedSlave slave, const ec_slave_config& config);

}  // namespace margay::compat::ecrt
