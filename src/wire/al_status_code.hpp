// AL status codes (register 0x0134): the reason why a state change was refused or reversed. ETG.1000.6 table "AL Status
// Codes", and the codes that ETG.1020 adds. Codes from 0x8000 belong to the vendor.
#pragma once

#include <cstdint>
#include <string_view>

namespace margay::wire {

enum class AlStatusCode : std::uint16_t {
    none = 0x0000,
    unspecified = 0x0001,
    no_memory = 0x0002,
    invalid_device_setup = 0x0003,
    invalid_revision = 0x0004,
    sii_firmware_mismatch = 0x0006,
    firmware_update_failed = 0x0007,
    license_error = 0x000E,
    invalid_requested_state_change = 0x0011,
    unknown_requested_state = 0x0012,
    bootstrap_not_supported = 0x0013,
    no_valid_firmware = 0x0014,
    invalid_boot_mailbox_configuration = 0x0015,
    invalid_mailbox_configuration = 0x0016,
    invalid_sync_manager_configuration = 0x0017,
    no_valid_inputs = 0x0018,
    no_valid_outputs = 0x0019,
    synchronization_error = 0x001A,
    sync_manager_watchdog = 0x001B,
    invalid_sync_manager_types = 0x001C,
    invalid_output_configuration = 0x001D,
    invalid_input_configuration = 0x001E,
    invalid_watchdog_configuration = 0x001F,
    needs_cold_start = 0x0020,
    needs_init = 0x0021,
    needs_preop = 0x0022,
    needs_safeop = 0x0023,
    invalid_input_mapping = 0x0024,
    invalid_output_mapping = 0x0025,
    inconsistent_settings = 0x0026,
    free_run_not_supported = 0x0027,
    sync_mode_not_supported = 0x0028,
    free_run_needs_three_buffers = 0x0029,
    background_watchdog = 0x002A,
    no_valid_inputs_and_outputs = 0x002B,
    fatal_sync_error = 0x002C,
    no_sync_error = 0x002D,
    cycle_time_too_small = 0x002E,
    invalid_dc_sync_configuration = 0x0030,
    invalid_dc_latch_configuration = 0x0031,
    pll_error = 0x0032,
    dc_sync_io_error = 0x0033,
    dc_sync_timeout = 0x0034,
    invalid_dc_sync_cycle_time = 0x0035,
    invalid_dc_sync0_cycle_time = 0x0036,
    invalid_dc_sync1_cycle_time = 0x0037,
    mailbox_aoe = 0x0041,
    mailbox_eoe = 0x0042,
    mailbox_coe = 0x0043,
    mailbox_foe = 0x0044,
    mailbox_soe = 0x0045,
    mailbox_voe = 0x004F,
    eeprom_no_access = 0x0050,
    eeprom_error = 0x0051,
    external_hardware_not_ready = 0x0052,
    restarted_locally = 0x0060,
    device_identification_updated = 0x0061,
    module_list_mismatch = 0x0070,
    supply_voltage_too_low = 0x0080,
    supply_voltage_too_high = 0x0081,
    temperature_too_low = 0x0082,
    temperature_too_high = 0x0083,
    application_controller_available = 0x00F0,
};

// The first code for vendors.
inline constexpr std::uint16_t kVendorAlStatusCodes = 0x8000;

// Text of the code; "vendor specific" or "reserved" for undefined codes. The strings are static. Callable from any
// thread and from the cycle.
[[nodiscard]] std::string_view to_text(AlStatusCode code);
[[nodiscard]] inline std::string_view al_status_text(std::uint16_t code) {
    return to_text(static_cast<AlStatusCode>(code));
}

}  // namespace margay::wire
