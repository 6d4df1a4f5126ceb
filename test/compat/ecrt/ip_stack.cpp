// The IP parameters of slaves: set before SAFEOP. The facade has no function that reads them, so the test asks the
// slave by the library, whose sources it contains. The last line of the output says that each test had the expected
// result.
#include <cycle.h>
#include "compat/ecrt/bus.hpp"

#include <margay/eoe.hpp>

#include <arpa/inet.h>
#include <ecrt.h>
#include <cerrno>
#include <cstdio>
#include <cstring>

using namespace margay;

namespace {

in_addr address(const char* text) {
    in_addr to{};
    inet_pton(AF_INET, text, &to);
    return to;
}

bool are_as_set(const EoeIp& ip) {
    return ip.mac == MacAddress{2, 0, 0, 0, 0, 7} && ip.address == Ipv4Address{192, 168, 5, 2} &&
           ip.subnet_mask == Ipv4Address{255, 255, 255, 0} && ip.default_gateway == Ipv4Address{192, 168, 5, 1} &&
           ip.dns_server == Ipv4Address{192, 168, 5, 53} && ip.host_name() == "gateway-7";
}

}  // namespace

int main() {
    ec_master_t* master = ecrt_request_master(0);
    if (master == nullptr) return 1;
    ec_domain_t* domain = ecrt_master_create_domain(master);
    ec_slave_config_t* gateway = ecrt_master_slave_config(master, 0, 0, 0x00004D47, 0x6601);
    ec_slave_config_t* drive = ecrt_master_slave_config(master, 0, 1, 0x00004D47, 0x5402);
    if (domain == nullptr || gateway == nullptr || drive == nullptr) return 1;
    const unsigned char mac[] = {2, 0, 0, 0, 0, 7};
    if (ecrt_slave_config_eoe_mac_address(gateway, mac) != 0 ||
        ecrt_slave_config_eoe_ip_address(gateway, address("192.168.5.2")) != 0 ||
        ecrt_slave_config_eoe_subnet_mask(gateway, address("255.255.255.0")) != 0 ||
        ecrt_slave_config_eoe_default_gateway(gateway, address("192.168.5.1")) != 0 ||
        ecrt_slave_config_eoe_dns_address(gateway, address("192.168.5.53")) != 0 ||
        ecrt_slave_config_eoe_hostname(gateway, "gateway-7") != 0)
        return 2;
    if (ecrt_slave_config_eoe_mac_address(gateway, nullptr) != -EINVAL ||
        ecrt_slave_config_eoe_hostname(gateway, nullptr) != -EINVAL ||
        ecrt_slave_config_eoe_hostname(gateway, "a-name-of-more-than-thirty-two-octets") != -EINVAL)
        return 3;
    // A slave without EoE: a message says so, and the slave comes to OP.
    if (ecrt_slave_config_eoe_ip_address(drive, address("192.168.5.3")) != 0) return 4;
    if (ecrt_slave_config_reg_pdo_entry(gateway, 0x7000, 0, domain, nullptr) < 0) return 5;
    if (ecrt_slave_config_reg_pdo_entry(drive, 0x6040, 0, domain, nullptr) < 0) return 5;
    if (ecrt_master_activate(master) != 0) return 6;
    if (ecrt_slave_config_eoe_ip_address(gateway, address("192.168.5.9")) != -EBUSY) return 7;
    for (int n = 0; n < 20000; ++n) {
        next_cycle();
        ecrt_master_receive(master);
        ecrt_domain_process(domain);
        ecrt_domain_queue(domain);
        ecrt_master_send(master);
        ec_slave_config_state_t first, second;
        ecrt_slave_config_state(gateway, &first);
        ecrt_slave_config_state(drive, &second);
        if (first.operational && second.operational) break;
        if (n == 19999) return 8;
    }
    const auto ip = EOEget_ip(*master->bus->ctx, gateway->number);
    if (!ip || !are_as_set(*ip)) return 9;
    ecrt_release_master(master);
    std::puts("the parameters are as set");
    return 0;
}
