/* A slave loses its station address before ec_configdc(). Delays cannot be measured past an unknown slave, and this is no
   success. When the slave is recovered, all clocks get their offsets and delays: lost_clock SOURCE SLAVE */
#include <ethercat.h>

#include <stdio.h>
#include <stdlib.h>

static char IOmap[4096];

/* What the system time offset (0x0920) has while it is asked whether a clock has 64 bits. */
#define PROBED ((uint64)1 << 32)

int main(int argc, char **argv) {
    uint16 lost, word, n;
    int clocks = 0;
    if (argc != 3) return 2;
    lost = (uint16)atoi(argv[2]);
    if (!ec_init(argv[1]) || ec_config_init(FALSE) < lost) return 1;
    ec_config_map(&IOmap);
    word = htoes(EC_STATE_INIT);
    ec_FPWR(ec_slave[lost].configadr, ECT_REG_ALCTL, sizeof(word), &word, EC_TIMEOUTRET3);
    word = 0;
    if (ec_FPWR(ec_slave[lost].configadr, ECT_REG_STADR, sizeof(word), &word, EC_TIMEOUTRET3) != 1) return 1;
    if (ec_configdc()) {
        printf("a success that is none\n");
        return 1;
    }
    ec_slave[lost].islost = TRUE;
    if (!ec_recover_slave(lost, 500) || !ec_configdc()) {
        printf("no clocks\n");
        return 1;
    }
    for (n = 1; n <= ec_slavecount; n++) {
        uint64 offset = PROBED;
        if (!ec_slave[n].hasdc) continue;
        if (ec_FPRD(ec_slave[n].configadr, ECT_REG_DCSYSOFFSET, sizeof(offset), &offset, EC_TIMEOUTRET3) != 1 ||
            offset == PROBED || (clocks > 0 && ec_slave[n].pdelay <= 0)) {
            printf("slave %d: offset 0x%llx, delay %d\n", n, (unsigned long long)offset, (int)ec_slave[n].pdelay);
            return 1;
        }
        ++clocks;
    }
    printf("%d clocks\n", clocks);
    ec_close();
    return clocks > 1 ? 0 : 1;
}
