/* The hook of a slave waits for another thread that reads an EEPROM. A third thread measures the clocks meanwhile, and goes
   on when the hook is over. */
#include "ethercat.h"

#include <pthread.h>
#include <stdio.h>
#include <unistd.h>

#include "must.h"

static int wrong;
static char image[4096];
static volatile int over;
static int hooks;
static uint32 vendor;

static OSAL_THREAD_FUNC read_vendor(void* unused) {
    (void)unused;
    vendor = ec_readeeprom(1, ECT_SII_MANUF, EC_TIMEOUTEEP);
    over = 1;
}

static volatile int measuring;
static int measured;
static void* measure(void* unused) {
    (void)unused;
    while (!measuring) osal_usleep(1000);
    measured += ec_configdc() ? 1 : 0;
    return NULL;
}

static int hook(uint16 slave) {
    OSAL_THREAD_HANDLE thread;
    int n;
    MUST(slave == 2);
    over = 0;
    measuring = 1;
    osal_usleep(50000); /* the thread that measures has begun */
    osal_thread_create(&thread, 128000, (void*)&read_vendor, NULL);
    for (n = 0; n < 2000 && !over; ++n) osal_usleep(1000);
    MUST(over);
    if (over) pthread_join((pthread_t)thread, NULL);
    ++hooks;
    return 1;
}

int main(int argc, char** argv) {
    pthread_t clocks;
    alarm(60);
    if (argc < 2 || ec_init(argv[1]) <= 0 || ec_config_init(FALSE) < 2) return 2;
    ec_slave[2].PO2SOconfig = hook;
    pthread_create(&clocks, NULL, measure, NULL);
    MUST(ec_config_map(image) > 0);
    pthread_join(clocks, NULL);
    MUST(measured == 1);
    MUST(hooks == 1 && vendor == ec_slave[1].eep_man);
    MUST(ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE) == EC_STATE_SAFE_OP);
    vendor = 0;
    measuring = 0;
    pthread_create(&clocks, NULL, measure, NULL);
    MUST(ec_reconfig_slave(2, 500) == EC_STATE_SAFE_OP);
    MUST(hooks == 2 && vendor == ec_slave[1].eep_man);
    pthread_join(clocks, NULL);
    MUST(measured == 2);
    ec_close();
    return wrong != 0;
}
