/* Another thread closes the master while a call waits for something that does not come: the call ends at once, as if no
 * frame came back, and so does ec_close(). */
#include "ethercat.h"

#include <pthread.h>
#include <stdio.h>
#include <time.h>

#include "must.h"

#define LONG_TIME 8000000
#define SHORT 1.5 /* seconds */

static int wrong;
static char image[4096];
static int kind;
static int result;

static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

static OSAL_THREAD_FUNC wait_long(void* unused) {
    ec_mbxbuft mail;
    uint8 frame[64];
    int size = sizeof(frame);
    uint16 status = 0;
    (void)unused;
    switch (kind) {
        case 0: result = ec_statecheck(0, EC_STATE_OPERATIONAL, LONG_TIME); break;
        case 1: result = ec_mbxreceive(1, &mail, LONG_TIME); break;
        case 2: result = ecx_EOErecv(&ecx_context, 1, 0, &size, frame, LONG_TIME); break;
        case 3: result = ec_readeepromAP(0x7000, ECT_SII_MANUF, LONG_TIME) != 0; break;
        case 4: result = ec_writeeepromAP(0x7000, ECT_SII_MANUF, 0, LONG_TIME); break;
        default: result = ec_eeprom_waitnotbusyFP(0x7000, &status, LONG_TIME); break;
    }
}

int main(int argc, char** argv) {
    if (argc < 2) return 1;
    for (kind = 0; kind < 6; ++kind) {
        OSAL_THREAD_HANDLE thread;
        double begin;
        if (ec_init(argv[1]) <= 0 || ec_config_init(FALSE) < 1) return 2;
        ec_config_map(image);
        result = -2;
        osal_thread_create(&thread, 128000, (void*)&wait_long, NULL);
        osal_usleep(50000);
        begin = seconds();
        ec_close();
        printf("call %d: closed after %.3f s\n", kind, seconds() - begin);
        MUST(seconds() - begin < SHORT);
        pthread_join((pthread_t)thread, NULL);
        MUST(seconds() - begin < SHORT);
        MUST(result == 0);
    }
    return wrong != 0;
}
