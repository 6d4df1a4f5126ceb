/* PDOs that a program adds to what the slave has by itself; lists that are refused, which change nothing, also when an
 * element behind a right one is refused; domains without entries. Ends with 0 when everything is as expected. */
#include "check.h"
#include "cycle.h"

#include <ecrt.h>

#include <errno.h>
#include <stdio.h>

static ec_master_t* master;
static ec_domain_t* domain;

/* A drive as it is without a configuration: 0x1600 has 0x6040 at octet 0, 0x1A00 has 0x6041 at octet 0. */
static ec_slave_config_t* configure(void) {
    master = ecrt_request_master(0);
    if (master == NULL) return NULL;
    domain = ecrt_master_create_domain(master);
    return ecrt_master_slave_config(master, 0, 0, 0x00004D47, 0x5402);
}

static int offset_of(ec_slave_config_t* sc, uint16_t index) {
    unsigned int bit;
    return ecrt_slave_config_reg_pdo_entry(sc, index, 0, domain, &bit);
}

static size_t outputs(ec_slave_config_t* sc) { return offset_of(sc, 0x6040) == 0 ? ecrt_domain_size(domain) : 0; }

static int without_a_change(size_t* octets) {
    ec_slave_config_t* const sc = configure();
    CHECK(sc != NULL);
    *octets = outputs(sc);
    CHECK(*octets > 2);
    ecrt_release_master(master);
    return 0;
}

/* With the SyncManager set, or not. */
static int one_more_pdo(size_t before, int set) {
    ec_slave_config_t* const sc = configure();
    CHECK(sc != NULL);
    if (set) CHECK(ecrt_slave_config_sync_manager(sc, 2, EC_DIR_OUTPUT, EC_WD_DEFAULT) == 0);
    CHECK(ecrt_slave_config_pdo_assign_add(sc, 2, 0x1601) == 0);
    CHECK(outputs(sc) > before);
    ecrt_release_master(master);
    return 0;
}

static int one_more_entry(size_t before) {
    ec_slave_config_t* const sc = configure();
    CHECK(sc != NULL);
    CHECK(ecrt_slave_config_pdo_mapping_add(sc, 0x1777, 0x60FF, 0, 32) == -ENOENT);
    CHECK(ecrt_slave_config_pdo_mapping_add(sc, 0x1600, 0x2FFF, 0, 32) == 0);
    CHECK(outputs(sc) == before + 4);
    CHECK(offset_of(sc, 0x2FFF) == (int)before);
    ecrt_release_master(master);
    return 0;
}

static int another_mapping(void) {
    ec_slave_config_t* const sc = configure();
    CHECK(sc != NULL);
    CHECK(ecrt_slave_config_pdo_mapping_clear(sc, 0x1600) == 0);
    CHECK(ecrt_slave_config_pdo_mapping_add(sc, 0x1600, 0x6040, 0, 16) == 0);
    CHECK(outputs(sc) == 2);
    ecrt_release_master(master);
    return 0;
}

static int refused_lists(size_t before) {
    const ec_sync_info_t invalid[] = {{2, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT},
                                      {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT}};
    const ec_sync_info_t too_high[] = {{17, EC_DIR_OUTPUT, 0, NULL, EC_WD_DEFAULT},
                                       {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT}};
    const ec_sync_info_t second[] = {{2, EC_DIR_OUTPUT, 0, NULL, EC_WD_DEFAULT},
                                     {3, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT},
                                     {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT}};
    ec_slave_config_t* const sc = configure();
    CHECK(sc != NULL);
    CHECK(ecrt_slave_config_pdos(sc, EC_END, invalid) == -EINVAL);
    CHECK(ecrt_slave_config_pdos(sc, EC_END, too_high) == -ENOENT);
    CHECK(ecrt_slave_config_pdos(sc, EC_END, second) == -EINVAL);
    CHECK(outputs(sc) == before);
    ecrt_release_master(master);
    return 0;
}

/* The slave comes to OP, and nothing is said about the domains. */
static int domains_without_entries(void) {
    ec_slave_config_t* const sc = configure();
    ec_domain_t* const second = ecrt_master_create_domain(master);
    int n, good = 0;
    CHECK(sc != NULL && second != NULL);
    CHECK(ecrt_master_activate(master) == 0);
    for (n = 0; n < 20000 && good < 200; ++n) {
        ec_slave_config_state_t state;
        next_cycle();
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_process(second);
        ecrt_slave_config_state(sc, &state);
        good += state.operational;
        ecrt_domain_queue(domain);
        ecrt_domain_queue(second);
        ecrt_master_send(master);
    }
    CHECK(good == 200);
    ecrt_release_master(master);
    return 0;
}

int main(void) {
    size_t before = 0;
    if (without_a_change(&before) != 0) return 1;
    if (one_more_pdo(before, 0) != 0 || one_more_pdo(before, 1) != 0) return 1;
    if (one_more_entry(before) != 0 || another_mapping() != 0) return 1;
    if (refused_lists(before) != 0) return 1;
    return domains_without_entries();
}
