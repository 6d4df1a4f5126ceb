/* Distributed clocks */
#ifndef MARGAY_SOEM2_SOEM_EC_DC_H
#define MARGAY_SOEM2_SOEM_EC_DC_H

#include "soem/ec_main.h"

#ifdef __cplusplus
extern "C" {
#endif

boolean ecx_configdc(ecx_contextt *context);
void ecx_dcsync0(ecx_contextt *context, uint16 slave, boolean act, uint32 CyclTime, int32 CyclShift);
void ecx_dcsync01(ecx_contextt *context, uint16 slave, boolean act, uint32 CyclTime0, uint32 CyclTime1,
    int32 CyclShift);

#ifdef __cplusplus
}
#endif

#endif
