/* Counts in `wrong`, a variable of the program, what does not hold. The program includes <stdio.h>. */
#ifndef MUST_H
#define MUST_H

#define MUST(what)                                       \
    do {                                                 \
        if (!(what)) {                                   \
            printf("line %d: not %s\n", __LINE__, #what); \
            ++wrong;                                     \
        }                                                \
    } while (0)

#endif
