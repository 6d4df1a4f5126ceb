/* Hardware of the host */
#ifndef MARGAY_SOEM2_OSHW_H
#define MARGAY_SOEM2_OSHW_H

#include "soem/ec_main.h"

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
