/* More slaves than the interface has room for: config_init() says so and shows none of them, and the states of all can
   be asked and written at once all the same. exceeded SOURCE */
#ifdef SOEM2
#include <soem/soem.h>
static ecx_contextt context;
#define COUNT context.slavecount
#define SLAVES context.slavelist
#define SCAN() ecx_config_init(&context)
#else
#include "ethercat.h"
#define context ecx_context
#define COUNT ec_slavecount
#define SLAVES ec_slave
#define SCAN() ecx_config_init(&context, FALSE)
#endif

#include <stdio.h>

#include "must.h"

int main(int argc, char** argv) {
    int wrong = 0;
    if (argc != 2 || !ecx_init(&context, argv[1])) return 2;
    MUST(SCAN() == EC_SLAVECOUNTEXCEEDED);
    MUST(COUNT == 0);
    SLAVES[0].state = EC_STATE_INIT;
    MUST(ecx_writestate(&context, 0) == EC_MAXSLAVE);
    MUST(ecx_statecheck(&context, 0, EC_STATE_INIT, EC_TIMEOUTSTATE) == EC_STATE_INIT);
    SLAVES[0].state = 0;
    MUST(ecx_readstate(&context) == EC_STATE_INIT);
    MUST(SLAVES[0].state == EC_STATE_INIT);
    ecx_close(&context);
    return wrong != 0;
}
