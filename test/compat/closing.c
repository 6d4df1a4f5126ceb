/* One thread opens and closes the master again and again, while another one is inside all kinds of calls. Each call
 * returns, and no call uses a master that is closed. The check thread runs still when the process ends. */
#include "ethercat.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char image[4096];
static volatile int calls;

static OSAL_THREAD_FUNC check(void* unused) {
    (void)unused;
    for (;;) {
        uint32 type = 0;
        int size = sizeof(type);
        ec_readstate();
        ec_statecheck(1, EC_STATE_OPERATIONAL, 500);
        ec_SDOread(1, 0x1000, 0, FALSE, &size, &type, 20000);
        ec_recover_slave(1, 500);
        ec_send_processdata();
        ec_receive_processdata(500);
        ++calls;
        osal_usleep(50);
    }
}

/* Texts of a table can be used together. */
static int texts(void) {
    const char* const al = ec_ALstatuscode2string(0x11);
    const char* const sdo = ec_sdoerror2string(0x06020000);
    const char* const again = ec_ALstatuscode2string(0x11);
    return al == again && strcmp(al, sdo) != 0 && strlen(al) > 5 && strlen(sdo) > 5;
}

int main(int argc, char** argv) {
    OSAL_THREAD_HANDLE thread;
    int n;
    if (argc < 3 || !texts()) return 1;
    osal_thread_create(&thread, 128000, (void*)&check, NULL);
    for (n = 0; n < atoi(argv[2]); ++n) {
        if (ec_init(argv[1]) <= 0 || ec_config_init(FALSE) < 1) return 2;
        ec_config_map(image);
        osal_usleep((uint32)(n * 137 % 2000));
        ec_close();
    }
    printf("%d rounds, %d of the other thread\n", n, calls);
    return calls > 0 ? 0 : 3;
}
