/* A slave that answers no mail has the process data of its SII, so all others have their usual places; its hook is
   called once, like those of the others, and all of them reach OP. For SOEM 1.4: mute SOURCE, where all are equal */
#include <ethercat.h>

#include <stdio.h>

#include "must.h"

static char IOmap[4096];
static int wrong;
static int calls[EC_MAXSLAVE];

static int hook(uint16 slave) {
    ++calls[slave];
    return 1;
}

int main(int argc, char **argv) {
    int n, wkc, rounds;
    if (argc != 2) return 2;
    if (!ec_init(argv[1]) || ec_config_init(FALSE) < 2) return 1;
    for (n = 1; n <= ec_slavecount; ++n) ec_slave[n].PO2SOconfig = hook;
    MUST(ec_config_map(IOmap) == ec_slavecount * (int)(ec_slave[1].Obytes + ec_slave[1].Ibytes));
    for (n = 1; n <= ec_slavecount; ++n) {
        MUST(calls[n] == 1);
        MUST(ec_slave[n].Obits == ec_slave[1].Obits && ec_slave[n].Ibits == ec_slave[1].Ibits);
        MUST(ec_slave[n].outputs == (uint8 *)IOmap + (uint32)(n - 1) * ec_slave[1].Obytes);
        MUST(ec_slave[n].SMtype[2] == 3 && ec_slave[n].SMtype[3] == 4);
    }
    MUST(ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE) == EC_STATE_SAFE_OP);
    ec_slave[0].state = EC_STATE_OPERATIONAL;
    ec_send_processdata();
    ec_receive_processdata(EC_TIMEOUTRET);
    ec_writestate(0);
    for (rounds = 0; rounds < 200 && ec_slave[0].state != EC_STATE_OPERATIONAL; ++rounds) {
        ec_send_processdata();
        ec_receive_processdata(EC_TIMEOUTRET);
        ec_statecheck(0, EC_STATE_OPERATIONAL, 5000);
    }
    MUST(ec_slave[0].state == EC_STATE_OPERATIONAL);
    ec_send_processdata();
    wkc = ec_receive_processdata(EC_TIMEOUTRET);
    MUST(wkc == ec_group[0].outputsWKC * 2 + ec_group[0].inputsWKC && wkc == 3 * ec_slavecount);
    ec_close();
    return wrong != 0;
}
