/* SoE, EoE and groups. For SOEM 1.4: services SOURCE, where slave 2 has drives (SoE) and slave 3 EoE; slaves 1 and 4
   have process data. */
#include <ethercat.h>

#include <stdio.h>
#include <string.h>

#include "must.h"

static char IOmap[4096];
static int wrong;

/* Slave 2 alone is in group 1; mapping group 0 takes it back. */
static void groups(void) {
    int first, all, slave;
    ec_slave[2].group = 1;
    first = ecx_config_map_group(&ecx_context, IOmap, 1);
    MUST(first > 0 && (uint32)first == ec_group[1].Obytes + ec_group[1].Ibytes);
    MUST(ec_group[1].Obytes == ec_slave[2].Obytes && ec_group[1].Ibytes == ec_slave[2].Ibytes);
    MUST(ec_slave[2].outputs == (uint8 *)IOmap && ec_slave[1].outputs == NULL);
    MUST(ec_group[1].logstartaddr == 1u << EC_LOGGROUPOFFSET);
    MUST(ec_statecheck(2, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE) == EC_STATE_SAFE_OP);
    MUST(ec_send_processdata_group(1) == 1);
    MUST(ec_receive_processdata_group(1, EC_TIMEOUTRET) == ec_group[1].outputsWKC * 2 + ec_group[1].inputsWKC);
    MUST(ec_receive_processdata_group(1, EC_TIMEOUTRET) == EC_NOFRAME);
    all = ec_config_map(IOmap);
    MUST(all > first && ec_group[1].outputsWKC == 0 && ec_group[1].inputsWKC == 0);
    for (slave = 1; slave <= ec_slavecount; ++slave) MUST(ec_slave[slave].outputs || ec_slave[slave].inputs);
    MUST(ecx_config_map_group(&ecx_context, IOmap, EC_MAXGROUP) == 0);
    MUST(ec_send_processdata_group(EC_MAXGROUP) == 0);
    MUST(ec_receive_processdata_group(EC_MAXGROUP, 100) == EC_NOFRAME);
}

/* The errors of one service. */
static int errors(void) {
    int count = 0;
    ec_errort error;
    while (ec_poperror(&error)) count += error.Etype == EC_ERR_TYPE_SOE_ERROR && error.Slave == 2;
    return count;
}

static void drives(void) {
    ec_SoEnamet name;
    uint8 value[64];
    int size = sizeof name, outputs = 0, inputs = 0;
    memset(&name, 0, sizeof name);
    MUST(ec_SoEread(2, 0, EC_SOE_NAME_B, 32, &size, &name, EC_TIMEOUTRXM) > 0);
    MUST(name.currentlength == size - 4 && strncmp(name.name, "Primary operation mode", name.currentlength) == 0);
    size = sizeof value;
    MUST(ec_SoEread(2, 0, EC_SOE_VALUE_B, 1, &size, value, EC_TIMEOUTRXM) > 0 && size == 2);
    MUST(errors() == 0);
    size = sizeof value;
    MUST(ec_SoEread(2, 0, EC_SOE_VALUE_B, 0x7777, &size, value, EC_TIMEOUTRXM) <= 0 && errors() == 1);
    /* The cycle time cannot be written in SAFEOP. */
    size = sizeof value;
    MUST(ec_SoEread(2, 0, EC_SOE_VALUE_B, 1, &size, value, EC_TIMEOUTRXM) > 0);
    MUST(ec_SoEwrite(2, 0, EC_SOE_VALUE_B, 1, 2, value, EC_TIMEOUTRXM) <= 0 && errors() == 1);
    MUST(ec_readIDNmap(2, &outputs, &inputs) > 0);
    MUST(outputs == ec_slave[2].Obits && inputs == ec_slave[2].Ibits);
    errors();
}

static void frames(void) {
    eoe_param_t set, got;
    uint8 frame[64];
    static uint8 huge[5000];
    int size = 10;
    memset(&set, 0, sizeof set);
    memset(&got, 0, sizeof got);
    memset(frame, 0xFF, sizeof frame);
    set.ip_set = set.subnet_set = 1;
    EOE_IP4_ADDR_TO_U32(&set.ip, 192, 168, 9, 5);
    EOE_IP4_ADDR_TO_U32(&set.subnet, 255, 255, 255, 0);
    MUST(ecx_EOEsetIp(&ecx_context, 3, 0, &set, EC_TIMEOUTRXM) > 0);
    MUST(ecx_EOEgetIp(&ecx_context, 3, 0, &got, EC_TIMEOUTRXM) > 0);
    MUST(got.ip_set && got.ip.addr == set.ip.addr && got.subnet.addr == set.subnet.addr);
    MUST(ecx_EOEsend(&ecx_context, 3, 0, sizeof frame, frame, EC_TIMEOUTRXM) > 0);
    MUST(ecx_EOEsend(&ecx_context, 3, 0, 0, frame, 1000) <= 0);
    MUST(ecx_EOEsend(&ecx_context, 3, 0, sizeof huge, huge, EC_TIMEOUTRXM) <= 0);
    MUST(ecx_EOErecv(&ecx_context, 3, 0, &size, frame, 10000) <= 0);
}

/* Slave 2 has no files, slave 4 no mailbox. */
static void files(void) {
    uint8 file[16];
    ec_errort error;
    int size = sizeof file;
    MUST(ec_FOEread(2, (char *)"file", 0, &size, file, EC_TIMEOUTRXM) == 0);
    MUST(ec_poperror(&error) && error.Etype == EC_ERR_TYPE_MBX_ERROR && error.ErrorCode == 2 && error.Slave == 2);
    MUST(ec_FOEwrite(4, (char *)"file", 0, size, file, EC_TIMEOUTRXM) == 0);
    MUST(!ec_poperror(&error));
}

int main(int argc, char **argv) {
    if (argc != 2) return 2;
    if (!ec_init(argv[1]) || ec_config_init(FALSE) != 4) return 1;
    groups();
    MUST(ec_statecheck(0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE) == EC_STATE_SAFE_OP);
    drives();
    frames();
    files();
    ec_close();
    return wrong != 0;
}
