/* Several masters in one program, each with a thread for the cycle and a thread that looks at its slaves. A master ends while its check
   thread is inside calls, and the others continue: masters SOURCE SOURCE [SOURCE]. */
#ifdef SOEM2
#include <soem/soem.h>
struct master {
    ecx_contextt context;
#define SLAVES(m) (m)->context.slavelist
#define GROUPS(m) (m)->context.grouplist
#define COUNT(m) (m)->context.slavecount
#define CONFIG_INIT(c) ecx_config_init(c)
#else
#include <ethercat.h>
#define MOST 32
struct master {
    ecx_contextt context;
    ecx_portt port;
    ec_slavet slaves[MOST];
    int count;
    ec_groupt groups[EC_MAXGROUP];
    uint8 esibuf[EC_MAXEEPBUF];
    uint32 esimap[EC_MAXEEPBITMAP];
    ec_eringt errors;
    ec_idxstackT stack;
    boolean flag;
    int64 dctime;
    ec_SMcommtypet types;
    ec_PDOassignt assign;
    ec_PDOdesct desc;
    ec_eepromSMt sm;
    ec_eepromFMMUt fmmu;
#define SLAVES(m) (m)->slaves
#define GROUPS(m) (m)->groups
#define COUNT(m) (m)->count
#define CONFIG_INIT(c) ecx_config_init(c, FALSE)
#endif
    const char *source;
    char map[4096];
    volatile int stop;
    volatile int checks;
    int cycles;
    int failed;
};

#include <pthread.h>
#include <stdio.h>
#include <string.h>

static struct master masters[3];

static void prepare(struct master *m) {
#ifdef SOEM2
    (void)m;
#else
    m->context.port = &m->port;
    m->context.slavelist = m->slaves;
    m->context.slavecount = &m->count;
    m->context.maxslave = MOST;
    m->context.grouplist = m->groups;
    m->context.maxgroup = EC_MAXGROUP;
    m->context.esibuf = m->esibuf;
    m->context.esimap = m->esimap;
    m->context.elist = &m->errors;
    m->context.idxstack = &m->stack;
    m->context.ecaterror = &m->flag;
    m->context.DCtime = &m->dctime;
    m->context.SMcommtype = &m->types;
    m->context.PDOassign = &m->assign;
    m->context.PDOdesc = &m->desc;
    m->context.eepSM = &m->sm;
    m->context.eepFMMU = &m->fmmu;
#endif
}

/* The check thread of the samples. It runs on while its master is closed. */
static void *check(void *argument) {
    struct master *m = (struct master *)argument;
    uint16 n;
    while (!m->stop) {
        uint32 type;
        int size = sizeof(type);
        ecx_readstate(&m->context);
        for (n = 1; n <= COUNT(m) && n < 16; ++n) {
            if (SLAVES(m)[n].state == EC_STATE_SAFE_OP + EC_STATE_ERROR) {
                SLAVES(m)[n].state = EC_STATE_SAFE_OP + EC_STATE_ACK;
                ecx_writestate(&m->context, n);
            } else if (SLAVES(m)[n].state == EC_STATE_NONE) {
                ecx_recover_slave(&m->context, n, 500);
            }
        }
        ecx_SDOread(&m->context, 1, 0x1000, 0, FALSE, &size, &type, 20000);
        ecx_statecheck(&m->context, 1, EC_STATE_OPERATIONAL, 500);
        while (ecx_iserror(&m->context)) ecx_elist2string(&m->context);
        ++m->checks;
        osal_usleep(500);
    }
    return NULL;
}

static void *drive(void *argument) {
    struct master *m = (struct master *)argument;
    pthread_t thread;
    int round, n;
    pthread_create(&thread, NULL, check, m);
    for (round = 0; round < 4 && m->failed == 0; ++round) {
        ecx_contextt *c = &m->context;
        int expected, right = 0;
        if (ecx_init(c, m->source) <= 0 || CONFIG_INIT(c) < 1) {
            m->failed = 1;
            break;
        }
        if (ecx_config_map_group(c, m->map, 0) <= 0) m->failed = 2;
        ecx_configdc(c);
        ecx_statecheck(c, 0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE);
        expected = GROUPS(m)[0].outputsWKC * 2 + GROUPS(m)[0].inputsWKC;
        for (n = 0; n < 100; ++n) {
            ecx_send_processdata(c);
            if (ecx_receive_processdata(c, 20000) == expected) ++right;
            ++m->cycles;
            osal_usleep(200);
        }
        if (right < 90) {
            printf("%s: %d cycles of 100 are right\n", m->source, right);
            m->failed = 3;
        }
        ecx_close(c);
    }
    m->stop = 1;
    pthread_join(thread, NULL);
    return NULL;
}

int main(int argc, char **argv) {
    pthread_t threads[3];
    int n, wrong = 0;
    if (argc < 3 || argc > 4) return 2;
    for (n = 0; n < argc - 1; ++n) {
        prepare(&masters[n]);
        masters[n].source = argv[n + 1];
        pthread_create(&threads[n], NULL, drive, &masters[n]);
    }
    for (n = 0; n < argc - 1; ++n) {
        pthread_join(threads[n], NULL);
        printf("%s: %d cycles, %d checks, %s %d\n", masters[n].source, masters[n].cycles, masters[n].checks,
               masters[n].failed ? "failed" : "good", masters[n].failed);
        wrong += masters[n].failed != 0 || masters[n].checks == 0;
    }
    return wrong == 0 ? 0 : 1;
}
