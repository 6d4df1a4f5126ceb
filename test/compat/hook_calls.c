/* A hook that makes calls which configure slaves: they would wait for the call with the hook, so they return 0 at once. A
   state is written, as a datagram: hook_calls SOURCE */
#include <ethercat.h>

#include <stdio.h>
#include <unistd.h>

#include "must.h"

static int wrong;
static char image[4096], other[4096];
static int hooks;

static int hook(uint16 slave) {
    MUST(slave == 2);
    MUST(!ec_configdc());
    MUST(ec_reconfig_slave(1, 500) == 0);
    MUST(ec_config_map(other) == 0);
    MUST(ec_config_init(FALSE) <= 0);
    MUST(ec_recover_slave(1, 500) == 1); /* it is not lost */
    ec_slave[1].state = EC_STATE_PRE_OP;
    MUST(ec_writestate(1) == 1);
    ++hooks;
    return 1;
}

int main(int argc, char** argv) {
    alarm(60);
    if (argc < 2 || ec_init(argv[1]) <= 0 || ec_config_init(FALSE) < 2) return 2;
    ec_slave[2].PO2SOconfig = hook;
    MUST(ec_config_map(image) > 0);
    MUST(hooks == 1 && ec_slavecount == 2);
    MUST(ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE) == EC_STATE_SAFE_OP);
    MUST(ec_configdc());
    MUST(ec_reconfig_slave(2, 500) == EC_STATE_SAFE_OP);
    MUST(hooks == 2);
    ec_close();
    printf("%d wrong\n", wrong);
    return wrong != 0;
}
