/* What the interface shows of a slave is what the chip has: FMMUs, also where a direction has several SyncManagers. A
   request for BOOT reaches a slave without a mailbox for it, and its answer is shown; a chip without firmware takes it.
   registers SOURCE */
#include <ethercat.h>

#include <stdio.h>
#include <string.h>

static char map[4096];

static int wrong_fmmus(int slave) {
    int n, wrong = 0, unused = 8;
    for (n = 0; n < 8; ++n) {
        ec_fmmut there, shown;
        memset(&there, 0, sizeof(there));
        memset(&shown, 0, sizeof(shown));
        ec_FPRD(ec_slave[slave].configadr, (uint16)(ECT_REG_FMMU0 + 16 * n), sizeof(there), &there, EC_TIMEOUTRET3);
        if (!there.FMMUactive && n < unused) unused = n;
        if (n >= EC_MAXFMMU) continue;
        shown = ec_slave[slave].FMMU[n];
        if (!there.FMMUactive && !shown.FMMUactive) continue;
        if (memcmp(&there, &shown, 13) != 0) {
            printf("slave %d FMMU%d: %d octets at 0x%04x, shown are %d at 0x%04x\n", slave, n, there.LogLength,
                   there.PhysStart, shown.LogLength, shown.PhysStart);
            ++wrong;
        }
    }
    if (ec_slave[slave].FMMUunused != (unused < EC_MAXFMMU ? unused : EC_MAXFMMU)) ++wrong;
    return wrong;
}

static int without_outputs(uint16 slave) {
    uint8 none = 0;
    return ec_SDOwrite(slave, 0x1C12, 0, FALSE, sizeof(none), &none, EC_TIMEOUTRXM);
}

/* Names FMMU0 for inputs and FMMU1 for the status of mailboxes: the FMMUs for outputs then are FMMU5 and FMMU6, for
   which the interface has no room. */
static int name_fmmus(uint16 slave) {
    const int at = ecx_siifind(&ecx_context, slave, ECT_SII_FMMU);
    return at > 0 && ec_writeeeprom(slave, (uint16)(at / 2 + 1), 0x0302, EC_TIMEOUTEEP) > 0 ? 0 : 1;
}

int main(int argc, char** argv) {
    int slave, fmmu, wrong = 0, active = 0, refused = 0;
    if (argc != 2 || !ec_init(argv[1]) || ec_config_init(FALSE) < 4) return 2;
    if (name_fmmus(4) != 0 || ec_config_init(FALSE) < 4) return 2;
    ec_slave[2].PO2SOconfig = without_outputs; /* the SII names FMMU0 for them */
    ec_config_map(map);
    if (ec_config_init(FALSE) < 4) return 2; /* the logical addresses of the next mapping are others */
    ec_slave[2].PO2SOconfig = without_outputs;
    ec_config_map(map);
    for (slave = 1; slave <= ec_slavecount; ++slave) {
        wrong += wrong_fmmus(slave);
        for (fmmu = 0; fmmu < EC_MAXFMMU; ++fmmu) active += ec_slave[slave].FMMU[fmmu].FMMUactive;
    }
    wrong += ec_LRD(ec_group[0].logstartaddr + ec_group[0].Obytes, 1, map, EC_TIMEOUTRET3) < 1;
    ec_slave[0].state = EC_STATE_INIT;
    ec_writestate(0);
    ec_statecheck(0, EC_STATE_INIT, EC_TIMEOUTSTATE);
    for (slave = 1; slave <= ec_slavecount; ++slave) {
        ec_slave[slave].state = EC_STATE_BOOT;
        wrong += ec_writestate((uint16)slave) != 1;
        ec_statecheck((uint16)slave, EC_STATE_BOOT, 20000);
        ec_readstate();
        if ((ec_slave[slave].state & EC_STATE_ERROR) != 0 && ec_slave[slave].ALstatuscode != 0) ++refused;
    }
    printf("%d FMMUs, %d slaves refused BOOT, %d wrong\n", active, refused, wrong);
    ec_close();
    return wrong != 0 || active != 8 || refused != 3;
}
