/* A program for SOEM 2.0 as its users write it: the context is zero at first, a thread exchanges process data, and the
   main thread reads objects meanwhile. simple_ng SOURCE CYCLES SLAVE_WITH_COE (0: none) */
#include "soem/soem.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static ecx_contextt ctx;
static uint8 IOmap[4096];
static OSAL_THREAD_HANDLE cycle_thread;
static volatile int cycles, good, running, hooks;
static int expected;

static int to_safe_op(ecx_contextt *context, uint16 slave) {
    uint32 vendor = 0;
    int size = sizeof(vendor);
    if (context->slavelist[slave].state != EC_STATE_PRE_OP) return 0;
    if ((context->slavelist[slave].mbx_proto & ECT_MBXPROT_COE) == 0) return 0;
    /* a hook may use the mailbox */
    if (ecx_SDOread(context, slave, 0x1018, 1, FALSE, &size, &vendor, EC_TIMEOUTRXM) > 0 &&
        etohl(vendor) == context->slavelist[slave].eep_man)
        ++hooks;
    return 1;
}

static OSAL_THREAD_FUNC_RT cycle(void *ptr) {
    (void)ptr;
    ecx_send_processdata(&ctx);
    while (running) {
        int wkc;
        osal_usleep(1000);
        wkc = ecx_receive_processdata(&ctx, EC_TIMEOUTRET * 10);
        ++cycles;
        if (wkc == expected) ++good;
        ecx_mbxhandler(&ctx, 0, 4);
        ecx_send_processdata(&ctx);
    }
    ecx_receive_processdata(&ctx, EC_TIMEOUTRET);
}

int main(int argc, char **argv) {
    int n, wanted, slave, coe = 0, reads = 0;
    ec_groupt *group = ctx.grouplist;
    ec_timet start, end, took;
    if (argc != 4) return 2;
    wanted = atoi(argv[2]);
    slave = atoi(argv[3]);
    if (!ecx_init(&ctx, argv[1]) || ecx_config_init(&ctx) <= 0) return 1;
    for (n = 1; n <= ctx.slavecount; ++n) {
        ctx.slavelist[n].PO2SOconfig = to_safe_op;
        if (ctx.slavelist[n].mbx_proto & ECT_MBXPROT_COE) ++coe;
    }
    ecx_config_map_group(&ctx, IOmap, 0);
    if (hooks != coe) printf("%d of %d hooks have read the vendor\n", hooks, coe);
    expected = group->outputsWKC * 2 + group->inputsWKC;
    ecx_configdc(&ctx);
    for (n = 1; n <= ctx.slavecount; ++n)
        if (ctx.slavelist[n].CoEdetails > 0) ecx_slavembxcyclic(&ctx, (uint16)n);
    ecx_statecheck(&ctx, 0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE * 4);
    ecx_send_processdata(&ctx);
    if (ecx_receive_processdata(&ctx, EC_TIMEOUTRET * 10) != expected) printf("not all slaves exchange in SAFEOP\n");
    running = 1;
    start = osal_current_time();
    osal_thread_create(&cycle_thread, 128000, &cycle, NULL);
    n = 20; /* a busy host may be too late for the watchdog of a slave */
    do {
        ctx.slavelist[0].state = EC_STATE_OPERATIONAL;
        ecx_writestate(&ctx, 0);
        ecx_statecheck(&ctx, 0, EC_STATE_OPERATIONAL, EC_TIMEOUTSTATE / 4);
    } while (ctx.slavelist[0].state != EC_STATE_OPERATIONAL && n-- > 0);
    n = ctx.slavelist[0].state;
    while (cycles < wanted) {
        uint32 value = 0;
        int size = sizeof(value);
        if (slave > 0 && ecx_SDOread(&ctx, (uint16)slave, 0x1018, 2, FALSE, &size, &value, EC_TIMEOUTRXM) > 0 &&
            etohl(value) == ctx.slavelist[slave].eep_id)
            ++reads;
        osal_usleep(5000);
    }
    end = osal_current_time();
    osal_time_diff(&start, &end, &took);
    running = 0;
    osal_usleep(50000);
    ctx.slavelist[0].state = EC_STATE_INIT;
    ecx_writestate(&ctx, 0);
    ecx_statecheck(&ctx, 0, EC_STATE_INIT, EC_TIMEOUTSTATE);
    printf("%d slaves, state %d, %d of %d cycles right, counter %d, %d reads, dc time %s, %d s\n", ctx.slavecount, n, good,
           cycles, expected, reads, ctx.DCtime != 0 ? "known" : "none", (int)took.tv_sec);
    n = n == EC_STATE_OPERATIONAL && good > wanted / 2 && hooks == coe && (slave == 0 || reads > 0) &&
        ctx.slavelist[0].state == EC_STATE_INIT;
    ecx_close(&ctx);
    return n ? 0 : 1;
}
