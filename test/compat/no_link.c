/* Without a link the scan returns at once, as with the original, and the program asks again: no_link SOURCE, whose first
   slave gets power after 3 s. In virtual time, so that a longer wait shows as slaves that were found. */
#include "must.h"

#ifdef SOEM2
#include <soem/soem.h>
static ecx_contextt context;
#define CTX (&context)
#define CONFIG_INIT() ecx_config_init(CTX)
#else
#include <ethercat.h>
#define CTX (&ecx_context)
#define CONFIG_INIT() ecx_config_init(CTX, FALSE)
#endif

#include <stdio.h>

static int wrong;

int main(int argc, char **argv) {
    int n;
    if (argc != 2 || ecx_init(CTX, argv[1]) <= 0) return 2;
    for (n = 0; n < 20; ++n) MUST(CONFIG_INIT() <= 0);
    osal_usleep(4000000);
    MUST(CONFIG_INIT() == 1);
    ecx_close(CTX);
    printf("%d wrong\n", wrong);
    return wrong == 0 ? 0 : 1;
}
