/* The headers alone, and names that programs define themselves. */
#include "ethercat.h"
#include "ethercatconfiglist.h"
#include "oshw.h"

#define EC_TIMEOUTMON 500
#define ECT_REG_WD_DIV 0x0400

static char IOmap[4096];
int example(void) {
    if (ec_init("eth0") <= 0 || ec_config_init(FALSE) <= 0) return 0;
    return ec_config_map(&IOmap) + ec_slavecount + EC_TIMEOUTMON + (int)etohs(ec_slave[0].state) + ec_slave[1].SMtype[0];
}
