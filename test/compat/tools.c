/* A program for SOEM 1.4 that reads what the tools of its users read: the EEPROM without a scan, the SII, objects and
   the dictionary, and errors. tools SOURCE SLAVE */
#include <ethercat.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int faults;
static void check(int right, const char *what) {
    if (right) return;
    printf("wrong: %s\n", what);
    ++faults;
}

static ec_ODlistt ODlist;
static ec_OElistt OElist;

int main(int argc, char **argv) {
    int slave, wkc, size, n, found = 0;
    uint16 word = 0, position;
    uint32 value = 0, vendor;
    uint64 words;
    ec_eepromSMt sm;
    ec_eepromFMMUt fmmu;
    ec_eepromPDOt pdo;
    static uint8 dump[EC_MAXEEPBUF];
    char name[EC_MAXNAME + 1] = "";
    if (argc != 3) return 2;
    slave = atoi(argv[2]);
    if (!ec_init(argv[1])) return 1;

    /* before a scan */
    ec_slavecount = ec_BRD(0x0000, ECT_REG_TYPE, sizeof(word), &word, EC_TIMEOUTSAFE);
    check(ec_slavecount >= slave, "number of slaves by a broadcast");
    position = (uint16)(1 - slave);
    word = htoes(0);
    check(ec_APWR(position, ECT_REG_EEPCFG, 1, &word, EC_TIMEOUTSAFE) == 1, "the EEPROM for the master");
    words = ec_readeepromAP(position, ECT_SII_MANUF, EC_TIMEOUTEEP);
    vendor = (uint32)etohll(words);
    check(vendor != 0, "vendor by position");

    check(ec_config_init(FALSE) == ec_slavecount && ec_slavecount > 0, "config_init");
    ec_statecheck(0, EC_STATE_PRE_OP, EC_TIMEOUTSTATE);
    check(ec_slave[0].state == EC_STATE_PRE_OP, "all in PREOP");
    check(ec_slave[slave].eep_man == vendor, "vendor of the scan");
    check(ec_slave[slave].configadr == 0x1000 + slave, "station address");
    check(etohl(ec_readeeprom((uint16)slave, ECT_SII_MANUF, EC_TIMEOUTEEP)) == vendor, "vendor by slave");
    check(ec_siifind((uint16)slave, ECT_SII_GENERAL) > 0, "category general");
    ec_siistring(name, (uint16)slave, 1);
    check(strlen(name) > 0, "first string");
    n = ec_siiSM((uint16)slave, &sm);
    check(n == 0 || sm.PhStart == etohs(ec_slave[slave].SM[0].StartAddr), "start of SyncManager 0");
    check(ec_siiSMnext((uint16)slave, &sm, 1) == (n > 1), "the next SyncManager");
    check(n < 2 || sm.PhStart == etohs(ec_slave[slave].SM[1].StartAddr), "start of SyncManager 1");
    check(n == 0 || (ec_siiFMMU((uint16)slave, &fmmu) > 0 && fmmu.FMMU0 == ec_slave[slave].FMMU0func), "FMMUs of the SII");
    ec_siiPDO((uint16)slave, &pdo, 0);
    ec_esidump((uint16)slave, dump);
    check(memcmp(dump + 2 * ECT_SII_MANUF, &ec_slave[slave].eep_man, 4) == 0, "dump of the SII");
    ec_eeprom2pdi((uint16)slave);
    check(ec_slave[slave].eep_pdi == 1, "the EEPROM for the slave");
    check(etohs(ec_FPRDw(ec_slave[slave].configadr, ECT_REG_ALSTAT, EC_TIMEOUTSAFE)) == EC_STATE_PRE_OP, "AL status register");

    /* objects */
    if (ec_slave[slave].mbx_proto & ECT_MBXPROT_COE) {
        size = sizeof(value);
        wkc = ec_SDOread((uint16)slave, 0x1018, 1, FALSE, &size, &value, EC_TIMEOUTRXM);
        check(wkc > 0 && size == 4 && etohl(value) == vendor, "identity object");
        size = sizeof(value);
        check(ec_SDOread((uint16)slave, 0x5FFF, 0, FALSE, &size, &value, EC_TIMEOUTRXM) == 0, "an object that does not exist");
        check(EcatError == TRUE, "the flag of errors");
        {
            ec_errort entry;
            check(ec_iserror() && ec_poperror(&entry) && entry.Etype == EC_ERR_TYPE_SDO_ERROR && entry.Index == 0x5FFF &&
                      (uint32)entry.AbortCode == 0x06020000u && entry.Slave == slave,
                  "the entry of the error");
        }
        while (EcatError) printf("%s", ec_elist2string());
        size = 1;
        check(ec_SDOread((uint16)slave, 0x1018, 1, FALSE, &size, &value, EC_TIMEOUTRXM) == 0, "a buffer that is too small");
        while (EcatError) printf("%s", ec_elist2string());
        memset(&ODlist, 0, sizeof(ODlist));
        if (ec_slave[slave].CoEdetails & ECT_COEDET_SDOINFO) {
            check(ec_readODlist((uint16)slave, &ODlist) > 0 && ODlist.Entries > 3, "the list of objects");
            for (n = 0; n < ODlist.Entries; ++n) {
                if (ODlist.Index[n] != 0x1018) continue;
                found = 1;
                check(ec_readODdescription((uint16)n, &ODlist) > 0 && ODlist.MaxSub[n] >= 1, "description of an object");
                check(ec_readOE((uint16)n, &ODlist, &OElist) > 0 && OElist.Entries > 1 && OElist.BitLength[1] == 32,
                      "description of entries");
            }
            check(found, "the identity object in the list");
        }
    }
    ec_slave[0].state = EC_STATE_INIT;
    check(ec_writestate(0) == ec_slavecount, "writestate");
    check(ec_statecheck(0, EC_STATE_INIT, EC_TIMEOUTSTATE) == EC_STATE_INIT, "all in INIT");
    ec_close();
    printf("%s: %d slaves, %d faults\n", name, ec_slavecount, faults);
    return faults == 0 ? 0 : 1;
}
