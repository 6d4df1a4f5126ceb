/* The signature of each function, written down apart from the header: a difference does not compile, and a function
 * that the library does not export does not link. Functions that return nothing in version 1.5 return int in
 * version 1.6. The test of the README compares the names with its table and with the exported symbols. */
#include <ecrt.h>
#include <stdio.h>

typedef void (*function_t)(void);

#define CHECK(NAME, TYPE_OF_RESULT, ...)                                   \
    do {                                                                   \
        TYPE_OF_RESULT(*function) __VA_ARGS__ = NAME;                      \
        if ((function_t)function != (function_t)0) puts(#NAME), ++checked; \
    } while (0)

int main(void) {
    unsigned int checked = 0;
    CHECK(ecrt_request_master, ec_master_t*, (unsigned int master_index));
    CHECK(ecrt_open_master, ec_master_t*, (unsigned int master_index));
    CHECK(ecrt_release_master, void, (ec_master_t * master));
    CHECK(ecrt_version_magic, unsigned int, (void));
    CHECK(ecrt_master_reserve, int, (ec_master_t * master));
    CHECK(ecrt_master_create_domain, ec_domain_t*, (ec_master_t * master));
    CHECK(ecrt_master_slave_config, ec_slave_config_t*,
          (ec_master_t * master, uint16_t alias, uint16_t position, uint32_t vendor_id, uint32_t product_code));
    CHECK(ecrt_master_select_reference_clock, int, (ec_master_t * master, ec_slave_config_t * sc));
    CHECK(ecrt_master_activate, int, (ec_master_t * master));
    CHECK(ecrt_master_deactivate, int, (ec_master_t * master));
    CHECK(ecrt_master_set_send_interval, int, (ec_master_t * master, size_t send_interval));
    CHECK(ecrt_master, int, (ec_master_t * master, ec_master_info_t * master_info));
    CHECK(ecrt_master_get_slave, int, (ec_master_t * master, uint16_t slave_position, ec_slave_info_t * slave_info));
    CHECK(ecrt_master_get_sync_manager, int,
          (ec_master_t * master, uint16_t slave_position, uint8_t sync_index, ec_sync_info_t * sync));
    CHECK(ecrt_master_get_pdo, int,
          (ec_master_t * master, uint16_t slave_position, uint8_t sync_index, uint16_t pos, ec_pdo_info_t * pdo));
    CHECK(ecrt_master_get_pdo_entry, int,
          (ec_master_t * master, uint16_t slave_position, uint8_t sync_index, uint16_t pdo_pos, uint16_t entry_pos,
           ec_pdo_entry_info_t * entry));
    CHECK(ecrt_master_scan_progress, int, (ec_master_t * master, ec_master_scan_progress_t * progress));
    CHECK(ecrt_master_sdo_download, int,
          (ec_master_t * master, uint16_t slave_position, uint16_t index, uint8_t subindex, const uint8_t* data,
           size_t data_size, uint32_t* abort_code));
    CHECK(ecrt_master_sdo_upload, int,
          (ec_master_t * master, uint16_t slave_position, uint16_t index, uint8_t subindex, uint8_t * target,
           size_t target_size, size_t * result_size, uint32_t * abort_code));
    CHECK(ecrt_master_write_idn, int,
          (ec_master_t * master, uint16_t slave_position, uint8_t drive_no, uint16_t idn, const uint8_t* data,
           size_t data_size, uint16_t* error_code));
    CHECK(ecrt_master_read_idn, int,
          (ec_master_t * master, uint16_t slave_position, uint8_t drive_no, uint16_t idn, uint8_t * target,
           size_t target_size, size_t * result_size, uint16_t * error_code));
    CHECK(ecrt_master_sdo_download_complete, int,
          (ec_master_t * master, uint16_t slave_position, uint16_t index, const uint8_t* data, size_t data_size,
           uint32_t* abort_code));
    CHECK(ecrt_master_receive, int, (ec_master_t * master));
    CHECK(ecrt_master_send, int, (ec_master_t * master));
    CHECK(ecrt_master_state, int, (const ec_master_t* master, ec_master_state_t* state));
    CHECK(ecrt_master_reset, int, (ec_master_t * master));
    CHECK(ecrt_master_link_state, int,
          (const ec_master_t* master, unsigned int dev_idx, ec_master_link_state_t* state));
    CHECK(ecrt_master_application_time, int, (ec_master_t * master, uint64_t app_time));
    CHECK(ecrt_master_sync_reference_clock, int, (ec_master_t * master));
    CHECK(ecrt_master_sync_reference_clock_to, int, (ec_master_t * master, uint64_t sync_time));
    CHECK(ecrt_master_sync_slave_clocks, int, (ec_master_t * master));
    CHECK(ecrt_master_reference_clock_time, int, (const ec_master_t* master, uint32_t* time));
    CHECK(ecrt_master_sync_monitor_queue, int, (ec_master_t * master));
    CHECK(ecrt_master_sync_monitor_process, uint32_t, (const ec_master_t* master));
    CHECK(ecrt_slave_config_sync_manager, int,
          (ec_slave_config_t * sc, uint8_t sync_index, ec_direction_t direction, ec_watchdog_mode_t watchdog_mode));
    CHECK(ecrt_slave_config_watchdog, int,
          (ec_slave_config_t * sc, uint16_t watchdog_divider, uint16_t watchdog_intervals));
    CHECK(ecrt_slave_config_pdo_assign_add, int, (ec_slave_config_t * sc, uint8_t sync_index, uint16_t index));
    CHECK(ecrt_slave_config_pdo_assign_clear, int, (ec_slave_config_t * sc, uint8_t sync_index));
    CHECK(ecrt_slave_config_pdo_mapping_add, int,
          (ec_slave_config_t * sc, uint16_t pdo_index, uint16_t entry_index, uint8_t entry_subindex,
           uint8_t entry_bit_length));
    CHECK(ecrt_slave_config_pdo_mapping_clear, int, (ec_slave_config_t * sc, uint16_t pdo_index));
    CHECK(ecrt_slave_config_pdos, int, (ec_slave_config_t * sc, unsigned int n_syncs, const ec_sync_info_t syncs[]));
    CHECK(ecrt_slave_config_reg_pdo_entry, int,
          (ec_slave_config_t * sc, uint16_t entry_index, uint8_t entry_subindex, ec_domain_t * domain,
           unsigned int* bit_position));
    CHECK(ecrt_slave_config_reg_pdo_entry_pos, int,
          (ec_slave_config_t * sc, uint8_t sync_index, unsigned int pdo_pos, unsigned int entry_pos,
           ec_domain_t* domain, unsigned int* bit_position));
    CHECK(ecrt_slave_config_dc, int,
          (ec_slave_config_t * sc, uint16_t assign_activate, uint32_t sync0_cycle, int32_t sync0_shift,
           uint32_t sync1_cycle, int32_t sync1_shift));
    CHECK(ecrt_slave_config_sdo, int,
          (ec_slave_config_t * sc, uint16_t index, uint8_t subindex, const uint8_t* data, size_t size));
    CHECK(ecrt_slave_config_sdo8, int,
          (ec_slave_config_t * sc, uint16_t sdo_index, uint8_t sdo_subindex, uint8_t value));
    CHECK(ecrt_slave_config_sdo16, int,
          (ec_slave_config_t * sc, uint16_t sdo_index, uint8_t sdo_subindex, uint16_t value));
    CHECK(ecrt_slave_config_sdo32, int,
          (ec_slave_config_t * sc, uint16_t sdo_index, uint8_t sdo_subindex, uint32_t value));
    CHECK(ecrt_slave_config_complete_sdo, int,
          (ec_slave_config_t * sc, uint16_t index, const uint8_t* data, size_t size));
    CHECK(ecrt_slave_config_create_sdo_request, ec_sdo_request_t*,
          (ec_slave_config_t * sc, uint16_t index, uint8_t subindex, size_t size));
    CHECK(ecrt_slave_config_state, int, (const ec_slave_config_t* sc, ec_slave_config_state_t* state));
    CHECK(ecrt_slave_config_idn, int,
          (ec_slave_config_t * sc, uint8_t drive_no, uint16_t idn, ec_al_state_t state, const uint8_t* data,
           size_t size));
    CHECK(ecrt_slave_config_emerg_size, int, (ec_slave_config_t * sc, size_t elements));
    CHECK(ecrt_slave_config_emerg_pop, int, (ec_slave_config_t * sc, uint8_t * target));
    CHECK(ecrt_slave_config_emerg_clear, int, (ec_slave_config_t * sc));
    CHECK(ecrt_slave_config_emerg_overruns, int, (const ec_slave_config_t* sc));
    CHECK(ecrt_slave_config_create_soe_request, ec_soe_request_t*,
          (ec_slave_config_t * sc, uint8_t drive_no, uint16_t idn, size_t size));
    CHECK(ecrt_slave_config_create_voe_handler, ec_voe_handler_t*, (ec_slave_config_t * sc, size_t size));
    CHECK(ecrt_slave_config_create_reg_request, ec_reg_request_t*, (ec_slave_config_t * sc, size_t size));
    CHECK(ecrt_slave_config_flag, int, (ec_slave_config_t * sc, const char* key, int32_t value));
    CHECK(ecrt_slave_config_eoe_mac_address, int, (ec_slave_config_t * sc, const unsigned char* mac_address));
    CHECK(ecrt_slave_config_eoe_ip_address, int, (ec_slave_config_t * sc, struct in_addr ip_address));
    CHECK(ecrt_slave_config_eoe_subnet_mask, int, (ec_slave_config_t * sc, struct in_addr subnet_mask));
    CHECK(ecrt_slave_config_eoe_default_gateway, int, (ec_slave_config_t * sc, struct in_addr gateway_address));
    CHECK(ecrt_slave_config_eoe_dns_address, int, (ec_slave_config_t * sc, struct in_addr dns_address));
    CHECK(ecrt_slave_config_eoe_hostname, int, (ec_slave_config_t * sc, const char* name));
    CHECK(ecrt_slave_config_state_timeout, int,
          (ec_slave_config_t * sc, ec_al_state_t from_state, ec_al_state_t to_state, unsigned int timeout_ms));
    CHECK(ecrt_domain_reg_pdo_entry_list, int, (ec_domain_t * domain, const ec_pdo_entry_reg_t* pdo_entry_regs));
    CHECK(ecrt_domain_size, size_t, (const ec_domain_t* domain));
    CHECK(ecrt_domain_data, uint8_t*, (const ec_domain_t* domain));
    CHECK(ecrt_domain_process, int, (ec_domain_t * domain));
    CHECK(ecrt_domain_queue, int, (ec_domain_t * domain));
    CHECK(ecrt_domain_state, int, (const ec_domain_t* domain, ec_domain_state_t* state));
    CHECK(ecrt_sdo_request_timeout, int, (ec_sdo_request_t * req, uint32_t timeout));
    CHECK(ecrt_sdo_request_data, uint8_t*, (const ec_sdo_request_t* req));
    CHECK(ecrt_sdo_request_state, ec_request_state_t, (const ec_sdo_request_t* req));
    CHECK(ecrt_sdo_request_write, int, (ec_sdo_request_t * req));
    CHECK(ecrt_sdo_request_read, int, (ec_sdo_request_t * req));
    CHECK(ecrt_sdo_request_index, int, (ec_sdo_request_t * req, uint16_t index, uint8_t subindex));
    CHECK(ecrt_sdo_request_data_size, size_t, (const ec_sdo_request_t* req));
    CHECK(ecrt_soe_request_idn, int, (ec_soe_request_t * req, uint8_t drive_no, uint16_t idn));
    CHECK(ecrt_soe_request_timeout, int, (ec_soe_request_t * req, uint32_t timeout));
    CHECK(ecrt_soe_request_data, uint8_t*, (const ec_soe_request_t* req));
    CHECK(ecrt_soe_request_data_size, size_t, (const ec_soe_request_t* req));
    CHECK(ecrt_soe_request_state, ec_request_state_t, (const ec_soe_request_t* req));
    CHECK(ecrt_soe_request_write, int, (ec_soe_request_t * req));
    CHECK(ecrt_soe_request_read, int, (ec_soe_request_t * req));
    CHECK(ecrt_voe_handler_send_header, int, (ec_voe_handler_t * voe, uint32_t vendor_id, uint16_t vendor_type));
    CHECK(ecrt_voe_handler_received_header, int,
          (const ec_voe_handler_t* voe, uint32_t* vendor_id, uint16_t* vendor_type));
    CHECK(ecrt_voe_handler_data, uint8_t*, (const ec_voe_handler_t* voe));
    CHECK(ecrt_voe_handler_data_size, size_t, (const ec_voe_handler_t* voe));
    CHECK(ecrt_voe_handler_write, int, (ec_voe_handler_t * voe, size_t size));
    CHECK(ecrt_voe_handler_read, int, (ec_voe_handler_t * voe));
    CHECK(ecrt_voe_handler_read_nosync, int, (ec_voe_handler_t * voe));
    CHECK(ecrt_voe_handler_execute, ec_request_state_t, (ec_voe_handler_t * voe));
    CHECK(ecrt_reg_request_data, uint8_t*, (const ec_reg_request_t* req));
    CHECK(ecrt_reg_request_state, ec_request_state_t, (const ec_reg_request_t* req));
    CHECK(ecrt_reg_request_write, int, (ec_reg_request_t * req, uint16_t address, size_t size));
    CHECK(ecrt_reg_request_read, int, (ec_reg_request_t * req, uint16_t address, size_t size));
    CHECK(ecrt_read_real, float, (const void* data));
    CHECK(ecrt_read_lreal, double, (const void* data));
    CHECK(ecrt_write_real, void, (void* data, float value));
    CHECK(ecrt_write_lreal, void, (void* data, double value));
    CHECK(ecrt_master_setup_domain_memory, int, (ec_master_t * master));
    CHECK(ecrt_master_sdo_upload_complete, int,
          (ec_master_t * master, uint16_t slave_position, uint16_t index, uint8_t * target, size_t target_size,
           size_t * result_size, uint32_t * abort_code));
    CHECK(ecrt_master_deactivate_slaves, void, (ec_master_t * master));
    CHECK(ecrt_master_eoe_is_open, int, (ec_master_t * master));
    CHECK(ecrt_master_eoe_process, int, (ec_master_t * master));
    CHECK(ecrt_master_eoe_addif, int, (ec_master_t * master, uint16_t alias, uint16_t posn));
    CHECK(ecrt_master_eoe_delif, int, (ec_master_t * master, uint16_t alias, uint16_t posn));
    CHECK(ecrt_master_64bit_reference_clock_time_queue, void, (ec_master_t * master));
    CHECK(ecrt_master_64bit_reference_clock_time, int, (ec_master_t * master, uint64_t * time));
    CHECK(ecrt_master_rt_slave_requests, int, (ec_master_t * master, unsigned int rt_slave_requests));
    CHECK(ecrt_master_exec_slave_requests, void, (ec_master_t * master));
    CHECK(ecrt_slave_config_overlapping_pdos, void, (ec_slave_config_t * sc, uint8_t allow_overlapping_pdos));
    CHECK(ecrt_slave_config_create_sdo_request_complete, ec_sdo_request_t*,
          (ec_slave_config_t * sc, uint16_t index, size_t size));
    CHECK(ecrt_slave_config_create_foe_request, ec_foe_request_t*, (ec_slave_config_t * sc, size_t size));
    CHECK(ecrt_sdo_request_index_complete, void, (ec_sdo_request_t * req, uint16_t index));
    CHECK(ecrt_sdo_request_write_with_size, void, (ec_sdo_request_t * req, size_t size));
    CHECK(ecrt_foe_request_file, void, (ec_foe_request_t * req, const char* file_name, uint32_t password));
    CHECK(ecrt_foe_request_timeout, void, (ec_foe_request_t * req, uint32_t timeout));
    CHECK(ecrt_foe_request_data, uint8_t*, (ec_foe_request_t * req));
    CHECK(ecrt_foe_request_data_size, size_t, (const ec_foe_request_t* req));
    CHECK(ecrt_foe_request_state, ec_request_state_t, (ec_foe_request_t * req));
    CHECK(ecrt_foe_request_result, ec_foe_error_t, (const ec_foe_request_t* req));
    CHECK(ecrt_foe_request_error_code, uint32_t, (const ec_foe_request_t* req));
    CHECK(ecrt_foe_request_progress, size_t, (const ec_foe_request_t* req));
    CHECK(ecrt_foe_request_write, void, (ec_foe_request_t * req, size_t size));
    CHECK(ecrt_foe_request_read, void, (ec_foe_request_t * req));
    CHECK(ecrt_reg_request_readwrite, void, (ec_reg_request_t * req, uint16_t address, size_t size));
    return checked == 130 ? 0 : 1;
}
