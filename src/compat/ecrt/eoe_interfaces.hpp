// Network interfaces of the kernel (TAP) for slaves with EoE.
#pragma once

namespace margay::compat::ecrt {

class Bus;

// Removes the interfaces of a master that ends. For the owner of the context.
void close_eoe_interfaces(Bus& bus);

}  // namespace margay::compat::ecrt
