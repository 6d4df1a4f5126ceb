/* A master is closed while another thread sends mail, and so takes buffers out of the pool of the context and gives
 * them back. After that the pool has no buffer, and the next opening fills it again. */
#include <soem/soem.h>

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

#include "must.h"

#define CONTEXTS 2

static int wrong;
static ecx_contextt contexts[CONTEXTS];
static volatile int stop;

static OSAL_THREAD_FUNC use(void* argument) {
    ecx_contextt* const context = argument;
    while (!stop) {
        ec_mbxbuft* const mail = ecx_getmbx(context);
        if (mail == NULL) continue;
        ec_clearmbx(mail);
        ecx_dropmbx(context, mail);
    }
}

int main(int argc, char** argv) {
    OSAL_THREAD_HANDLE threads[CONTEXTS];
    int n;
    int taken = 0;
    if (argc < 3) return 1;
    for (n = 0; n < CONTEXTS; ++n) osal_thread_create(&threads[n], 128000, (void*)&use, &contexts[n]);
    for (n = 0; n < atoi(argv[2]); ++n) {
        ecx_contextt* const context = &contexts[n % CONTEXTS];
        if (ecx_init(context, argv[1]) <= 0) return 2;
        osal_usleep((uint32)(n * 37 % 500));
        ecx_close(context);
        MUST(ecx_getmbx(context) == NULL);
    }
    stop = 1;
    for (n = 0; n < CONTEXTS; ++n) pthread_join((pthread_t)threads[n], NULL);
    MUST(ecx_init(&contexts[0], argv[1]) > 0);
    while (ecx_getmbx(&contexts[0]) != NULL) ++taken;
    MUST(taken == EC_MBXPOOLSIZE);
    ecx_close(&contexts[0]);
    return wrong;
}
