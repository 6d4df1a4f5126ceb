/* Groups without process data: nothing is sent, and so nothing comes back. */
#ifdef SOEM2
#include <soem/soem.h>
#else
#include "ethercat.h"
#endif

#include <stdio.h>

#include "must.h"

static int wrong;
static char images[2][4096];
#ifdef SOEM2
static ecx_contextt context;
#define SLAVES context.slavelist
#define GROUPS context.grouplist
#else
#define context ecx_context
#define SLAVES ec_slave
#define GROUPS ec_group
#endif

static void exchange(uint8 group, int sent, int received) {
    MUST(ecx_send_processdata_group(&context, group) == sent);
    MUST(ecx_receive_processdata_group(&context, group, EC_TIMEOUTRET) == received);
}

/* `argv[1]`: a coupler and a drive. */
int main(int argc, char** argv) {
    int n;
    if (argc < 2 || !ecx_init(&context, argv[1])) return 2;
    exchange(0, 0, EC_NOFRAME);
#ifdef SOEM2
    MUST(ecx_config_init(&context) == 2);
#else
    MUST(ecx_config_init(&context, FALSE) == 2);
#endif
    exchange(0, 0, EC_NOFRAME);
    /* The coupler alone. */
    SLAVES[1].group = 1;
    SLAVES[2].group = 0;
    MUST(ecx_config_map_group(&context, images[1], 1) == 0);
    MUST(GROUPS[1].nsegments == 0);
    for (n = 0; n < 3; ++n) {
        exchange(1, 0, EC_NOFRAME);
        GROUPS[1].blockLRW ^= 1;
    }
    GROUPS[1].blockLRW = 0;
    /* Both: the drive is in this group too. */
    SLAVES[2].group = 1;
    MUST(ecx_config_map_group(&context, images[1], 1) > 0);
    exchange(1, 1, 3);
    /* The group loses all slaves to another one. */
    MUST(ecx_config_map_group(&context, images[0], 0) > 0);
    exchange(0, 1, 3);
    exchange(1, 0, EC_NOFRAME);
    exchange(0, 1, 3);
    ecx_close(&context);
    return wrong != 0;
}
