#include "common/source_arguments.hpp"

#include "common/counted.hpp"
#include "common/program.hpp"
#include "common/ready_made.hpp"
#include "common/segment_look.hpp"
#include "common/slave_report.hpp"

#include <fmt/format.h>

#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>
#include <algorithm>
#include <cstring>

namespace margay::samples {
namespace {

// "up" for an Ethernet interface with a link, "no link" or "down" for others; empty when the interface is not
// Ethernet.
std::string ethernet_state(int socket, const char* name) {
    ifreq request{};
    std::strncpy(request.ifr_name, name, IFNAMSIZ - 1);
    if (::ioctl(socket, SIOCGIFHWADDR, &request) < 0 || request.ifr_hwaddr.sa_family != ARPHRD_ETHER) return {};
    if (::ioctl(socket, SIOCGIFFLAGS, &request) < 0) return {};
    if ((request.ifr_flags & IFF_UP) == 0) return "down";
    return (request.ifr_flags & IFF_RUNNING) != 0 ? "up" : "no link";
}

void add_source_options(Arguments& arguments, SourceArguments& values) {
    arguments.option("--record", values.options.record,
                     "write every frame sent and received to this file, as pcap (two interfaces: as pcapng)");
    arguments.flag("--trace", values.options.trace, "print a line for every datagram to standard error");
    arguments.flag(
        "--take-over", values.take_over,
        "scan also when slaves are in SAFEOP or OP, for example under another master; the slaves go to INIT");
}

}  // namespace

std::string interface_text() {
    return "interface (eth0; xdp:eth0 by AF_XDP; try-xdp:eth0 by AF_XDP, or else as eth0), two interfaces at the "
           "ends of a ring (eth0+eth1, xdp:eth0+xdp:eth1)";
}

std::string source_text() {
    return interface_text() +
           ", simulated segment "
           "(sim:demo, sim:drives, sim:FILE.toml, sim:a.bin,b.bin, sim:a.xml) or "
           "recording (pcap:FILE; it answers only what the recorded master asked, so it must be one that "
           "this program made by --record)";
}

void add_source_arguments(Arguments& arguments, SourceArguments& values, const std::string& more) {
    arguments.positional("SOURCE", values.source, source_text() + more);
    add_source_options(arguments, values);
    arguments.without_arguments([] { return list_of_interfaces() + list_of_segments("sim:"); });
}

void add_interface_arguments(Arguments& arguments, SourceArguments& values) {
    arguments.positional("SOURCE", values.source, interface_text());
    add_source_options(arguments, values);
    arguments.without_arguments(list_of_interfaces);
}

std::string list_of_interfaces() {
    std::string lines;
    const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    auto* all = ::if_nameindex();
    for (const auto* one = all; one != nullptr && one->if_index != 0; ++one)
        if (const auto state = ethernet_state(socket, one->if_name); !state.empty())
            lines += fmt::format("  {:<20} {}\n", one->if_name, state);
    if (all != nullptr) ::if_freenameindex(all);
    if (socket >= 0) ::close(socket);
    return "Ethernet interfaces:\n" + (lines.empty() ? std::string("  none\n") : lines);
}

std::string list_of_segments(const std::string& prefix) {
    std::string lines = "Ready-made simulated segments:\n";
    for (const auto& [name, title] : ready_made_segments()) lines += fmt::format("  {:<20} {}\n", prefix + name, title);
    return lines;
}

std::string scan_refusal(Source& source) {
    const auto look = look_at_segment(source.nic(), source.osal(), source.second());
    if (!look.link) return sentence({.code = Errc::link_down, .step = Step::wait_link});
    if (!look.running()) return {};
    return fmt::format(
        "slaves of this segment are in SAFEOP or OP ({}): another master may be running them, and this "
        "program begins by putting all slaves to INIT. Use --take-over to do this.",
        counted(look.slaves, "slave answers", "slaves answer"));
}

int run_on_source(const SourceArguments& values, const std::function<int(Source&)>& body) {
    auto source = open_source(values.source, values.options);
    if (!source) return fail(source.error(), exit_code::kSystem);
    // In virtual time there is no other master.
    const auto refusal = source->virtual_time() || values.take_over ? std::string() : scan_refusal(*source);
    int code = refusal.empty() ? body(*source) : fail(refusal);
    if (const auto repeated = source->repeated_answers(); !repeated.empty()) warn(repeated);
    const auto remark = source->finish();
    if (remark.empty()) return code;
    if (code == exit_code::kWell) code = exit_code::kSegment;
    return fail(remark, source->recording_lost() ? exit_code::kSystem : code);
}

}  // namespace margay::samples
