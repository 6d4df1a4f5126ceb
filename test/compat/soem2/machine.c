/* A machine as users of SOEM 2.0 write it: two groups of slaves with images of their own, a real-time thread that exchanges them and handles
   mailboxes, a check thread, hooks that set objects before SAFEOP, a network description with start-up commands, clocks, and services from the
   main thread. The segment has drives with CoE and clocks, and terminals. With the name of an interface, the interface is switched off and on
   again: machine SOURCE [INTERFACE] */
#include "../must.h"

#include <soem/soem.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CYCLE_NS 1000000
#define CYCLES 1500

static ecx_contextt ctx;
static uint8 map0[1024], map1[1024];
static OSAL_THREAD_HANDLE rt_thread, check_thread;
static volatile int running, in_op, cycles, right[2], wrong_in_op[2], handled, times, back_in_time, checks;
static int expected[2];
static int hooks, wrong;

/* The acceleration of slave 1, by a network description; of another revision for slave 2, so that nothing is written there. */
static uint8 acceleration[4] = {0xD2, 0x04, 0, 0};
static uint8 deceleration[4] = {0x2E, 0x16, 0, 0};
static ec_enicoecmdt commands1[] = {
    {.Transition = ECT_ESMTRANS_PS, .Ccs = 2, .Index = 0x6083, .Timeout = EC_TIMEOUTRXM, .DataSize = 4, .Data = acceleration},
    {.Transition = ECT_ESMTRANS_SO, .Ccs = 2, .Index = 0x6084, .Timeout = EC_TIMEOUTRXM, .DataSize = 4, .Data = deceleration},
};
static ec_enislavet eni_slaves[2];
static ec_enit eni = {.slave = eni_slaves, .slavecount = 2};

static uint32 read_number(uint16 slave, uint16 index) {
    uint32 value = 0;
    int size = sizeof(value);
    return ecx_SDOread(&ctx, slave, index, 0, FALSE, &size, &value, EC_TIMEOUTRXM) > 0 ? etohl(value) : 0xFFFFFFFF;
}

/* Runs in PREOP, after the commands of the description. */
static int setup(ecx_contextt *context, uint16 slave) {
    uint32 velocity = htoel(77000 + slave);
    int *calls = (int *)context->userdata;
    MUST(context == &ctx && context->slavelist[slave].state == EC_STATE_PRE_OP);
    if (slave == 1 && read_number(1, 0x6083) != 1234) return 0;
    if (ecx_SDOwrite(context, slave, 0x6081, 0, FALSE, sizeof(velocity), &velocity, EC_TIMEOUTRXM) <= 0) return 0;
    ++*calls;
    return 1;
}

/* Receive first, then send: one frame of each group is always on the wire. */
static OSAL_THREAD_FUNC_RT rt(void *ptr) {
    ec_timet next, step;
    int64 before = 0;
    uint8 g;
    (void)ptr;
    step.tv_sec = 0;
    step.tv_nsec = CYCLE_NS;
    for (g = 0; g < 2; ++g) ecx_send_processdata_group(&ctx, g);
    osal_get_monotonic_time(&next);
    while (running) {
        osal_timespecadd(&next, &step, &next);
        osal_monotonic_sleep(&next);
        for (g = 0; g < 2; ++g) {
            const int wkc = ecx_receive_processdata_group(&ctx, g, EC_TIMEOUTRET * 5);
            if (wkc == expected[g])
                ++right[g];
            else if (in_op)
                ++wrong_in_op[g];
            if (ctx.slavelist[0].hasdc && wkc > 0 && g == 1) { /* the clocks are in the second group */
                if (ctx.DCtime > before) ++times;
                if (ctx.DCtime < before) ++back_in_time;
                before = ctx.DCtime;
            }
            if (ecx_mbxhandler(&ctx, g, 4) >= 0) ++handled;
        }
        ++cycles;
        for (g = 0; g < 2; ++g) ecx_send_processdata_group(&ctx, g);
    }
    for (g = 0; g < 2; ++g) ecx_receive_processdata_group(&ctx, g, EC_TIMEOUTRET);
}

static OSAL_THREAD_FUNC check(void *ptr) {
    (void)ptr;
    while (running) {
        int n;
        ecx_readstate(&ctx);
        for (n = 1; n <= ctx.slavecount; ++n) {
            ec_slavet *s = &ctx.slavelist[n];
            const uint16 slave = (uint16)n;
            if (!in_op || s->state == EC_STATE_OPERATIONAL) continue;
            ctx.grouplist[s->group].docheckstate = TRUE;
            if (s->state == EC_STATE_SAFE_OP + EC_STATE_ERROR) {
                s->state = EC_STATE_SAFE_OP + EC_STATE_ACK;
                ecx_writestate(&ctx, slave);
            } else if (s->state == EC_STATE_SAFE_OP) {
                s->state = EC_STATE_OPERATIONAL;
                if (s->mbxhandlerstate == ECT_MBXH_LOST) s->mbxhandlerstate = ECT_MBXH_CYCLIC;
                ecx_writestate(&ctx, slave);
            } else if (s->state > EC_STATE_NONE) {
                if (ecx_reconfig_slave(&ctx, slave, EC_TIMEOUTRET) >= EC_STATE_PRE_OP) s->islost = FALSE;
            } else if (!s->islost) {
                ecx_statecheck(&ctx, slave, EC_STATE_OPERATIONAL, EC_TIMEOUTRET);
                if (s->state == EC_STATE_NONE) {
                    s->islost = TRUE;
                    s->mbxhandlerstate = ECT_MBXH_LOST;
                    if (s->Ibytes) memset(s->inputs, 0, s->Ibytes);
                }
            }
            if (s->islost && s->state <= EC_STATE_INIT && ecx_recover_slave(&ctx, slave, 500)) s->islost = FALSE;
        }
        ++checks;
        osal_usleep(5000);
    }
}

/* Waits until a number of further cycles is over. */
static void wait_cycles(int count) {
    const int until = cycles + count;
    int n;
    for (n = 0; n < 20000 && cycles < until; ++n) osal_usleep(1000);
}

/* The program writes blockLRW while process data is exchanged: the working counters that it has computed still come back. */
static void split_and_join(uint8 group) {
    uint8 *const blocked = &ctx.grouplist[group].blockLRW;
    int before, failed;
    *blocked = 1;
    wait_cycles(20);
    before = right[group];
    failed = wrong_in_op[group];
    wait_cycles(100);
    MUST(right[group] - before >= 95);
    *blocked = 0;
    wait_cycles(20);
    wait_cycles(100);
    printf("group %d: %d wrong cycles\n", group, wrong_in_op[group] - failed);
}

/* Mail of the program itself, in buffers of the pool: an SDO upload, octet by octet. Without a free buffer the answer waits. */
static void own_mail(uint16 slave) {
    static ec_mbxbuft *taken[EC_MBXPOOLSIZE];
    ec_mbxbuft *mail = ecx_getmbx(&ctx), *answer = NULL;
    ec_mbxheadert *header = (ec_mbxheadert *)mail;
    uint8 *octets = (uint8 *)mail + sizeof(ec_mbxheadert);
    uint32 type;
    int n = 0;
    if (mail == NULL) {
        MUST(mail != NULL);
        return;
    }
    ec_clearmbx(mail);
    header->length = htoes(10);
    header->mbxtype = ECT_MBXT_COE;
    octets[1] = ECT_COES_SDOREQ << 4;
    octets[2] = ECT_SDO_UP_REQ;
    octets[4] = 0x10;
    MUST(ecx_mbxsend(&ctx, slave, mail, EC_TIMEOUTTXM) > 0);
    while (n < EC_MBXPOOLSIZE && (taken[n] = ecx_getmbx(&ctx)) != NULL) ++n;
    MUST(n == EC_MBXPOOLSIZE && ecx_getmbx(&ctx) == NULL);
    osal_usleep(20000);
    MUST(ecx_mbxreceive(&ctx, slave, &answer, 1000) <= 0 && answer == NULL);
    while (n > 0) MUST(ecx_dropmbx(&ctx, taken[--n]) == 1);
    MUST(ecx_mbxreceive(&ctx, slave, &answer, EC_TIMEOUTRXM) > 0 && answer != NULL);
    if (answer == NULL) return;
    octets = (uint8 *)answer + sizeof(ec_mbxheadert);
    memcpy(&type, octets + 6, sizeof(type));
    MUST((((ec_mbxheadert *)answer)->mbxtype & 0x0F) == ECT_MBXT_COE && octets[1] >> 4 == ECT_COES_SDORES);
    MUST(etohl(type) == read_number(slave, 0x1000));
    MUST(ecx_dropmbx(&ctx, answer) == 1 && ecx_dropmbx(&ctx, (ec_mbxbuft *)&ctx) == 0);
    MUST(ecx_mbxreceive(&ctx, slave, &answer, 1000) <= 0 && answer == NULL);
}

/* The slaves leave OP, as after a fault: the check thread brings them back. */
static void fall(uint16 slave) {
    uint16 word = htoes(EC_STATE_PRE_OP);
    const int before = hooks;
    int n;
    MUST(ecx_FPWR(&ctx.port, ctx.slavelist[slave].configadr, ECT_REG_ALCTL, sizeof(word), &word, EC_TIMEOUTSAFE) == 1);
    wait_cycles(20);
    for (n = 0; n < 2000 && (ctx.slavelist[slave].state != EC_STATE_OPERATIONAL || hooks == before); ++n) osal_usleep(2000);
    MUST(ctx.slavelist[slave].state == EC_STATE_OPERATIONAL);
    MUST(hooks == before + 1 && ctx.grouplist[ctx.slavelist[slave].group].docheckstate == TRUE);
    MUST(read_number(slave, 0x6081) == 77000U + slave);
}

/* The interface is switched off: no slave has a state, and no cycle comes back. Switched on again, the check thread brings the slaves to OP. */
static void switch_off_and_on(const char *interface) {
    char command[128];
    int n, before;
    snprintf(command, sizeof(command), "ip link set %s down", interface);
    MUST(system(command) == 0);
    wait_cycles(50);
    before = right[0] + right[1];
    wait_cycles(50);
    MUST(right[0] + right[1] == before);
    MUST(ecx_readstate(&ctx) == EC_STATE_NONE && ctx.slavelist[1].state == EC_STATE_NONE);
    MUST(ecx_statecheck(&ctx, 0, EC_STATE_OPERATIONAL, EC_TIMEOUTRET) == EC_STATE_NONE);
    MUST(ecx_BRD(&ctx.port, 0, ECT_REG_TYPE, 1, &n, EC_TIMEOUTRET) == EC_NOFRAME);
    snprintf(command, sizeof(command), "ip link set %s up", interface);
    MUST(system(command) == 0);
    for (n = 0; n < 2000 && ecx_statecheck(&ctx, 0, EC_STATE_OPERATIONAL, 20000) != EC_STATE_OPERATIONAL; ++n) {
    }
    MUST(ctx.slavelist[0].state == EC_STATE_OPERATIONAL);
    for (n = 1; n <= ctx.slavecount; ++n) MUST(read_number((uint16)(1 + n % 2), 0x1000) != 0xFFFFFFFF);
    before = right[0];
    wait_cycles(100);
    MUST(right[0] - before >= 50);
}

int main(int argc, char **argv) {
    int n, used, drives = 0, cyclic = 0;
    char name[EC_MAXNAME + 1];
    if (argc < 2) return 2;
    ctx.userdata = &hooks;
    ctx.ENI = &eni;
    if (!ecx_init(&ctx, argv[1]) || ecx_config_init(&ctx) < 3) return 1;
    /* Terminals in group 0 would take all slaves: the drives have group 1, and group 1 is mapped behind group 0. */
    for (n = 1; n <= ctx.slavecount; ++n) {
        ec_slavet *s = &ctx.slavelist[n];
        MUST(s->state == EC_STATE_INIT && s->configadr == EC_NODEOFFSET + n && s->group == 0);
        ecx_siistring(&ctx, name, (uint16)n, 1);
        MUST(strcmp(name, s->name) == 0);
        MUST(ecx_readeeprom(&ctx, (uint16)n, ECT_SII_SER, EC_TIMEOUTEEP) == s->eep_ser);
        if (s->mbx_proto & ECT_MBXPROT_COE) {
            s->group = 1;
            s->PO2SOconfig = setup;
            ++drives;
        }
    }
    MUST(drives >= 2 && drives < ctx.slavecount);
    for (n = 0; n < 2; ++n) {
        eni_slaves[n].Slave = (uint16)(n + 1);
        eni_slaves[n].VendorId = ctx.slavelist[n + 1].eep_man;
        eni_slaves[n].ProductCode = ctx.slavelist[n + 1].eep_id;
        eni_slaves[n].RevisionNo = ctx.slavelist[n + 1].eep_rev + (uint32)n;
        eni_slaves[n].CoECmds = commands1;
        eni_slaves[n].CoECmdCount = 2;
    }
    ecx_statecheck(&ctx, 0, EC_STATE_PRE_OP, EC_TIMEOUTSTATE);
    used = ecx_config_map_group(&ctx, map0, 0);
    MUST(used > 0 && used <= (int)sizeof(map0));
    MUST(ctx.slavelist[0].Ibytes == ctx.grouplist[0].Ibytes + (uint32)ctx.grouplist[0].mbxstatuslength);
    MUST(ctx.grouplist[0].mbxstatuslength == 0 || ctx.slavelist[0].mbxstatus == ctx.grouplist[0].mbxstatus);
    hooks = 0;
    used = ecx_config_map_group(&ctx, map1, 1);
    MUST(used == (int)(ctx.grouplist[1].Obytes + ctx.grouplist[1].Ibytes) + ctx.grouplist[1].mbxstatuslength);
    MUST(hooks == drives);
    MUST(ctx.grouplist[1].logstartaddr == 1U << EC_LOGGROUPOFFSET && ctx.grouplist[1].outputs == map1);
    for (n = 1; n <= ctx.slavecount; ++n) {
        const ec_slavet *s = &ctx.slavelist[n];
        const uint8 *const map = s->group == 1 ? map1 : map0;
        MUST(s->Obits == 0 || s->outputs == map + s->Ooffset);
        MUST(s->Ibits == 0 || s->inputs == map + s->Ioffset);
        MUST(s->Ostartbit == 0 && s->Istartbit == 0);
        if (s->CoEdetails > 0) cyclic += ecx_slavembxcyclic(&ctx, (uint16)n);
        MUST((s->mbxstatus != NULL) == (s->mbxhandlerstate == ECT_MBXH_CYCLIC));
    }
    MUST(cyclic == drives && ctx.grouplist[1].mbxstatuslength == drives);
    MUST(read_number(1, 0x6083) == 1234 && read_number(1, 0x6084) != 5678 && read_number(2, 0x6083) != 1234);
    MUST(ecx_mbxENIinitcmds(&ctx, 1, ECT_ESMTRANS_SO) == 1 && read_number(1, 0x6084) == 5678);
    commands1[1].Index = 0x5FFE; /* an object that is not there */
    MUST(ecx_mbxENIinitcmds(&ctx, 1, ECT_ESMTRANS_SO) == 0 && ecx_iserror(&ctx));
    MUST(ecx_mbxENIinitcmds(&ctx, 2, ECT_ESMTRANS_SO) == 1);
    while (ecx_iserror(&ctx)) printf("%s", ecx_elist2string(&ctx));

    MUST(ecx_configdc(&ctx) == TRUE && ctx.slavelist[0].hasdc && ctx.grouplist[1].hasdc && ctx.grouplist[1].DCnext == 1);
    for (n = 1; n <= ctx.slavecount; ++n)
        if (ctx.slavelist[n].hasdc && ctx.slavelist[n].group == 1) {
            ecx_dcsync0(&ctx, (uint16)n, TRUE, CYCLE_NS, CYCLE_NS / 2);
            MUST(ctx.slavelist[n].DCactive == 1 && ctx.slavelist[n].DCcycle == CYCLE_NS && ctx.slavelist[n].DCshift == CYCLE_NS / 2);
        }
    for (n = 0; n < 2; ++n) expected[n] = ctx.grouplist[n].outputsWKC * 2 + ctx.grouplist[n].inputsWKC;
    MUST(expected[0] > 0 && expected[1] == 3 * drives);
    MUST(ecx_statecheck(&ctx, 0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE * 4) == EC_STATE_SAFE_OP);

    running = 1;
    MUST(osal_thread_create_rt(&rt_thread, 128000, (void *)rt, NULL) == 1);
    MUST(osal_thread_create(&check_thread, 128000, (void *)check, NULL) == 1);
    wait_cycles(20);
    ctx.slavelist[0].state = EC_STATE_OPERATIONAL;
    MUST(ecx_writestate(&ctx, 0) == ctx.slavecount);
    for (n = 0; n < 100 && ecx_statecheck(&ctx, 0, EC_STATE_OPERATIONAL, 50000) != EC_STATE_OPERATIONAL; ++n) {
    }
    MUST(ctx.slavelist[0].state == EC_STATE_OPERATIONAL);
    in_op = 1;
    for (n = 0; n < 20; ++n) MUST(read_number((uint16)(1 + n % 2), 0x6081) == 77001U + (uint32)(n % 2));
    split_and_join(1);
    split_and_join(0);
    own_mail(2);
    fall(2);
    while (cycles < CYCLES) osal_usleep(1000);
    in_op = 0;
    printf("%d cycles, %d and %d right, in OP %d and %d wrong, %d times, %d checks\n", cycles, right[0], right[1], wrong_in_op[0],
           wrong_in_op[1], times, checks);
    MUST(right[0] * 10 >= cycles * 9 && right[1] * 10 >= cycles * 8);
    MUST(times * 10 >= cycles * 8 && back_in_time == 0);
    if (argc > 2) {
        in_op = 1;
        switch_off_and_on(argv[2]);
        in_op = 0;
    }
    running = 0;
    osal_usleep(20000);
    pthread_join((pthread_t)rt_thread, NULL);
    pthread_join((pthread_t)check_thread, NULL);
    MUST(handled == 2 * cycles && checks > 0);
    ctx.slavelist[0].state = EC_STATE_INIT;
    ecx_writestate(&ctx, 0);
    MUST(ecx_statecheck(&ctx, 0, EC_STATE_INIT, EC_TIMEOUTSTATE) == EC_STATE_INIT);
    ecx_close(&ctx);
    printf("%d wrong\n", wrong);
    return wrong == 0 ? 0 : 1;
}
