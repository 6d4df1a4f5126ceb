/* A ring: both ends of the cable are connected to the master. The clocks of its slaves are synchronised. And groups: slaves
 * that go into another group are not counted in the first one any more. */
#include "ethercat.h"

#include <stdio.h>

static char image[4096];
static char other[4096];

static int cycle(int group) {
    ec_send_processdata_group((uint8)group);
    return ec_receive_processdata_group((uint8)group, EC_TIMEOUTRET);
}
static int expected(int group) { return ec_group[group].outputsWKC * 2 + ec_group[group].inputsWKC; }

int main(int argc, char** argv) {
    char second[] = "the other end";
    int n;
    if (argc < 3) return 1;
    if (ec_init_redundant(argv[2], second) > 0) return 2; /* a segment without a ring */
    if (ec_init_redundant(argv[1], second) <= 0) return 3;
    if (ec_config_init(FALSE) < 3) return 4;
    if (ec_config_map(image) <= 0 || expected(0) == 0) return 5;
    if (ec_configdc() == FALSE || ec_slave[0].hasdc == FALSE) return 10;
    /* The delays are those of the line: later slaves have longer ones. */
    for (n = 2; n <= ec_slavecount; ++n)
        if (ec_slave[n].hasdc == FALSE || ec_slave[n].pdelay <= ec_slave[n - 1].pdelay) return 11;
    ec_dcsync0(1, TRUE, 1000000, 0);
    if (cycle(0) != expected(0)) return 6;
    if (ec_DCtime == 0) return 12;
    n = expected(0);
    ec_slave[ec_slavecount].group = 1;
    if (ec_config_map_group(other, 1) <= 0 || expected(1) == 0) return 7;
    if (expected(0) + expected(1) != n) return 8;
    if (cycle(0) != expected(0) || cycle(1) != expected(1)) return 9;
    ec_close();
    printf("%d, %d and %d\n", n, expected(0), expected(1));
    return 0;
}
