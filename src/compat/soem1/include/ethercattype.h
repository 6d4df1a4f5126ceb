/* Constants, enumerations and the error entry of the interface SOEM 1.4. An interface that programs of other masters are written for; what each function does here: src/compat/README.md */
#ifndef MARGAY_SOEM1_ETHERCATTYPE_H
#define MARGAY_SOEM1_ETHERCATTYPE_H

#include "osal.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The functions and variables of one global master; with EC_VER2 only the functions with a context */
#ifndef EC_VER2
#ifndef EC_VER1
#define EC_VER1
#endif
#endif

/* An application may bring timeouts that it can change at run time */
#ifdef USE_SOEM_CONFIG_H
#include "soem_config.h"
#endif

/* Sizes, timeouts in microseconds, results */
#ifndef EC_TIMEOUTRET
#define EC_TIMEOUTRET 2000
#endif
#ifndef EC_TIMEOUTRET3
#define EC_TIMEOUTRET3 (EC_TIMEOUTRET * 3)
#endif
#ifndef EC_TIMEOUTSAFE
#define EC_TIMEOUTSAFE 20000
#endif
#ifndef EC_TIMEOUTEEP
#define EC_TIMEOUTEEP 20000
#endif
#ifndef EC_TIMEOUTRXM
#define EC_TIMEOUTRXM 700000
#endif
#ifndef EC_TIMEOUTSTATE
#define EC_TIMEOUTSTATE 2000000
#endif
#define EC_MAXEEPBITMAP 128
#define EC_MAXEEPBUF 4096
#define EC_BUFSIZE EC_MAXECATFRAME
#ifndef EC_MAXBUF
#define EC_MAXBUF 16
#endif
#ifndef EC_TIMEOUTTXM
#define EC_TIMEOUTTXM 20000
#endif
#ifndef EC_DEFAULTRETRIES
#define EC_DEFAULTRETRIES 3
#endif
#define EC_LOGGROUPOFFSET 16

#include "margay_soem/type.h"

/* Word addresses of the SII */
enum {
    ECT_SII_MANUF = 8, ECT_SII_ID = 0xa, ECT_SII_REV = 0xc, ECT_SII_BOOTRXMBX = 0x14, ECT_SII_BOOTTXMBX = 0x16,
    ECT_SII_MBXSIZE = 0x19, ECT_SII_TXMBXADR = 0x1a, ECT_SII_RXMBXADR = 0x18, ECT_SII_MBXPROTO = 0x1c
};

#define ECT_SII_SN 0x0e

/* Traces of the application */
#ifdef EC_DEBUG
#include <stdio.h>
#define EC_PRINT printf
#else
#define EC_PRINT(...) do { } while (0)
#endif

#ifdef __cplusplus
}
#endif

#endif
