/* Transfers to a slave that never answers end with -EIO, and requests with an error after their timeout; those of the
 * other slave go on. Ends with 0 when everything is as expected. */
#include "cycle.h"

#include <ecrt.h>
#include <errno.h>
#include <stdio.h>

#include "check.h"

#define DRIVE 0x00004D47, 0x5402

static int transfers(ec_master_t* master) {
    uint8_t value[4] = {0};
    size_t size = 99;
    uint32_t abort_code = 99;
    CHECK(ecrt_master_sdo_upload(master, 1, 0x1018, 1, value, sizeof(value), &size, &abort_code) == -EIO);
    CHECK(size == 0 && abort_code == 0);
    abort_code = 99;
    CHECK(ecrt_master_sdo_download(master, 1, 0x6060, 0, value, 1, &abort_code) == -EIO);
    CHECK(abort_code == 0);
    CHECK(ecrt_master_sdo_upload(master, 0, 0x1018, 1, value, sizeof(value), &size, &abort_code) == 0);
    CHECK(size == 4 && EC_READ_U32(value) == 0x00004D47);
    return 0;
}

static ec_request_state_t end_of(ec_master_t* master, ec_domain_t* domain, ec_sdo_request_t* request) {
    for (unsigned int n = 0; n < 5000 && ecrt_sdo_request_state(request) == EC_REQUEST_BUSY; ++n) {
        next_cycle();
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }
    return ecrt_sdo_request_state(request);
}

int main(void) {
    ec_slave_config_t *first, *second;
    ec_sdo_request_t *answered, *silent;
    ec_domain_t* domain;
    ec_master_t* master = ecrt_request_master(0);
    if (!master) return 2;
    CHECK(transfers(master) == 0);
    domain = ecrt_master_create_domain(master);
    first = ecrt_master_slave_config(master, 0, 0, DRIVE);
    second = ecrt_master_slave_config(master, 0, 1, DRIVE);
    CHECK(domain && first && second);
    CHECK(ecrt_slave_config_reg_pdo_entry(first, 0x6041, 0, domain, NULL) >= 0);
    answered = ecrt_slave_config_create_sdo_request(first, 0x1018, 1, 4);
    silent = ecrt_slave_config_create_sdo_request(second, 0x1018, 1, 4);
    CHECK(answered && silent && ecrt_sdo_request_timeout(silent, 100) == 0 &&
          ecrt_sdo_request_timeout(answered, 4000) == 0);
    CHECK(ecrt_master_activate(master) == 0);
    ecrt_sdo_request_read(silent);
    ecrt_sdo_request_read(answered);
    CHECK(end_of(master, domain, silent) == EC_REQUEST_ERROR);
    CHECK(end_of(master, domain, answered) == EC_REQUEST_SUCCESS);
    CHECK(EC_READ_U32(ecrt_sdo_request_data(answered)) == 0x00004D47);
    ecrt_release_master(master);
    return 0;
}
