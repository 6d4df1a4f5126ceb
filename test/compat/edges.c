/* Calls that programs make by mistake or seldom: before a master is open, after it was closed, with numbers of slaves and groups that do
   not exist, with memory that is too small, with an error list that is full, and the rarely used functions. Each call returns the error
   of the interface, and no call touches memory that is not its own: edges SOURCE. */
#include "must.h"

#ifdef SOEM2
#include <soem/soem.h>
#define SLAVES context.slavelist
#define COUNT context.slavecount
static ecx_contextt context;
#define CTX (&context)
#define PORT (&context.port)
#define CONFIG_INIT() ecx_config_init(CTX)
typedef uint32 bits_t;
#else
#include <ethercat.h>
#define SLAVES ec_slave
#define COUNT ec_slavecount
#define CTX (&ecx_context)
#define PORT (&ecx_port)
#define CONFIG_INIT() ecx_config_init(CTX, FALSE)
typedef int bits_t;
#endif

#include <stdio.h>
#include <string.h>

static char map[4096];
static int wrong;

/* Without an open master nothing works, and nothing breaks. */
static void without_master(void) {
    uint32 value = 0;
    int size = sizeof(value);
    uint16 status = 0;
    char text[EC_MAXNAME + 1] = "x";
    bits_t out = 0, in = 0;
    MUST(CONFIG_INIT() <= 0);
    MUST(ecx_config_map_group(CTX, map, 0) == 0);
    MUST(ecx_send_processdata(CTX) == 0);
    MUST(ecx_receive_processdata(CTX, 100) == EC_NOFRAME);
    MUST(ecx_statecheck(CTX, 0, EC_STATE_OPERATIONAL, 100) == 0);
    MUST(ecx_writestate(CTX, 0) <= 0);
    ecx_readstate(CTX);
    MUST(ecx_SDOread(CTX, 1, 0x1000, 0, FALSE, &size, &value, 100) <= 0);
    MUST(ecx_SDOwrite(CTX, 1, 0x1000, 0, FALSE, 4, &value, 100) <= 0);
    MUST(ecx_FOEread(CTX, 1, (char *)"x", 0, &size, &value, 100) <= 0);
    MUST(ecx_BRD(PORT, 0, 0, 2, &status, 100) == EC_NOFRAME);
    MUST(ecx_FPRDw(PORT, 0x1001, 0, 100) == 0);
    MUST(ecx_readeeprom(CTX, 1, 8, 100) == 0);
    MUST(ecx_recover_slave(CTX, 1, 100) == 0);
    MUST(ecx_reconfig_slave(CTX, 1, 100) == 0);
    MUST(ecx_configdc(CTX) == FALSE);
    MUST(ecx_readPDOmap(CTX, 1, &out, &in) == 0);
    ecx_dcsync0(CTX, 1, TRUE, 1000000, 0);
    ecx_siistring(CTX, text, 1, 1);
    ecx_close(CTX);
    MUST(ecx_init(CTX, "sim:no_such_segment") <= 0);
    MUST(ecx_init(CTX, "") <= 0);
    MUST(ecx_init(CTX, "no_such_interface") <= 0);
}

/* Numbers that do not exist. */
static void wrong_numbers(void) {
    static const uint16 numbers[] = {0, 9, 200, 201, 0x1001, 0xFFFF};
    unsigned n;
    for (n = 0; n < sizeof(numbers) / sizeof(numbers[0]); ++n) {
        const uint16 slave = numbers[n];
        uint8 octets[8];
        int size = sizeof(octets);
        char text[EC_MAXNAME + 1] = "";
        ec_eepromFMMUt fmmu;
        ec_eepromSMt sm;
        static ec_ODlistt list;
        static ec_OElistt entries;
        bits_t out = 0, in = 0;
        memset(&sm, 0, sizeof(sm));
        memset(&fmmu, 0, sizeof(fmmu));
        MUST(ecx_SDOread(CTX, slave, 0x1018, 1, FALSE, &size, octets, 1000) <= 0);
        MUST(ecx_SDOwrite(CTX, slave, 0x1018, 1, FALSE, 4, octets, 1000) <= 0);
        size = sizeof(octets);
        MUST(ecx_FOEread(CTX, slave, (char *)"x", 0, &size, octets, 1000) <= 0);
        MUST(ecx_FOEwrite(CTX, slave, (char *)"x", 0, 4, octets, 1000) <= 0);
        size = sizeof(octets);
        MUST(ecx_SoEread(CTX, slave, 0, EC_SOE_VALUE_B, 16, &size, octets, 1000) <= 0);
        MUST(ecx_SoEwrite(CTX, slave, 0, EC_SOE_VALUE_B, 16, 2, octets, 1000) <= 0);
        MUST(ecx_RxPDO(CTX, slave, 1, 4, octets) <= 0);
        size = sizeof(octets);
        MUST(ecx_TxPDO(CTX, slave, 1, &size, octets, 1000) <= 0);
        MUST(ecx_EOEsend(CTX, slave, 0, 8, octets, 1000) <= 0);
        size = sizeof(octets);
        MUST(ecx_EOErecv(CTX, slave, 0, &size, octets, 1000) <= 0);
        MUST(ecx_readODlist(CTX, slave, &list) <= 0);
        list.Slave = slave;
        MUST(ecx_readODdescription(CTX, 0, &list) <= 0);
        MUST(ecx_readODdescription(CTX, 0xFFFF, &list) <= 0);
        MUST(ecx_readOE(CTX, 0xFFFF, &list, &entries) <= 0);
        MUST(ecx_readPDOmap(CTX, slave, &out, &in) == 0);
        MUST(ecx_readIDNmap(CTX, slave, &out, &in) == 0);
        MUST(ecx_mbxempty(CTX, slave, 1000) <= 0);
        MUST(ecx_recover_slave(CTX, slave, 500) == 0);
        MUST(ecx_reconfig_slave(CTX, slave, 500) == 0);
        if (slave != 0) {
            MUST(ecx_statecheck(CTX, slave, EC_STATE_PRE_OP, 1000) == 0);
            MUST(ecx_writestate(CTX, slave) <= 0);
        }
        ecx_siistring(CTX, text, slave, 1);
        (void)ecx_siigetbyte(CTX, slave, 0);
        (void)ecx_siifind(CTX, slave, ECT_SII_GENERAL);
        (void)ecx_siiFMMU(CTX, slave, &fmmu);
        (void)ecx_siiSM(CTX, slave, &sm);
        (void)ecx_siiSMnext(CTX, slave, &sm, 77);
        ecx_readeeprom1(CTX, slave, 8);
        (void)ecx_readeeprom2(CTX, slave, 1000);
        (void)ecx_eeprom2master(CTX, slave);
        (void)ecx_eeprom2pdi(CTX, slave);
        ecx_dcsync0(CTX, slave, TRUE, 0, -1);
        ecx_dcsync01(CTX, slave, TRUE, 0, 0, 0);
        while (ecx_iserror(CTX)) ecx_elist2string(CTX);
    }
    MUST(ecx_config_map_group(CTX, map, 255) == 0);
    MUST(ecx_send_processdata_group(CTX, 255) == 0);
    MUST(ecx_receive_processdata_group(CTX, 255, 100) == EC_NOFRAME);
    MUST(ecx_config_map_group(CTX, NULL, 0) == 0);
}

/* Values that are longer than the memory of the program, sizes that are zero or negative. */
static void small_memory(void) {
    struct {
        uint8 before[8];
        uint8 value[2];
        uint8 after[8];
    } memory;
    int size;
    ec_errort error;
    memset(&memory, 0x5A, sizeof(memory));
    size = 2;
    MUST(ecx_SDOread(CTX, 1, 0x1008, 0, FALSE, &size, memory.value, EC_TIMEOUTRXM) <= 0);
    size = 0;
    MUST(ecx_SDOread(CTX, 1, 0x1008, 0, FALSE, &size, memory.value, EC_TIMEOUTRXM) <= 0);
    size = -1;
    MUST(ecx_SDOread(CTX, 1, 0x1008, 0, FALSE, &size, memory.value, EC_TIMEOUTRXM) <= 0);
    MUST(memory.before[7] == 0x5A && memory.after[0] == 0x5A && memory.after[7] == 0x5A);
    MUST(ecx_SDOwrite(CTX, 1, 0x1000, 0, FALSE, -4, memory.value, EC_TIMEOUTRXM) <= 0);
    MUST(ecx_SDOwrite(CTX, 1, 0x1000, 0, FALSE, 4, memory.before, EC_TIMEOUTRXM) <= 0);
    if (SLAVES[1].mbx_l != 0) {
        MUST(ecx_iserror(CTX));
        MUST(ecx_poperror(CTX, &error));
    }
    while (ecx_poperror(CTX, &error)) {
    }
    MUST(!ecx_iserror(CTX));
}

/* The list keeps the newest errors. */
static void many_errors(void) {
    ec_errort error;
    int n, taken = 0, last = -1;
    memset(&error, 0, sizeof(error));
    for (n = 0; n < 200; ++n) ecx_packeterror(CTX, 1, (uint16)n, 0, 3);
    while (ecx_poperror(CTX, &error)) {
        ++taken;
        MUST(last == -1 || error.Index == last + 1);
        last = error.Index;
    }
    MUST(last == 199 && taken >= EC_MAXELIST - 1 && taken <= EC_MAXELIST + 1);
    MUST(!ecx_iserror(CTX) && strlen(ecx_elist2string(CTX)) == 0);
    for (n = 0; n < 30; ++n) {
        error.Etype = (ec_err_type)n;
        MUST(strlen(ecx_err2string(error)) > 0);
    }
}

/* Datagrams of all kinds, and frames that the program builds. */
static void datagrams(void) {
    uint16 type = 0, word = 0;
    uint8 octets[64];
    int64 time = 0;
    int wkc, n;
    memset(octets, 0, sizeof(octets));
    MUST(ecx_BRD(PORT, 0, ECT_REG_TYPE, 2, &type, EC_TIMEOUTRET3) == COUNT);
    MUST(ecx_APRD(PORT, 0, ECT_REG_STADR, 2, &word, EC_TIMEOUTRET3) == 1 && etohs(word) == SLAVES[1].configadr);
    MUST(etohs(ecx_APRDw(PORT, 0, ECT_REG_STADR, EC_TIMEOUTRET3)) == SLAVES[1].configadr);
    MUST(etohs(ecx_FPRDw(PORT, SLAVES[1].configadr, ECT_REG_STADR, EC_TIMEOUTRET3)) == SLAVES[1].configadr);
    MUST(ecx_FPRD(PORT, 0x7777, 0, 2, &word, EC_TIMEOUTRET3) == 0);
    MUST(ecx_APWRw(PORT, 0, 0x0F80, 0x1234, EC_TIMEOUTRET3) >= 0);
    MUST(ecx_FPWRw(PORT, SLAVES[1].configadr, 0x0F80, 0x1234, EC_TIMEOUTRET3) >= 0);
    MUST(ecx_LRD(PORT, 0x7F000000, 8, octets, EC_TIMEOUTRET3) == 0);
    MUST(ecx_LWR(PORT, 0x7F000000, 8, octets, EC_TIMEOUTRET3) == 0);
    MUST(ecx_LRW(PORT, 0x7F000000, 8, octets, EC_TIMEOUTRET3) == 0);
    wkc = ecx_LRWDC(PORT, 0x7F000000, 8, octets, SLAVES[1].configadr, &time, EC_TIMEOUTRET3);
    MUST(wkc == 0);
    /* More frames than buffers, none of them sent. */
    for (n = 0; n < 3 * EC_MAXBUF; ++n) {
        const int idx = ecx_getindex(PORT);
        MUST(idx >= 0 && idx < EC_MAXBUF);
        ecx_setbufstat(PORT, (uint8)idx, EC_BUF_EMPTY);
    }
    {
        const int idx = ecx_getindex(PORT);
        memset(octets, 0, sizeof(octets));
        ecx_setupdatagram(PORT, &PORT->txbuf[idx], EC_CMD_BRD, (uint8)idx, 0, ECT_REG_TYPE, 2, octets);
        n = ecx_adddatagram(PORT, &PORT->txbuf[idx], EC_CMD_FPRD, (uint8)idx, FALSE, SLAVES[1].configadr, ECT_REG_STADR, 2, octets);
        MUST(ecx_srconfirm(PORT, (uint8)idx, EC_TIMEOUTRET3) == 1); /* of the last datagram */
        memcpy(&word, &PORT->rxbuf[idx][n], 2);
        MUST(etohs(word) == SLAVES[1].configadr);
        ecx_setbufstat(PORT, (uint8)idx, EC_BUF_EMPTY);
    }
    MUST(ecx_waitinframe(PORT, 0, 100) == EC_NOFRAME);
}

static void memory_of_slaves(void) {
    static uint8 dump[EC_MAXEEPBUF];
    static ec_eepromPDOt pdo;
    uint16 n;
    for (n = 1; n <= COUNT; ++n) {
        const uint64 wide = ecx_readeepromFP(CTX, SLAVES[n].configadr, ECT_SII_MANUF, EC_TIMEOUTEEP);
        MUST((uint32)wide == SLAVES[n].eep_man);
        MUST(ecx_readeeprom(CTX, n, ECT_SII_ID, EC_TIMEOUTEEP) == SLAVES[n].eep_id);
        MUST(ecx_readeeprom(CTX, n, 0xFFF0, EC_TIMEOUTEEP) != SLAVES[n].eep_id);
        memset(dump, 0, sizeof(dump));
        ecx_esidump(CTX, n, dump);
        MUST(memcmp(dump + 16, &SLAVES[n].eep_man, 4) == 0);
        (void)ecx_siiPDO(CTX, n, &pdo, 0);
        (void)ecx_siiPDO(CTX, n, &pdo, 1);
        (void)ecx_siiPDO(CTX, n, &pdo, 7);
        (void)ecx_siigetbyte(CTX, n, 0xFFFF);
        MUST(ecx_siifind(CTX, n, 0x7FFE) == 0);
    }
}

/* A broadcast asks slaves that no scan has found yet. */
static void states_before_a_scan(void) {
    const int state = ecx_statecheck(CTX, 0, EC_STATE_INIT, 2000);
    MUST(state != EC_STATE_NONE && (SLAVES[0].state & 0xF) == state);
#ifndef SOEM2
    MUST(ecx_detect_slaves(CTX) >= 1 && COUNT >= 1);
    MUST(ecx_statecheck(CTX, 0, EC_STATE_INIT, 100000) == EC_STATE_INIT);
    MUST(ecx_readstate(CTX) == EC_STATE_INIT && (SLAVES[COUNT].state & 0xF) == EC_STATE_INIT);
#endif
}

int main(int argc, char **argv) {
    int round, used;
    if (argc != 2) return 2;
    without_master();
    for (round = 0; round < 2; ++round) {
        MUST(ecx_init(CTX, argv[1]) > 0);
        if (round == 1) MUST(ecx_init(CTX, argv[1]) > 0); /* again, without closing */
        MUST(ecx_config_map_group(CTX, map, 0) == 0);     /* before a scan */
        MUST(ecx_send_processdata(CTX) == 0);
        MUST(ecx_receive_processdata(CTX, 100) == EC_NOFRAME);
        if (round == 0) states_before_a_scan();
        MUST(CONFIG_INIT() >= 1);
        MUST(CONFIG_INIT() >= 1);
        if (COUNT < 1) return 1;
        wrong_numbers();
        small_memory();
        many_errors();
        datagrams();
        memory_of_slaves();
        used = ecx_config_map_group(CTX, map, 0);
        MUST(used > 0);
        MUST(ecx_config_map_group(CTX, map, 0) == used);
        MUST(ecx_receive_processdata(CTX, 100) == EC_NOFRAME); /* nothing was sent */
        MUST(ecx_send_processdata(CTX) == 1);
        MUST(ecx_send_processdata(CTX) == 1); /* twice */
        MUST(ecx_receive_processdata(CTX, EC_TIMEOUTRET) > 0);
        wrong_numbers();
        MUST(ecx_send_processdata(CTX) == 1);
        MUST(ecx_receive_processdata(CTX, EC_TIMEOUTRET) > 0);
        MUST(CONFIG_INIT() >= 1); /* a new scan takes the mapping away */
        MUST(ecx_receive_processdata(CTX, 100) == EC_NOFRAME);
        ecx_close(CTX);
        ecx_close(CTX);
        MUST(ecx_send_processdata(CTX) == 0);
        MUST(ecx_statecheck(CTX, 1, EC_STATE_OPERATIONAL, 100) == 0);
    }
    without_master();
    printf("%d slaves, %d wrong\n", COUNT, wrong);
    return wrong == 0 ? 0 : 1;
}
