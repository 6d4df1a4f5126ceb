/* Inputs change only while the thread of the cycle receives, also when another thread exchanges frames: held_inputs SOURCE
   With and without distributed clocks, whose time is a second datagram of the frame. */
#include <ethercat.h>

#include <pthread.h>
#include <stdio.h>
#include <string.h>

#include "must.h"

enum { CYCLES = 300, MARK = 0xA5 };

static char IOmap[4096];
static int wrong, stop, calls;

static void* exchange(void* unused) {
    (void)unused;
    while (!__sync_fetch_and_add(&stop, 0)) {
        uint32 vendor = 0;
        int size = sizeof vendor;
        ec_readstate();
        ec_SDOread(1, 0x1018, 1, FALSE, &size, &vendor, EC_TIMEOUTRXM);
        __sync_fetch_and_add(&calls, 1);
        osal_usleep(200);
    }
    return NULL;
}

static int all_are(const uint8* octets, uint32 count, int value) {
    uint32 n;
    for (n = 0; n < count; ++n)
        if (octets[n] != value) return 0;
    return 1;
}

static void cycle(void) {
    const uint32 count = ec_group[0].Ibytes;
    uint8* const inputs = ec_group[0].inputs;
    const int expected = ec_group[0].outputsWKC * 2 + ec_group[0].inputsWKC;
    int early = 0, old = 0, cycles = 0;
    pthread_t thread;
    stop = 0;
    calls = 0;
    MUST(pthread_create(&thread, NULL, &exchange, NULL) == 0);
    /* A busy machine may keep the other thread from the processor, or a frame for longer than the timeout. */
    for (; cycles < CYCLES || (cycles < 20 * CYCLES && __sync_fetch_and_add(&calls, 0) <= 10); ++cycles) {
        int wkc;
        memset(inputs, MARK, count);
        ec_send_processdata();
        osal_usleep(500);
        early += !all_are(inputs, count, MARK);
        wkc = ec_receive_processdata(EC_TIMEOUTRET);
        old += wkc != expected || all_are(inputs, count, MARK);
    }
    __sync_fetch_and_add(&stop, 1);
    pthread_join(thread, NULL);
    printf("%d of %d cycles had new inputs before they were received, %d had none behind; %d calls beside them\n", early,
           cycles, old, calls);
    MUST(early == 0);
    MUST(old < cycles / 10);
    MUST(calls > 10);
}

int main(int argc, char** argv) {
    if (argc != 2 || ec_init(argv[1]) <= 0 || ec_config_init(FALSE) <= 0) return 2;
    MUST(ec_config_map(IOmap) > 0);
    MUST(ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE * 4) == EC_STATE_SAFE_OP);
    MUST(ec_group[0].Ibytes > 0);
    cycle();
    MUST(ec_configdc());
    MUST(ec_config_map(IOmap) > 0);
    MUST(ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE * 4) == EC_STATE_SAFE_OP);
    cycle();
    MUST(ec_DCtime != 0);
    ec_close();
    return wrong != 0;
}
