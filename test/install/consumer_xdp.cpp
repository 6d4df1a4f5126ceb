// The program of another project with the AF_XDP NIC.
#include <margay/parts/oshw/xdp/xdp_nic.hpp>

int main() {
    margay::XdpNic nic;
    return !nic.open("no-such-nic") && !nic.problem().empty() ? 0 : 1;
}
