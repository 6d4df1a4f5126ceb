/* Compares every constant, field and function of an interface with the table. */
#include "rows.h"

#include <stdio.h>

int main(void) {
    int wrong = 0;
    int n;
    const struct type_row *functions = function_rows();
    for (n = 0; n < number_row_count; ++n) {
        if (number_rows[n].here == number_rows[n].wanted) continue;
        printf("%s is %ld, not %ld\n", number_rows[n].name, number_rows[n].here, number_rows[n].wanted);
        ++wrong;
    }
    for (n = 0; n < field_row_count; ++n) {
        if (field_rows[n].right) continue;
        printf("%s has another type\n", field_rows[n].name);
        ++wrong;
    }
    for (n = 0; n < function_row_count; ++n) {
        if (functions[n].right) continue;
        printf("%s() has another type\n", functions[n].name);
        ++wrong;
    }
    printf("%d constants, %d fields, %d functions; %d wrong\n", number_row_count, field_row_count, function_row_count,
           wrong);
    return wrong == 0 && number_row_count > 200 && field_row_count > 200 && function_row_count > 100 ? 0 : 1;
}
