/* A cycle of 1 ms for the programs of this folder. */
#ifndef CYCLE_H
#define CYCLE_H

#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif

#include <stdint.h>
#include <stdlib.h>
#include <time.h>

#define CYCLE_NS 1000000L

/* Sleeps at least one period after the previous cycle. On a busy machine cycles come later, but never several at once.
 * */
static inline void next_cycle(void) {
    const struct timespec period = {0, CYCLE_NS};
    clock_nanosleep(CLOCK_MONOTONIC, 0, &period, NULL);
}

/* The number of right cycles in succession; with FAR_SEGMENT in the environment, the total number. The segment is then
 * another process, and on a busy machine some of its answers are too late. */
static inline unsigned int count_right(unsigned int before, int right) {
    if (right) return before + 1;
    return getenv("FAR_SEGMENT") != NULL ? before : 0;
}

static inline uint64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000U + (uint64_t)now.tv_nsec;
}

#endif
