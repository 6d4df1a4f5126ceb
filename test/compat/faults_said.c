/* Why the services of a slave do nothing, and why a slave does not reach SAFEOP, is said on standard error; nothing is
   said of a slave that works. faults_said SOURCE: the mailboxes in the SII of slave 1 cannot be used, slave 2 refuses
   PREOP, slave 3 works */
#include <ethercat.h>

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "must.h"

static char image[4096];
static int wrong;

/* The lines with both texts in them. */
static int lines(FILE* said, const char* first, const char* second) {
    char line[512];
    int count = 0;
    rewind(said);
    while (fgets(line, sizeof(line), said) != NULL)
        if (strstr(line, first) != NULL && strstr(line, second) != NULL) ++count;
    return count;
}

int main(int argc, char** argv) {
    FILE* const said = tmpfile();
    if (argc != 2 || said == NULL || !ec_init(argv[1])) return 2;
    if (dup2(fileno(said), STDERR_FILENO) < 0) return 2;
    MUST(ec_config_init(FALSE) == 3);
    MUST(ec_config_init(FALSE) == 3);
    MUST(lines(said, "slave 1", "1487") == 1);
    MUST(lines(said, "slave 2", "SAFEOP") == 0);
    MUST(ec_config_map(image) > 0);
    ec_readstate();
    MUST(ec_slave[1].state == EC_STATE_SAFE_OP && ec_slave[2].state == EC_STATE_INIT + EC_STATE_ERROR);
    MUST(lines(said, "slave 1", "") == 1);
    MUST(lines(said, "slave 2", "SAFEOP") == 1);
    MUST(lines(said, "slave 3", "") == 0);
    ec_close();
    return wrong != 0;
}
