/* SoE: parameters of drives */
#ifndef MARGAY_SOEM2_SOEM_EC_SOE_H
#define MARGAY_SOEM2_SOEM_EC_SOE_H

#include "soem/ec_main.h"

#ifdef __cplusplus
extern "C" {
#endif

#include "margay_soem/soe.h"

int ecx_SoEread(ecx_contextt *context, uint16 slave, uint8 driveNo, uint8 elementflags, uint16 idn, int *psize,
    void *p, int timeout);
int ecx_SoEwrite(ecx_contextt *context, uint16 slave, uint8 driveNo, uint8 elementflags, uint16 idn, int psize,
    void *p, int timeout);
int ecx_readIDNmap(ecx_contextt *context, uint16 slave, uint32 *Osize, uint32 *Isize);

#ifdef __cplusplus
}
#endif

#endif
