/* The interface of the IgH EtherCAT master for programs in userspace (versions 1.5 and 1.6), on top of Margay.
 *
 * Programs for that interface compile with this header and run without a kernel module. For C99 and later, and for
 * C++11 and later. The README.md of this facade in the sources of Margay says for every row how far it works.
 *
 * Results: functions that return int return 0 (or a value that is not negative) or the negative of an errno value; a
 * pointer is NULL on failure. The reason of a failure goes to stderr where the result does not say it: for -ENOENT
 * (what was asked for is not there) and arguments out of range there may be no line. Phases:
 *   [cfg] between ecrt_request_master() and ecrt_master_activate(), not in the cyclic thread; may wait
 *   [rt]  in the cyclic thread; never waits
 *   [any] in any thread; functions that talk to a slave wait for it
 */
#ifndef __ECRT_H__
#define __ECRT_H__

#include <netinet/in.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>

/* ---------------------------------------------------------------- version and features */

#define ECRT_VER_MAJOR 1
#define ECRT_VER_MINOR 6
#define ECRT_VERSION(a, b) (((a) << 8) + (b))
#define ECRT_VERSION_MAGIC ECRT_VERSION(ECRT_VER_MAJOR, ECRT_VER_MINOR)

#define EC_HAVE_REDUNDANCY
#define EC_HAVE_EMERGENCY
#define EC_HAVE_REG_ACCESS
#define EC_HAVE_SELECT_REF_CLOCK
#define EC_HAVE_REF_CLOCK_TIME
#define EC_HAVE_REG_BY_POS
#define EC_HAVE_SYNC_TO
#define EC_HAVE_FLAGS
#define EC_HAVE_SOE_REQUESTS
#define EC_HAVE_SCAN_PROGRESS
#define EC_HAVE_SET_IP
#define EC_HAVE_STATE_TIMEOUT

/* Programs of version 1.6 may use this macro in declarations of their own. */
#define EC_PUBLIC_API

/* ---------------------------------------------------------------- constants */

#define EC_END (~0U)                  /* the end of a list; in ec_sync_info_t.index it is 0xff */
#define EC_MAX_SYNC_MANAGERS (16)     /* SyncManagers of a slave */
#define EC_MAX_STRING_LENGTH (64)     /* of the name of a slave, with the terminating zero */
#define EC_MAX_PORTS (4)              /* ports of a slave */
#define EC_COE_EMERGENCY_MSG_SIZE (8) /* octets of an emergency */

/* Nanoseconds since 2000-01-01 00:00 of a struct timeval (not of a pointer to it), which counts from 1970. */
#define EC_TIMEVAL2NANO(TV)                                                     \
    ((((uint64_t)(TV).tv_sec) - (uint64_t)946684800U) * (uint64_t)1000000000U + \
     ((uint64_t)(TV).tv_usec) * (uint64_t)1000U)

/* ---------------------------------------------------------------- types */

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ec_master ec_master_t;
typedef struct ec_slave_config ec_slave_config_t;
typedef struct ec_domain ec_domain_t;
typedef struct ec_sdo_request ec_sdo_request_t;
typedef struct ec_soe_request ec_soe_request_t;
typedef struct ec_foe_request ec_foe_request_t;
typedef struct ec_voe_handler ec_voe_handler_t;
typedef struct ec_reg_request ec_reg_request_t;

/* The kind of a port, with the values of the SII. */
typedef enum {
    EC_PORT_NOT_IMPLEMENTED = 0,
    EC_PORT_NOT_CONFIGURED = 1,
    EC_PORT_EBUS = 2,
    EC_PORT_MII = 3
} ec_slave_port_desc_t;

/* How the working counter of a domain compares with the expected one. */
typedef enum { EC_WC_ZERO = 0, EC_WC_INCOMPLETE = 1, EC_WC_COMPLETE = 2 } ec_wc_state_t;

/* The direction of process data. Outputs are written by the master. */
typedef enum { EC_DIR_INVALID = 0, EC_DIR_OUTPUT = 1, EC_DIR_INPUT = 2, EC_DIR_COUNT = 3 } ec_direction_t;

/* Whether a SyncManager triggers the process data watchdog; EC_WD_DEFAULT: as the slave says. */
typedef enum { EC_WD_DEFAULT = 0, EC_WD_ENABLE = 1, EC_WD_DISABLE = 2 } ec_watchdog_mode_t;

/* The state of an asynchronous request. */
typedef enum {
    EC_REQUEST_UNUSED = 0,
    EC_REQUEST_BUSY = 1,
    EC_REQUEST_SUCCESS = 2,
    EC_REQUEST_ERROR = 3
} ec_request_state_t;

/* AL states, with the values of the standard. */
typedef enum { EC_AL_STATE_INIT = 1, EC_AL_STATE_PREOP = 2, EC_AL_STATE_SAFEOP = 4, EC_AL_STATE_OP = 8 } ec_al_state_t;

/* The result of a file transfer. */
typedef enum {
    FOE_BUSY = 0,
    FOE_READY = 1,
    FOE_IDLE = 2,
    FOE_WC_ERROR = 3,
    FOE_RECEIVE_ERROR = 4,
    FOE_PROT_ERROR = 5,
    FOE_NODATA_ERROR = 6,
    FOE_PACKETNO_ERROR = 7,
    FOE_OPCODE_ERROR = 8,
    FOE_TIMEOUT_ERROR = 9,
    FOE_SEND_RX_DATA_ERROR = 10,
    FOE_RX_DATA_ACK_ERROR = 11,
    FOE_ACK_ERROR = 12,
    FOE_MBOX_FETCH_ERROR = 13,
    FOE_READ_NODATA_ERROR = 14,
    FOE_MBOX_PROT_ERROR = 15,
    FOE_READ_OVER_ERROR = 16
} ec_foe_error_t;

/* All slaves together. */
typedef struct {
    unsigned int slaves_responding; /* how many slaves answer, over all links */
    unsigned int al_states : 4;     /* all AL states, combined by OR: bit 0 INIT, 1 PREOP, 2 SAFEOP, 3 OP */
    unsigned int link_up : 1;       /* at least one link is up */
} ec_master_state_t;

/* The same of one link. */
typedef struct {
    unsigned int slaves_responding;
    unsigned int al_states : 4;
    unsigned int link_up : 1;
} ec_master_link_state_t;

/* The slave of one configuration. */
typedef struct {
    unsigned int online : 1;      /* the slave is there, and is the configured one */
    unsigned int operational : 1; /* it was brought to OP with this configuration */
    unsigned int al_state : 4;    /* EC_AL_STATE_…; 0: not known */
} ec_slave_config_state_t;

typedef struct {
    unsigned int slave_count;
    unsigned int link_up : 1;
    uint8_t scan_busy;
    uint64_t app_time; /* ns, as set last */
} ec_master_info_t;

typedef struct {
    unsigned int slave_count;
    unsigned int scan_index; /* slaves that have been scanned */
} ec_master_scan_progress_t;

typedef struct {
    uint8_t link_up;
    uint8_t loop_closed;
    uint8_t signal_detected;
} ec_slave_port_link_t;

typedef struct {
    uint16_t position; /* in the ring, the first is 0 */
    uint32_t vendor_id;
    uint32_t product_code;
    uint32_t revision_number;
    uint32_t serial_number;
    uint16_t alias;
    int16_t current_on_ebus; /* mA */
    struct {
        ec_slave_port_desc_t desc;
        ec_slave_port_link_t link;
        uint32_t receive_time;
        uint16_t next_slave; /* position of the slave at this port; 0xffff: none */
        uint32_t delay_to_next_dc;
    } ports[EC_MAX_PORTS];
    uint8_t al_state;
    uint8_t error_flag;
    uint8_t sync_count;
    uint16_t sdo_count;
    char name[EC_MAX_STRING_LENGTH];
} ec_slave_info_t;

typedef struct {
    unsigned int working_counter;
    ec_wc_state_t wc_state;
    unsigned int redundancy_active;
} ec_domain_state_t;

/* An entry of a PDO; index 0: a gap. */
typedef struct {
    uint16_t index;
    uint8_t subindex;
    uint8_t bit_length;
} ec_pdo_entry_info_t;

/* A PDO; without entries it keeps those of the slave. */
typedef struct {
    uint16_t index;
    unsigned int n_entries;
    const ec_pdo_entry_info_t* entries;
} ec_pdo_info_t;

/* A SyncManager with its PDOs. A list ends with an element whose index is 0xff. */
typedef struct {
    uint8_t index;
    ec_direction_t dir;
    unsigned int n_pdos;
    const ec_pdo_info_t* pdos;
    ec_watchdog_mode_t watchdog_mode;
} ec_sync_info_t;

/* An entry that a domain is to exchange. A list ends with an element whose index is 0. */
typedef struct {
    uint16_t alias;
    uint16_t position;
    uint32_t vendor_id;
    uint32_t product_code;
    uint16_t index;
    uint8_t subindex;
    unsigned int* offset;       /* result: octet in the data of the domain */
    unsigned int* bit_position; /* result: bit in this octet; NULL: the entry begins on an octet */
} ec_pdo_entry_reg_t;

/* ---------------------------------------------------------------- the master */

/* Reserves a master for this program, begins to scan its segment, and returns after the first scan [any]. */
ec_master_t* ecrt_request_master(unsigned int master_index);
/* The same without a reservation: for reading only [any]. */
ec_master_t* ecrt_open_master(unsigned int master_index);
/* Ends the use of a master: slaves go to PREOP, all objects of the master are gone [any]. */
void ecrt_release_master(ec_master_t* master);
/* ECRT_VERSION_MAGIC of the library. */
unsigned int ecrt_version_magic(void);
/* Reserves a master that was opened. -EBUSY: it is reserved already [any]. */
int ecrt_master_reserve(ec_master_t* master);

/* A new domain; a configuration for a slave, or the one that exists for this address [cfg]. */
ec_domain_t* ecrt_master_create_domain(ec_master_t* master);
ec_slave_config_t* ecrt_master_slave_config(ec_master_t* master, uint16_t alias, uint16_t position, uint32_t vendor_id,
                                            uint32_t product_code);
/* The slave whose clock is the reference clock; NULL: the first one with a clock [cfg]. */
int ecrt_master_select_reference_clock(ec_master_t* master, ec_slave_config_t* sc);
/* Ends the configuration; from now on the program exchanges frames [cfg]. */
int ecrt_master_activate(ec_master_t* master);
/* Back to the configuration: all domains, slave configurations and requests end, and pointers to them must not be used
 * any more [cfg]. */
int ecrt_master_deactivate(ec_master_t* master);
/* The cycle time in us [cfg]. */
int ecrt_master_set_send_interval(ec_master_t* master, size_t send_interval);

/* Facts about the segment [any]. */
int ecrt_master(ec_master_t* master, ec_master_info_t* master_info);
int ecrt_master_scan_progress(ec_master_t* master, ec_master_scan_progress_t* progress);
int ecrt_master_get_slave(ec_master_t* master, uint16_t slave_position, ec_slave_info_t* slave_info);
int ecrt_master_get_sync_manager(ec_master_t* master, uint16_t slave_position, uint8_t sync_index,
                                 ec_sync_info_t* sync);
int ecrt_master_get_pdo(ec_master_t* master, uint16_t slave_position, uint8_t sync_index, uint16_t pos,
                        ec_pdo_info_t* pdo);
int ecrt_master_get_pdo_entry(ec_master_t* master, uint16_t slave_position, uint8_t sync_index, uint16_t pdo_pos,
                              uint16_t entry_pos, ec_pdo_entry_info_t* entry);

/* Access to objects and drive parameters of the slave at a position in the ring. Waits; beside a cycle the cyclic
 * thread must go on meanwhile [any]. */
int ecrt_master_sdo_download(ec_master_t* master, uint16_t slave_position, uint16_t index, uint8_t subindex,
                             const uint8_t* data, size_t data_size, uint32_t* abort_code);
int ecrt_master_sdo_download_complete(ec_master_t* master, uint16_t slave_position, uint16_t index, const uint8_t* data,
                                      size_t data_size, uint32_t* abort_code);
int ecrt_master_sdo_upload(ec_master_t* master, uint16_t slave_position, uint16_t index, uint8_t subindex,
                           uint8_t* target, size_t target_size, size_t* result_size, uint32_t* abort_code);
int ecrt_master_sdo_upload_complete(ec_master_t* master, uint16_t slave_position, uint16_t index, uint8_t* target,
                                    size_t target_size, size_t* result_size, uint32_t* abort_code);
int ecrt_master_write_idn(ec_master_t* master, uint16_t slave_position, uint8_t drive_no, uint16_t idn,
                          const uint8_t* data, size_t data_size, uint16_t* error_code);
int ecrt_master_read_idn(ec_master_t* master, uint16_t slave_position, uint8_t drive_no, uint16_t idn, uint8_t* target,
                         size_t target_size, size_t* result_size, uint16_t* error_code);

/* The cycle: take in what has come back, and send what was queued [rt]. */
int ecrt_master_receive(ec_master_t* master);
int ecrt_master_send(ec_master_t* master);
/* What is known now [rt]. */
int ecrt_master_state(const ec_master_t* master, ec_master_state_t* state);
int ecrt_master_link_state(const ec_master_t* master, unsigned int dev_idx, ec_master_link_state_t* state);
/* Configure slaves with errors again [rt]. */
int ecrt_master_reset(ec_master_t* master);

/* Clocks [rt]. Times in ns. */
int ecrt_master_application_time(ec_master_t* master, uint64_t app_time);
int ecrt_master_sync_reference_clock(ec_master_t* master);
int ecrt_master_sync_reference_clock_to(ec_master_t* master, uint64_t sync_time);
int ecrt_master_sync_slave_clocks(ec_master_t* master);
int ecrt_master_reference_clock_time(const ec_master_t* master, uint32_t* time);
int ecrt_master_sync_monitor_queue(ec_master_t* master);
uint32_t ecrt_master_sync_monitor_process(const ec_master_t* master);

/* Of a line of versions of their own. */
int ecrt_master_setup_domain_memory(ec_master_t* master);
void ecrt_master_deactivate_slaves(ec_master_t* master);
void ecrt_master_64bit_reference_clock_time_queue(ec_master_t* master);
int ecrt_master_64bit_reference_clock_time(ec_master_t* master, uint64_t* time);
int ecrt_master_rt_slave_requests(ec_master_t* master, unsigned int rt_slave_requests);
void ecrt_master_exec_slave_requests(ec_master_t* master);
int ecrt_master_eoe_is_open(ec_master_t* master);
int ecrt_master_eoe_process(ec_master_t* master);
int ecrt_master_eoe_addif(ec_master_t* master, uint16_t alias, uint16_t posn);
int ecrt_master_eoe_delif(ec_master_t* master, uint16_t alias, uint16_t posn);

/* ---------------------------------------------------------------- the configuration of a slave [cfg] */

int ecrt_slave_config_sync_manager(ec_slave_config_t* sc, uint8_t sync_index, ec_direction_t direction,
                                   ec_watchdog_mode_t watchdog_mode);
/* `watchdog_divider` in 40 ns, `watchdog_intervals` in that unit; 0: as the slave has it. */
int ecrt_slave_config_watchdog(ec_slave_config_t* sc, uint16_t watchdog_divider, uint16_t watchdog_intervals);
int ecrt_slave_config_pdo_assign_add(ec_slave_config_t* sc, uint8_t sync_index, uint16_t index);
int ecrt_slave_config_pdo_assign_clear(ec_slave_config_t* sc, uint8_t sync_index);
int ecrt_slave_config_pdo_mapping_add(ec_slave_config_t* sc, uint16_t pdo_index, uint16_t entry_index,
                                      uint8_t entry_subindex, uint8_t entry_bit_length);
int ecrt_slave_config_pdo_mapping_clear(ec_slave_config_t* sc, uint16_t pdo_index);
/* All at once: `n_syncs` elements at most, or up to the end of the list (EC_END). */
int ecrt_slave_config_pdos(ec_slave_config_t* sc, unsigned int n_syncs, const ec_sync_info_t syncs[]);
void ecrt_slave_config_overlapping_pdos(ec_slave_config_t* sc, uint8_t allow_overlapping_pdos);

/* Puts an entry (with its whole SyncManager) into a domain; returns its octet in the domain's data. */
int ecrt_slave_config_reg_pdo_entry(ec_slave_config_t* sc, uint16_t entry_index, uint8_t entry_subindex,
                                    ec_domain_t* domain, unsigned int* bit_position);
int ecrt_slave_config_reg_pdo_entry_pos(ec_slave_config_t* sc, uint8_t sync_index, unsigned int pdo_pos,
                                        unsigned int entry_pos, ec_domain_t* domain, unsigned int* bit_position);

/* SYNC signals: the word for ESC register 0x0980, cycles and shifts in ns. */
int ecrt_slave_config_dc(ec_slave_config_t* sc, uint16_t assign_activate, uint32_t sync0_cycle, int32_t sync0_shift,
                         uint32_t sync1_cycle, int32_t sync1_shift);

/* What is written each time the slave is configured. `data` is copied. */
int ecrt_slave_config_sdo(ec_slave_config_t* sc, uint16_t index, uint8_t subindex, const uint8_t* data, size_t size);
int ecrt_slave_config_sdo8(ec_slave_config_t* sc, uint16_t sdo_index, uint8_t sdo_subindex, uint8_t value);
int ecrt_slave_config_sdo16(ec_slave_config_t* sc, uint16_t sdo_index, uint8_t sdo_subindex, uint16_t value);
int ecrt_slave_config_sdo32(ec_slave_config_t* sc, uint16_t sdo_index, uint8_t sdo_subindex, uint32_t value);
int ecrt_slave_config_complete_sdo(ec_slave_config_t* sc, uint16_t index, const uint8_t* data, size_t size);
int ecrt_slave_config_idn(ec_slave_config_t* sc, uint8_t drive_no, uint16_t idn, ec_al_state_t state,
                          const uint8_t* data, size_t size);

/* Emergencies of the slave: the ring of `elements`, its oldest message, how many were lost. */
int ecrt_slave_config_emerg_size(ec_slave_config_t* sc, size_t elements);
int ecrt_slave_config_emerg_pop(ec_slave_config_t* sc, uint8_t* target);
int ecrt_slave_config_emerg_clear(ec_slave_config_t* sc);
int ecrt_slave_config_emerg_overruns(const ec_slave_config_t* sc);

/* Requests with room for `size` octets. */
ec_sdo_request_t* ecrt_slave_config_create_sdo_request(ec_slave_config_t* sc, uint16_t index, uint8_t subindex,
                                                       size_t size);
ec_sdo_request_t* ecrt_slave_config_create_sdo_request_complete(ec_slave_config_t* sc, uint16_t index, size_t size);
ec_soe_request_t* ecrt_slave_config_create_soe_request(ec_slave_config_t* sc, uint8_t drive_no, uint16_t idn,
                                                       size_t size);
ec_foe_request_t* ecrt_slave_config_create_foe_request(ec_slave_config_t* sc, size_t size);
ec_voe_handler_t* ecrt_slave_config_create_voe_handler(ec_slave_config_t* sc, size_t size);
ec_reg_request_t* ecrt_slave_config_create_reg_request(ec_slave_config_t* sc, size_t size);

int ecrt_slave_config_state(const ec_slave_config_t* sc, ec_slave_config_state_t* state); /* [rt] */
int ecrt_slave_config_flag(ec_slave_config_t* sc, const char* key, int32_t value);
int ecrt_slave_config_state_timeout(ec_slave_config_t* sc, ec_al_state_t from_state, ec_al_state_t to_state,
                                    unsigned int timeout_ms);

/* The parameters of the IP stack of a slave with EoE. */
int ecrt_slave_config_eoe_mac_address(ec_slave_config_t* sc, const unsigned char* mac_address);
int ecrt_slave_config_eoe_ip_address(ec_slave_config_t* sc, struct in_addr ip_address);
int ecrt_slave_config_eoe_subnet_mask(ec_slave_config_t* sc, struct in_addr subnet_mask);
int ecrt_slave_config_eoe_default_gateway(ec_slave_config_t* sc, struct in_addr gateway_address);
int ecrt_slave_config_eoe_dns_address(ec_slave_config_t* sc, struct in_addr dns_address);
int ecrt_slave_config_eoe_hostname(ec_slave_config_t* sc, const char* name);

/* ---------------------------------------------------------------- domains */

int ecrt_domain_reg_pdo_entry_list(ec_domain_t* domain, const ec_pdo_entry_reg_t* pdo_entry_regs); /* [cfg] */
size_t ecrt_domain_size(const ec_domain_t* domain);
/* The data, from ecrt_master_activate() on; NULL before. */
uint8_t* ecrt_domain_data(const ec_domain_t* domain);
/* After receive: inputs into the data. Before send: the outputs are to be sent. [rt] */
int ecrt_domain_process(ec_domain_t* domain);
int ecrt_domain_queue(ec_domain_t* domain);
int ecrt_domain_state(const ec_domain_t* domain, ec_domain_state_t* state);

/* ---------------------------------------------------------------- requests [rt] */

int ecrt_sdo_request_index(ec_sdo_request_t* req, uint16_t index, uint8_t subindex);
void ecrt_sdo_request_index_complete(ec_sdo_request_t* req, uint16_t index);
int ecrt_sdo_request_timeout(ec_sdo_request_t* req, uint32_t timeout); /* ms; 0: none */
uint8_t* ecrt_sdo_request_data(const ec_sdo_request_t* req);
size_t ecrt_sdo_request_data_size(const ec_sdo_request_t* req);
ec_request_state_t ecrt_sdo_request_state(const ec_sdo_request_t* req);
int ecrt_sdo_request_write(ec_sdo_request_t* req);
void ecrt_sdo_request_write_with_size(ec_sdo_request_t* req, size_t size);
int ecrt_sdo_request_read(ec_sdo_request_t* req);

int ecrt_soe_request_idn(ec_soe_request_t* req, uint8_t drive_no, uint16_t idn);
int ecrt_soe_request_timeout(ec_soe_request_t* req, uint32_t timeout);
uint8_t* ecrt_soe_request_data(const ec_soe_request_t* req);
size_t ecrt_soe_request_data_size(const ec_soe_request_t* req);
ec_request_state_t ecrt_soe_request_state(const ec_soe_request_t* req);
int ecrt_soe_request_write(ec_soe_request_t* req);
int ecrt_soe_request_read(ec_soe_request_t* req);

void ecrt_foe_request_file(ec_foe_request_t* req, const char* file_name, uint32_t password);
void ecrt_foe_request_timeout(ec_foe_request_t* req, uint32_t timeout);
uint8_t* ecrt_foe_request_data(ec_foe_request_t* req);
size_t ecrt_foe_request_data_size(const ec_foe_request_t* req);
ec_request_state_t ecrt_foe_request_state(ec_foe_request_t* req);
ec_foe_error_t ecrt_foe_request_result(const ec_foe_request_t* req);
uint32_t ecrt_foe_request_error_code(const ec_foe_request_t* req);
size_t ecrt_foe_request_progress(const ec_foe_request_t* req);
void ecrt_foe_request_write(ec_foe_request_t* req, size_t size);
void ecrt_foe_request_read(ec_foe_request_t* req);

int ecrt_voe_handler_send_header(ec_voe_handler_t* voe, uint32_t vendor_id, uint16_t vendor_type);
int ecrt_voe_handler_received_header(const ec_voe_handler_t* voe, uint32_t* vendor_id, uint16_t* vendor_type);
uint8_t* ecrt_voe_handler_data(const ec_voe_handler_t* voe);
size_t ecrt_voe_handler_data_size(const ec_voe_handler_t* voe);
int ecrt_voe_handler_write(ec_voe_handler_t* voe, size_t size);
int ecrt_voe_handler_read(ec_voe_handler_t* voe);
int ecrt_voe_handler_read_nosync(ec_voe_handler_t* voe);
ec_request_state_t ecrt_voe_handler_execute(ec_voe_handler_t* voe);

uint8_t* ecrt_reg_request_data(const ec_reg_request_t* req);
ec_request_state_t ecrt_reg_request_state(const ec_reg_request_t* req);
int ecrt_reg_request_write(ec_reg_request_t* req, uint16_t address, size_t size);
int ecrt_reg_request_read(ec_reg_request_t* req, uint16_t address, size_t size);
void ecrt_reg_request_readwrite(ec_reg_request_t* req, uint16_t address, size_t size);

/* ---------------------------------------------------------------- values in process data */

float ecrt_read_real(const void* data);
double ecrt_read_lreal(const void* data);
void ecrt_write_real(void* data, float value);
void ecrt_write_lreal(void* data, double value);

/* Little-endian values at any address, for hosts of either byte order. Compilers make one load or store of them. */
static inline uint16_t margay_ecrt_get16(const void* at) {
    const uint8_t* p = (const uint8_t*)at;
    return (uint16_t)(p[0] | ((unsigned int)p[1] << 8));
}
static inline uint32_t margay_ecrt_get32(const void* at) {
    const uint8_t* p = (const uint8_t*)at;
    return (uint32_t)p[0] | ((uint32_t)p[1] << 8) | ((uint32_t)p[2] << 16) | ((uint32_t)p[3] << 24);
}
static inline uint64_t margay_ecrt_get64(const void* at) {
    const uint8_t* p = (const uint8_t*)at;
    return (uint64_t)margay_ecrt_get32(p) | ((uint64_t)margay_ecrt_get32(p + 4) << 32);
}
static inline void margay_ecrt_put8(void* at, uint8_t value) { *(uint8_t*)at = value; }
static inline void margay_ecrt_put16(void* at, uint16_t value) {
    uint8_t* p = (uint8_t*)at;
    p[0] = (uint8_t)(value & 0xFFU);
    p[1] = (uint8_t)(value >> 8);
}
static inline void margay_ecrt_put32(void* at, uint32_t value) {
    uint8_t* p = (uint8_t*)at;
    p[0] = (uint8_t)(value & 0xFFU);
    p[1] = (uint8_t)((value >> 8) & 0xFFU);
    p[2] = (uint8_t)((value >> 16) & 0xFFU);
    p[3] = (uint8_t)(value >> 24);
}
static inline void margay_ecrt_put64(void* at, uint64_t value) {
    uint8_t* p = (uint8_t*)at;
    margay_ecrt_put32(p, (uint32_t)(value & 0xFFFFFFFFU));
    margay_ecrt_put32(p + 4, (uint32_t)(value >> 32));
}
static inline uint8_t margay_ecrt_with_bit(uint8_t octet, unsigned int bit, int on) {
    return (uint8_t)(on ? octet | (1U << bit) : octet & ~(1U << bit));
}
static inline void margay_ecrt_put_bit(void* at, unsigned int bit, int on) {
    *(uint8_t*)at = margay_ecrt_with_bit(*(uint8_t*)at, bit, on);
}
/* Values in the byte order of the host, from and to the little-endian octets of the same variable. */
static inline uint16_t margay_ecrt_swap16(uint16_t value) { return margay_ecrt_get16(&value); }
static inline uint32_t margay_ecrt_swap32(uint32_t value) { return margay_ecrt_get32(&value); }
static inline uint64_t margay_ecrt_swap64(uint64_t value) { return margay_ecrt_get64(&value); }

#ifdef __cplusplus
}
#endif

#define EC_READ_BIT(DATA, POS) ((*((const uint8_t*)(DATA)) >> (POS)) & 0x01)
#define EC_WRITE_BIT(DATA, POS, VAL)                                     \
    do {                                                                 \
        margay_ecrt_put_bit((DATA), (unsigned int)(POS), (VAL) ? 1 : 0); \
    } while (0)

#define EC_READ_U8(DATA) ((uint8_t) * ((const uint8_t*)(DATA)))
#define EC_READ_S8(DATA) ((int8_t) * ((const uint8_t*)(DATA)))
#define EC_READ_U16(DATA) (margay_ecrt_get16(DATA))
#define EC_READ_S16(DATA) ((int16_t)margay_ecrt_get16(DATA))
#define EC_READ_U32(DATA) (margay_ecrt_get32(DATA))
#define EC_READ_S32(DATA) ((int32_t)margay_ecrt_get32(DATA))
#define EC_READ_U64(DATA) (margay_ecrt_get64(DATA))
#define EC_READ_S64(DATA) ((int64_t)margay_ecrt_get64(DATA))
#define EC_READ_REAL(DATA) (ecrt_read_real(DATA))
#define EC_READ_LREAL(DATA) (ecrt_read_lreal(DATA))

#define EC_WRITE_U8(DATA, VAL)                    \
    do {                                          \
        margay_ecrt_put8((DATA), (uint8_t)(VAL)); \
    } while (0)
#define EC_WRITE_S8(DATA, VAL) EC_WRITE_U8(DATA, VAL)
#define EC_WRITE_U16(DATA, VAL)                     \
    do {                                            \
        margay_ecrt_put16((DATA), (uint16_t)(VAL)); \
    } while (0)
#define EC_WRITE_S16(DATA, VAL) EC_WRITE_U16(DATA, VAL)
#define EC_WRITE_U32(DATA, VAL)                     \
    do {                                            \
        margay_ecrt_put32((DATA), (uint32_t)(VAL)); \
    } while (0)
#define EC_WRITE_S32(DATA, VAL) EC_WRITE_U32(DATA, VAL)
#define EC_WRITE_U64(DATA, VAL)                     \
    do {                                            \
        margay_ecrt_put64((DATA), (uint64_t)(VAL)); \
    } while (0)
#define EC_WRITE_S64(DATA, VAL) EC_WRITE_U64(DATA, VAL)
#define EC_WRITE_REAL(DATA, VAL)               \
    do {                                       \
        ecrt_write_real((DATA), (float)(VAL)); \
    } while (0)
#define EC_WRITE_LREAL(DATA, VAL)                \
    do {                                         \
        ecrt_write_lreal((DATA), (double)(VAL)); \
    } while (0)

#ifndef le16_to_cpu
#define le16_to_cpu(x) (margay_ecrt_swap16((uint16_t)(x)))
#define le32_to_cpu(x) (margay_ecrt_swap32((uint32_t)(x)))
#define le64_to_cpu(x) (margay_ecrt_swap64((uint64_t)(x)))
#define cpu_to_le16(x) (margay_ecrt_swap16((uint16_t)(x)))
#define cpu_to_le32(x) (margay_ecrt_swap32((uint32_t)(x)))
#define cpu_to_le64(x) (margay_ecrt_swap64((uint64_t)(x)))
#define le16_to_cpup(x) (margay_ecrt_get16(x))
#define le32_to_cpup(x) (margay_ecrt_get32(x))
#define le64_to_cpup(x) (margay_ecrt_get64(x))
#define cpu_to_le16p(x) (margay_ecrt_get16(x))
#define cpu_to_le32p(x) (margay_ecrt_get32(x))
#define cpu_to_le64p(x) (margay_ecrt_get64(x))
#endif

#endif /* __ECRT_H__ */
