/* What is refused: changes while the master is active, and configuration by a handle that was only opened. Octets that
 * the program writes into the memory of a domain before activation stay. The time of the clocks goes on also in cycles
 * without the first domain. In a ring both links can be asked. */
#include "check.h"
#include "cycle.h"

#include <ecrt.h>

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static ec_master_t* master;
static ec_domain_t* first;
static ec_domain_t* second;
static uint32_t clock_time; /* of the reference clock; 0: not read in this cycle */

static void one_cycle(int with_first) {
    next_cycle();
    ecrt_master_receive(master);
    if (ecrt_master_reference_clock_time(master, &clock_time) != 0) clock_time = 0;
    ecrt_domain_process(first);
    ecrt_domain_process(second);
    ecrt_master_application_time(master, now_ns());
    ecrt_master_sync_slave_clocks(master);
    if (with_first) ecrt_domain_queue(first);
    ecrt_domain_queue(second);
    ecrt_master_send(master);
}

static int refused(ec_slave_config_t* sc) {
    const uint8_t octet = 0;
    CHECK(ecrt_slave_config_watchdog(sc, 0, 100) == -EBUSY);
    CHECK(ecrt_slave_config_dc(sc, 0x300, 1000000, 0, 0, 0) == -EBUSY);
    CHECK(ecrt_slave_config_sdo8(sc, 0x6060, 0, 8) == -EBUSY);
    CHECK(ecrt_slave_config_sdo16(sc, 0x6060, 0, 8) == -EBUSY);
    CHECK(ecrt_slave_config_sdo32(sc, 0x6060, 0, 8) == -EBUSY);
    CHECK(ecrt_slave_config_sdo(sc, 0x6060, 0, &octet, 1) == -EBUSY);
    CHECK(ecrt_slave_config_complete_sdo(sc, 0x6060, &octet, 1) == -EBUSY);
    CHECK(ecrt_slave_config_idn(sc, 0, 1, EC_AL_STATE_PREOP, &octet, 1) == -EBUSY);
    CHECK(ecrt_slave_config_emerg_size(sc, 4) == -EBUSY);
    CHECK(ecrt_slave_config_state_timeout(sc, EC_AL_STATE_SAFEOP, EC_AL_STATE_OP, 100) == -EBUSY);
    CHECK(ecrt_slave_config_pdos(sc, EC_END, NULL) == -EBUSY);
    CHECK(ecrt_master_select_reference_clock(master, sc) == -EBUSY);
    CHECK(ecrt_master_create_domain(master) == NULL);
    return 0;
}

/* Sizes that no memory has, and no domain. */
static int impossible(ec_slave_config_t* sc) {
    const uint8_t octet = 0;
    const size_t huge = (size_t)-1;
    CHECK(ecrt_slave_config_create_sdo_request(sc, 0x1000, 0, huge) == NULL);
    CHECK(ecrt_slave_config_create_sdo_request_complete(sc, 0x1000, huge) == NULL);
    CHECK(ecrt_slave_config_create_soe_request(sc, 0, 1, huge) == NULL);
    CHECK(ecrt_slave_config_create_foe_request(sc, huge) == NULL);
    CHECK(ecrt_slave_config_create_reg_request(sc, huge) == NULL);
    CHECK(ecrt_slave_config_create_voe_handler(sc, huge) == NULL);
    CHECK(ecrt_slave_config_sdo(sc, 0x6060, 0, &octet, huge) == -ENOMEM);
    CHECK(ecrt_slave_config_complete_sdo(sc, 0x6060, &octet, huge) == -ENOMEM);
    CHECK(ecrt_master_sdo_download(master, 0, 0x6060, 0, &octet, huge, NULL) == -ENOMEM);
    CHECK(ecrt_master_sdo_download_complete(master, 0, 0x6060, &octet, huge, NULL) == -ENOMEM);
    CHECK(ecrt_master_write_idn(master, 0, 0, 1, &octet, huge, NULL) == -ENOMEM);
    CHECK(ecrt_slave_config_reg_pdo_entry(sc, 0x6041, 0, NULL, NULL) == -EINVAL);
    CHECK(ecrt_slave_config_reg_pdo_entry_pos(sc, 3, 0, 0, NULL, NULL) == -EINVAL);
    CHECK(ecrt_domain_reg_pdo_entry_list(first, NULL) == -EINVAL);
    return 0;
}

int main(int argc, char** argv) {
    const int links = argc > 1 ? atoi(argv[1]) : 1;
    ec_slave_config_t* a;
    ec_slave_config_t* b;
    ec_master_link_state_t link;
    ec_master_t* opened;
    uint32_t before = 0;
    int offset, n;

    master = ecrt_request_master(0);
    CHECK(master != NULL);
    opened = ecrt_open_master(0);
    CHECK(opened != NULL);
    CHECK(ecrt_master_create_domain(opened) == NULL);
    CHECK(ecrt_master_slave_config(opened, 0, 0, 1, 1) == NULL);
    CHECK(ecrt_master_activate(opened) == -EPERM);

    first = ecrt_master_create_domain(master);
    second = ecrt_master_create_domain(master);
    {
        ec_slave_info_t info;
        CHECK(ecrt_master_get_slave(opened, 0, &info) == 0);
        a = ecrt_master_slave_config(master, 0, 0, info.vendor_id, info.product_code);
        CHECK(ecrt_master_get_slave(opened, 1, &info) == 0);
        b = ecrt_master_slave_config(master, 0, 1, info.vendor_id, info.product_code);
    }
    CHECK(a != NULL && b != NULL);
    CHECK(impossible(a) == 0);
    CHECK(ecrt_slave_config_reg_pdo_entry(a, 0x6041, 0, first, NULL) >= 0);
    offset = ecrt_slave_config_reg_pdo_entry(b, 0x6040, 0, second, NULL);
    CHECK(offset >= 0);
    CHECK(ecrt_master_setup_domain_memory(master) == 0);
    EC_WRITE_U16(ecrt_domain_data(second) + offset, 0x0102);
    CHECK(ecrt_master_activate(master) == 0);
    CHECK(EC_READ_U16(ecrt_domain_data(second) + offset) == 0x0102);
    if (refused(a) != 0) return 1;
    CHECK(ecrt_master_receive(opened) == -EPERM);

    for (n = 0; n < 20000; ++n) {
        ec_slave_config_state_t state_a, state_b;
        one_cycle(1);
        ecrt_slave_config_state(a, &state_a);
        ecrt_slave_config_state(b, &state_b);
        if (state_a.operational && state_b.operational) break;
    }
    CHECK(n < 20000);
    if (links == 1) {
        for (n = 0; n < 5000 && clock_time == 0; ++n) one_cycle(1);
        CHECK(n < 5000);
        for (n = 0; n < 5000; ++n) {
            one_cycle(0);
            if (n < 10) continue; /* an answer of a cycle with the first domain */
            if (before == 0) before = clock_time;
            if (clock_time != 0 && clock_time != before) break;
        }
        CHECK(n < 5000);
    }
    for (n = 0; n < 5000; ++n) {
        one_cycle(1);
        if (ecrt_master_link_state(master, 0, &link) == 0 && link.link_up && link.slaves_responding > 0) break;
    }
    CHECK(n < 5000);
    CHECK((ecrt_master_link_state(master, 1, &link) == 0) == (links == 2));
    CHECK(ecrt_master_link_state(master, 2, &link) == -EINVAL);
    ecrt_release_master(opened);
    return 0; /* the threads of the library run still */
}
