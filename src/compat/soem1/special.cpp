// Functions of SOEM 1.4 only: the global master, and the functions whose parameters differ.
#include "compat/soem/cycle.hpp"

using namespace margay::soem;

namespace {

// Memory of the global master.
struct Scratch {
    uint8 esibuf[EC_MAXEEPBUF];
    uint32 esimap[EC_MAXEEPBITMAP];
    ec_eringt errors;
    ec_idxstackT stack;
    ec_SMcommtypet types[EC_MAX_MAPT];
    ec_PDOassignt assignments[EC_MAX_MAPT];
    ec_PDOdesct descriptions[EC_MAX_MAPT];
    ec_eepromSMt sm;
    ec_eepromFMMUt fmmu;
} scratch;

void clear(ecx_contextt& context) {
    *context.slavecount = 0;
    std::memset(static_cast<void*>(context.slavelist), 0, sizeof(ec_slavet) * static_cast<size_t>(context.maxslave));
    std::memset(static_cast<void*>(context.grouplist), 0, sizeof(ec_groupt) * static_cast<size_t>(context.maxgroup));
}

}  // namespace

extern "C" {

ecx_portt ecx_port;
ecx_redportt ecx_redport;
ec_slavet ec_slave[EC_MAXSLAVE];
int ec_slavecount;
ec_groupt ec_group[EC_MAXGROUP];
boolean EcatError = FALSE;
int64 ec_DCtime;

ecx_contextt ecx_context = {
    &ecx_port,
    ec_slave,
    &ec_slavecount,
    EC_MAXSLAVE,
    ec_group,
    EC_MAXGROUP,
    scratch.esibuf,
    scratch.esimap,
    0,
    &scratch.errors,
    &scratch.stack,
    &EcatError,
    0,
    0,
    &ec_DCtime,
    scratch.types,
    scratch.assignments,
    scratch.descriptions,
    &scratch.sm,
    &scratch.fmmu,
    nullptr,
    nullptr,
    0,
    nullptr,
};

int ecx_config_init(ecx_contextt* context, uint8 usetable) {
    if (usetable != 0) say_once("there is no built-in table of devices: the slaves say what they are");
    return config_init(*context);
}

void ecx_init_context(ecx_contextt* context) {
    if (context->port == nullptr) return clear(*context);
    const Pinned session = session_of(context);
    if (session == nullptr) return clear(*context);
    const auto configuring = session->lock_configuring();
    const auto eeproms = session->lock_eeproms();
    const Session::Guard guard(*session);
    clear(*context);
}

int ecx_detect_slaves(ecx_contextt* context) {
    uint16 control = htoes(EC_STATE_INIT | EC_STATE_ACK);
    ecx_BWR(context->port, 0, ECT_REG_ALCTL, sizeof(control), &control, EC_TIMEOUTRET3);
    uint16 type = 0;
    const int wkc = ecx_BRD(context->port, 0, ECT_REG_TYPE, sizeof(type), &type, EC_TIMEOUTSAFE);
    if (wkc >= context->maxslave) return EC_SLAVECOUNTEXCEEDED;
    const Pinned session = session_of(context);
    if (wkc <= 0 || session == nullptr) return wkc;
    const Session::Guard guard(*session);  // other threads count the slaves with it
    *context->slavecount = wkc;
    return wkc;
}

int ecx_config_map_group(ecx_contextt* context, void* pIOmap, uint8 group) {
    return config_map(*context, pIOmap, group, false, false);
}
int ecx_config_map_group_aligned(ecx_contextt* context, void* pIOmap, uint8 group) {
    return config_map(*context, pIOmap, group, false, true);
}
int ecx_config_overlap_map_group(ecx_contextt* context, void* pIOmap, uint8 group) {
    return config_map(*context, pIOmap, group, true, true);
}
int ecx_send_overlap_processdata_group(ecx_contextt* context, uint8 group) { return send_group(*context, group); }
int ecx_send_overlap_processdata(ecx_contextt* context) { return send_group(*context, 0); }

int ec_config_map(void* pIOmap) { return ecx_config_map_group(&ecx_context, pIOmap, 0); }
int ec_config_map_aligned(void* pIOmap) { return ecx_config_map_group_aligned(&ecx_context, pIOmap, 0); }
int ec_config_overlap_map(void* pIOmap) { return ecx_config_overlap_map_group(&ecx_context, pIOmap, 0); }
int ec_config(uint8 usetable, void* pIOmap) {
    const int wkc = ec_config_init(usetable);
    if (wkc > 0) ec_config_map(pIOmap);
    return wkc;
}
int ec_config_overlap(uint8 usetable, void* pIOmap) {
    const int wkc = ec_config_init(usetable);
    if (wkc > 0) ec_config_overlap_map(pIOmap);
    return wkc;
}
int ec_findconfig(uint32, uint32) { return 0; }
int ec_init_redundant(const char* ifname, char* if2name) {
    return ecx_init_redundant(&ecx_context, &ecx_redport, ifname, if2name);
}

int ecx_FPRD_multi(ecx_contextt* context, int n, uint16* configlst, ec_alstatust* slstatlst, int timeout) {
    int wkc = 0;
    for (int i = 0; i < n; ++i) {
        const int read =
            ecx_FPRD(context->port, configlst[i], ECT_REG_ALSTAT, sizeof(ec_alstatust), &slstatlst[i], timeout);
        if (read < 0) return read;
        wkc += read;
    }
    return wkc;
}

}  // extern "C"
