// Builds the SII of a device with process data of a chosen size.
#pragma once

#include "wire/sii_writer.hpp"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace margay {

// Builds an SII with outputs in SyncManager 0 and inputs in SyncManager 1, with PDO entries of up to 8 bits. The PDOs
// 0x1A01 and 0x1601 are not assigned.
struct IoDevice {
    std::uint32_t product = 0x0100;
    std::uint16_t alias = 0;
    std::uint8_t flags = 0;  // wire::sii::general_flag bits
    std::uint16_t identification_address = 0;
    bool emulation = false;  // no program: the ESC copies AL control to AL status
};
inline std::vector<std::byte> io_image(std::uint32_t output_bits, std::uint32_t input_bits,
                                       const IoDevice& device = {}) {
    namespace sii = wire::sii;
    const auto entries = [](std::uint32_t bits, std::uint16_t index) {
        std::vector<sii::PdoEntryDescription> all;
        for (std::uint8_t sub = 1; bits > 0; ++sub) {
            const auto part = static_cast<std::uint8_t>(std::min(bits, 248U));
            all.push_back({.index = index, .subindex = sub, .bit_length = part});
            bits -= part;
        }
        return all;
    };
    const auto out_entries = entries(output_bits, 0x7000);
    const auto in_entries = entries(input_bits, 0x6000);
    const auto unused = entries(77, 0x5000);
    std::vector<sii::PdoDescription> rx{{.index = 0x1601, .entries = unused}};
    std::vector<sii::PdoDescription> tx{{.index = 0x1A01, .entries = unused}};
    std::vector<SmInfo> sms;
    std::vector<FmmuUse> fmmus;
    if (output_bits > 0) {
        rx.push_back({.index = 0x1600, .sync_manager = static_cast<std::uint8_t>(sms.size()), .entries = out_entries});
        sms.push_back({0x1100, static_cast<std::uint16_t>((output_bits + 7) / 8), 0x64, 1, SmType::outputs});
        fmmus.push_back(FmmuUse::outputs);
    }
    if (input_bits > 0) {
        tx.push_back({.index = 0x1A00, .sync_manager = static_cast<std::uint8_t>(sms.size()), .entries = in_entries});
        sms.push_back({0x2000, static_cast<std::uint16_t>((input_bits + 7) / 8), 0x20, 1, SmType::inputs});
        fmmus.push_back(FmmuUse::inputs);
    }
    std::vector<std::byte> image(2048);
    const auto written = sii::write_image(
        {.configuration = {.pdi_control = static_cast<std::uint16_t>(device.emulation ? 0x0105 : 0x0005),
                           .alias = device.alias},
         .identity = {.vendor = 0x00004D47, .product = device.product},
         .name = "MG IO",
         .general = {.flags = device.flags, .identification_address = device.identification_address},
         .fmmus = fmmus,
         .sync_managers = sms,
         .tx_pdos = tx,
         .rx_pdos = rx},
        image);
    if (!written.ok()) image.clear();
    return image;
}

}  // namespace margay
