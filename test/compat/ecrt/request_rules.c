/* The timeout of a request counts from its start on, also while the segment does not start up because nobody cycles.
 * A register is read and written by one datagram. */
#include "check.h"
#include "cycle.h"

#include <ecrt.h>

#include <stdio.h>

#define USER_RAM 0x0F80

static ec_master_t* master;

static ec_request_state_t wait_for(ec_reg_request_t* request) {
    int n;
    for (n = 0; n < 20000 && ecrt_reg_request_state(request) == EC_REQUEST_BUSY; ++n) {
        next_cycle();
        ecrt_master_receive(master);
        ecrt_master_send(master);
    }
    return ecrt_reg_request_state(request);
}

static int exchanges(ec_reg_request_t* request, uint16_t before, uint16_t after) {
    EC_WRITE_U16(ecrt_reg_request_data(request), after);
    ecrt_reg_request_readwrite(request, USER_RAM, 2);
    CHECK(wait_for(request) == EC_REQUEST_SUCCESS);
    CHECK(EC_READ_U16(ecrt_reg_request_data(request)) == before);
    ecrt_reg_request_read(request, USER_RAM, 2);
    CHECK(wait_for(request) == EC_REQUEST_SUCCESS);
    CHECK(EC_READ_U16(ecrt_reg_request_data(request)) == after);
    return 0;
}

int main(void) {
    ec_slave_info_t info;
    ec_slave_config_t *sc, *absent;
    ec_sdo_request_t *patient, *impatient;
    ec_reg_request_t *reg, *nowhere;
    int n;
    master = ecrt_request_master(0);
    CHECK(master != NULL);
    CHECK(ecrt_master_get_slave(master, 0, &info) == 0);
    sc = ecrt_master_slave_config(master, 0, 0, info.vendor_id, info.product_code);
    absent = ecrt_master_slave_config(master, 0, 9, info.vendor_id, info.product_code);
    CHECK(sc != NULL && absent != NULL);
    patient = ecrt_slave_config_create_sdo_request(sc, 0x1018, 1, 4);
    impatient = ecrt_slave_config_create_sdo_request(sc, 0x1018, 1, 4);
    reg = ecrt_slave_config_create_reg_request(sc, 4);
    nowhere = ecrt_slave_config_create_reg_request(absent, 4);
    CHECK(patient != NULL && impatient != NULL && reg != NULL && nowhere != NULL);
    EC_WRITE_U16(ecrt_reg_request_data(reg), 0);
    ecrt_reg_request_write(reg, USER_RAM, 2);
    CHECK(wait_for(reg) == EC_REQUEST_SUCCESS);
    CHECK(exchanges(reg, 0, 0x1234) == 0);
    ecrt_reg_request_readwrite(reg, USER_RAM, 5);
    CHECK(ecrt_reg_request_state(reg) == EC_REQUEST_ERROR);
    ecrt_reg_request_readwrite(nowhere, USER_RAM, 2);
    CHECK(wait_for(nowhere) == EC_REQUEST_ERROR);

    CHECK(ecrt_master_activate(master) == 0);
    ecrt_sdo_request_timeout(impatient, 20);
    ecrt_sdo_request_read(patient);
    ecrt_sdo_request_read(impatient);
    EC_WRITE_U16(ecrt_reg_request_data(reg), 0x5678);
    ecrt_reg_request_readwrite(reg, USER_RAM, 2);
    for (n = 0; n < 20000 && ecrt_sdo_request_state(impatient) == EC_REQUEST_BUSY; ++n) next_cycle();
    CHECK(ecrt_sdo_request_state(impatient) == EC_REQUEST_ERROR);
    CHECK(ecrt_sdo_request_state(patient) == EC_REQUEST_BUSY);
    CHECK(ecrt_reg_request_state(reg) == EC_REQUEST_BUSY);
    /* With cycles all begins. */
    CHECK(wait_for(reg) == EC_REQUEST_SUCCESS);
    CHECK(EC_READ_U16(ecrt_reg_request_data(reg)) == 0x1234);
    for (n = 0; n < 20000 && ecrt_sdo_request_state(patient) == EC_REQUEST_BUSY; ++n) {
        next_cycle();
        ecrt_master_receive(master);
        ecrt_master_send(master);
    }
    CHECK(ecrt_sdo_request_state(patient) == EC_REQUEST_SUCCESS);
    CHECK(EC_READ_U32(ecrt_sdo_request_data(patient)) == info.vendor_id);
    CHECK(exchanges(reg, 0x5678, 0x9ABC) == 0);
    ecrt_release_master(master);
    return 0;
}
