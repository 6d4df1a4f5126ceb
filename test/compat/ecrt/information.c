/* Opens a master for reading, and lists slaves, SyncManagers, PDOs and entries, as tools and binding generators do.
 * Ends with 0 when the list agrees with the segment of its arguments: the number of slaves, and of entries. */
#include <ecrt.h>
#include <errno.h>
#include <stdio.h>

int main(int argc, char** argv) {
    ec_master_t* master = ecrt_open_master(0);
    ec_master_info_t info;
    ec_slave_info_t slave;
    ec_sync_info_t sync;
    unsigned int entries = 0;
    if (!master || ecrt_master(master, &info)) return 1;
    printf("%u slaves, scan %s\n", info.slave_count, info.scan_busy ? "busy" : "over");
    for (uint16_t pos = 0; pos < info.slave_count; ++pos) {
        if (ecrt_master_get_slave(master, pos, &slave)) return 1;
        printf("%u %u: 0x%08x 0x%08x %s, %u SyncManagers, AL state %u\n", slave.alias, slave.position, slave.vendor_id,
               slave.product_code, slave.name, slave.sync_count, slave.al_state);
        if (slave.position != pos || slave.al_state != EC_AL_STATE_PREOP || slave.error_flag) return 2;
        for (uint8_t s = 0; s < slave.sync_count; ++s) {
            if (ecrt_master_get_sync_manager(master, pos, s, &sync)) return 1;
            printf("  SM%u %s, %u PDOs\n", sync.index, sync.dir == EC_DIR_OUTPUT ? "output" : "input", sync.n_pdos);
            for (uint16_t p = 0; p < sync.n_pdos; ++p) {
                ec_pdo_info_t pdo;
                if (ecrt_master_get_pdo(master, pos, s, p, &pdo)) return 1;
                printf("    PDO 0x%04x\n", pdo.index);
                for (uint16_t e = 0; e < pdo.n_entries; ++e) {
                    ec_pdo_entry_info_t entry;
                    if (ecrt_master_get_pdo_entry(master, pos, s, p, e, &entry)) return 1;
                    printf("      0x%04x:%02x %u bits\n", entry.index, entry.subindex, entry.bit_length);
                    ++entries;
                }
                if (ecrt_master_get_pdo_entry(master, pos, s, p, (uint16_t)pdo.n_entries, NULL) != -ENOENT) return 2;
            }
        }
        if (ecrt_master_get_sync_manager(master, pos, slave.sync_count, &sync) != -ENOENT) return 2;
    }
    if (ecrt_master_get_slave(master, (uint16_t)info.slave_count, &slave) != -ENOENT) return 2;
    ecrt_release_master(master);
    printf("%u entries\n", entries);
    return argc == 3 && (info.slave_count != strtoul(argv[1], NULL, 10) || entries != strtoul(argv[2], NULL, 10)) ? 3
                                                                                                                  : 0;
}
