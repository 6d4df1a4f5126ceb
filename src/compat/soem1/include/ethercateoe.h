/* EoE: Ethernet frames and IP parameters */
#ifndef MARGAY_SOEM1_ETHERCATEOE_H
#define MARGAY_SOEM1_ETHERCATEOE_H

#include "ethercatmain.h"

#ifdef __cplusplus
extern "C" {
#endif

#include "margay_soem/eoe.h"

int ecx_EOEdefinehook(ecx_contextt *context, void *hook);
int ecx_EOEsetIp(ecx_contextt *context, uint16 slave, uint8 port, eoe_param_t *ipparam, int timeout);
int ecx_EOEgetIp(ecx_contextt *context, uint16 slave, uint8 port, eoe_param_t *ipparam, int timeout);
int ecx_EOEsend(ecx_contextt *context, uint16 slave, uint8 port, int psize, void *p, int timeout);
int ecx_EOErecv(ecx_contextt *context, uint16 slave, uint8 port, int *psize, void *p, int timeout);
int ecx_EOEreadfragment(ec_mbxbuft *MbxIn, uint8 *rxfragmentno, uint16 *rxframesize, uint16 *rxframeoffset,
    uint16 *rxframeno, int *psize, void *p);

#ifdef __cplusplus
}
#endif

#endif
