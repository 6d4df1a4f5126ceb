/* FoE: files */
#ifndef MARGAY_SOEM1_ETHERCATFOE_H
#define MARGAY_SOEM1_ETHERCATFOE_H

#include "ethercatmain.h"

#ifdef __cplusplus
extern "C" {
#endif

int ecx_FOEread(ecx_contextt *context, uint16 slave, char *filename, uint32 password, int *psize, void *p,
    int timeout);
int ecx_FOEwrite(ecx_contextt *context, uint16 slave, char *filename, uint32 password, int psize, void *p,
    int timeout);
int ecx_FOEdefinehook(ecx_contextt *context, void *hook);

#ifdef EC_VER1
int ec_FOEread(uint16 slave, char *filename, uint32 password, int *psize, void *p, int timeout);
int ec_FOEwrite(uint16 slave, char *filename, uint32 password, int psize, void *p, int timeout);
int ec_FOEdefinehook(void *hook);
#endif

#ifdef __cplusplus
}
#endif

#endif
