/* All of the interface SOEM 2.0 */
#ifndef MARGAY_SOEM2_SOEM_SOEM_H
#define MARGAY_SOEM2_SOEM_SOEM_H

#include "soem/ec_options.h"
#include "soem/ec_type.h"
#include "nicdrv.h"
#include "soem/ec_base.h"
#include "soem/ec_main.h"
#include "soem/ec_dc.h"
#include "soem/ec_coe.h"
#include "soem/ec_foe.h"
#include "soem/ec_soe.h"
#include "soem/ec_eoe.h"
#include "soem/ec_config.h"
#include "soem/ec_print.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifdef __cplusplus
}
#endif

#endif
