/* Another thread closes the master while ec_config_init() searches the slaves, earlier or later: ec_config_init() has
 * found all slaves and all of their data, or it has found none. */
#include "ethercat.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "must.h"

static int wrong;
static ec_slavet whole[EC_MAXSLAVE];

static long microseconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1000000L + now.tv_nsec / 1000;
}

static OSAL_THREAD_FUNC close_later(void* delay) {
    osal_usleep(*(uint32*)delay);
    ec_close();
}

static int differ(const ec_slavet* one, const ec_slavet* other) {
    return one->eep_man != other->eep_man || one->Itype != other->Itype || one->mbx_l != other->mbx_l ||
           one->activeports != other->activeports || strcmp(one->name, other->name) != 0;
}

int main(int argc, char** argv) {
    int interrupted = 0;
    int n;
    const int rounds = argc < 3 ? 0 : atoi(argv[2]);
    if (rounds < 1) return 1;
    for (n = 0; n < rounds; ++n) {
        OSAL_THREAD_HANDLE thread;
        uint32 delay;
        long begin;
        int slaves;
        int again;
        int s;
        if (ec_init(argv[1]) <= 0) return 2;
        begin = microseconds();
        slaves = ec_config_init(FALSE);
        delay = (uint32)((microseconds() - begin) * n / rounds);
        MUST(slaves > 0);
        memcpy(whole, ec_slave, sizeof(whole));
        osal_thread_create(&thread, 128000, (void*)&close_later, &delay);
        again = ec_config_init(FALSE);
        pthread_join((pthread_t)thread, NULL);
        MUST(again == ec_slavecount || (again == EC_NOFRAME && ec_slavecount == 0));
        if (again == EC_NOFRAME) {
            ++interrupted;
            continue;
        }
        MUST(again == slaves);
        for (s = 1; s <= again; ++s) MUST(!differ(&ec_slave[s], &whole[s]));
    }
    printf("%d of %d scans were interrupted\n", interrupted, rounds);
    MUST(interrupted > 0);
    return wrong != 0;
}
