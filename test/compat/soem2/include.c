/* The headers alone, and names that programs define themselves. */
#include "soem/soem.h"
#include "oshw.h"

#define EC_TIMEOUTMON 500

static ecx_contextt ctx;
static uint8 IOmap[4096];
int example(void) {
    ec_timet a, b, c;
    osal_get_monotonic_time(&a);
    osal_get_monotonic_time(&b);
    osal_timespecadd(&a, &b, &c);
    if (ecx_init(&ctx, "eth0") <= 0 || ecx_config_init(&ctx) <= 0) return 0;
    return ecx_config_map_group(&ctx, IOmap, 0) + ctx.slavecount + EC_TIMEOUTMON + (c.tv_sec > 0);
}
