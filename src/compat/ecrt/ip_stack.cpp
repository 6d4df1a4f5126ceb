// The parameters of the IP stack of a slave with EoE: set before SAFEOP, in each start-up of the slave.
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"
#include "compat/ecrt/slave_config.hpp"
#include "compat/ecrt/start_up.hpp"

#include <margay/hooked_slave.hpp>

#include <netinet/in.h>
#include <cerrno>
#include <cstring>

namespace margay::compat::ecrt {

// If the slave refuses the parameters, its process data is exchanged nevertheless.
Task<> set_ip(HookedSlave slave, const ec_slave_config& config) {
    const auto set = co_await slave.eoe_set_ip(config.ip);
    if (!set) say_error(config.bus, "the IP parameters of a slave were not set", set.error());
    co_return {};
}

namespace {

Ipv4Address octets(struct in_addr address) {
    Ipv4Address to;
    static_assert(sizeof(to) == sizeof(address.s_addr));
    std::memcpy(to.data(), &address.s_addr, sizeof(to));
    return to;
}

int set_address(ec_slave_config& config, std::optional<Ipv4Address> EoeIp::*which, struct in_addr address) {
    const Change change(config);
    if (change.refused()) return -EBUSY;
    config.ip.*which = octets(address);
    return 0;
}

}  // namespace

}  // namespace margay::compat::ecrt

using namespace margay;
using namespace margay::compat::ecrt;

extern "C" {

int ecrt_slave_config_eoe_mac_address(ec_slave_config_t* sc, const unsigned char* mac_address) {
    if (mac_address == nullptr) return -EINVAL;
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    MacAddress& mac = sc->ip.mac.emplace();
    std::memcpy(mac.data(), mac_address, mac.size());
    return 0;
}

int ecrt_slave_config_eoe_ip_address(ec_slave_config_t* sc, struct in_addr ip_address) {
    return set_address(*sc, &EoeIp::address, ip_address);
}

int ecrt_slave_config_eoe_subnet_mask(ec_slave_config_t* sc, struct in_addr subnet_mask) {
    return set_address(*sc, &EoeIp::subnet_mask, subnet_mask);
}

int ecrt_slave_config_eoe_default_gateway(ec_slave_config_t* sc, struct in_addr gateway_address) {
    return set_address(*sc, &EoeIp::default_gateway, gateway_address);
}

int ecrt_slave_config_eoe_dns_address(ec_slave_config_t* sc, struct in_addr dns_address) {
    return set_address(*sc, &EoeIp::dns_server, dns_address);
}

int ecrt_slave_config_eoe_hostname(ec_slave_config_t* sc, const char* name) {
    if (name == nullptr) return -EINVAL;
    const Change change(*sc);
    if (change.refused()) return -EBUSY;
    return sc->ip.set_host_name(name) ? 0 : -EINVAL;
}

}  // extern "C"
