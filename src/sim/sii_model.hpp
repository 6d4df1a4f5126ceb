// The properties that a simulated device gets from its SII image: chip, mailboxes, process data. Content that cannot be
// read is treated as absent.
#pragma once

#include "sim/esc_description.hpp"
#include "subdevice/description.hpp"
#include "wire/sii_category.hpp"

#include <string>
#include <vector>

namespace margay::sim {

struct SiiModel {
    struct Area {  // one process data SyncManager
        std::uint8_t sync_manager = 0;
        wire::sii::SyncManagers::Value info{};
        std::uint32_t pdo_bits = 0;  // of the PDOs assigned by default
    };

    wire::sii::FixedPart fixed;
    wire::sii::General general;
    std::string name;  // in UTF-8; may be empty
    std::vector<Area> areas;
    unsigned sync_managers = 0;
    unsigned fmmus = 0;
    bool has_dc = false;

    [[nodiscard]] bool device_emulation() const {
        return (fixed.configuration.pdi_control >> 8 & wire::esc_configuration::kDeviceEmulation) != 0;
    }
    // The description that the slave stack uses for its checks.
    [[nodiscard]] subdevice::DeviceDescription description() const;
    // A suitable chip for the device: its ports, and enough FMMUs, SyncManagers and RAM.
    [[nodiscard]] EscDescription chip() const;
};

[[nodiscard]] SiiModel read_sii_model(Bytes image);

}  // namespace margay::sim
