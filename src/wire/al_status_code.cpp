#include "wire/al_status_code.hpp"

namespace margay::wire {

std::string_view to_text(AlStatusCode code) {
    using enum AlStatusCode;
    switch (code) {
        case none: return "no error";
        case unspecified: return "unspecified error";
        case no_memory: return "no memory";
        case invalid_device_setup: return "invalid device setup";
        case invalid_revision: return "invalid revision";
        case sii_firmware_mismatch: return "SII information does not match the firmware";
        case firmware_update_failed: return "firmware update not successful, the old firmware still runs";
        case license_error: return "license error";
        case invalid_requested_state_change: return "invalid requested state change";
        case unknown_requested_state: return "unknown requested state";
        case bootstrap_not_supported: return "bootstrap not supported";
        case no_valid_firmware: return "no valid firmware";
        case invalid_boot_mailbox_configuration: return "invalid mailbox configuration (BOOT)";
        case invalid_mailbox_configuration: return "invalid mailbox configuration (PREOP)";
        case invalid_sync_manager_configuration: return "invalid sync manager configuration";
        case no_valid_inputs: return "no valid inputs available";
        case no_valid_outputs: return "no valid outputs";
        case synchronization_error: return "synchronization error";
        case sync_manager_watchdog: return "sync manager watchdog";
        case invalid_sync_manager_types: return "invalid sync manager types";
        case invalid_output_configuration: return "invalid output configuration";
        case invalid_input_configuration: return "invalid input configuration";
        case invalid_watchdog_configuration: return "invalid watchdog configuration";
        case needs_cold_start: return "slave needs a cold start";
        case needs_init: return "slave needs INIT";
        case needs_preop: return "slave needs PREOP";
        case needs_safeop: return "slave needs SAFEOP";
        case invalid_input_mapping: return "invalid input mapping";
        case invalid_output_mapping: return "invalid output mapping";
        case inconsistent_settings: return "inconsistent settings";
        case free_run_not_supported: return "free run not supported";
        case sync_mode_not_supported: return "synchronization mode not supported";
        case free_run_needs_three_buffers: return "free run needs three-buffer mode";
        case background_watchdog: return "background watchdog";
        case no_valid_inputs_and_outputs: return "no valid inputs and outputs";
        case fatal_sync_error: return "fatal synchronization error";
        case no_sync_error: return "no synchronization signal";
        case cycle_time_too_small: return "cycle time too small";
        case invalid_dc_sync_configuration: return "invalid DC SYNC configuration";
        case invalid_dc_latch_configuration: return "invalid DC latch configuration";
        case pll_error: return "PLL error";
        case dc_sync_io_error: return "DC sync I/O error";
        case dc_sync_timeout: return "DC sync timeout";
        case invalid_dc_sync_cycle_time: return "DC: invalid sync cycle time";
        case invalid_dc_sync0_cycle_time: return "DC: SYNC0 cycle time does not fit the application";
        case invalid_dc_sync1_cycle_time: return "DC: SYNC1 cycle time does not fit the application";
        case mailbox_aoe: return "mailbox: AoE";
        case mailbox_eoe: return "mailbox: EoE";
        case mailbox_coe: return "mailbox: CoE";
        case mailbox_foe: return "mailbox: FoE";
        case mailbox_soe: return "mailbox: SoE";
        case mailbox_voe: return "mailbox: VoE";
        case eeprom_no_access: return "EEPROM: no access";
        case eeprom_error: return "EEPROM: error";
        case external_hardware_not_ready: return "external hardware not ready";
        case restarted_locally: return "slave restarted locally";
        case device_identification_updated: return "device identification value updated";
        case module_list_mismatch: return "detected module list does not match the configured one";
        case supply_voltage_too_low: return "supply voltage too low";
        case supply_voltage_too_high: return "supply voltage too high";
        case temperature_too_low: return "temperature too low";
        case temperature_too_high: return "temperature too high";
        case application_controller_available: return "application controller available";
    }
    return static_cast<std::uint16_t>(code) >= kVendorAlStatusCodes ? "vendor specific" : "reserved code";
}

}  // namespace margay::wire
