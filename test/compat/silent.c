/* The first slave closes its port for a second: no frame comes back. The calls of a check thread for SOEM 1.4 last as
   long as with the original, and none of them is a success: silent SOURCE */
#include <ethercat.h>

#include <stdio.h>

#include "must.h"

static char IOmap[4096];
static int wrong;
static uint16 first_station;

/* The clock of the first slave, in microseconds. */
static long long slave_us(void) {
    uint64 now = 0;
    MUST(ec_FPRD(first_station, ECT_REG_DCSYSTIME, sizeof(now), &now, EC_TIMEOUTRET3) == 1);
    return (long long)(etohll(now) / 1000);
}

enum { SILENCE_US = 1200000 };

/* Closes port 0 of the first slave for a second (DL control: temporary use). */
static void make_silent(void) {
    uint8 control[2] = {3, 3};
    ec_APWR(0, ECT_REG_DLCTL, sizeof(control), control, EC_TIMEOUTRET);
}

#define MUST_LAST(most_us, call, result)                         \
    do {                                                         \
        const long long begin = slave_us();                      \
        int returned, lasted;                                    \
        make_silent();                                           \
        returned = (int)(call);                                  \
        osal_usleep(SILENCE_US);                                 \
        lasted = (int)(slave_us() - begin - SILENCE_US);         \
        printf("%s: %d after %d us\n", #call, returned, lasted); \
        MUST(returned == (result));                              \
        MUST(lasted <= (most_us));                               \
    } while (0)

int main(int argc, char** argv) {
    if (argc != 2 || !ec_init(argv[1]) || ec_config_init(FALSE) != 2) return 1;
    first_station = ec_slave[1].configadr;
    ec_config_map(&IOmap);
    ec_configdc();
    ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE);
    MUST(ec_slave[0].state == EC_STATE_SAFE_OP);
    MUST_LAST(15000, ec_readstate(), EC_STATE_NONE);
    MUST_LAST(15000, ec_statecheck(2, EC_STATE_SAFE_OP, 2000), EC_STATE_NONE);
    ec_slave[2].state = EC_STATE_PRE_OP;
    MUST_LAST(15000, ec_writestate(2), EC_NOFRAME);
    MUST_LAST(40000, ec_recover_slave(2, 500), 0);
    MUST_LAST(50000, ec_reconfig_slave(2, 500), 0);
    MUST(ec_slave[2].state == EC_STATE_NONE);
    MUST_LAST(40000, ec_configdc(), FALSE);
    MUST_LAST(100000, ec_config_init(FALSE), EC_NOFRAME);
    MUST(ec_config_init(FALSE) == 2);
    ec_config_map(&IOmap);
    /* Only the second slave is gone. */
    {
        uint8 control[2] = {1, 0x0C};
        MUST(ec_FPWR(ec_slave[1].configadr, ECT_REG_DLCTL, sizeof(control), control, EC_TIMEOUTRET3) == 1);
    }
    MUST(ec_reconfig_slave(2, 500) == 0);
    MUST(ec_slave[2].state == EC_STATE_NONE);
    /* It is there again, and answers before a program has read the states. */
    {
        uint8 control[2] = {1, 0};
        uint32 vendor = 0;
        int size = sizeof(vendor);
        MUST(ec_FPWR(ec_slave[1].configadr, ECT_REG_DLCTL, sizeof(control), control, EC_TIMEOUTRET3) == 1);
        osal_usleep(300000);
        MUST(ec_SDOread(2, 0x1018, 1, FALSE, &size, &vendor, EC_TIMEOUTRXM) == 1);
        MUST(etohl(vendor) == ec_slave[2].eep_man);
    }
    ec_close();
    return wrong != 0;
}
