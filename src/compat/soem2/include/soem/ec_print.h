/* Texts of errors */
#ifndef MARGAY_SOEM2_SOEM_EC_PRINT_H
#define MARGAY_SOEM2_SOEM_EC_PRINT_H

#include "soem/ec_main.h"

#ifdef __cplusplus
extern "C" {
#endif

char *ec_ALstatuscode2string(uint16 ALstatuscode);
char *ecx_elist2string(ecx_contextt *context);
const char *ec_sdoerror2string(uint32 sdoerrorcode);
char *ec_soeerror2string(uint16 errorcode);
char *ec_mbxerror2string(uint16 errorcode);
char *ecx_err2string(const ec_errort Ec);

#ifdef __cplusplus
}
#endif

#endif
