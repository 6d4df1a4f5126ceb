#include "subdevice/sync_objects.hpp"

#include "subdevice/application.hpp"

namespace margay::subdevice {

bool supports_sync_type(const DeviceDescription& device, bool outputs, std::uint16_t type) {
    switch (type) {
        case sync_type::kFreeRun: return device.free_run_cycle != Duration::zero() && !device.dc.required;
        case sync_type::kSmEvent: return !device.dc.required;
        case sync_type::kSm2Event: return !outputs && device.outputs.present() && !device.dc.required;
        case sync_type::kDcSync0: return device.dc.supported;
        default: return false;
    }
}

HookAnswer check_sync_type(const ObjectAccess& access, Bytes data) {
    if (access.application == nullptr) return Abort::none;
    const auto& device = access.application->description();
    // A complete access begins with subindex 0, in 16 bits, or with subindex 1.
    const std::size_t at = access.complete && access.subindex == 0 ? 2 : 0;
    if ((!access.complete && access.subindex != sync_subindex::kType) || data.size() < at + 2) return Abort::none;
    bool right = true;
    for (const bool outputs : {true, false})
        for_each_area(device, outputs, [&](const ProcessDataArea& area, std::size_t) {
            if (area.sync_parameters() == access.object.index)
                right = supports_sync_type(device, outputs, load_le<std::uint16_t>(data, at));
        });
    return right ? Abort::none : Abort::value_range;
}

}  // namespace margay::subdevice
