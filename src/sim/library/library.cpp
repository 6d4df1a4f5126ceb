#include "sim/library/library.hpp"

#include "sim/library/stack_firmware.hpp"

namespace margay::sim {

std::span<const Blueprint* const> blueprints() {
    static constexpr const Blueprint* kAll[] = {&kDigitalIo,  &kAnalogIo,  &kEncoder,   &kDrive,      &kSoeDrive,
                                                &kBootloader, &kOddDevice, &kVoeDevice, &kAoeGateway, &kOpenBootloader,
                                                &kEoeGateway, &kDcBridge,  &kSplitIo,   &kModularIo};
    return kAll;
}

std::vector<std::byte> sii_of(const Blueprint& blueprint, const subdevice::ObjectDictionary& dictionary) {
    std::vector<std::byte> image(2048);
    const auto workspace = std::make_unique<subdevice::SiiWorkspace<32, 256>>();
    [[maybe_unused]] const auto written =
        subdevice::write_sii(*blueprint.device, blueprint.board, dictionary, *workspace, image);
    return image;
}

Device build(const Blueprint& blueprint) {
    Device device;
    device.chip = blueprint.chip();
    auto firmware = std::make_unique<StackFirmware>(blueprint);
    device.sii = sii_of(blueprint, firmware->dictionary());
    device.firmware = std::move(firmware);
    return device;
}

}  // namespace margay::sim
