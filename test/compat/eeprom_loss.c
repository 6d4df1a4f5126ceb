/* Frames are lost, and an EEPROM tool for SOEM 1.4 reads directly behind a writing, when the EEPROM acknowledges no
   command: no reading has the octets of another word, and what was written is there: eeprom_loss SOURCE SLAVE */
#include <ethercat.h>

#include <stdio.h>
#include <stdlib.h>

#include "must.h"

enum { KNOWN = 0x1A0, WRITTEN = 0x180, WORDS = 8, ROUNDS = 300, WAYS = 4 };

static int wrong;

static int write_by(int way, uint16 slave, uint16 word, uint16 value) {
    if (way == 2) return ec_writeeepromAP((uint16)(1 - slave), word, value, EC_TIMEOUTEEP);
    if (way == 3) return ec_writeeepromFP(ec_slave[slave].configadr, word, value, EC_TIMEOUTEEP);
    return ec_writeeeprom(slave, word, value, EC_TIMEOUTEEP);
}

static uint32 read_by(int way, uint16 slave, uint16 word) {
    if (way == 0) return ec_readeeprom(slave, word, EC_TIMEOUTEEP);
    if (way == 2) return (uint32)etohll(ec_readeepromAP((uint16)(1 - slave), word, EC_TIMEOUTEEP));
    if (way == 3) return (uint32)etohll(ec_readeepromFP(ec_slave[slave].configadr, word, EC_TIMEOUTEEP));
    ec_readeeprom1(slave, word);
    return ec_readeeprom2(slave, EC_TIMEOUTEEP);
}

static uint16 value_at(int n) { return (uint16)(0xB000 + n); }

int main(int argc, char** argv) {
    uint16 slave;
    int n, unread = 0, unwritten = 0;
    if (argc != 3) return 2;
    slave = (uint16)atoi(argv[2]);
    if (!ec_init(argv[1]) || ec_config_init(FALSE) < slave) return 1;
    for (n = 0; n < WORDS; n++) MUST(ec_writeeeprom(slave, (uint16)(KNOWN + n), value_at(n), 200000) == 1);
    for (n = 0; n < ROUNDS; n++) {
        int way = n % WAYS, known = n % (WORDS - 1);
        uint16 value = (uint16)(0x1000 + n), word = (uint16)(WRITTEN + n % WORDS);
        int written = write_by(way, slave, word, value);
        uint32 read = read_by(way, slave, (uint16)(KNOWN + known));
        if (read == 0)
            ++unread;
        else
            MUST(read == ((uint32)value_at(known + 1) << 16 | value_at(known)));
        if (!written)
            ++unwritten;
        else
            MUST((uint16)ec_readeeprom(slave, word, 200000) == value);
    }
    printf("%d of %d not read, %d not written\n", unread, ROUNDS, unwritten);
    MUST(unread < ROUNDS / 20 && unwritten < ROUNDS / 20);
    ec_close();
    return wrong != 0;
}
