#include "storm/device_bits.hpp"

#include "osal/virtual/virtual_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "storm/roomy_context.hpp"

#include <margay/margay.hpp>

#include <map>

namespace margay::storm {
namespace {

DeviceBits read(const std::string& name) {
    auto device = sim::make_device(name);
    if (!device) return {};
    VirtualOsal osal;
    sim::Segment segment;
    (void)segment.connect_master({segment.add(std::move(*device).assemble()), 0});
    segment.power_up(osal.now());
    SimulatedNic nic(segment, osal);
    RoomyContext ctx({.slaves = 1});
    std::vector<std::byte> image(4096);
    if (!init(ctx, nic, osal) || !config_init(ctx) || !config_map(ctx, image)) return {};
    const SlaveImage& data = ctx.slave(1).image;
    return {data.inputs.bits, data.outputs.bits};
}

}  // namespace

DeviceBits bits_of_device(const std::string& name) {
    static std::map<std::string, DeviceBits> known;
    const auto found = known.find(name);
    return found != known.end() ? found->second : known.emplace(name, read(name)).first->second;
}

}  // namespace margay::storm
