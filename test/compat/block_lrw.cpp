// The program writes blockLRW of a group at any time: the frames have LRD and LWR from the next send on, or LRW again,
// and the program receives the working counter that it has computed. The interface does not show the commands, so the
// test reads them from the library.
#ifdef SOEM2
#include <soem/soem.h>
static ecx_contextt context;
#define CTX (&context)
#define PORT (context.port)
#define GROUP context.grouplist[0]
#define SLAVES context.slavelist
#define CONFIG_INIT() ecx_config_init(CTX)
#else
#include <ethercat.h>
#define CTX (&ecx_context)
#define PORT (ecx_port)
#define GROUP ec_group[0]
#define SLAVES ec_slave
#define CONFIG_INIT() ecx_config_init(CTX, FALSE)
#endif

#include "compat/soem/session.hpp"

#include <cstdio>
#include <string>

namespace {

char map[4096];
int wrong = 0;
int expected = 0;

void must(bool holds, const char* what) {
    if (holds) return;
    std::printf("not %s\n", what);
    ++wrong;
}

std::string commands() {
    const margay::soem::Sessions::Pinned session(PORT.margay_session, &PORT);
    std::string all;
    for (std::size_t n = 0;; ++n) {
        const auto datagram = margay::process_datagram(session->context(), n, 0);
        if (datagram.command == 0) return all;
        all += datagram.command == 10 ? "LRD " : datagram.command == 11 ? "LWR " : "LRW ";
    }
}

void cycles(int count) {
    for (int n = 0; n < count; ++n) {
        must(ecx_send_processdata(CTX) == 1, "sent");
        must(ecx_receive_processdata(CTX, EC_TIMEOUTRET) == expected, "the working counter");
        osal_usleep(1000);
    }
}

void expect_commands(int value, const char* which) {
    GROUP.blockLRW = static_cast<uint8>(value);
    cycles(300);  // longer than the watchdog of the outputs
    if (commands() != which) std::printf("%s after blockLRW = %d\n", commands().c_str(), value);
    must(commands() == which, "the commands");
    ecx_readstate(CTX);
    must(SLAVES[0].state == EC_STATE_OPERATIONAL, "OP");
    must(GROUP.outputsWKC * 2 + GROUP.inputsWKC == expected, "the same working counters");
}

}  // namespace

int main() {
    if (ecx_init(CTX, "sim:drives") <= 0 || CONFIG_INIT() < 1) return 1;
    must(ecx_config_map_group(CTX, map, 0) > 0, "mapped");
    expected = GROUP.outputsWKC * 2 + GROUP.inputsWKC;
    must(commands() == "LRW ", "LRW at first");
    ecx_configdc(CTX);
    ecx_statecheck(CTX, 0, EC_STATE_SAFE_OP, EC_TIMEOUTSTATE);
    cycles(1);
    SLAVES[0].state = EC_STATE_OPERATIONAL;
    ecx_writestate(CTX, 0);
    for (int n = 0; n < 100; ++n) {
        cycles(1);
        if (ecx_statecheck(CTX, 0, EC_STATE_OPERATIONAL, 1000) == EC_STATE_OPERATIONAL) break;
    }
    expect_commands(1, "LWR LRD ");
    expect_commands(2, "LWR LRD ");
    expect_commands(0, "LRW ");
    // A change between send and receive takes effect with the next send.
    ecx_send_processdata(CTX);
    GROUP.blockLRW = 1;
    must(ecx_receive_processdata(CTX, EC_TIMEOUTRET) == expected, "the cycle on the wire");
    must(commands() == "LRW ", "LRW until the next send");
    expect_commands(1, "LWR LRD ");
    // A change also takes effect with the next mapping.
    must(ecx_config_map_group(CTX, map, 0) > 0, "mapped again");
    must(commands() == "LWR LRD ", "LRD and LWR by the mapping");
    must(GROUP.outputsWKC * 2 + GROUP.inputsWKC == expected, "the same working counters");
    cycles(10);
    ecx_close(CTX);
    std::printf("%d wrong\n", wrong);
    return wrong == 0 ? 0 : 1;
}
