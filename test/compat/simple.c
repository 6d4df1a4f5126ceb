/* A program for SOEM 1.4 as its users write it: brings a segment to OP, exchanges process data, and has a thread that
   looks after lost slaves. simple SOURCE CYCLES */
#include <ethercat.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EC_TIMEOUTMON 500

static char IOmap[4096];
static OSAL_THREAD_HANDLE thread1;
static volatile int expectedWKC;
static volatile int wkc;
static volatile boolean inOP;
static volatile boolean stop;
static uint8 currentgroup = 0;

static OSAL_THREAD_FUNC ecatcheck(void *ptr) {
    int slave;
    (void)ptr;
    while (!stop) {
        if (inOP && ((wkc < expectedWKC) || ec_group[currentgroup].docheckstate)) {
            ec_group[currentgroup].docheckstate = FALSE;
            ec_readstate();
            for (slave = 1; slave <= ec_slavecount; slave++) {
                if ((ec_slave[slave].group == currentgroup) && (ec_slave[slave].state != EC_STATE_OPERATIONAL)) {
                    ec_group[currentgroup].docheckstate = TRUE;
                    if (ec_slave[slave].state == (EC_STATE_SAFE_OP + EC_STATE_ERROR)) {
                        ec_slave[slave].state = (EC_STATE_SAFE_OP + EC_STATE_ACK);
                        ec_writestate(slave);
                    } else if (ec_slave[slave].state == EC_STATE_SAFE_OP) {
                        ec_slave[slave].state = EC_STATE_OPERATIONAL;
                        ec_writestate(slave);
                    } else if (ec_slave[slave].state > EC_STATE_NONE) {
                        if (ec_reconfig_slave(slave, EC_TIMEOUTMON)) {
                            ec_slave[slave].islost = FALSE;
                            printf("slave %d reconfigured\n", slave);
                        }
                    } else if (!ec_slave[slave].islost) {
                        ec_statecheck(slave, EC_STATE_OPERATIONAL, EC_TIMEOUTRET);
                        if (ec_slave[slave].state == EC_STATE_NONE) ec_slave[slave].islost = TRUE;
                    }
                }
                if (ec_slave[slave].islost) {
                    if (ec_slave[slave].state == EC_STATE_NONE) {
                        if (ec_recover_slave(slave, EC_TIMEOUTMON)) ec_slave[slave].islost = FALSE;
                    } else {
                        ec_slave[slave].islost = FALSE;
                    }
                }
            }
        }
        osal_usleep(10000);
    }
}

int main(int argc, char **argv) {
    int i, chk, good = 0, cycles;
    if (argc != 3) return 2;
    cycles = atoi(argv[2]);
    if (!ec_init(argv[1])) return 1;
    if (ec_config_init(FALSE) <= 0) return 1;
    ec_config_map(&IOmap);
    ec_configdc();
    ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE * 4);
    if (ec_slave[0].state != EC_STATE_SAFE_OP) {
        printf("not in SAFEOP: %d\n", ec_slave[0].state);
        return 1;
    }
    expectedWKC = (ec_group[0].outputsWKC * 2) + ec_group[0].inputsWKC;
    ec_slave[0].state = EC_STATE_OPERATIONAL;
    ec_send_processdata();
    ec_receive_processdata(EC_TIMEOUTRET);
    ec_writestate(0);
    chk = 200;
    do {
        ec_send_processdata();
        ec_receive_processdata(EC_TIMEOUTRET);
        ec_statecheck(0, EC_STATE_OPERATIONAL, 50000);
        /* a busy host was too late for the watchdog of a slave */
        if (ec_slave[0].state & EC_STATE_ERROR) {
            ec_slave[0].state = EC_STATE_OPERATIONAL;
            ec_writestate(0);
        }
    } while (chk-- && (ec_slave[0].state != EC_STATE_OPERATIONAL));
    if (ec_slave[0].state != EC_STATE_OPERATIONAL) {
        ec_readstate();
        for (i = 1; i <= ec_slavecount; i++)
            if (ec_slave[i].state != EC_STATE_OPERATIONAL)
                printf("slave %d state 0x%02x status code 0x%04x: %s\n", i, ec_slave[i].state, ec_slave[i].ALstatuscode,
                       ec_ALstatuscode2string(ec_slave[i].ALstatuscode));
        return 1;
    }
    osal_thread_create(&thread1, 128000, &ecatcheck, NULL);
    inOP = TRUE;
    for (i = 1; i <= cycles; i++) {
        ec_send_processdata();
        wkc = ec_receive_processdata(EC_TIMEOUTRET * 10);
        if (wkc >= expectedWKC) ++good;
        if (ec_slave[0].outputs != NULL && ec_slave[0].Obytes > 0) ec_slave[0].outputs[0] = (uint8)i;
        osal_usleep(1000);
    }
    inOP = FALSE;
    stop = TRUE;
    osal_usleep(50000);
    ec_slave[0].state = EC_STATE_INIT;
    ec_writestate(0);
    ec_statecheck(0, EC_STATE_INIT, EC_TIMEOUTSTATE);
    printf("%d slaves, %d of %d cycles right, expected counter %d, last %d, state %d\n", ec_slavecount, good, cycles,
           expectedWKC, wkc, ec_slave[0].state);
    chk = ec_slave[0].state == EC_STATE_INIT;
    ec_close();
    return good >= cycles / 2 && expectedWKC > 0 && chk ? 0 : 1;
}
