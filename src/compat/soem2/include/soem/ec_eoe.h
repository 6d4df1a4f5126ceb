/* EoE: Ethernet frames and IP parameters */
#ifndef MARGAY_SOEM2_SOEM_EC_EOE_H
#define MARGAY_SOEM2_SOEM_EC_EOE_H

#include "soem/ec_main.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EC_MAXEOEDATA (EC_MAXMBX - 10)
#define EOE_IP4_LENGTH 4

#include "margay_soem/eoe.h"

int ecx_EOEdefinehook(ecx_contextt *context, void *hook);
int ecx_EOEsend(ecx_contextt *context, uint16 slave, uint8 port, int psize, void *p, int timeout);
int ecx_EOEreadfragment(ec_mbxbuft *MbxIn, uint8 *rxfragmentno, uint16 *rxframesize, uint16 *rxframeoffset,
    uint16 *rxframeno, int *psize, void *p);
int ecx_EOEsetIp(ecx_contextt *context, uint16 slave, uint8 port, eoe_param_t *ipparam, int timeout);
int ecx_EOEgetIp(ecx_contextt *context, uint16 slave, uint8 port, eoe_param_t *ipparam, int timeout);
int ecx_EOErecv(ecx_contextt *context, uint16 slave, uint8 port, int *psize, void *p, int timeout);

#ifdef __cplusplus
}
#endif

#endif
