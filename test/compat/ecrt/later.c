/* A configuration for a slave that appears after activation. The other slave is exchanged meanwhile. Ends with 0 when
 * the late slave has attached to its configuration and come to OP. */
#include "cycle.h"

#include <ecrt.h>
#include <stdio.h>

#define DRIVE 0x00004D47, 0x5402
#define DIG_OUT_8 0x00004D47, 0x2008

static ec_pdo_entry_info_t entries[] = {{0x6040, 0, 16}, {0x607a, 0, 32}, {0x6041, 0, 16}, {0x6064, 0, 32}};
static ec_pdo_info_t pdos[] = {{0x1600, 2, entries}, {0x1a00, 2, entries + 2}};
static ec_sync_info_t syncs[] = {{2, EC_DIR_OUTPUT, 1, pdos, EC_WD_ENABLE},
                                 {3, EC_DIR_INPUT, 1, pdos + 1, EC_WD_DISABLE},
                                 {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT}};

int main(void) {
    ec_master_t* master = ecrt_request_master(0);
    ec_domain_t* domain;
    ec_slave_config_t *first, *late;
    ec_domain_state_t ds;
    ec_slave_config_state_t first_state, late_state;
    ec_master_state_t ms;
    unsigned int alone = 0, together = 0;
    int offset;
    if (!master || !(domain = ecrt_master_create_domain(master))) return 1;
    first = ecrt_master_slave_config(master, 0, 0, DRIVE);
    late = ecrt_master_slave_config(master, 0, 1, DRIVE);
    if (!first || !late || ecrt_slave_config_pdos(first, EC_END, syncs) || ecrt_slave_config_pdos(late, EC_END, syncs))
        return 1;
    if (ecrt_slave_config_sdo32(late, 0x6083, 0, 4711)) return 1;
    if (ecrt_slave_config_reg_pdo_entry(first, 0x6040, 0, domain, NULL) != 0) return 1;
    if (ecrt_slave_config_reg_pdo_entry(first, 0x6041, 0, domain, NULL) != 6) return 1;
    offset = ecrt_slave_config_reg_pdo_entry(late, 0x6041, 0, domain, NULL);
    if (offset != 12) return 1;
    ecrt_slave_config_state(late, &late_state);
    if (late_state.online) return 2;
    if (ecrt_master_activate(master)) return 1;
    for (unsigned int n = 0; n < 30000 && together < 100; ++n) {
        next_cycle();
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_state(domain, &ds);
        ecrt_master_state(master, &ms);
        ecrt_slave_config_state(first, &first_state);
        ecrt_slave_config_state(late, &late_state);
        if (first_state.operational && !late_state.online && ds.wc_state == EC_WC_INCOMPLETE &&
            ms.slaves_responding == 1)
            ++alone;
        together = first_state.operational && late_state.operational && ds.wc_state == EC_WC_COMPLETE &&
                           ms.slaves_responding == 2 && ms.al_states == EC_AL_STATE_OP
                       ? together + 1
                       : 0;
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }
    printf("%u cycles alone, %u together, WC %u, status 0x%04x\n", alone, together, ds.working_counter,
           EC_READ_U16(ecrt_domain_data(domain) + offset));
    if (alone < 50) return 3;
    if (together < 100 || ds.working_counter != 4) return 4;
    if (EC_READ_U16(ecrt_domain_data(domain) + offset) == 0) return 5;
    ecrt_release_master(master);
    return 0;
}
