/* A cyclic thread, which polls SDO and register requests, and a second thread, which reads and writes objects and
 * waits for them. Ends with 0 when all transfers have the expected results and no cycle was incomplete meanwhile. */
#define _POSIX_C_SOURCE 200809L

#include "cycle.h"

#include <ecrt.h>
#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>

#define DRIVE 0x00004D47, 0x5402

static ec_master_t* master;
static ec_domain_t* domain;
static ec_slave_config_t* sc;
static ec_sdo_request_t *sdo, *wrong;
static ec_reg_request_t* reg;

/* Shared with the second thread. */
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static int running, stop, lost;

static int is_stopped(void) {
    int result;
    pthread_mutex_lock(&mutex);
    result = stop;
    pthread_mutex_unlock(&mutex);
    return result;
}

static unsigned int sdo_ended, sdo_right, wrong_ended, reg_ended;

static void poll_requests(void) {
    switch (ecrt_sdo_request_state(sdo)) {
        case EC_REQUEST_UNUSED: ecrt_sdo_request_read(sdo); break;
        case EC_REQUEST_BUSY: break;
        case EC_REQUEST_SUCCESS:
            ++sdo_ended;
            sdo_right += ecrt_sdo_request_data_size(sdo) == 4 && EC_READ_U32(ecrt_sdo_request_data(sdo)) == 0x00004D47;
            ecrt_sdo_request_read(sdo);
            break;
        case EC_REQUEST_ERROR: ++sdo_ended; break;
    }
    if (ecrt_sdo_request_state(wrong) == EC_REQUEST_ERROR) ++wrong_ended;
    if (ecrt_sdo_request_state(wrong) != EC_REQUEST_BUSY) ecrt_sdo_request_write(wrong);
    if (ecrt_reg_request_state(reg) == EC_REQUEST_SUCCESS && EC_READ_U16(ecrt_reg_request_data(reg)) == 0x0008)
        ++reg_ended;
    if (ecrt_reg_request_state(reg) != EC_REQUEST_BUSY) ecrt_reg_request_read(reg, 0x0130, 2);
}

static void* cyclic_thread(void* unused) {
    unsigned int good = 0;
    (void)unused;
    while (!is_stopped()) {
        ec_domain_state_t ds;
        ec_slave_config_state_t state;
        next_cycle();
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_state(domain, &ds);
        ecrt_slave_config_state(sc, &state);
        if (good >= 50) {
            poll_requests();
            if (ds.wc_state != EC_WC_COMPLETE) ++lost;
        } else {
            good = ds.wc_state == EC_WC_COMPLETE && state.operational ? good + 1 : 0;
        }
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
        pthread_mutex_lock(&mutex);
        running = good >= 50;
        pthread_mutex_unlock(&mutex);
    }
    return NULL;
}

/* Transfers of the second thread; the same before and after activation. */
static int transfers(void) {
    uint8_t value[8] = {0};
    uint8_t small[2];
    size_t size = 0;
    uint32_t abort_code = 1;
    const uint8_t acceleration[4] = {0x10, 0x27, 0, 0};
    if (ecrt_master_sdo_upload(master, 0, 0x1018, 2, value, sizeof value, &size, &abort_code)) return 1;
    if (size != 4 || EC_READ_U32(value) != 0x5402 || abort_code != 0) return 2;
    if (ecrt_master_sdo_download(master, 0, 0x6083, 0, acceleration, 4, &abort_code) || abort_code != 0) return 3;
    if (ecrt_master_sdo_upload(master, 0, 0x6083, 0, value, sizeof value, &size, &abort_code)) return 4;
    if (EC_READ_U32(value) != 10000) return 5;
    /* An object that is not there, too little room, a slave that is not there. */
    if (ecrt_master_sdo_upload(master, 0, 0x5555, 0, value, sizeof value, &size, &abort_code) != -EIO) return 6;
    if (abort_code != 0x06020000 || size != 0) return 7;
    if (ecrt_master_sdo_upload(master, 0, 0x1018, 2, small, sizeof small, &size, &abort_code) != -EOVERFLOW) return 8;
    if (ecrt_master_sdo_upload(master, 9, 0x1018, 2, value, sizeof value, &size, &abort_code) != -EINVAL) return 9;
    return 0;
}

int main(void) {
    pthread_t thread;
    ec_slave_info_t info;
    int result, alive = 0;
    if (!(master = ecrt_request_master(0)) || ecrt_request_master(0)) return 1;
    if ((result = transfers()) != 0) {
        fprintf(stderr, "before activation: %d\n", result);
        return 2;
    }
    domain = ecrt_master_create_domain(master);
    sc = ecrt_master_slave_config(master, 0, 0, DRIVE);
    if (!domain || !sc || ecrt_slave_config_reg_pdo_entry(sc, 0x6040, 0, domain, NULL) < 0 ||
        ecrt_slave_config_reg_pdo_entry(sc, 0x6041, 0, domain, NULL) < 0)
        return 1;
    if (ecrt_master_slave_config(master, 0, 0, DRIVE) != sc || ecrt_master_slave_config(master, 0, 0, 1, 2)) return 1;
    sdo = ecrt_slave_config_create_sdo_request(sc, 0x1018, 1, 4);
    wrong = ecrt_slave_config_create_sdo_request(sc, 0x5555, 0, 2);
    reg = ecrt_slave_config_create_reg_request(sc, 2);
    if (!sdo || !wrong || !reg) return 1;
    ecrt_sdo_request_timeout(sdo, 5000);
    if (ecrt_sdo_request_state(sdo) != EC_REQUEST_UNUSED) return 1;
    if (ecrt_master_activate(master) || !ecrt_domain_data(domain)) return 1;
    if (pthread_create(&thread, NULL, cyclic_thread, NULL)) return 1;
    for (int n = 0; n < 20000 && !alive; ++n) {
        next_cycle();
        pthread_mutex_lock(&mutex);
        alive = running;
        pthread_mutex_unlock(&mutex);
    }
    result = alive ? 0 : 100;
    for (int n = 0; n < 3 && result == 0; ++n) result = transfers();
    if (result == 0 && (ecrt_master_get_slave(master, 0, &info) || info.al_state != EC_AL_STATE_OP)) result = 101;
    pthread_mutex_lock(&mutex);
    stop = 1;
    pthread_mutex_unlock(&mutex);
    pthread_join(thread, NULL);
    printf("%u SDO requests, %u right, %u refused ones, %u registers, %d incomplete cycles, result %d\n", sdo_ended,
           sdo_right, wrong_ended, reg_ended, lost, result);
    if (result != 0) return 3;
    if (sdo_ended == 0 || sdo_right != sdo_ended || wrong_ended == 0 || reg_ended == 0) return 4;
    if (lost != 0) return 5;
    ecrt_release_master(master);
    return 0;
}
