// Opening and closing the network interface, and the network interfaces of the host.
#include "compat/soem/facade.hpp"

#include <arpa/inet.h>
#include <net/if.h>
#include <cstdlib>

namespace margay::soem {
namespace {

Limits limits_for(int slaves, int groups) {
    Limits limits;
    limits.slaves = static_cast<std::uint16_t>(std::clamp(slaves, 1, 65000));
    limits.groups = static_cast<std::uint16_t>(std::clamp(groups, 1, 256));
    limits.process_frames = EC_MAXIOSEGMENTS;
    return limits;
}

int open_port(ecx_portt& port, const char* name, int slaves, int groups) {
    if (name == nullptr) return 0;
    Sessions::remove(port.margay_session, &port);
    port.margay_session = -1;
    auto session = Session::open(name, limits_for(slaves, groups));
    if (session == nullptr) return 0;
    port.margay_session = Sessions::add(std::move(session), &port);
    if (port.margay_session < 0) {
        say("no more than 64 ports can be open at the same time");
        return 0;
    }
    port.sockhandle = -1;
    port.lastidx = 0;
    std::fill_n(port.rxbufstat, EC_MAXBUF, static_cast<int>(EC_BUF_EMPTY));
    return 1;
}

}  // namespace
}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

int ecx_setupnic(ecx_portt* port, const char* ifname, int secondary) {
    if (secondary != 0) {
        say_once("a second network interface for cable redundancy is not supported");
        return 0;
    }
    return open_port(*port, ifname, EC_MAXSLAVE, EC_MAXGROUP);
}

int ecx_closenic(ecx_portt* port) {
    Sessions::remove(port->margay_session, port);
    port->margay_session = -1;
    return 0;
}

int ecx_init(ecx_contextt* context, const char* ifname) {
    begin_context(*context);
    return open_port(port_of(*context), ifname, most_slaves(*context), most_groups(*context));
}

int ecx_init_redundant(ecx_contextt*, ecx_redportt*, const char*, char*) {
    say_once("cable redundancy is not supported: ecx_init_redundant() opens no network interface");
    return 0;
}

void ecx_close(ecx_contextt* context) { ecx_closenic(&port_of(*context)); }

ec_adaptert* ec_find_adapters(void) {
    struct if_nameindex* const names = if_nameindex();
    if (names == nullptr) return nullptr;
    ec_adaptert* first = nullptr;
    ec_adaptert** last = &first;
    for (auto* name = names; name->if_index != 0 && name->if_name != nullptr; ++name) {
        auto* const adapter = static_cast<ec_adaptert*>(std::calloc(1, sizeof(ec_adaptert)));
        if (adapter == nullptr) break;
        std::strncpy(adapter->name, name->if_name, sizeof(adapter->name) - 1);
        std::strncpy(adapter->desc, name->if_name, sizeof(adapter->desc) - 1);
        *last = adapter;
        last = &adapter->next;
    }
    if_freenameindex(names);
    return first;
}

void ec_free_adapters(ec_adaptert* adapter) {
    while (adapter != nullptr) {
        ec_adaptert* const next = adapter->next;
        std::free(adapter);
        adapter = next;
    }
}

ec_adaptert* oshw_find_adapters(void) { return ec_find_adapters(); }
void oshw_free_adapters(ec_adaptert* adapter) { ec_free_adapters(adapter); }
uint16 oshw_htons(uint16 hostshort) { return htons(hostshort); }
uint16 oshw_ntohs(uint16 networkshort) { return ntohs(networkshort); }

}  // extern "C"
