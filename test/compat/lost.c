/* A slave loses its station address and its state, as after a loss of power; a program for SOEM 1.4 brings it back as its
   check thread would: lost SOURCE SLAVE */
#include <ethercat.h>

#include <stdio.h>
#include <stdlib.h>

#include "cycles.h"

static char IOmap[4096];
static int hooks;

static int hook(uint16 slave) {
    (void)slave;
    ++hooks;
    return 1;
}

static int to_op(uint16 slave) {
    int tries = 100;
    ec_slave[slave].state = EC_STATE_OPERATIONAL;
    cycles(1);
    ec_writestate(slave);
    do {
        cycles(1);
        ec_statecheck(slave, EC_STATE_OPERATIONAL, 0);
    } while (ec_slave[slave].state != EC_STATE_OPERATIONAL && tries-- > 0);
    return ec_slave[slave].state == EC_STATE_OPERATIONAL;
}

int main(int argc, char **argv) {
    uint16 slave, word, station;
    int expected, wkc, state;
    if (argc != 3) return 2;
    slave = (uint16)atoi(argv[2]);
    if (!ec_init(argv[1]) || ec_config_init(FALSE) < slave) return 1;
    ec_slave[slave].PO2SOconfig = hook;
    ec_config_map(&IOmap);
    if (hooks != 1) return 1;
    ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE * 4);
    expected = ec_group[0].outputsWKC * 2 + ec_group[0].inputsWKC;
    if (!to_op(0) || cycles(1) != expected) {
        printf("not in OP with all slaves\n");
        return 1;
    }
    station = ec_slave[slave].configadr;
    word = htoes(EC_STATE_INIT);
    ec_FPWR(station, ECT_REG_ALCTL, sizeof(word), &word, EC_TIMEOUTRET3);
    word = 0;
    if (ec_FPWR(station, ECT_REG_STADR, sizeof(word), &word, EC_TIMEOUTRET3) != 1) return 1;
    wkc = cycles(5);
    printf("expected %d, now %d\n", expected, wkc);
    if (wkc >= expected) return 1;
    ec_readstate();
    if (ec_slave[slave].state != EC_STATE_NONE) {
        printf("the lost slave has state 0x%02x\n", ec_slave[slave].state);
        return 1;
    }
    if (ec_statecheck(slave, EC_STATE_OPERATIONAL, EC_TIMEOUTRET) != EC_STATE_NONE) return 1;
    ec_slave[slave].islost = TRUE;
    if (!ec_recover_slave(slave, 500)) {
        printf("not recovered\n");
        return 1;
    }
    if (ec_recover_slave(slave, 500) != 1) return 1; /* it has its address */
    state = ec_reconfig_slave(slave, 500);
    if (state != EC_STATE_SAFE_OP || hooks != 2) {
        printf("reconfigured: state %d, %d hooks\n", state, hooks);
        return 1;
    }
    if (!to_op(slave)) {
        printf("not in OP again: 0x%02x\n", ec_slave[slave].state);
        return 1;
    }
    ec_slave[slave].islost = FALSE;
    wkc = cycles(5);
    ec_readstate();
    printf("expected %d, again %d, lowest state %d\n", expected, wkc, ec_slave[0].state);
    ec_close();
    return wkc == expected && ec_slave[0].state == EC_STATE_OPERATIONAL ? 0 : 1;
}
