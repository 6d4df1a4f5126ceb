/* What goes to stderr: slaves have the positions of the interface, a missing one without a position has its alias, and
 * a domain without entries beside one with entries is no error. Requests that fail, and calls that are refused, name
 * their configuration, also directly before the end of the master. The test reads stderr; this program checks what
 * works meanwhile. */
#include "cycle.h"

#include <ecrt.h>

#include <stdint.h>
#include <stdio.h>

int main(void) {
    ec_master_t* master = ecrt_request_master(0);
    ec_domain_t *domain, *empty;
    ec_slave_config_t *drive, *far_off, *by_alias;
    ec_slave_config_state_t state = {0};
    ec_sdo_request_t* sdo;
    ec_reg_request_t* reg;
    ec_sdo_request_t* missing[24]; /* all of them fail at the same time */
    ec_domain_state_t of_domain = {0}, of_empty = {0};
    uint8_t octets[4];
    size_t size = 0;
    uint32_t abort_code = 0;
    int n;
    if (master == NULL) return 1;
    if (ecrt_master_sdo_upload(master, 1, 0x9999, 1, octets, sizeof octets, &size, &abort_code) == 0) return 1;
    domain = ecrt_master_create_domain(master);
    empty = ecrt_master_create_domain(master);
    drive = ecrt_master_slave_config(master, 0, 0, 0x4d47, 0x5402);
    far_off = ecrt_master_slave_config(master, 0, 5, 0x4d47, 0x5402);
    by_alias = ecrt_master_slave_config(master, 55, 0, 0x4d47, 0x1008);
    if (domain == NULL || empty == NULL || drive == NULL || far_off == NULL || by_alias == NULL) return 1;
    if (ecrt_slave_config_reg_pdo_entry(drive, 0x6041, 0, domain, NULL) < 0) return 1;
    if (ecrt_slave_config_state_timeout(drive, EC_AL_STATE_INIT, EC_AL_STATE_OP, 100) == 0) return 1;
    if (ecrt_slave_config_create_sdo_request(far_off, 0x9998, 2, SIZE_MAX) != NULL) return 1;
    sdo = ecrt_slave_config_create_sdo_request(drive, 0x9998, 2, 4);
    reg = ecrt_slave_config_create_reg_request(drive, 2);
    if (sdo == NULL || reg == NULL) return 1;
    for (n = 0; n < 24; ++n) {
        missing[n] = ecrt_slave_config_create_sdo_request(far_off, 0x9000, (uint8_t)n, 4);
        if (missing[n] == NULL) return 1;
    }
    if (ecrt_master_activate(master) != 0) return 1;
    for (n = 0; n < 8000 && !(state.operational && of_domain.wc_state == EC_WC_COMPLETE); ++n) {
        next_cycle();
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_process(empty);
        ecrt_slave_config_state(drive, &state);
        ecrt_domain_state(domain, &of_domain);
        ecrt_domain_state(empty, &of_empty);
        ecrt_domain_queue(domain);
        ecrt_domain_queue(empty);
        ecrt_master_send(master);
    }
    for (n = 0; n < 3; ++n) {
        ecrt_sdo_request_read(sdo);
        while (ecrt_sdo_request_state(sdo) == EC_REQUEST_BUSY) {
            next_cycle();
            ecrt_master_receive(master);
            ecrt_master_send(master);
        }
        if (ecrt_sdo_request_state(sdo) != EC_REQUEST_ERROR) return 1;
    }
    for (n = 0; n < 200; ++n) next_cycle(); /* the lines of stderr come from a thread of their own */
    for (n = 0; n < 24; ++n) {
        ecrt_sdo_request_read(missing[n]);
        if (ecrt_sdo_request_state(missing[n]) != EC_REQUEST_ERROR) return 1;
    }
    for (n = 0; n < 2; ++n) { /* again after a success */
        ecrt_reg_request_readwrite(reg, 0x0F80, 3);
        if (ecrt_reg_request_state(reg) != EC_REQUEST_ERROR) return 1;
        if (n == 1) break;
        ecrt_reg_request_readwrite(reg, 0x0F80, 2);
        while (ecrt_reg_request_state(reg) == EC_REQUEST_BUSY) {
            next_cycle();
            ecrt_master_receive(master);
            ecrt_master_send(master);
        }
        if (ecrt_reg_request_state(reg) != EC_REQUEST_SUCCESS) return 1;
    }
    ecrt_release_master(master);
    if (!state.operational || of_domain.wc_state != EC_WC_COMPLETE || of_empty.wc_state != EC_WC_ZERO) return 1;
    fprintf(stderr, "everything was said\n");
    return 0;
}
