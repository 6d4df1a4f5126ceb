/* Hardware of the host */
#ifndef MARGAY_SOEM1_OSHW_H
#define MARGAY_SOEM1_OSHW_H

#include "ethercattype.h"
#include "ethercatmain.h"
#include "nicdrv.h"

#ifdef __cplusplus
extern "C" {
#endif

uint16 oshw_htons(uint16 hostshort);
uint16 oshw_ntohs(uint16 networkshort);
ec_adaptert *oshw_find_adapters(void);
void oshw_free_adapters(ec_adaptert *adapter);

#ifdef __cplusplus
}
#endif

#endif
