/* An EEPROM tool for SOEM 1.4, which writes word after word: eeprom SOURCE SLAVE */
#include <ethercat.h>

#include <stdio.h>
#include <stdlib.h>

#include "must.h"

enum { FIRST = 0x40, WORDS = 32 };

static int wrong;

/* Each word is read directly behind its writing. */
static void write_words(uint16 position) {
    uint16 before[WORDS];
    int n;
    for (n = 0; n < WORDS; n++) {
        uint16 word = (uint16)(FIRST + n);
        before[n] = (uint16)etohll(ec_readeepromAP(position, word, EC_TIMEOUTEEP));
        MUST(ec_writeeepromAP(position, word, (uint16)~before[n], EC_TIMEOUTEEP) == 1);
        MUST((uint16)etohll(ec_readeepromAP(position, word, EC_TIMEOUTEEP)) == (uint16)~before[n]);
    }
    for (n = 0; n < WORDS; n++) MUST(ec_writeeepromAP(position, (uint16)(FIRST + n), before[n], EC_TIMEOUTEEP) == 1);
}

/* A slave that does not answer has no contents, and those of a slave that answers again are its own. */
static void ask_nobody(uint16 slave) {
    uint16 position = (uint16)(1 - slave);
    uint16 nobody = 0, station = htoes(ec_slave[slave].configadr);
    uint8 vendor = (uint8)ec_slave[slave].eep_man;
    MUST(ec_APWR(position, ECT_REG_STADR, sizeof(nobody), &nobody, EC_TIMEOUTSAFE) == 1);
    MUST(ec_siigetbyte(slave, 2 * ECT_SII_MANUF) == 0xFF);
    MUST(ec_siifind(slave, ECT_SII_GENERAL) == 0);
    MUST(ec_APWR(position, ECT_REG_STADR, sizeof(station), &station, EC_TIMEOUTSAFE) == 1);
    MUST(ec_siigetbyte(slave, 2 * ECT_SII_MANUF) == vendor);
    MUST(ec_siifind(slave, ECT_SII_GENERAL) > 0);
}

/* A word in two calls, behind a writing. The EEPROM of a slave that is protected stores no word, and says so. */
static void read_in_halves(uint16 slave) {
    uint16 n, before = (uint16)ec_readeeprom(slave, FIRST, EC_TIMEOUTEEP);
    for (n = 0; n < WORDS; n++) {
        uint16 value = (uint16)(0x5A00 + n);
        MUST(ec_writeeeprom(slave, FIRST, value, EC_TIMEOUTEEP) == 1);
        ec_readeeprom1(slave, FIRST);
        MUST((uint16)ec_readeeprom2(slave, EC_TIMEOUTEEP) == value);
    }
    MUST(ec_writeeeprom(slave, FIRST, before, EC_TIMEOUTEEP) == 1);
    MUST(ec_writeeeprom((uint16)ec_slavecount, FIRST, 0x1234, EC_TIMEOUTEEP) == 0);
}

int main(int argc, char **argv) {
    uint16 slave, position;
    uint8 master = 0;
    if (argc != 3) return 2;
    slave = (uint16)atoi(argv[2]);
    position = (uint16)(1 - slave);
    if (!ec_init(argv[1])) return 1;
    MUST(ec_APWR(position, ECT_REG_EEPCFG, sizeof(master), &master, EC_TIMEOUTSAFE) == 1);
    write_words(position);
    MUST(ec_config_init(FALSE) >= slave);
    if (ec_slavecount >= slave) {
        read_in_halves(slave);
        ask_nobody(slave);
    }
    ec_close();
    return wrong != 0;
}
