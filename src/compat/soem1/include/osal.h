/* Times, timers and threads. An interface that programs of other masters are written for; what each function does here: src/compat/README.md */
#ifndef MARGAY_SOEM1_OSAL_H
#define MARGAY_SOEM1_OSAL_H

#include "osal_defs.h"
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Integers of fixed size */
typedef uint8_t boolean;
typedef int8_t int8;
typedef int16_t int16;
typedef int32_t int32;
typedef int64_t int64;
typedef uint8_t uint8;
typedef uint16_t uint16;
typedef uint32_t uint32;
typedef uint64_t uint64;
typedef float float32;
typedef double float64;

#ifndef TRUE
#define TRUE 1
#endif
#ifndef FALSE
#define FALSE 0
#endif

/* A time in seconds and microseconds */
typedef struct {
    uint32 sec;
    uint32 usec;
} ec_timet;

/* A timer */
typedef struct {
    ec_timet stop_time;
} osal_timert;

int osal_usleep(uint32 usec);
ec_timet osal_current_time(void);
void osal_time_diff(ec_timet *start, ec_timet *end, ec_timet *diff);
int osal_thread_create(void *thandle, int stacksize, void *func, void *param);
int osal_thread_create_rt(void *thandle, int stacksize, void *func, void *param);
void osal_timer_start(osal_timert *self, uint32 timeout_us);
boolean osal_timer_is_expired(osal_timert *self);

#ifdef __cplusplus
}
#endif

#endif
