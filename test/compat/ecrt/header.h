/* Types, constants and macros of ecrt.h, as the interface has them; compiled as C99 and as every C++. */
#ifndef HEADER_H
#define HEADER_H

#include <ecrt.h>

#define VALUE(NAME, EXPECTED) failures += (NAME) == (EXPECTED) ? 0 : 1
/* The type of a member, by a pointer to it. */
#define MEMBER(OBJECT, NAME, TYPE)           \
    do {                                     \
        const TYPE* member = &(OBJECT).NAME; \
        failures += member != 0 ? 0 : 1;     \
    } while (0)

static int check_constants(void) {
    int failures = 0;
    VALUE(ECRT_VER_MAJOR, 1);
    VALUE(ECRT_VER_MINOR, 6);
    VALUE(ECRT_VERSION(1, 6), 0x106);
    VALUE(ECRT_VERSION_MAGIC, 0x106);
    VALUE(ecrt_version_magic(), 0x106U);
    VALUE(EC_END, ~0U);
    VALUE((uint8_t)EC_END, 0xFFU);
    VALUE(EC_MAX_SYNC_MANAGERS, 16);
    VALUE(EC_MAX_STRING_LENGTH, 64);
    VALUE(EC_MAX_PORTS, 4);
    VALUE(EC_COE_EMERGENCY_MSG_SIZE, 8);
    VALUE(EC_PORT_NOT_IMPLEMENTED, 0);
    VALUE(EC_PORT_NOT_CONFIGURED, 1);
    VALUE(EC_PORT_EBUS, 2);
    VALUE(EC_PORT_MII, 3);
    VALUE(EC_WC_ZERO, 0);
    VALUE(EC_WC_INCOMPLETE, 1);
    VALUE(EC_WC_COMPLETE, 2);
    VALUE(EC_DIR_INVALID, 0);
    VALUE(EC_DIR_OUTPUT, 1);
    VALUE(EC_DIR_INPUT, 2);
    VALUE(EC_DIR_COUNT, 3);
    VALUE(EC_WD_DEFAULT, 0);
    VALUE(EC_WD_ENABLE, 1);
    VALUE(EC_WD_DISABLE, 2);
    VALUE(EC_REQUEST_UNUSED, 0);
    VALUE(EC_REQUEST_BUSY, 1);
    VALUE(EC_REQUEST_SUCCESS, 2);
    VALUE(EC_REQUEST_ERROR, 3);
    VALUE(EC_AL_STATE_INIT, 1);
    VALUE(EC_AL_STATE_PREOP, 2);
    VALUE(EC_AL_STATE_SAFEOP, 4);
    VALUE(EC_AL_STATE_OP, 8);
    VALUE(FOE_BUSY, 0);
    VALUE(FOE_READY, 1);
    VALUE(FOE_IDLE, 2);
    VALUE(FOE_TIMEOUT_ERROR, 9);
    VALUE(FOE_READ_OVER_ERROR, 16);
    return failures;
}

static int check_types(void) {
    int failures = 0;
    ec_master_state_t ms = {0, 0, 0};
    ec_master_link_state_t ls = {0, 0, 0};
    ec_slave_config_state_t cs = {0, 0, 0};
    ec_master_info_t mi = {0, 0, 0, 0};
    ec_master_scan_progress_t sp = {0, 0};
    ec_slave_info_t si;
    ec_domain_state_t ds = {0, EC_WC_ZERO, 0};
    /* These four are initialised by the order of their members. */
    ec_pdo_entry_info_t entry = {0x6040, 1, 16};
    ec_pdo_info_t pdo = {0x1600, 1, &entry};
    ec_sync_info_t sync = {2, EC_DIR_OUTPUT, 1, &pdo, EC_WD_ENABLE};
    unsigned int offset = 0, bit = 0;
    ec_pdo_entry_reg_t reg = {1, 2, 3, 4, 5, 6, &offset, &bit};
    MEMBER(ms, slaves_responding, unsigned int);
    MEMBER(ls, slaves_responding, unsigned int);
    ms.al_states = ls.al_states = cs.al_state = 15;
    ms.link_up = ls.link_up = mi.link_up = cs.online = cs.operational = 1;
    VALUE(ms.al_states + ls.al_states + cs.al_state, 45U);
    VALUE(ms.link_up + ls.link_up + mi.link_up + cs.online + cs.operational, 5U);
    MEMBER(mi, slave_count, unsigned int);
    MEMBER(mi, scan_busy, uint8_t);
    MEMBER(mi, app_time, uint64_t);
    MEMBER(sp, slave_count, unsigned int);
    MEMBER(sp, scan_index, unsigned int);
    MEMBER(si, position, uint16_t);
    MEMBER(si, vendor_id, uint32_t);
    MEMBER(si, product_code, uint32_t);
    MEMBER(si, revision_number, uint32_t);
    MEMBER(si, serial_number, uint32_t);
    MEMBER(si, alias, uint16_t);
    MEMBER(si, current_on_ebus, int16_t);
    MEMBER(si, ports[3].desc, ec_slave_port_desc_t);
    MEMBER(si, ports[3].link.link_up, uint8_t);
    MEMBER(si, ports[3].link.loop_closed, uint8_t);
    MEMBER(si, ports[3].link.signal_detected, uint8_t);
    MEMBER(si, ports[3].receive_time, uint32_t);
    MEMBER(si, ports[3].next_slave, uint16_t);
    MEMBER(si, ports[3].delay_to_next_dc, uint32_t);
    MEMBER(si, al_state, uint8_t);
    MEMBER(si, error_flag, uint8_t);
    MEMBER(si, sync_count, uint8_t);
    MEMBER(si, sdo_count, uint16_t);
    VALUE(sizeof si.name, 64U);
    MEMBER(ds, working_counter, unsigned int);
    MEMBER(ds, wc_state, ec_wc_state_t);
    MEMBER(ds, redundancy_active, unsigned int);
    VALUE(entry.index + entry.subindex + entry.bit_length, 0x6040 + 17);
    VALUE(pdo.index + pdo.n_entries, 0x1601U);
    VALUE(sync.index + sync.n_pdos, 3U);
    VALUE(sync.dir, EC_DIR_OUTPUT);
    VALUE(sync.watchdog_mode, EC_WD_ENABLE);
    VALUE(reg.alias + reg.position + reg.vendor_id + reg.product_code + reg.index + reg.subindex, 21U);
    failures += reg.offset == &offset && reg.bit_position == &bit && pdo.entries == &entry && sync.pdos == &pdo ? 0 : 1;
    return failures;
}

/* At odd addresses, and with arguments that have an effect. */
static int check_macros(void) {
    int failures = 0;
    uint8_t data[32] = {0};
    uint8_t* at = data + 1;
    struct timeval time;
    EC_WRITE_U8(at, 0x81);
    VALUE(EC_READ_U8(at), 0x81);
    VALUE(EC_READ_S8(at), -127);
    EC_WRITE_S8(at, -2);
    VALUE(EC_READ_U8(at), 0xFE);
    EC_WRITE_U16(at, 0x8081);
    VALUE(EC_READ_U16(at), 0x8081);
    VALUE(EC_READ_S16(at), -32639);
    VALUE(at[0] == 0x81 && at[1] == 0x80, 1);
    EC_WRITE_S16(at, -3);
    VALUE(EC_READ_S16(at), -3);
    EC_WRITE_U32(at, 0x81828384U);
    VALUE(EC_READ_U32(at), 0x81828384U);
    VALUE(at[0] == 0x84 && at[3] == 0x81, 1);
    EC_WRITE_S32(at, -4);
    VALUE(EC_READ_S32(at), -4);
    EC_WRITE_U64(at, (uint64_t)0x8182838485868788U);
    VALUE(EC_READ_U64(at), (uint64_t)0x8182838485868788U);
    VALUE(at[0] == 0x88 && at[7] == 0x81, 1);
    EC_WRITE_S64(at, -5);
    VALUE(EC_READ_S64(at), -5);
    EC_WRITE_REAL(at, 1.5);
    VALUE(EC_READ_REAL(at) == 1.5f && EC_READ_U32(at) == 0x3FC00000U, 1);
    EC_WRITE_LREAL(at, -1.5);
    VALUE(EC_READ_LREAL(at) == -1.5 && EC_READ_U64(at) == (uint64_t)0xBFF8000000000000U, 1);
    EC_WRITE_U8(at, 0x00);
    EC_WRITE_BIT(at, 5, 2);
    VALUE(EC_READ_U8(at), 0x20);
    VALUE(EC_READ_BIT(at, 5), 1);
    VALUE(EC_READ_BIT(at, 4), 0);
    EC_WRITE_BIT(at, 5, 0);
    VALUE(EC_READ_U8(at), 0x00);
    data[1] = 1, data[2] = 2;
    at = data + 1;
    VALUE(EC_READ_U8(at++), 1);
    VALUE(at == data + 2, 1);
    EC_WRITE_U16(at++, 7);
    VALUE(at == data + 3 && EC_READ_U16(data + 2) == 7, 1);
    if (failures == 0)
        EC_WRITE_U8(data, 9);
    else
        EC_WRITE_U8(data, 8);
    VALUE(le16_to_cpu(cpu_to_le16(0x1234)), 0x1234);
    VALUE(le32_to_cpu(cpu_to_le32(0x12345678)), 0x12345678U);
    VALUE(le64_to_cpu(cpu_to_le64(0x123456789U)), 0x123456789U);
    EC_WRITE_U32(data, 0x12345678);
    VALUE(le16_to_cpup(data), 0x5678);
    VALUE(le32_to_cpup(data), 0x12345678U);
    time.tv_sec = 946684801;
    time.tv_usec = 5;
    VALUE(EC_TIMEVAL2NANO(time), 1000005000U);
    return failures;
}

static int check_header(void) { return check_constants() + check_types() + check_macros(); }

#endif
