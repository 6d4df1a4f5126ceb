// Configurations of simulated drives with lists of their PDOs. Without these lists, the polling thread would read the
// PDOs of the slaves before activation, which takes an undefined time.
#pragma once

#include <ecrt.h>
#include <cstdint>

namespace {

constexpr std::uint32_t kVendor = 0x00004D47;
constexpr std::uint32_t kDrive = 0x00005402;

constexpr ec_pdo_entry_info_t kEntries[] = {{0x6040, 0, 16}, {0x6060, 0, 8}, {0x607A, 0, 32},
                                            {0x6041, 0, 16}, {0x6061, 0, 8}, {0x6064, 0, 32}};
constexpr ec_pdo_info_t kPdos[] = {{0x1600, 3, kEntries}, {0x1A00, 3, kEntries + 3}};
constexpr ec_sync_info_t kSyncs[] = {{2, EC_DIR_OUTPUT, 1, kPdos, EC_WD_ENABLE},
                                     {3, EC_DIR_INPUT, 1, kPdos + 1, EC_WD_DISABLE},
                                     {0xFF, EC_DIR_INVALID, 0, nullptr, EC_WD_DEFAULT}};

// The configuration of the drive at this position; nullptr: it was refused.
ec_slave_config_t* configure_drive(ec_master_t* master, std::uint16_t position) {
    ec_slave_config_t* const config = ecrt_master_slave_config(master, 0, position, kVendor, kDrive);
    return config != nullptr && ecrt_slave_config_pdos(config, EC_END, kSyncs) == 0 ? config : nullptr;
}

}  // namespace
