/* A program activates, deactivates and activates at once again, with a configuration by alias before one by position.
 * The segment has not changed, so each start is as good as the first: OP, and no message (the test looks for them). */
#include "cycle.h"

#include <ecrt.h>
#include <stdio.h>

#include "check.h"

enum { STARTS = 4, MOST_CYCLES = 5000 };

/* The number of cycles until both slaves are in OP. */
static int start(ec_master_t* master, int most_cycles) {
    ec_domain_t* domain = ecrt_master_create_domain(master);
    ec_slave_config_t* by_alias = ecrt_master_slave_config(master, 0x7777, 0, 0x4d47, 0x5402);
    ec_slave_config_t* by_place = ecrt_master_slave_config(master, 0, 3, 0x4d47, 0x1008);
    unsigned int bit;
    int n;
    if (!domain || !by_alias || !by_place) return MOST_CYCLES;
    if (ecrt_slave_config_reg_pdo_entry(by_alias, 0x6041, 0, domain, NULL) < 0) return MOST_CYCLES;
    if (ecrt_slave_config_reg_pdo_entry(by_place, 0x6020, 1, domain, &bit) < 0) return MOST_CYCLES;
    if (ecrt_master_activate(master)) return MOST_CYCLES;
    for (n = 0; n < most_cycles; ++n) {
        ec_slave_config_state_t first, second;
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_slave_config_state(by_alias, &first);
        ecrt_slave_config_state(by_place, &second);
        if (first.operational && second.operational) break;
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
        next_cycle();
    }
    return n;
}

int main(void) {
    ec_master_t* master = ecrt_request_master(0);
    int n;
    if (!master) return 1;
    for (n = 0; n < STARTS; ++n) {
        const int cycles = start(master, MOST_CYCLES);
        printf("start %d: OP after %d cycles\n", n + 1, cycles);
        CHECK(cycles < MOST_CYCLES);
        CHECK(ecrt_master_deactivate(master) == 0);
        /* Ended long before OP. */
        CHECK(start(master, 10 * n + 1) < MOST_CYCLES);
        CHECK(ecrt_master_deactivate(master) == 0);
    }
    ecrt_release_master(master);
    return 0;
}
