/* Devices whose process data is not read from the slave */
#ifndef MARGAY_SOEM1_ETHERCATCONFIGLIST_H
#define MARGAY_SOEM1_ETHERCATCONFIGLIST_H

#include "ethercatmain.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A device with sizes that the program knows; the library has no list of devices */
typedef struct {
    uint32 man;
    uint32 id;
    char name[EC_MAXNAME + 1];
    uint8 Dtype;
    uint16 Ibits;
    uint16 Obits;
    uint16 SM2a;
    uint32 SM2f;
    uint16 SM3a;
    uint32 SM3f;
    uint8 FM0ac;
    uint8 FM1ac;
} ec_configlist_t;

#ifdef __cplusplus
}
#endif

#endif
