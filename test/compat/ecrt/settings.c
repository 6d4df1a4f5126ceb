/* Settings that go to the slave as the program states them: the watchdog, the number of emergencies that are kept, and
 * two configurations for one device. Ends with 0 when everything is as expected. */
#include "cycle.h"

#include <ecrt.h>
#include <errno.h>
#include <stdio.h>

#include "check.h"

#define DRIVE 0x00004D47, 0x5402

static ec_master_t* master;
static ec_domain_t* domain;

static void cycle(void) {
    next_cycle();
    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
}

static unsigned int read_register(ec_reg_request_t* request, uint16_t address) {
    ecrt_reg_request_read(request, address, 2);
    for (unsigned int n = 0; n < 1000 && ecrt_reg_request_state(request) == EC_REQUEST_BUSY; ++n) cycle();
    if (ecrt_reg_request_state(request) != EC_REQUEST_SUCCESS) return 0xFFFFFFFFU;
    return EC_READ_U16(ecrt_reg_request_data(request));
}

/* The drive sends an emergency before each answer. */
static int cause_emergency(ec_sdo_request_t* fault) {
    ecrt_sdo_request_read(fault);
    for (unsigned int n = 0; n < 5000 && ecrt_sdo_request_state(fault) == EC_REQUEST_BUSY; ++n) cycle();
    for (unsigned int n = 0; n < 50; ++n) cycle();
    return ecrt_sdo_request_state(fault) == EC_REQUEST_SUCCESS;
}

int main(void) {
    static const uint16_t dividers[3] = {10, 1, 0}, intervals[3] = {1001, 4, 30000};
    static const uint16_t addresses[3][2] = {{0, 0}, {0, 1}, {0, 2}};
    ec_slave_config_t *configs[3], *twice;
    ec_reg_request_t* requests[3];
    ec_slave_config_state_t state, other;
    ec_domain_state_t ds;
    ec_sdo_request_t* fault;
    uint8_t message[EC_COE_EMERGENCY_MSG_SIZE];
    unsigned int up = 0;
    if (!(master = ecrt_request_master(0)) || !(domain = ecrt_master_create_domain(master))) return 2;
    for (int n = 0; n < 3; ++n) {
        configs[n] = ecrt_master_slave_config(master, addresses[n][0], addresses[n][1], DRIVE);
        requests[n] = ecrt_slave_config_create_reg_request(configs[n], 2);
        CHECK(requests[n] != NULL && ecrt_slave_config_watchdog(configs[n], dividers[n], intervals[n]) == 0);
        CHECK(ecrt_slave_config_reg_pdo_entry(configs[n], 0x6040, 0, domain, NULL) >= 0);
    }
    twice = ecrt_master_slave_config(master, 16, 0, DRIVE); /* the alias of the second drive */
    CHECK(twice != NULL && ecrt_slave_config_reg_pdo_entry(twice, 0x6041, 0, domain, NULL) >= 0);
    CHECK((fault = ecrt_slave_config_create_sdo_request(configs[2], 0x6041, 0, 2)) != NULL);
    CHECK(ecrt_slave_config_emerg_size(configs[2], 2) == 0);
    CHECK(ecrt_master_activate(master) == 0);
    for (int n = 0; n < 20000 && up < 3; ++n) {
        cycle();
        up = 0;
        for (int i = 0; i < 3; ++i) {
            ecrt_slave_config_state(configs[i], &state);
            up += state.al_state >= (dividers[i] != 0 ? EC_AL_STATE_SAFEOP : EC_AL_STATE_OP);
        }
    }
    CHECK(up == 3);
    for (unsigned int n = 0; n < 100; ++n) cycle();
    /* Short watchdogs keep the first two drives in SAFEOP. The first configuration has the device; the other one waits.
     */
    ecrt_slave_config_state(twice, &other);
    ecrt_domain_state(domain, &ds);
    CHECK(!other.online && !other.operational);
    CHECK(ds.wc_state == EC_WC_INCOMPLETE);
    for (int n = 0; n < 3; ++n) {
        if (dividers[n] != 0) CHECK(read_register(requests[n], 0x0400) == dividers[n]);
        CHECK(read_register(requests[n], 0x0420) == intervals[n]);
    }
    /* The ring keeps the oldest ones. */
    CHECK(ecrt_slave_config_emerg_clear(configs[2]) == 0 && ecrt_slave_config_emerg_overruns(configs[2]) == 0);
    for (int n = 0; n < 5; ++n) CHECK(cause_emergency(fault));
    CHECK(ecrt_slave_config_emerg_pop(configs[2], message) == 0);
    CHECK(ecrt_slave_config_emerg_pop(configs[2], message) == 0);
    CHECK(ecrt_slave_config_emerg_pop(configs[2], message) == -ENOENT);
    CHECK(ecrt_slave_config_emerg_overruns(configs[2]) == 3);
    CHECK(ecrt_slave_config_emerg_clear(configs[2]) == 0 && ecrt_slave_config_emerg_overruns(configs[2]) == 0);
    ecrt_release_master(master);
    return 0;
}
