/* What depends on the compiler and the system */
#ifndef MARGAY_SOEM1_OSAL_DEFS_H
#define MARGAY_SOEM1_OSAL_DEFS_H

#include <pthread.h>
#include <sys/time.h>
#include <time.h>

/* Structures without padding */
#ifndef PACKED
#define PACKED_BEGIN
#define PACKED __attribute__((__packed__))
#define PACKED_END
#endif

/* Threads. The address of a handle is given to osal_thread_create(), which stores a pthread_t there. */
#define OSAL_THREAD_HANDLE pthread_t *
#define OSAL_THREAD_FUNC void
#define OSAL_THREAD_FUNC_RT void

#endif
