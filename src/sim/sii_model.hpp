// What a simulated device takes from its SII image: chip, mailboxes, process data. Read forgivingly: what
// cannot be read is absent.
#pragma once

#include "sim/esc_description.hpp"
#include "subdevice/description.hpp"
#include "wire/sii_category.hpp"

#include <string>
#include <vector>

namespace margay::sim {

struct SiiModel {
    struct Area {  // one SyncManager of process data
        std::uint8_t sync_manager = 0;
        wire::sii::SyncManagers::Value info{};
        std::uint32_t pdo_bits = 0;  // of the PDOs assigned to it by default
    };

    wire::sii::FixedPart fixed;
    wire::sii::General general;
    std::string name;  // in UTF-8; empty where there is none
    std::vector<Area> areas;
    unsigned sync_managers = 0;
    unsigned fmmus = 0;
    bool has_dc = false;

    [[nodiscard]] bool device_emulation() const {
        return (fixed.configuration.pdi_control >> 8 & wire::esc_configuration::kDeviceEmulation) != 0;
    }
    // What the slave stack checks against.
    [[nodiscard]] subdevice::DeviceDescription description() const;
    // A chip that such a device may have: its ports, and enough FMMUs, SyncManagers and RAM.
    [[nodiscard]] EscDescription chip() const;
};

[[nodiscard]] SiiModel read_sii_model(Bytes image);

}  // namespace margay::sim
