/* FoE: files */
#ifndef MARGAY_SOEM2_SOEM_EC_FOE_H
#define MARGAY_SOEM2_SOEM_EC_FOE_H

#include "soem/ec_main.h"

#ifdef __cplusplus
extern "C" {
#endif

int ecx_FOEwrite(ecx_contextt *context, uint16 slave, char *filename, uint32 password, int psize, void *p,
    int timeout);
int ecx_FOEdefinehook(ecx_contextt *context, void *hook);
int ecx_FOEread(ecx_contextt *context, uint16 slave, char *filename, uint32 password, int *psize, void *p,
    int timeout);

#ifdef __cplusplus
}
#endif

#endif
