// Opening and closing the network interface, and the network interfaces of the host.
#include "compat/soem/facade.hpp"

#include <arpa/inet.h>
#include <net/if.h>
#include <cstdlib>
#include <mutex>
#include <string>

namespace margay::soem {
namespace {

Limits limits_for(int slaves, int groups) {
    Limits limits;
    limits.slaves = static_cast<std::uint16_t>(std::clamp(slaves, 1, 65000));
    limits.groups = static_cast<std::uint16_t>(std::clamp(groups, 1, 256));
    limits.process_frames = EC_MAXIOSEGMENTS;
    return limits;
}

// Locked while a port is opened or closed, because two threads may do that with the same port.
std::mutex ports_mutex;
using PortsLock = std::lock_guard<std::mutex>;

void close_port(ecx_portt& port) { Sessions::remove(place_of(port).exchange(-1), &port); }

// `ring`: the interface or segment must have two ends.
int open_port(ecx_portt& port, const std::string& name, int slaves, int groups, bool ring = false) {
    close_port(port);
    auto session = Session::open(name, limits_for(slaves, groups));
    if (session == nullptr) return 0;
    if (ring && !session->redundant()) {
        say(name + ": this segment has no ring");
        return 0;
    }
    // Before another thread can find the session, because that thread may then build frames.
    port.sockhandle = -1;
    std::atomic_ref(port.lastidx) = 0;
    for (int n = 0; n < EC_MAXBUF; ++n) status_of(port, n) = EC_BUF_EMPTY;
    const int place = Sessions::add(std::move(session), &port);
    if (place < 0) {
        say("no more than 64 ports can be open at the same time");
        return 0;
    }
    place_of(port) = place;
    return 1;
}

}  // namespace
}  // namespace margay::soem

using namespace margay::soem;

extern "C" {

int ecx_setupnic(ecx_portt* port, const char* ifname, int secondary) {
    if (ifname == nullptr) return 0;
    if (secondary != 0) {
        say_once("ecx_setupnic() opens no second network interface: ecx_init_redundant() opens both");
        return 0;
    }
    const PortsLock lock(ports_mutex);
    return open_port(*port, ifname, EC_MAXSLAVE, EC_MAXGROUP);
}

int ecx_closenic(ecx_portt* port) {
    const PortsLock lock(ports_mutex);
    close_port(*port);
    return 0;
}

int ecx_init(ecx_contextt* context, const char* ifname) {
    if (ifname == nullptr) return 0;
    const PortsLock lock(ports_mutex);
    begin_context(*context);
    return open_port(port_of(*context), ifname, most_slaves(*context), most_groups(*context));
}

// A simulated segment with a ring contains both ends, so the second name is not used.
int ecx_init_redundant(ecx_contextt* context, ecx_redportt* redport, const char* ifname, char* if2name) {
    if (ifname == nullptr || if2name == nullptr) return 0;
    const PortsLock lock(ports_mutex);
    begin_context(*context);
    port_of(*context).redport = redport;
    const std::string first(ifname);
    const std::string both = first.starts_with("sim:") ? first : first + "+" + if2name;
    return open_port(port_of(*context), both, most_slaves(*context), most_groups(*context), true);
}

void ecx_close(ecx_contextt* context) {
    const PortsLock lock(ports_mutex);
    close_port(port_of(*context));
    end_context(*context);
}

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
