// The program of another project for a real interface. The interface does not exist.
#include <margay/host_context.hpp>
#include <margay/margay.hpp>
#include <margay/parts/osal/linux/linux_osal.hpp>
#include <margay/parts/oshw/linux/packet_nic.hpp>

int main() {
    margay::LinuxOsal osal;
    margay::PacketNic nic;
    if (nic.open("no-such-port") || nic.problem().find("no-such-port") == nic.problem().npos) return 1;
    margay::HostContext ctx;
    if (!init(ctx, nic, osal)) return 1;
    (void)poll(ctx, osal.now());
    return nic.link_state() == margay::LinkState::down && ctx.slaves().empty() ? 0 : 1;
}
