/* A device is connected before the configured one while the program configures. A PDO without a list has the entries of
 * the configured device, and not of the one that has its place now. Ends with 0 when everything is as expected. */
#include <check.h>
#include <cycle.h>

#include <ecrt.h>
#include <stdio.h>

int main(void) {
    ec_master_t* const master = ecrt_request_master(0);
    CHECK(master != NULL);
    ec_domain_t* const domain = ecrt_master_create_domain(master);
    ec_slave_config_t* const drive = ecrt_master_slave_config(master, 7, 0, 0x4D47, 0x5402);
    ec_pdo_info_t pdo = {0x1A00, 0, NULL};
    const ec_sync_info_t syncs[] = {{3, EC_DIR_INPUT, 1, &pdo, EC_WD_DISABLE},
                                    {0xFF, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT}};
    CHECK(domain != NULL && drive != NULL);
    CHECK(ecrt_slave_config_pdos(drive, EC_END, syncs) == 0);

    ec_master_info_t info;
    unsigned ms = 0;
    for (; ms < 10000; ++ms) { /* the device comes, and the segment is scanned again */
        CHECK(ecrt_master(master, &info) == 0);
        if (info.scan_busy) break;
        next_cycle();
    }
    CHECK(info.scan_busy && ms > 0);
    unsigned bit = 99;
    const int at = ecrt_slave_config_reg_pdo_entry(drive, 0x6041, 0, domain, &bit);
    CHECK(ecrt_master(master, &info) == 0);
    CHECK(info.slave_count == 3);
    CHECK(at == 0 && bit == 0);
    ec_slave_info_t slave;
    CHECK(ecrt_master_get_slave(master, 2, &slave) == 0 && slave.alias == 7);
    /* The whole PDO of the drive, and not the 6 octets of the other device. */
    const unsigned size = (unsigned)ecrt_domain_size(domain);
    CHECK(size == 20);
    ecrt_release_master(master);
    printf("the entries are those of the drive\n");
    return 0;
}
