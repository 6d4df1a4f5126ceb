// Images for the tests of the SII: images of real devices, and the image of a made-up device.
#pragma once

#include <places.hpp>
#include "wire/sii_writer.hpp"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace margay::wire::sii {

inline std::vector<std::byte> bytes(std::initializer_list<int> values) {
    std::vector<std::byte> out;
    for (const int v : values) out.push_back(static_cast<std::byte>(v));
    return out;
}

inline std::string text(Bytes octets) {
    std::string out;
    for (const auto octet : octets) out.push_back(static_cast<char>(octet));
    return out;
}

inline bool have_images() { return std::string_view(MARGAY_SII_DIR) != ""; }

// Empty when the file cannot be read.
inline std::vector<std::byte> image_of(const std::string& file) {
    std::ifstream in(std::filesystem::path(MARGAY_SII_DIR) / file, std::ios::binary);
    const std::string octets(std::istreambuf_iterator<char>(in), {});
    std::vector<std::byte> out;
    for (const char c : octets) out.push_back(static_cast<std::byte>(c));
    return out;
}

// A device with everything that an SII can describe.
struct MadeUpDevice {
    static constexpr PdoEntryDescription kStatus[] = {
        {0x6041, 0, "Status word", 0x06, 16, 0}, {0x0000, 0, "", 0x00, 3, 0}, {0x6060, 1, "Ready", 0x01, 1, 0}};
    static constexpr PdoEntryDescription kControl[] = {{0x6040, 0, "Control word", 0x06, 16, 0}};
    static constexpr PdoDescription kInputs[] = {
        {0x1A00, 3, 0, "Inputs", pdo_flag::kFixedContent | pdo_flag::kMandatory, kStatus},
        {0x1A01, Pdo::kNoSyncManager, 1, "Inputs", 0, {}}};
    static constexpr PdoDescription kOutputs[] = {{0x1600, 2, 0, "Outputs", pdo_flag::kFixedContent, kControl}};
    static constexpr FmmuUse kFmmus[] = {FmmuUse::outputs, FmmuUse::inputs, FmmuUse::mailbox_status};
    static constexpr SmInfo kSyncManagers[] = {{0x1000, 128, 0x26, 1, SmType::mailbox_out},
                                               {0x1080, 128, 0x22, 1, SmType::mailbox_in},
                                               {0x1100, 2, 0x64, 1, SmType::outputs},
                                               {0x1400, 3, 0x20, 1, SmType::inputs}};
    static constexpr DcDescription kDc[] = {{{.sync0_cycle_time_ns = 250'000,
                                              .sync0_shift_time_ns = -1000,
                                              .sync1_shift_time_ns = 2000,
                                              .sync1_cycle_factor = -1,
                                              .assign_activate = 0x0730,
                                              .sync0_cycle_factor = -8},
                                             "DC",
                                             "Distributed clocks"},
                                            {{}, "Free run", ""}};

    Description description{.configuration = {.pdi_control = 0x0C08, .pdi_configuration = 0x6E, .alias = 0x1234},
                            .identity = {0x4D47, 0x10203040, 0x00010002, 77},
                            .mailbox = {0x1000, 128, 0x1080, 128, mailbox_protocol::kCoE | mailbox_protocol::kFoE},
                            .boot_mailbox = {0x1000, 256, 0x1200, 256, 0},
                            .group = "Made up",
                            .order = "MG-1",
                            .name = "Made up drive",
                            .general = {.coe_details = coe_detail::kSdo | coe_detail::kCompleteAccess,
                                        .foe_details = 1,
                                        .eoe_details = 3,
                                        .soe_channels = 2,
                                        .ds402_channels = 4,
                                        .sysman_class = 5,
                                        .flags = general_flag::kNotLrw,
                                        .ebus_current_ma = -500,
                                        .physical_ports = 0x3311,
                                        .identification_address = 0x0F40},
                            .fmmus = kFmmus,
                            .sync_managers = kSyncManagers,
                            .tx_pdos = kInputs,
                            .rx_pdos = kOutputs,
                            .dc = kDc};

    [[nodiscard]] std::vector<std::byte> image(std::size_t eeprom_bytes = 2048) const {
        std::vector<std::byte> out(eeprom_bytes);
        if (!write_image(description, out).ok()) out.clear();
        return out;
    }
};

}  // namespace margay::wire::sii
