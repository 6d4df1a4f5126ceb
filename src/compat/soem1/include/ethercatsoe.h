/* SoE: parameters of drives */
#ifndef MARGAY_SOEM1_ETHERCATSOE_H
#define MARGAY_SOEM1_ETHERCATSOE_H

#include "ethercatmain.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EC_SOE_MAXNAME 60
#define EC_SOE_MAXMAPPING 64

#include "margay_soem/soe.h"

int ecx_SoEread(ecx_contextt *context, uint16 slave, uint8 driveNo, uint8 elementflags, uint16 idn, int *psize,
    void *p, int timeout);
int ecx_SoEwrite(ecx_contextt *context, uint16 slave, uint8 driveNo, uint8 elementflags, uint16 idn, int psize,
    void *p, int timeout);
int ecx_readIDNmap(ecx_contextt *context, uint16 slave, int *Osize, int *Isize);

#ifdef EC_VER1
int ec_SoEread(uint16 slave, uint8 driveNo, uint8 elementflags, uint16 idn, int *psize, void *p, int timeout);
int ec_SoEwrite(uint16 slave, uint8 driveNo, uint8 elementflags, uint16 idn, int psize, void *p, int timeout);
int ec_readIDNmap(uint16 slave, int *Osize, int *Isize);
#endif

#ifdef __cplusplus
}
#endif

#endif
