/* Configuration of the segment */
#ifndef MARGAY_SOEM1_ETHERCATCONFIG_H
#define MARGAY_SOEM1_ETHERCATCONFIG_H

#include "ethercatmain.h"

#ifdef __cplusplus
extern "C" {
#endif

#define EC_NODEOFFSET 0x1000
#define EC_TEMPNODE 0xffff

int ecx_config_init(ecx_contextt *context, uint8 usetable);
int ecx_config_map_group(ecx_contextt *context, void *pIOmap, uint8 group);
int ecx_config_overlap_map_group(ecx_contextt *context, void *pIOmap, uint8 group);
int ecx_recover_slave(ecx_contextt *context, uint16 slave, int timeout);
int ecx_reconfig_slave(ecx_contextt *context, uint16 slave, int timeout);
int ecx_config_map_group_aligned(ecx_contextt *context, void *pIOmap, uint8 group);
int ecx_detect_slaves(ecx_contextt *context);
void ecx_init_context(ecx_contextt *context);

#ifdef EC_VER1
int ec_config_init(uint8 usetable);
int ec_config_map(void *pIOmap);
int ec_config_map_group(void *pIOmap, uint8 group);
int ec_config_overlap_map_group(void *pIOmap, uint8 group);
int ec_config(uint8 usetable, void *pIOmap);
int ec_recover_slave(uint16 slave, int timeout);
int ec_reconfig_slave(uint16 slave, int timeout);
int ec_config_overlap_map(void *pIOmap);
int ec_config_overlap(uint8 usetable, void *pIOmap);
int ec_config_map_group_aligned(void *pIOmap, uint8 group);
int ec_config_map_aligned(void *pIOmap);
int ec_findconfig(uint32 man, uint32 id);
#endif

#ifdef __cplusplus
}
#endif

#endif
