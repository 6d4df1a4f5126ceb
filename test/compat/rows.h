/* Rows of a table of an interface, for a program in C. */
#include <stddef.h>

struct number_row {
    const char *name;
    long here;
    long wanted;
};
struct type_row {
    const char *name;
    int right;
};
extern const struct number_row number_rows[];
extern const int number_row_count;
extern const struct type_row field_rows[];
extern const int field_row_count;
extern const struct type_row *function_rows(void);
extern const int function_row_count;
