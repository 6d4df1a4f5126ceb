/* Devices that are not there at activation: the domain, the positions, and devices that nobody has configured. The
 * argument is the scene. Ends with 0 when everything is as expected. */
#include "cycle.h"

#include <ecrt.h>
#include <stdio.h>
#include <string.h>

#include "check.h"

#define VENDOR 0x00004D47
#define COUPLER VENDOR, 0x0100
#define DIG_IN_8 VENDOR, 0x1008
#define DIG_OUT_8 VENDOR, 0x2008
#define DRIVE VENDOR, 0x5402
#define MOST 20000 /* cycles */

static ec_master_t* master;
static ec_domain_t* domain;
static ec_domain_state_t ds;
static ec_master_state_t ms;

static ec_pdo_entry_info_t in_entries[8], out_entries[8];
static ec_pdo_info_t in_pdos[8], out_pdos[8];
static ec_sync_info_t in_syncs[] = {{0, EC_DIR_INPUT, 8, in_pdos, EC_WD_DEFAULT},
                                    {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT}};
static ec_sync_info_t out_syncs[] = {{0, EC_DIR_OUTPUT, 8, out_pdos, EC_WD_DEFAULT},
                                     {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT}};

static void describe_terminals(void) {
    for (unsigned int n = 0; n < 8; ++n) {
        in_entries[n] = (ec_pdo_entry_info_t){(uint16_t)(0x6000 + 16 * n), 1, 1};
        out_entries[n] = (ec_pdo_entry_info_t){(uint16_t)(0x7000 + 16 * n), 1, 1};
        in_pdos[n] = (ec_pdo_info_t){(uint16_t)(0x1a00 + n), 1, &in_entries[n]};
        out_pdos[n] = (ec_pdo_info_t){(uint16_t)(0x1600 + n), 1, &out_entries[n]};
    }
}

static void cycle(void) {
    next_cycle();
    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    ecrt_domain_state(domain, &ds);
    ecrt_master_state(master, &ms);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
}

static ec_slave_config_state_t state_of(const ec_slave_config_t* sc) {
    ec_slave_config_state_t state;
    ecrt_slave_config_state(sc, &state);
    return state;
}

/* Cycles until all of them are in OP, with a complete domain; 0: that never happens. */
static unsigned int until_operational(ec_slave_config_t** configs, unsigned int count) {
    for (unsigned int n = 1, right = 0; n < MOST; ++n) {
        unsigned int up = 0;
        cycle();
        for (unsigned int i = 0; i < count; ++i) up += state_of(configs[i]).operational;
        right = up == count && ds.wc_state == EC_WC_COMPLETE ? right + 1 : 0;
        if (right == 50) return n;
    }
    return 0;
}

static unsigned int read_register(ec_reg_request_t* request, uint16_t address) {
    ecrt_reg_request_read(request, address, 2);
    for (unsigned int n = 0; n < 1000 && ecrt_reg_request_state(request) == EC_REQUEST_BUSY; ++n) cycle();
    if (ecrt_reg_request_state(request) != EC_REQUEST_SUCCESS) return 0xFFFFFFFFU;
    return EC_READ_U16(ecrt_reg_request_data(request));
}

/* A domain with an input of the machine and one of a tool is not complete without the tool. */
static int tool(void) {
    ec_slave_config_t* configs[3];
    unsigned int bit, alone = 0;
    configs[0] = ecrt_master_slave_config(master, 0, 0, DIG_IN_8);
    configs[1] = ecrt_master_slave_config(master, 0x102, 0, COUPLER);
    configs[2] = ecrt_master_slave_config(master, 0x102, 1, DIG_IN_8);
    CHECK(ecrt_slave_config_pdos(configs[0], EC_END, in_syncs) == 0);
    CHECK(ecrt_slave_config_pdos(configs[2], EC_END, in_syncs) == 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(configs[0], 0x6000, 1, domain, &bit) == 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(configs[2], 0x6000, 1, domain, &bit) == 1);
    CHECK(ecrt_master_activate(master) == 0);
    for (unsigned int n = 0; n < MOST && !state_of(configs[2]).operational; ++n) {
        cycle();
        if (state_of(configs[2]).online) continue;
        CHECK(ds.wc_state != EC_WC_COMPLETE);
        if (ds.wc_state == EC_WC_INCOMPLETE && ds.working_counter == 1) ++alone;
    }
    CHECK(alone > 50);
    CHECK(until_operational(configs, 3) != 0);
    CHECK(ds.working_counter == 2);
    return 0;
}

/* Configuration 0:2 has the device that is second at first. When a branch is connected before it, the device has
 * another position, and another configuration. */
static int equal_branches(void) {
    ec_slave_config_t* configs[2];
    ec_reg_request_t* requests[2];
    unsigned int bit;
    int first, second;
    for (unsigned int n = 0; n < 2; ++n) {
        configs[n] = ecrt_master_slave_config(master, 0, (uint16_t)(2 + 2 * n), DIG_OUT_8);
        CHECK(ecrt_slave_config_pdos(configs[n], EC_END, out_syncs) == 0);
        requests[n] = ecrt_slave_config_create_reg_request(configs[n], 2);
        CHECK(requests[n] != NULL);
    }
    first = ecrt_slave_config_reg_pdo_entry(configs[0], 0x7000, 1, domain, &bit);
    second = ecrt_slave_config_reg_pdo_entry(configs[1], 0x7000, 1, domain, &bit);
    CHECK(first >= 0 && second >= 0);
    CHECK(ecrt_master_activate(master) == 0);
    EC_WRITE_U8(ecrt_domain_data(domain) + first, 0x11);
    EC_WRITE_U8(ecrt_domain_data(domain) + second, 0x22);
    for (unsigned int n = 0; n < MOST && !state_of(configs[0]).operational; ++n) cycle();
    CHECK(read_register(requests[0], 0x0012) == 22); /* the device of branch y */
    CHECK(until_operational(configs, 2) != 0);
    CHECK(read_register(requests[0], 0x0012) == 11);
    CHECK(read_register(requests[1], 0x0012) == 22);
    CHECK((read_register(requests[0], 0x0F00) & 0xFF) == 0x11);
    CHECK((read_register(requests[1], 0x0F00) & 0xFF) == 0x22);
    CHECK(ms.slaves_responding == 5);
    return 0;
}

/* The devices of both branches differ. No configuration has its device before both are there. */
static int other_branches(void) {
    ec_slave_config_t* configs[2];
    unsigned int bit;
    configs[0] = ecrt_master_slave_config(master, 0, 2, DIG_IN_8);
    configs[1] = ecrt_master_slave_config(master, 0, 4, DIG_OUT_8);
    CHECK(ecrt_slave_config_pdos(configs[0], EC_END, in_syncs) == 0);
    CHECK(ecrt_slave_config_pdos(configs[1], EC_END, out_syncs) == 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(configs[0], 0x6000, 1, domain, &bit) == 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(configs[1], 0x7000, 1, domain, &bit) == 1);
    CHECK(ecrt_master_activate(master) == 0);
    for (unsigned int n = 0; n < 1000; ++n) {
        cycle();
        CHECK(!state_of(configs[0]).online && !state_of(configs[1]).online && ds.wc_state != EC_WC_COMPLETE);
    }
    CHECK(until_operational(configs, 2) != 0);
    return 0;
}

/* A device that nobody has configured comes later, at the end of the line. The configured one stays in OP. */
static int newcomer(void) {
    ec_slave_config_t* configs[1];
    ec_slave_info_t info;
    ec_master_info_t seen;
    configs[0] = ecrt_master_slave_config(master, 0, 0, DRIVE);
    CHECK(ecrt_slave_config_reg_pdo_entry(configs[0], 0x6041, 0, domain, NULL) == 0);
    CHECK(ecrt_master_activate(master) == 0);
    CHECK(until_operational(configs, 1) != 0);
    CHECK(ms.slaves_responding == 1 && ms.al_states == EC_AL_STATE_OP);
    for (unsigned int n = 0; n < MOST && ms.al_states != (EC_AL_STATE_OP | EC_AL_STATE_PREOP); ++n) {
        cycle();
        CHECK(state_of(configs[0]).operational && ds.wc_state == EC_WC_COMPLETE);
    }
    CHECK(ms.slaves_responding == 2 && ms.al_states == (EC_AL_STATE_OP | EC_AL_STATE_PREOP));
    CHECK(ecrt_master(master, &seen) == 0 && seen.slave_count == 2);
    CHECK(ecrt_master_get_slave(master, 1, &info) == 0);
    CHECK(info.vendor_id == VENDOR && info.product_code == 0x5402 && info.al_state == EC_AL_STATE_PREOP);
    return 0;
}

int main(int argc, char** argv) {
    int result = 2;
    if (argc != 2 || !(master = ecrt_request_master(0)) || !(domain = ecrt_master_create_domain(master))) return 2;
    describe_terminals();
    if (!strcmp(argv[1], "tool")) result = tool();
    if (!strcmp(argv[1], "equal_branches")) result = equal_branches();
    if (!strcmp(argv[1], "other_branches")) result = other_branches();
    if (!strcmp(argv[1], "newcomer")) result = newcomer();
    ecrt_release_master(master);
    return result;
}
