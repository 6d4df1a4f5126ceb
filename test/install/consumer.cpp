// The program of another project that uses the installed package: a master and a segment of one slave with a blank
// EEPROM.
#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <osal/virtual/virtual_osal.hpp>
#include <oshw/simulated/simulated_nic.hpp>

int main() {
    margay::VirtualOsal osal;
    margay::sim::Segment segment;
    const auto slave = segment.add(
        std::make_unique<margay::sim::Esc>(margay::sim::et1100(), std::vector<std::byte>(2048, std::byte{0xFF})));
    const bool connected = segment.connect_master({slave, 0});
    segment.power_up(osal.now());
    margay::SimulatedNic nic(segment, osal);
    margay::HostContext ctx;
    if (!connected || !init(ctx, nic, osal)) return 1;
    // The slave cannot go to PREOP, because its EEPROM is blank; the error names it.
    const auto found = config_init(ctx);
    const bool named = !found && found.error().slave == 1;
    return named && ctx.slaves().size() == 1 && ctx.slave(1).station_address.value == 0x1001 ? 0 : 1;
}
