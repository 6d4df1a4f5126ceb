/* What depends on the compiler and the system */
#ifndef MARGAY_SOEM2_OSAL_DEFS_H
#define MARGAY_SOEM2_OSAL_DEFS_H

#include <pthread.h>
#include <sys/time.h>
#include <time.h>

/* Structures without padding */
#ifndef OSAL_PACKED
#define OSAL_PACKED_BEGIN
#define OSAL_PACKED __attribute__((__packed__))
#define OSAL_PACKED_END
#endif

/* Threads. The address of a handle is given to osal_thread_create(), which stores a pthread_t there. */
#define OSAL_THREAD_HANDLE pthread_t *
#define OSAL_THREAD_FUNC void
#define OSAL_THREAD_FUNC_RT void

/* Times and mutexes of the system */
#define ec_timet struct timespec
#define osal_mutext pthread_mutex_t
#define osal_timespec_from_usec(usec, result) \
    do { \
        (result)->tv_sec = (usec) / 1000000; \
        (result)->tv_nsec = ((usec) % 1000000) * 1000; \
    } while (0)
#define osal_timespeccmp(a, b, CMP) \
    (((a)->tv_sec == (b)->tv_sec) ? ((a)->tv_nsec CMP (b)->tv_nsec) : ((a)->tv_sec CMP (b)->tv_sec))
#define osal_timespecadd(a, b, result) \
    do { \
        (result)->tv_sec = (a)->tv_sec + (b)->tv_sec; \
        (result)->tv_nsec = (a)->tv_nsec + (b)->tv_nsec; \
        if ((result)->tv_nsec >= 1000000000) { \
            ++(result)->tv_sec; \
            (result)->tv_nsec -= 1000000000; \
        } \
    } while (0)
#define osal_timespecsub(a, b, result) \
    do { \
        (result)->tv_sec = (a)->tv_sec - (b)->tv_sec; \
        (result)->tv_nsec = (a)->tv_nsec - (b)->tv_nsec; \
        if ((result)->tv_nsec < 0) { \
            --(result)->tv_sec; \
            (result)->tv_nsec += 1000000000; \
        } \
    } while (0)

#endif
