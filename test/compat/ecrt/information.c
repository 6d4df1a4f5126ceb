/* Opens a master for reading, and lists slaves, SyncManagers, PDOs and entries, as tools and binding generators do.
 * Ends with 0 when the list agrees with the segment of its arguments: the number of slaves, of entries, of ports with a
 * delay to the next clock, and of objects. */
#define _POSIX_C_SOURCE 200112L
#include <ecrt.h>
#include <errno.h>
#include <stdio.h>
#include <time.h>

/* The ports of a slave. The delay is the same at both ends. Returns how many have one; -1: something is wrong. */
static int delays_of(ec_master_t* master, const ec_slave_info_t* slave) {
    int count = 0;
    for (int port = 0; port < EC_MAX_PORTS; ++port) {
        const uint32_t delay = slave->ports[port].delay_to_next_dc;
        ec_slave_info_t next;
        int same = 0;
        if (delay == 0) continue;
        ++count;
        printf("  port %d: %u ns to the next clock, received at %u\n", port, delay, slave->ports[port].receive_time);
        if (slave->ports[port].receive_time == 0) return -1;
        for (uint16_t pos = 0; ecrt_master_get_slave(master, pos, &next) == 0; ++pos)
            for (int other = 0; other < EC_MAX_PORTS; ++other)
                same += pos != slave->position && next.ports[other].delay_to_next_dc == delay;
        if (same == 0) return -1;
    }
    return count;
}

/* Scans again, and looks how far that is. 1: as it must be. */
static int scan_again(ec_master_t* master, unsigned int slaves) {
    const struct timespec pause = {0, 1000000};
    ec_master_scan_progress_t progress;
    ec_master_info_t info;
    int busy = 0;
    if (ecrt_master_reset(master)) return 0;
    for (int n = 0; n < 5000; ++n) {
        nanosleep(&pause, NULL);
        if (ecrt_master(master, &info) || ecrt_master_scan_progress(master, &progress)) return 0;
        busy |= info.scan_busy;
        if (progress.scan_index > progress.slave_count || progress.slave_count > slaves) return 0;
        if (busy && !info.scan_busy) return progress.scan_index == slaves && progress.slave_count == slaves;
    }
    return 0;
}

static unsigned long argument(int argc, char** argv, int n) { return argc > n ? strtoul(argv[n], NULL, 10) : 0; }

int main(int argc, char** argv) {
    ec_master_t* master = ecrt_open_master(0);
    ec_master_info_t info;
    ec_slave_info_t slave;
    ec_sync_info_t sync;
    unsigned int entries = 0, delays = 0, objects = 0;
    if (!master || ecrt_master(master, &info)) return 1;
    printf("%u slaves, scan %s\n", info.slave_count, info.scan_busy ? "busy" : "over");
    for (uint16_t pos = 0; pos < info.slave_count; ++pos) {
        if (ecrt_master_get_slave(master, pos, &slave)) return 1;
        printf("%u %u: 0x%08x 0x%08x %s, %u SyncManagers, AL state %u\n", slave.alias, slave.position, slave.vendor_id,
               slave.product_code, slave.name, slave.sync_count, slave.al_state);
        objects += slave.sdo_count;
        const int ports = delays_of(master, &slave);
        if (ports < 0) return 2;
        delays += (unsigned int)ports;
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
    printf("%u entries, %u delays, %u objects\n", entries, delays, objects);
    if (!scan_again(master, info.slave_count)) return 2;
    ecrt_release_master(master);
    return argc == 5 && info.slave_count == argument(argc, argv, 1) && entries == argument(argc, argv, 2) &&
                   delays == argument(argc, argv, 3) && objects == argument(argc, argv, 4)
               ? 0
               : 3;
}
