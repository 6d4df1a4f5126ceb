/* Ends the function with 1 when the condition does not hold. The program includes <stdio.h>, behind cycle.h. */
#ifndef CHECK_H
#define CHECK_H

#define CHECK(condition)                                                    \
    do {                                                                    \
        if (!(condition)) {                                                 \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
            return 1;                                                       \
        }                                                                   \
    } while (0)

#endif
