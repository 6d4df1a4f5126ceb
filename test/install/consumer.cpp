// The program of another project that uses the installed package: a master and a segment of one slave with a blank
// EEPROM.
#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <margay/parts/osal/virtual/virtual_osal.hpp>
#include <margay/parts/oshw/simulated/simulated_nic.hpp>
#include <margay/version.hpp>

#include <string_view>

#if !MARGAY_VERSION_AT_LEAST(0, 1, 0) || MARGAY_VERSION_AT_LEAST(MARGAY_VERSION_MAJOR, MARGAY_VERSION_MINOR + 1, 0)
#error "the macro does not compare"
#endif
static_assert(margay::kVersion >= margay::Version{0, 1, 0} && margay::kVersion < margay::Version{999, 0, 0});
static_assert(std::string_view(MARGAY_VERSION_TEXT) == PACKAGE_VERSION);

int main() {
    margay::VirtualOsal osal;
    margay::sim::Segment segment;
    const auto slave = segment.add(
        std::make_unique<margay::sim::Esc>(margay::sim::et1100(), std::vector<std::byte>(2048, std::byte{0xFF})));
    const bool connected = segment.connect_master({slave, 0});
    segment.power_up(osal.now());
    margay::SimulatedNic nic(segment, osal);
    margay::HostContext ctx;
    if (!connected || !init(ctx, nic, osal) || margay::library_version() != margay::kVersion) return 1;
    // The slave cannot go to PREOP, because its EEPROM is blank. The error names the slave.
    const auto found = config_init(ctx);
    const bool named = !found && found.error().slave == 1;
    return named && ctx.slaves().size() == 1 && ctx.slave(1).station_address.value == 0x1001 ? 0 : 1;
}
