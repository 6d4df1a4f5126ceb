/* Constants, enumerations and the error entry of the interface SOEM 2.0. An interface that programs of other masters are written for; what each function does here: src/compat/README.md */
#ifndef MARGAY_SOEM2_SOEM_EC_TYPE_H
#define MARGAY_SOEM2_SOEM_EC_TYPE_H

#include "osal.h"
#include "soem/ec_options.h"

#ifdef __cplusplus
extern "C" {
#endif

#include "margay_soem/type.h"

/* Word addresses of the SII */
enum {
    ECT_SII_MANUF = 8, ECT_SII_ID = 0xa, ECT_SII_REV = 0xc, ECT_SII_SER = 0xe, ECT_SII_BOOTRXMBX = 0x14,
    ECT_SII_BOOTTXMBX = 0x16, ECT_SII_MBXSIZE = 0x19, ECT_SII_TXMBXADR = 0x1a, ECT_SII_RXMBXADR = 0x18,
    ECT_SII_MBXPROTO = 0x1c
};

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
