/* Mailbox services beside objects: drive parameters (SoE), vendor messages (VoE), files (FoE) and emergencies. Ends
 * with 0 when each had the expected result. */
#include "cycle.h"

#include <ecrt.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>

#define DRIVE 0x00004D47, 0x5402
#define SOE_DRIVE 0x00004D47, 0x5204
#define VOE_DEVICE 0x00004D47, 0x5F0E

static ec_master_t *master;
static ec_domain_t *domain;

static void cycle(void) {
    next_cycle();
    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
}

static int soe(ec_soe_request_t *request) {
    for (int n = 0; n < 5000 && ecrt_soe_request_state(request) == EC_REQUEST_BUSY; ++n) cycle();
    return ecrt_soe_request_state(request) == EC_REQUEST_SUCCESS;
}

static int voe(ec_voe_handler_t *handler) {
    ec_request_state_t state = ecrt_voe_handler_execute(handler);
    for (int n = 0; n < 5000 && state == EC_REQUEST_BUSY; ++n) {
        cycle();
        state = ecrt_voe_handler_execute(handler);
    }
    return state == EC_REQUEST_SUCCESS;
}

static int check_voe(ec_voe_handler_t *handler) {
    uint32_t vendor = 0;
    uint16_t type = 0;
    ecrt_voe_handler_send_header(handler, 0x1234, 7);
    memcpy(ecrt_voe_handler_data(handler), "abcd", 4);
    if (ecrt_voe_handler_write(handler, 4) || !voe(handler)) return 1;
    if (ecrt_voe_handler_read(handler) || !voe(handler)) return 2;
    ecrt_voe_handler_received_header(handler, &vendor, &type);
    /* The device sends the octets back in reverse order, with the next type. */
    if (vendor != 0x1234 || type != 8 || ecrt_voe_handler_data_size(handler) != 4) return 3;
    if (memcmp(ecrt_voe_handler_data(handler), "dcba", 4) != 0) return 4;
    /* No message: an error after a while. */
    if (ecrt_voe_handler_read_nosync(handler) || voe(handler)) return 5;
    return 0;
}

static int check_soe(ec_soe_request_t *request) {
    const uint8_t *data;
    if (ecrt_soe_request_read(request) || !soe(request)) return 1;
    data = ecrt_soe_request_data(request);
    if (ecrt_soe_request_data_size(request) != 4 || EC_READ_U32(data) != 1111) return 2; /* by ecrt_slave_config_idn() */
    EC_WRITE_U32(ecrt_soe_request_data(request), 2222);
    if (ecrt_soe_request_write(request) || !soe(request)) return 3;
    EC_WRITE_U32(ecrt_soe_request_data(request), 0);
    if (ecrt_soe_request_read(request) || !soe(request)) return 4;
    if (EC_READ_U32(ecrt_soe_request_data(request)) != 2222) return 5;
    if (ecrt_soe_request_idn(request, 8, 1) != -EINVAL || ecrt_soe_request_idn(request, 0, 0x8FFF)) return 6;
    if (ecrt_soe_request_read(request) || soe(request)) return 7; /* no such parameter */
    return 0;
}

static int check_emergency(ec_slave_config_t *sc, ec_sdo_request_t *request) {
    uint8_t message[EC_COE_EMERGENCY_MSG_SIZE];
    int got = -ENOENT;
    if (ecrt_slave_config_emerg_pop(sc, message) != -ENOENT) return 1;
    EC_WRITE_U16(ecrt_sdo_request_data(request), 1);
    ecrt_sdo_request_write(request);
    for (int n = 0; n < 5000 && got != 0; ++n) {
        cycle();
        got = ecrt_slave_config_emerg_pop(sc, message);
    }
    if (got != 0) return 2;
    printf("emergency 0x%04x, register 0x%02x\n", EC_READ_U16(message), message[2]);
    if (EC_READ_U16(message) == 0 || ecrt_slave_config_emerg_overruns(sc) != 0) return 3;
    return ecrt_slave_config_emerg_clear(sc);
}

int main(void) {
    ec_slave_config_t *drive, *soe_drive, *voe_device;
    ec_soe_request_t *parameter;
    ec_voe_handler_t *vendor, *sender;
    ec_foe_request_t *file;
    ec_sdo_request_t *fault;
    ec_slave_config_state_t state;
    uint8_t window[4], value[4];
    size_t size;
    uint16_t error_code = 1;
    int result, ready = 0;
    if (!(master = ecrt_request_master(0)) || !(domain = ecrt_master_create_domain(master))) return 1;
    drive = ecrt_master_slave_config(master, 0, 0, DRIVE);
    soe_drive = ecrt_master_slave_config(master, 0, 1, SOE_DRIVE);
    voe_device = ecrt_master_slave_config(master, 0, 2, VOE_DEVICE);
    if (!drive || !soe_drive || !voe_device) return 1;
    /* S-0-0159, and the same by a transfer that waits. */
    if (ecrt_master_read_idn(master, 1, 0, 159, value, sizeof value, &size, &error_code) || size != 4) return 2;
    EC_WRITE_U32(window, 1111);
    if (ecrt_slave_config_idn(soe_drive, 0, 159, EC_AL_STATE_PREOP, window, 4)) return 2;
    if (ecrt_slave_config_idn(soe_drive, 0, 159, EC_AL_STATE_OP, window, 4) != -EINVAL) return 2;
    if (ecrt_master_write_idn(master, 1, 0, 0x8FFF, window, 4, &error_code) != -EIO || error_code == 0) return 2;
    if (ecrt_slave_config_reg_pdo_entry(drive, 0x6040, 0, domain, NULL) < 0) return 3;
    parameter = ecrt_slave_config_create_soe_request(soe_drive, 0, 159, 4);
    sender = ecrt_slave_config_create_voe_handler(voe_device, 32);
    vendor = ecrt_slave_config_create_voe_handler(voe_device, 32);
    file = ecrt_slave_config_create_foe_request(voe_device, 100);
    fault = ecrt_slave_config_create_sdo_request(drive, 0x2F00, 1, 2);
    if (!parameter || !sender || !vendor || !file || !fault || ecrt_slave_config_emerg_size(drive, 4)) return 4;
    if (ecrt_soe_request_state(parameter) != EC_REQUEST_UNUSED || ecrt_voe_handler_execute(vendor) != EC_REQUEST_UNUSED)
        return 4;
    if (ecrt_master_activate(master)) return 1;
    for (int n = 0; n < 20000 && !ready; ++n) {
        cycle();
        ecrt_slave_config_state(voe_device, &state);
        ready = state.operational;
        ecrt_slave_config_state(soe_drive, &state);
        ready = ready && state.al_state >= EC_AL_STATE_PREOP && state.online;
        ecrt_slave_config_state(drive, &state);
        ready = ready && state.operational;
    }
    if (!ready) return 5;
    if ((result = check_voe(vendor)) != 0) return 10 + result;
    /* One handler sends, another one reads; then each does both. */
    ecrt_voe_handler_send_header(sender, 0x1234, 9);
    memcpy(ecrt_voe_handler_data(sender), "12", 2);
    if (ecrt_voe_handler_write(sender, 2) || !voe(sender)) return 16;
    if (ecrt_voe_handler_read(vendor) || !voe(vendor)) return 17;
    if (memcmp(ecrt_voe_handler_data(vendor), "21", 2) != 0) return 18;
    if (check_voe(sender) != 0 || check_voe(vendor) != 0) return 19;
    if ((result = check_soe(parameter)) != 0) return 20 + result;
    if ((result = check_emergency(drive, fault)) != 0) return 30 + result;
    /* A device without FoE. */
    ecrt_foe_request_file(file, "firmware", 0);
    ecrt_foe_request_read(file);
    for (int n = 0; n < 5000 && ecrt_foe_request_state(file) == EC_REQUEST_BUSY; ++n) cycle();
    if (ecrt_foe_request_state(file) != EC_REQUEST_ERROR || ecrt_foe_request_result(file) == FOE_READY) return 40;
    ecrt_release_master(master);
    return 0;
}
