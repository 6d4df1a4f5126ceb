#include "nic_check/read.hpp"
#ifdef MARGAY_WITH_XDP
#include "oshw/xdp/xdp_nic.hpp"
#endif

namespace margay::nic_check {

#ifdef MARGAY_WITH_XDP
void try_xdp(InterfaceFacts& facts) {
    XdpNic nic;
    if (nic.open(facts.name))
        facts.xdp_mode = std::string(to_text(nic.mode()));
    else
        facts.xdp_refusal = nic.problem();
}
#else
void try_xdp(InterfaceFacts& facts) { facts.unread["AF_XDP"] = "this program was built without libxdp and libbpf"; }
#endif

}  // namespace margay::nic_check
