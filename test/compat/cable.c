/* The cable to the slaves behind slave 1 is away for some time; the slaves keep power, state and address. A check thread
   has searched for them meanwhile. When the cable is back they exchange process data at once, and stay in OP, whatever
   states the program writes: cable SOURCE (three slaves at least) */
#include <ethercat.h>

#include <stdio.h>

#include "cycles.h"
#include "must.h"

static char IOmap[4096];
static int wrong, expected;

/* DL control of slave 1: port 1 closed or open. */
static void set_port(int open) {
    uint8 control[2] = {1, 0};
    control[1] = open ? 0x00 : 0x0C;
    MUST(ec_FPWR(ec_slave[1].configadr, ECT_REG_DLCTL, sizeof control, control, EC_TIMEOUTRET3) == 1);
}

static void cut(int recover) {
    set_port(0);
    cycles(50);
    ec_readstate();
    MUST(ec_slave[1].state == EC_STATE_OPERATIONAL);
    MUST(ec_slave[2].state == EC_STATE_NONE && ec_slave[ec_slavecount].state == EC_STATE_NONE);
    if (recover) MUST(ec_recover_slave(2, 500) == 0);
    ec_slave[0].state = EC_STATE_OPERATIONAL;
    MUST(ec_writestate(0) == 1); /* as a broadcast: the working counter */
    set_port(1);
    MUST(cycles(300) == expected);
    ec_readstate();
    MUST(ec_slave[0].state == EC_STATE_OPERATIONAL);
}

static void all_in_op(void) {
    MUST(cycles(20) == expected);
    ec_readstate();
    MUST(ec_slave[0].state == EC_STATE_OPERATIONAL);
}

int main(int argc, char** argv) {
    int n, recover;
    if (argc != 2 || !ec_init(argv[1]) || ec_config_init(FALSE) < 3) return 2;
    ec_config_map(IOmap);
    ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE);
    expected = ec_group[0].outputsWKC * 2 + ec_group[0].inputsWKC;
    cycles(2);
    ec_slave[0].state = EC_STATE_OPERATIONAL;
    MUST(ec_writestate(0) == ec_slavecount);
    for (n = 0; n < 300 && ec_statecheck(0, EC_STATE_OPERATIONAL, 0) != EC_STATE_OPERATIONAL; ++n) cycles(1);
    for (recover = 0; recover < 2; ++recover) {
        cut(recover);
        ec_slave[1].state = EC_STATE_OPERATIONAL;
        MUST(ec_writestate(1) == 1);
        all_in_op();

        cut(recover);
        MUST(ec_recover_slave(2, 500) == 1);
        ec_slave[2].state = EC_STATE_OPERATIONAL;
        MUST(ec_writestate(2) == 1);
        all_in_op();

        cut(recover);
        MUST(ec_reconfig_slave(2, 500) == EC_STATE_SAFE_OP);
        cycles(5);
        ec_slave[2].state = EC_STATE_OPERATIONAL;
        MUST(ec_writestate(2) == 1);
        all_in_op();
    }
    ec_close();
    return wrong != 0;
}
