/* A slave loses its station address and its state, as after a loss of power, and nobody reads the states: the inputs of
   the other slaves go on. For SOEM 1.4: partial SOURCE SLAVE, where slave 1 is a drive */
#include <ethercat.h>

#include <stdio.h>
#include <stdlib.h>

#include "cycles.h"
#include "must.h"

static char IOmap[4096];
static int wrong;

/* The status word answers to "shutdown" and to "disable voltage". */
static void answers(uint8 control, uint8 status) {
    ec_slave[1].outputs[0] = control;
    cycles(100);
    MUST((ec_slave[1].inputs[0] & 0x6F) == status);
}

int main(int argc, char **argv) {
    uint16 slave, position, word;
    int wkc, tries;
    if (argc != 3) return 2;
    slave = (uint16)atoi(argv[2]);
    position = (uint16)(1 - slave);
    if (!ec_init(argv[1]) || ec_config_init(FALSE) < slave) return 1;
    MUST(ec_config_map(IOmap) > 0);
    ec_configdc();
    ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE);
    cycles(1);
    ec_slave[0].state = EC_STATE_OPERATIONAL;
    ec_writestate(0);
    for (tries = 0; tries < 100 && ec_statecheck(0, EC_STATE_OPERATIONAL, 0) != EC_STATE_OPERATIONAL; tries++) cycles(1);
    wkc = cycles(10);
    MUST(wkc == ec_group[0].outputsWKC * 2 + ec_group[0].inputsWKC);
    answers(0x06, 0x21);
    word = htoes(EC_STATE_INIT);
    MUST(ec_APWR(position, ECT_REG_ALCTL, sizeof(word), &word, EC_TIMEOUTSAFE) == 1);
    word = 0;
    MUST(ec_APWR(position, ECT_REG_STADR, sizeof(word), &word, EC_TIMEOUTSAFE) == 1);
    cycles(50);
    MUST(cycles(1) > 0 && cycles(1) < wkc);
    answers(0x00, 0x40);
    answers(0x06, 0x21);
    ec_close();
    return wrong != 0;
}
