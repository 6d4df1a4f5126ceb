/* Two masters in one program, each cycled by a thread of its own, while a third thread reads objects of both. Each master is activated,
 * deactivated, activated with another configuration and released while its slaves are in OP. Then calls with arguments that do not
 * exist: each returns an error of the interface. */
#include "cycle.h"

#include <ecrt.h>

#include <errno.h>
#include <pthread.h>
#include <stdio.h>

static volatile int wrong;
#define MUST(condition)                                                     \
    do {                                                                    \
        if (!(condition)) {                                                 \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
            wrong = wrong + 1;                                              \
        }                                                                   \
    } while (0)

static ec_master_t* masters[2];
static volatile int stop_reading;
static volatile int objects_read;

static void* read_objects(void* unused) {
    (void)unused;
    while (!stop_reading) {
        int n;
        for (n = 0; n < 2; ++n) {
            ec_master_info_t info;
            ec_slave_info_t slave;
            uint32_t type = 0, abort_code = 0;
            size_t size = 0;
            MUST(ecrt_master(masters[n], &info) == 0);
            if (ecrt_master_get_slave(masters[n], 0, &slave) != 0) continue;
            if (ecrt_master_sdo_upload(masters[n], 0, 0x1000, 0, (uint8_t*)&type, sizeof type, &size, &abort_code) == 0 && size == 4)
                objects_read = objects_read + 1;
        }
        next_cycle();
    }
    return NULL;
}

/* Activates the master with the domain, and cycles until the slave is in OP and some cycles more. */
static int operate(ec_master_t* master, ec_domain_t* domain, ec_slave_config_t* sc) {
    int n, good = 0;
    if (ecrt_master_activate(master) != 0 || ecrt_domain_data(domain) == NULL) return 0;
    for (n = 0; n < 8000 && good < 50; ++n) {
        ec_slave_config_state_t slave;
        ec_domain_state_t state;
        next_cycle();
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_state(domain, &state);
        ecrt_slave_config_state(sc, &slave);
        good += slave.operational && state.wc_state == EC_WC_COMPLETE;
        ecrt_master_application_time(master, now_ns());
        ecrt_master_sync_reference_clock(master);
        ecrt_master_sync_slave_clocks(master);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
    }
    return good >= 50;
}

static void* drive(void* argument) {
    ec_master_t* master = masters[*(int*)argument];
    int round;
    for (round = 0; round < 3; ++round) {
        unsigned int bit = 0;
        int at;
        ec_slave_info_t info;
        ec_slave_config_t* sc;
        ec_domain_t* domain = ecrt_master_create_domain(master);
        MUST(domain != NULL);
        MUST(ecrt_master_get_slave(master, 0, &info) == 0);
        sc = ecrt_master_slave_config(master, 0, 0, info.vendor_id, info.product_code);
        MUST(sc != NULL);
        if (domain == NULL || sc == NULL) return NULL;
        MUST(ecrt_master_slave_config(master, 0, 0, info.vendor_id, info.product_code) == sc);
        MUST(ecrt_master_slave_config(master, 0, 0, info.vendor_id + 1, info.product_code) == NULL);
        at = ecrt_slave_config_reg_pdo_entry(sc, 0x6041, 0, domain, &bit);
        MUST(at >= 0 && bit == 0);
        MUST(ecrt_slave_config_reg_pdo_entry(sc, 0x6041, 0, domain, NULL) == at);
        MUST(ecrt_slave_config_reg_pdo_entry(sc, 0x1234, 5, domain, NULL) == -ENOENT);
        MUST(operate(master, domain, sc));
        if (round < 2) ecrt_master_deactivate(master);
    }
    return NULL;
}

/* Arguments that do not exist. */
static void wrong_arguments(ec_master_t* master) {
    ec_slave_info_t slave;
    ec_sync_info_t sync;
    ec_pdo_info_t pdo;
    ec_pdo_entry_info_t entry;
    ec_master_link_state_t link;
    ec_slave_config_state_t state;
    ec_slave_config_t* absent = ecrt_master_slave_config(master, 77, 300, 0xE000, 1);
    ec_domain_t* domain = ecrt_master_create_domain(master);
    uint8_t octets[4] = {0};
    size_t size = 0;
    uint32_t code = 0;
    uint16_t soe = 0;
    MUST(ecrt_master_get_slave(master, 0xFFFF, &slave) == -ENOENT);
    MUST(ecrt_master_get_sync_manager(master, 0xFFFF, 0, &sync) < 0);
    MUST(ecrt_master_get_sync_manager(master, 0, 200, &sync) < 0);
    MUST(ecrt_master_get_pdo(master, 0, 200, 0, &pdo) < 0);
    MUST(ecrt_master_get_pdo(master, 0, 2, 0xFFFF, &pdo) < 0);
    MUST(ecrt_master_get_pdo_entry(master, 0, 2, 0, 0xFFFF, &entry) < 0);
    MUST(ecrt_master_link_state(master, 9, &link) == -EINVAL);
    MUST(ecrt_master_sdo_download(master, 0xFFFF, 0x6040, 0, octets, 2, &code) == -EINVAL);
    MUST(ecrt_master_sdo_download(master, 0, 0x1000, 0, octets, 4, &code) < 0 && code != 0);
    MUST(ecrt_master_sdo_download_complete(master, 0xFFFF, 0x6040, octets, 2, &code) < 0);
    MUST(ecrt_master_sdo_upload(master, 0, 0x1000, 0, octets, 1, &size, &code) == -EOVERFLOW && size == 0);
    MUST(ecrt_master_read_idn(master, 0xFFFF, 0, 1, octets, sizeof octets, &size, &soe) < 0);
    MUST(ecrt_master_write_idn(master, 0, 9, 1, octets, 2, &soe) < 0);
    MUST(ecrt_master_sdo_upload(master, 99, 0x1000, 0, octets, sizeof octets, &size, &code) == -EINVAL);
    MUST(absent != NULL && domain != NULL);
    if (absent == NULL || domain == NULL) return;
    MUST(ecrt_slave_config_sync_manager(absent, 200, EC_DIR_INPUT, EC_WD_DEFAULT) < 0);
    MUST(ecrt_slave_config_sync_manager(absent, 2, EC_DIR_INVALID, EC_WD_DEFAULT) == -EINVAL);
    MUST(ecrt_slave_config_pdo_assign_add(absent, 200, 0x1600) < 0);
    MUST(ecrt_slave_config_pdo_mapping_add(absent, 0x1777, 0x6040, 0, 16) < 0);
    MUST(ecrt_slave_config_reg_pdo_entry(absent, 0x6041, 0, domain, NULL) < 0);
    MUST(ecrt_slave_config_reg_pdo_entry_pos(absent, 200, 0, 0, domain, NULL) < 0);
    MUST(ecrt_slave_config_state(absent, &state) == 0 && state.online == 0);
    MUST(ecrt_domain_size(domain) == 0);
    MUST(ecrt_master_receive(master) == 0 && ecrt_master_send(master) == 0 && ecrt_domain_process(domain) == 0);
    MUST(ecrt_request_master(0) == NULL && ecrt_request_master(31) == NULL && ecrt_request_master(100000) == NULL);
}

int main(void) {
    pthread_t threads[2], reader;
    static int numbers[2] = {0, 1};
    int n;
    for (n = 0; n < 2; ++n) {
        masters[n] = ecrt_request_master((unsigned int)n);
        if (masters[n] == NULL) return 1;
    }
    pthread_create(&reader, NULL, read_objects, NULL);
    for (n = 0; n < 2; ++n) pthread_create(&threads[n], NULL, drive, &numbers[n]);
    for (n = 0; n < 2; ++n) pthread_join(threads[n], NULL);
    stop_reading = 1;
    /* Nobody cycles any more: the transfer of the reader ends when the master is not active. */
    for (n = 0; n < 2; ++n) ecrt_master_deactivate(masters[n]);
    pthread_join(reader, NULL);
    for (n = 0; n < 2; ++n) wrong_arguments(masters[n]);
    for (n = 0; n < 2; ++n) ecrt_release_master(masters[n]);
    masters[0] = ecrt_request_master(0);
    MUST(masters[0] != NULL);
    ecrt_release_master(masters[0]);
    ecrt_release_master(NULL);
    printf("%d objects read, %d wrong\n", objects_read, wrong);
    return wrong == 0 && objects_read > 0 ? 0 : 1;
}
