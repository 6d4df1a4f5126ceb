/* The clocks before the mapping, the mapping before the clocks, and both again. The first slave of the source has the
   feature of clocks and no clock that runs: clock_order SOURCE */
#include <ethercat.h>

#include <stdio.h>

#include "must.h"

static char IOmap[4096];
static int wrong;

static int to_op(void) {
    int n;
    ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE);
    ec_slave[0].state = EC_STATE_OPERATIONAL;
    ec_writestate(0);
    for (n = 0; n < 500; ++n) {
        ec_send_processdata();
        ec_receive_processdata(EC_TIMEOUTRET);
        ec_statecheck(0, EC_STATE_OPERATIONAL, 0);
        if (ec_slave[0].state == EC_STATE_OPERATIONAL) return 1;
        osal_usleep(1000);
    }
    return 0;
}

int main(int argc, char** argv) {
    int slaves;
    if (argc != 2 || !ec_init(argv[1])) return 1;
    slaves = ec_config_init(FALSE);
    MUST(slaves >= 2);
    MUST(ec_configdc() == TRUE);
    MUST(ec_config_map(&IOmap) > 0);
    MUST(to_op());
    MUST(ec_config_init(FALSE) == slaves);
    MUST(ec_config_map(&IOmap) > 0);
    MUST(ec_configdc() == TRUE);
    MUST(to_op());
    MUST(ec_config_init(FALSE) == slaves);
    MUST(ec_configdc() == TRUE);
    MUST(ec_config_map(&IOmap) > 0);
    MUST(ec_configdc() == TRUE);
    MUST(to_op());
    ec_close();
    return wrong != 0;
}
