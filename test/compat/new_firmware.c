/* A slave of a running machine gets firmware of another revision and joins the cycle again, without a scan and without a
   mapping: new_firmware SOURCE SLAVE PASSWORD MAJOR */
#include <ethercat.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cycles.h"
#include "must.h"

static char IOmap[4096];
static uint8 image[4096];
static int wrong, expected;

static uint32 crc32_of(const uint8* octets, size_t count) {
    uint32 crc = 0xFFFFFFFFu;
    size_t n;
    int bit;
    for (n = 0; n < count; ++n) {
        crc ^= octets[n];
        for (bit = 0; bit < 8; ++bit) crc = (crc & 1u) != 0 ? crc >> 1 ^ 0xEDB88320u : crc >> 1;
    }
    return ~crc;
}

static void put(uint8* at, uint32 value) {
    int n;
    for (n = 0; n < 4; ++n) at[n] = (uint8)(value >> 8 * n);
}

/* Magic, checksum of what follows, product, version. */
static void make_image(uint32 product, int major) {
    memcpy(image, "MGFW", 4);
    put(image + 8, product);
    image[14] = (uint8)major;
    put(image + 4, crc32_of(image + 8, sizeof image - 8));
}

static void reach(uint16 slave, uint16 state) {
    int n;
    ec_slave[slave].state = state;
    MUST(ec_writestate(slave) > 0);
    for (n = 0; n < 200 && ec_statecheck(slave, state, 0) != state; ++n) cycles(10);
    MUST(ec_slave[slave].state == state);
}

static void take_boot_mailboxes(uint16 slave) {
    const uint32 out = ec_readeeprom(slave, ECT_SII_BOOTRXMBX, EC_TIMEOUTEEP);
    const uint32 in = ec_readeeprom(slave, ECT_SII_BOOTTXMBX, EC_TIMEOUTEEP);
    ec_slavet* const s = &ec_slave[slave];
    s->SM[0].StartAddr = s->mbx_wo = (uint16)LO_WORD(out);
    s->SM[0].SMlength = s->mbx_l = (uint16)HI_WORD(out);
    s->SM[1].StartAddr = s->mbx_ro = (uint16)LO_WORD(in);
    s->SM[1].SMlength = s->mbx_rl = (uint16)HI_WORD(in);
    ec_FPWR(s->configadr, ECT_REG_SM0, sizeof(ec_smt), &s->SM[0], EC_TIMEOUTSAFE);
    ec_FPWR(s->configadr, ECT_REG_SM1, sizeof(ec_smt), &s->SM[1], EC_TIMEOUTSAFE);
}

int main(int argc, char** argv) {
    uint16 slave;
    uint32 password, revision;
    if (argc != 5) return 2;
    slave = (uint16)atoi(argv[2]);
    password = (uint32)strtoul(argv[3], NULL, 0);
    if (!ec_init(argv[1]) || ec_config_init(FALSE) < slave) return 2;
    ec_config_map(IOmap);
    ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE * 4);
    expected = ec_group[0].outputsWKC * 2 + ec_group[0].inputsWKC;
    reach(0, EC_STATE_OPERATIONAL);
    MUST(cycles(2) == expected);

    reach(slave, EC_STATE_INIT);
    take_boot_mailboxes(slave);
    reach(slave, EC_STATE_BOOT);
    make_image(ec_slave[slave].eep_id, atoi(argv[4]));
    MUST(ec_FOEwrite(slave, (char*)"firmware", password, sizeof image, image, EC_TIMEOUTSTATE) > 0);
    reach(slave, EC_STATE_INIT);
    MUST(cycles(1500) < expected);

    MUST(ec_recover_slave(slave, 500) == 1);
    MUST(ec_reconfig_slave(slave, 500) == EC_STATE_SAFE_OP);
    reach(slave, EC_STATE_OPERATIONAL);
    MUST(cycles(2) == expected);
    printf("%d of %d\n", cycles(100), expected);
    revision = ec_readeeprom(slave, ECT_SII_REV, EC_TIMEOUTEEP);
    printf("revision 0x%08x, was 0x%08x\n", revision, ec_slave[slave].eep_rev);
    MUST(revision != ec_slave[slave].eep_rev);
    ec_close();
    return wrong != 0;
}
