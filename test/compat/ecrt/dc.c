/* Axes with distributed clocks, and a drive that does not use them: the time of the program is the time of the segment.
 * The first application time is told in the cycle, after activation. Ends with 0 when all slaves are in OP, the clocks
 * differ by less than 10 us, the reference clock shows the time of the program, and SYNC0 begins in the phase of the
 * first application time. */
#include "cycle.h"

#include <ecrt.h>
#include <errno.h>
#include <stdio.h>

#define DRIVE 0x00004D47, 0x5402
#define AXIS 0x00004D47, 0x2521
#define SHIFT_NS 250000
#define EPOCH_NS 0xFFFFFF0000000000U /* the time of the program wraps soon after its start */

static ec_pdo_entry_info_t axis_entries[] = {{0x7000, 1, 16}, {0x7000, 2, 32}, {0x6000, 1, 16}, {0x6000, 2, 32}};
static ec_pdo_info_t axis_pdos[] = {{0x1600, 2, axis_entries + 0}, {0x1a00, 2, axis_entries + 2}};
static ec_sync_info_t axis_syncs[] = {{0, EC_DIR_OUTPUT, 1, axis_pdos + 0, EC_WD_ENABLE},
                                      {1, EC_DIR_INPUT, 1, axis_pdos + 1, EC_WD_DISABLE},
                                      {0xff, EC_DIR_INVALID, 0, NULL, EC_WD_DEFAULT}};

static ec_master_t* master;
static ec_domain_t* domain;
static ec_slave_config_t* sc[3];
static uint8_t* pd;
static uint64_t first_time;

static uint64_t system_time_ns(void) { return EPOCH_NS + now_ns(); }

static unsigned int cycles, good;
static uint32_t difference, monitor = 0xFFFFFFFFU;

static void cyclic_task(int off_control, int off_status) {
    ec_domain_state_t ds;
    ec_master_state_t ms;
    uint32_t reference = 0;
    const uint64_t time = system_time_ns();
    if (first_time == 0) first_time = time;
    ecrt_master_application_time(master, time);
    ecrt_master_receive(master);
    ecrt_domain_process(domain);
    ecrt_domain_state(domain, &ds);
    ecrt_master_state(master, &ms);
    if (cycles % 4 == 1) monitor = ecrt_master_sync_monitor_process(master);
    if (ecrt_master_reference_clock_time(master, &reference) == 0) difference = (uint32_t)time - reference;
    EC_WRITE_U16(pd + off_control, EC_READ_U16(pd + off_status) & 0x0008 ? 0x80 : 0x06);
    ecrt_master_sync_reference_clock_to(master, system_time_ns());
    ecrt_master_sync_slave_clocks(master);
    if (cycles % 4 == 0) ecrt_master_sync_monitor_queue(master);
    ecrt_domain_queue(domain);
    ecrt_master_send(master);
    good = count_right(good, ds.wc_state == EC_WC_COMPLETE && ms.al_states == EC_AL_STATE_OP && monitor < 10000);
    ++cycles;
}

static int wait_for(ec_reg_request_t* request, int off_control, int off_status) {
    for (int n = 0; n < 2000 && ecrt_reg_request_state(request) == EC_REQUEST_BUSY; ++n) {
        next_cycle();
        cyclic_task(off_control, off_status);
    }
    return ecrt_reg_request_state(request) == EC_REQUEST_SUCCESS ? 0 : -1;
}

int main(void) {
    ec_reg_request_t* request;
    ec_slave_config_state_t state;
    int off_control, off_status;
    uint64_t start;
    master = ecrt_request_master(0);
    if (!master || !(domain = ecrt_master_create_domain(master))) return 1;
    for (uint16_t n = 0; n < 2; ++n) {
        if (!(sc[n] = ecrt_master_slave_config(master, 0, n, AXIS))) return 1;
        if (ecrt_slave_config_pdos(sc[n], EC_END, axis_syncs)) return 1;
        ecrt_slave_config_dc(sc[n], 0x0300, CYCLE_NS, SHIFT_NS, 0, 0);
    }
    if (!(sc[2] = ecrt_master_slave_config(master, 0, 2, DRIVE))) return 1;
    if (ecrt_slave_config_sdo8(sc[2], 0x6060, 0, 8)) return 1;
    if (ecrt_slave_config_reg_pdo_entry(sc[0], 0x7000, 2, domain, NULL) != 2) return 2;
    if (ecrt_slave_config_reg_pdo_entry(sc[1], 0x7000, 1, domain, NULL) != 6) return 2;
    if (ecrt_slave_config_reg_pdo_entry(sc[1], 0x6000, 2, domain, NULL) != 12 + 2) return 2;
    if (ecrt_slave_config_reg_pdo_entry(sc[1], 0x6000, 3, domain, NULL) != -ENOENT) return 2;
    off_control = ecrt_slave_config_reg_pdo_entry(sc[2], 0x6040, 0, domain, NULL);
    off_status = ecrt_slave_config_reg_pdo_entry(sc[2], 0x6041, 0, domain, NULL);
    if (off_control != 18 || off_status != 18 + 14) return 2;
    if (!(request = ecrt_slave_config_create_reg_request(sc[1], 8))) return 1;
    if (ecrt_master_select_reference_clock(master, sc[0])) return 1;
    if (ecrt_master_activate(master) || !(pd = ecrt_domain_data(domain))) return 1;
    while (cycles < 50000 && good < 100) {
        next_cycle();
        cyclic_task(off_control, off_status);
    }
    printf("%u cycles, sync monitor %u ns, the reference clock is %u ns behind the program\n", cycles, monitor,
           difference);
    if (good < 100) return 3;
    /* One cycle old: the time of the last frame. A busy machine makes the cycle longer. */
    if (difference > 200000000U) return 4;
    ecrt_slave_config_state(sc[0], &state);
    if (!state.online || !state.operational || state.al_state != EC_AL_STATE_OP) return 5;
    /* ESC registers: the cycle and the start of SYNC0, and what is activated. */
    ecrt_reg_request_read(request, 0x09A0, 4);
    if (wait_for(request, off_control, off_status) || EC_READ_U32(ecrt_reg_request_data(request)) != CYCLE_NS) return 6;
    ecrt_reg_request_read(request, 0x0980, 2);
    if (wait_for(request, off_control, off_status) || EC_READ_U16(ecrt_reg_request_data(request)) != 0x0300) return 7;
    ecrt_reg_request_read(request, 0x0990, 8);
    if (wait_for(request, off_control, off_status)) return 8;
    start = EC_READ_U64(ecrt_reg_request_data(request));
    printf("SYNC0 at %llu, %llu ns behind a multiple of the cycle since the first time\n", (unsigned long long)start,
           (unsigned long long)((start - first_time) % CYCLE_NS));
    if ((start - first_time) % CYCLE_NS != SHIFT_NS) return 9;
    ecrt_release_master(master);
    return 0;
}
