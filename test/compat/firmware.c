/* A program for SOEM 1.4 that writes a firmware: firmware SOURCE SLAVE PASSWORD. It sets the mailboxes of BOOT itself, and
   nobody else knows them: it has taken them out of the EEPROM before. */
#include <ethercat.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint8 file[16384];
static uint8 back[16384 + 512];
static int reports;

static int progress(uint16 slave, int packet, int size) {
    (void)slave, (void)packet, (void)size;
    ++reports;
    return 1;
}

/* Reads the mailboxes of BOOT, and takes them out of the EEPROM. */
static int take_mailboxes_out(uint16 slave, uint32 *written, uint32 *read) {
    uint16 word;
    *written = ec_readeeprom(slave, ECT_SII_BOOTRXMBX, EC_TIMEOUTEEP);
    *read = ec_readeeprom(slave, ECT_SII_BOOTTXMBX, EC_TIMEOUTEEP);
    for (word = ECT_SII_BOOTRXMBX; word < ECT_SII_BOOTTXMBX + 2; ++word)
        if (ec_writeeeprom(slave, word, 0, EC_TIMEOUTEEP) <= 0) return 0;
    return *written != 0 && *read != 0 && ec_readeeprom(slave, ECT_SII_BOOTRXMBX, EC_TIMEOUTEEP) == 0;
}

int main(int argc, char **argv) {
    int result, n, size;
    uint16 slave;
    uint32 password, data, other;
    if (argc != 4) return 2;
    slave = (uint16)atoi(argv[2]);
    password = (uint32)strtoul(argv[3], NULL, 0);
    if (!ec_init(argv[1]) || ec_config_init(FALSE) < slave) return 1;
    if (!take_mailboxes_out(slave, &data, &other) || ec_config_init(FALSE) < slave) return 1;
    ec_statecheck(0, EC_STATE_PRE_OP, EC_TIMEOUTSTATE * 4);
    ec_slave[slave].state = EC_STATE_INIT;
    ec_writestate(slave);
    if (ec_statecheck(slave, EC_STATE_INIT, EC_TIMEOUTSTATE * 4) != EC_STATE_INIT) return 1;
    ec_slave[slave].SM[0].StartAddr = (uint16)LO_WORD(data);
    ec_slave[slave].SM[0].SMlength = (uint16)HI_WORD(data);
    ec_slave[slave].mbx_wo = (uint16)LO_WORD(data);
    ec_slave[slave].mbx_l = (uint16)HI_WORD(data);
    data = other;
    ec_slave[slave].SM[1].StartAddr = (uint16)LO_WORD(data);
    ec_slave[slave].SM[1].SMlength = (uint16)HI_WORD(data);
    ec_slave[slave].mbx_ro = (uint16)LO_WORD(data);
    ec_slave[slave].mbx_rl = (uint16)HI_WORD(data);
    ec_FPWR(ec_slave[slave].configadr, ECT_REG_SM0, sizeof(ec_smt), &ec_slave[slave].SM[0], EC_TIMEOUTSAFE);
    ec_FPWR(ec_slave[slave].configadr, ECT_REG_SM1, sizeof(ec_smt), &ec_slave[slave].SM[1], EC_TIMEOUTSAFE);
    ec_slave[slave].state = EC_STATE_BOOT;
    ec_writestate(slave);
    if (ec_statecheck(slave, EC_STATE_BOOT, EC_TIMEOUTSTATE * 10) != EC_STATE_BOOT) {
        printf("not in BOOT: 0x%02x\n", ec_slave[slave].state);
        return 1;
    }
    ec_FOEdefinehook((void *)progress);
    size = sizeof(back);
    result = ec_FOEread(slave, (char *)"firmware", password, &size, back, EC_TIMEOUTSTATE);
    printf("read: %d, %d octets, %d reports\n", result, size, reports);
    if (result <= 0 || size <= 0 || size > (int)sizeof(file) || reports == 0) return 1;
    memcpy(file, back, (size_t)size);
    reports = 0;
    result = ec_FOEwrite(slave, (char *)"firmware", password, size, file, EC_TIMEOUTSTATE);
    printf("write: %d, %d reports\n", result, reports);
    if (result <= 0 || reports == 0) return 1;
    result = ec_FOEwrite(slave, (char *)"no such file of this slave", password, 16, file, EC_TIMEOUTSTATE);
    printf("a file that does not exist: %d\n", result);
    if (result != -EC_ERR_TYPE_FOE_FILE_NOTFOUND) return 1;
    n = sizeof(back);
    result = ec_FOEread(slave, (char *)"no such file of this slave", password, &n, back, EC_TIMEOUTSTATE);
    if (result != -EC_ERR_TYPE_FOE_ERROR) return 1;
    n = 10;
    result = ec_FOEread(slave, (char *)"firmware", password, &n, back, EC_TIMEOUTSTATE);
    printf("a buffer that is too small: %d\n", result);
    if (result != -EC_ERR_TYPE_FOE_BUF2SMALL) return 1;
    ec_slave[slave].state = EC_STATE_INIT;
    ec_writestate(slave);
    result = ec_statecheck(slave, EC_STATE_INIT, EC_TIMEOUTSTATE * 4) == EC_STATE_INIT;
    ec_close();
    return result ? 0 : 1;
}
