/* A slave in OP, or all of them, lose their station addresses and nothing else. A program for SOEM 1.4 brings them back
   as its check thread would: lost_address SOURCE SLAVE ROUNDS (SLAVE 0: all) */
#include <ethercat.h>

#include <stdio.h>
#include <stdlib.h>

static char IOmap[4096];

/* What a check thread does with a slave that is not in OP. */
static void check(uint16 slave) {
    ec_slavet* s = &ec_slave[slave];
    if (s->state == EC_STATE_SAFE_OP + EC_STATE_ERROR) {
        s->state = EC_STATE_SAFE_OP + EC_STATE_ACK;
        ec_writestate(slave);
    } else if (s->state == EC_STATE_SAFE_OP) {
        s->state = EC_STATE_OPERATIONAL;
        ec_writestate(slave);
    } else if (s->state > EC_STATE_NONE) {
        if (ec_reconfig_slave(slave, 500)) s->islost = FALSE;
    } else if (!s->islost) {
        ec_statecheck(slave, EC_STATE_OPERATIONAL, EC_TIMEOUTRET);
        if (s->state == EC_STATE_NONE) s->islost = TRUE;
    }
    if (s->islost && (s->state != EC_STATE_NONE || ec_recover_slave(slave, 500))) s->islost = FALSE;
}

/* Until all slaves are in OP with a full working counter. Returns the number of cycles, or -1. */
static int cycles_until_right(int expected) {
    int n, slave;
    for (n = 0; n < 2000; ++n) {
        int wkc;
        ec_send_processdata();
        wkc = ec_receive_processdata(EC_TIMEOUTRET);
        osal_usleep(1000);
        if (n % 10 != 9) continue;
        ec_readstate();
        if (wkc == expected && ec_slave[0].state == EC_STATE_OPERATIONAL) return n;
        for (slave = 1; slave <= ec_slavecount; ++slave)
            if (ec_slave[slave].state != EC_STATE_OPERATIONAL) check((uint16)slave);
    }
    return -1;
}

int main(int argc, char** argv) {
    uint16 slave, nothing = 0;
    int expected, n, round, rounds, back;
    if (argc != 4) return 2;
    slave = (uint16)atoi(argv[2]);
    rounds = atoi(argv[3]);
    if (!ec_init(argv[1]) || ec_config_init(FALSE) < slave) return 1;
    ec_config_map(&IOmap);
    ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE * 4);
    expected = ec_group[0].outputsWKC * 2 + ec_group[0].inputsWKC;
    if (cycles_until_right(expected) < 0) return 1;
    for (round = 0; round < rounds; ++round) {
        for (n = 1; n <= ec_slavecount; ++n)
            if (slave == 0 || slave == n)
                ec_FPWR(ec_slave[n].configadr, ECT_REG_STADR, sizeof(nothing), &nothing, EC_TIMEOUTRET3);
        back = cycles_until_right(expected);
        if (round == 0 || back < 0) printf("round %d: in OP again after %d cycles\n", round, back);
        if (back < 0) return 1;
    }
    ec_close();
    return 0;
}
