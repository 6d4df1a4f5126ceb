/* Frames are lost: a call of SOEM 1.4 sends again each EC_TIMEOUTRET until its timeout. So a reading with EC_TIMEOUTRET3 is
   sent three times, and names are read whole: loss SOURCE */
#include <ethercat.h>

#include <stdio.h>
#include <string.h>

int main(int argc, char **argv) {
    int n, lost = 0;
    if (argc != 2) return 2;
    if (!ec_init(argv[1]) || ec_config_init(FALSE) != 2) return 1;
    for (n = 0; n < 2000; ++n) {
        uint16 word = 0;
        if (ec_FPRD(ec_slave[1].configadr, ECT_REG_TYPE, sizeof(word), &word, EC_TIMEOUTRET3) != 1) ++lost;
    }
    printf("%d of %d readings without a reply, names '%s' and '%s'\n", lost, n, ec_slave[1].name, ec_slave[2].name);
    n = strcmp(ec_slave[1].name, ec_slave[2].name);
    ec_close();
    return lost == 0 && n == 0 ? 0 : 1;
}
