#include "nic_check/findings.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace margay::nic_check {
namespace {

constexpr int kNeededMtu = 1500;
constexpr std::uint32_t kEtherCatMbit = 100;
constexpr std::uint32_t kLongestWait_us = 10;  // of coalescing, before it matters in a cycle of 1 ms

using Findings = std::vector<Finding>;

void good(Findings& all, std::string subject, std::string text) {
    all.push_back({Verdict::good, std::move(subject), std::move(text), {}});
}
void better(Findings& all, std::string subject, std::string text, std::string command = {}) {
    all.push_back({Verdict::better, std::move(subject), std::move(text), std::move(command)});
}
void not_known(Findings& all, const InterfaceFacts& facts, std::string subject, const std::string& fact) {
    const auto why = facts.unread.find(fact);
    all.push_back(
        {Verdict::not_known, std::move(subject), why == facts.unread.end() ? "it was not read" : why->second, {}});
}

void judge_kind(const InterfaceFacts& f, Findings& all) {
    if (f.wireless)
        better(all, "driver", "a wireless interface loses and delays frames: EtherCAT needs a cable");
    else if (!f.kind.empty())
        better(all, "driver",
               fmt::format("a virtual interface ({}): good for tests; slaves need a port of hardware", f.kind));
    else if (!f.driver)
        not_known(all, f, "driver", "driver");
    else if (*f.driver == "virtio_net" || *f.driver == "vmxnet3" || *f.driver == "hv_netvsc")
        better(all, "driver", *f.driver + ", the port of a virtual machine: its times are those of the host");
    else if (f.driver->starts_with("r815") || f.driver->starts_with("ax88") || *f.driver == "asix" ||
             *f.driver == "cdc_ncm")
        better(all, "driver",
               *f.driver + ", an adapter on USB: each frame waits for the polling of the USB host (125 µs and more)");
    else
        good(all, "driver", *f.driver);
    if (!f.master.empty())
        better(all, "bridge", fmt::format("the interface belongs to {}, which sends frames of its own", f.master),
               fmt::format("ip link set dev {} nomaster", f.name));
}

void judge_link(const InterfaceFacts& f, Findings& all) {
    if (!f.up)
        better(all, "link", "the interface is switched off", fmt::format("ip link set dev {} up", f.name));
    else if (!f.carrier)
        not_known(all, f, "link", "link");
    else if (!*f.carrier)
        better(all, "link", "there is no link: plug in the cable, and switch on the first slave");
    else
        good(all, "link", "up");
    if (f.mtu < kNeededMtu)
        better(all, "MTU", fmt::format("{}: EtherCAT frames have up to {} octets", f.mtu, kNeededMtu),
               fmt::format("ip link set dev {} mtu {}", f.name, kNeededMtu));
    else
        good(all, "MTU", std::to_string(f.mtu));
    if (!f.speed_mbit)
        not_known(all, f, "speed", "speed");
    else if (*f.speed_mbit < kEtherCatMbit)
        better(all, "speed", fmt::format("{} Mbit/s: slaves need 100 Mbit/s", *f.speed_mbit),
               fmt::format("ethtool -s {} autoneg on advertise 0x008", f.name));
    else if (*f.speed_mbit > kEtherCatMbit)
        better(all, "speed",
               fmt::format("{} Mbit/s: slaves run at 100 Mbit/s, so something else is at the other end of the cable",
                           *f.speed_mbit));
    else
        good(all, "speed", "100 Mbit/s");
    if (!f.full_duplex)
        not_known(all, f, "duplex", "speed");
    else if (*f.full_duplex)
        good(all, "duplex", "full");
    else
        better(all, "duplex", "half: a frame that comes back collides with the next one",
               fmt::format("ethtool -s {} autoneg on advertise 0x008", f.name));
}

void judge_switch(const InterfaceFacts& f, Findings& all, const char* fact, const std::optional<bool>& on,
                  const char* subject, const char* why, const std::string& command) {
    if (!on)
        not_known(all, f, subject, fact);
    else if (*on)
        better(all, subject, why, command);
    else
        good(all, subject, "off");
}

void judge_delays(const InterfaceFacts& f, Findings& all) {
    judge_switch(f, all, "lro", f.lro, "large receive offload", "on: frames wait in the NIC for more of them",
                 fmt::format("ethtool -K {} lro off", f.name));
    judge_switch(f, all, "gro", f.gro, "generic receive offload",
                 "on: a received frame takes a longer way through the kernel",
                 fmt::format("ethtool -K {} gro off", f.name));
    judge_switch(f, all, "eee", f.eee, "Energy Efficient Ethernet",
                 "on: the link sleeps between cycles and needs microseconds to wake up",
                 fmt::format("ethtool --set-eee {} eee off", f.name));
    judge_switch(f, all, "pause", f.pause, "flow control", "on: a pause frame stops the sending",
                 fmt::format("ethtool -A {} autoneg off rx off tx off", f.name));
    if (!f.coalescing) return not_known(all, f, "interrupt coalescing", "coalescing");
    const auto& c = *f.coalescing;
    const auto command = fmt::format("ethtool -C {}{} rx-usecs 0 tx-usecs 0", f.name,
                                     c.adaptive_receive || c.adaptive_send ? " adaptive-rx off adaptive-tx off" : "");
    if (c.adaptive_receive || c.adaptive_send)
        better(all, "interrupt coalescing", "adaptive: the time from a frame to its interrupt changes with the traffic",
               command);
    else if (c.receive_us > kLongestWait_us)
        better(all, "interrupt coalescing",
               fmt::format("a received frame waits up to {} µs for its interrupt", c.receive_us), command);
    else
        good(all, "interrupt coalescing", fmt::format("receive {} µs, send {} µs", c.receive_us, c.send_us));
}

void judge_interrupts(const InterfaceFacts& f, Findings& all) {
    if (!f.interrupts) {
        if (!f.kind.empty()) return;  // a virtual interface has none
        return not_known(all, f, "interrupts", "interrupts");
    }
    if (f.interrupts->empty()) {
        all.push_back(
            {Verdict::not_known, "interrupts", "none of /proc/interrupts could be assigned to the interface", {}});
        return;
    }
    for (const auto& irq : *f.interrupts) {
        const auto subject = fmt::format("interrupt {} ({})", irq.number, irq.name);
        const bool one = !irq.cpus.empty() && irq.cpus.find_first_of(",-") == std::string::npos;
        if (irq.cpus.empty())
            all.push_back({Verdict::not_known, subject, "its processors are not readable", {}});
        else if (one)
            good(all, subject, "on processor " + irq.cpus);
        else
            better(all, subject,
                   fmt::format("moves between the processors {}: keep it beside the thread of the cycle", irq.cpus),
                   fmt::format("echo N > /proc/irq/{}/smp_affinity_list", irq.number));
    }
}

void judge_sockets(const InterfaceFacts& f, Findings& all) {
    if (!f.qdisc)
        not_known(all, f, "queueing discipline", "qdisc");
    else
        good(all, "queueing discipline", *f.qdisc + ": AF_PACKET and AF_XDP of Margay bypass it");
    if (f.xdp_mode && *f.xdp_mode == "zero copy")
        good(all, "AF_XDP", "zero copy: use xdp:" + f.name + "; times of frames need AF_PACKET");
    else if (f.xdp_mode)
        good(all, "AF_XDP",
             fmt::format("{} mode; the driver has no zero copy. Compare xdp:{} with {}", *f.xdp_mode, f.name, f.name));
    else if (!f.xdp_refusal.empty())
        better(all, "AF_XDP", f.xdp_refusal);
    else if (f.unread.contains("AF_XDP"))
        not_known(all, f, "AF_XDP", "AF_XDP");
    else
        all.push_back({Verdict::not_known, "AF_XDP",
                       "it was not tried, because a try disturbs a master on the interface",
                       fmt::format("nic_check {} --try-xdp", f.name)});
}

// The support of the interface for "sent at", "received at" and "send at".
void judge_stamps(const InterfaceFacts& f, Findings& all, const char* subject, bool hardware, bool software,
                  const char* restriction) {
    const int clock = f.time_stamping->clock;
    if (hardware)
        good(all, subject,
             clock < 0 ? "of the hardware" : fmt::format("of the hardware, with the clock /dev/ptp{}", clock));
    else if (software)
        better(all, subject, fmt::format("of the software only: they contain the delays of the kernel{}", restriction));
    else
        better(all, subject, fmt::format("none{}", restriction));
}

void judge_timing(const InterfaceFacts& f, Findings& all) {
    constexpr const char* kSent = "times of sent frames";
    constexpr const char* kReceived = "times of received frames";
    constexpr const char* kSendAt = "sending at a time";
    if (f.time_stamping) {
        const auto& t = *f.time_stamping;
        judge_stamps(f, all, kSent, t.send_hardware, t.send_software, "");
        const bool only_ptp = t.receive_hardware && !t.all_received;
        judge_stamps(f, all, kReceived, t.receive_hardware && t.all_received, t.receive_software,
                     only_ptp ? "; the hardware notes those of PTP frames only" : "");
    } else {
        not_known(all, f, kSent, "time stamping");
        not_known(all, f, kReceived, "time stamping");
    }
    if (!f.send_at) return not_known(all, f, kSendAt, "send at");
    const auto& s = *f.send_at;
    if (s.holder == SendingAtATime::Holder::nic)
        good(all, kSendAt, fmt::format("the NIC holds frames until their time ({} with offload)", s.qdisc));
    else if (s.holder == SendingAtATime::Holder::kernel)
        better(
            all, kSendAt,
            fmt::format("{} sends them by a timer of the kernel, with its jitter. A NIC that knows the time (igb, igc, "
                        "stmmac) does better with etf and offload below mqprio or taprio",
                        s.qdisc));
    else
        better(all, kSendAt,
               s.qdisc.empty()
                   ? fmt::format("not possible: {}", s.why)
                   : fmt::format("not possible by its queueing discipline {}: {}. etf holds them, where the "
                                 "kernel has it (CONFIG_NET_SCH_ETF)",
                                 s.qdisc, s.why),
               fmt::format("tc qdisc replace dev {} root etf clockid CLOCK_TAI delta 200000", f.name));
}

// Compares with a cycle that has this priority of SCHED_FIFO, as in the samples.
constexpr int kCyclePriority = 80;

void judge_irq_threads(const InterfaceFacts& f, Findings& all) {
    if (!f.irq_threads) return;  // a virtual interface, or another network namespace
    for (const IrqThread& thread : *f.irq_threads) {
        const std::string subject = fmt::format("priority of {}", thread.name.data());
        if (is_above(thread, kCyclePriority))
            good(all, subject, fmt::format("{}, above that of a cycle ({})", thread.priority, kCyclePriority));
        else
            better(all, subject,
                   fmt::format("{}, not above that of a cycle ({}): replies wait while the cycle uses its processor",
                               thread.priority, kCyclePriority),
                   fmt::format("chrt -f -p {} {}", kCyclePriority + 1, thread.id));
    }
}

void judge_others(const InterfaceFacts& f, Findings& all) {
    if (!f.network_manager)
        not_known(all, f, "NetworkManager", "NetworkManager");
    else if (*f.network_manager)
        better(all, "NetworkManager", "manages the interface: it switches it off and on, and sends DHCP requests",
               fmt::format("nmcli device set {} managed no", f.name));
    else
        good(all, "NetworkManager", "does not manage the interface");
    if (!f.systemd_networkd)
        not_known(all, f, "systemd-networkd", "systemd-networkd");
    else if (*f.systemd_networkd)
        better(
            all, "systemd-networkd", "manages the interface",
            fmt::format(
                "printf '[Match]\\nName={}\\n[Link]\\nUnmanaged=yes\\n' > /etc/systemd/network/05-ethercat.network && "
                "networkctl reload",
                f.name));
    else
        good(all, "systemd-networkd", "does not manage the interface");
    if (!f.ipv6)
        not_known(all, f, "IPv6", "IPv6");
    else if (*f.ipv6)
        better(all, "IPv6", "on: the kernel sends router and neighbour solicitations, which travel through all slaves",
               fmt::format("sysctl -w net.ipv6.conf.{}.disable_ipv6=1", f.name));
    else
        good(all, "IPv6", "off");
    std::vector<std::string> own;
    for (const auto& address : f.addresses)
        if (!address.starts_with("fe80:")) own.push_back(address);
    if (own.empty())
        good(all, "IP addresses", "none");
    else
        better(
            all, "IP addresses",
            fmt::format("{}: other programs send frames through this interface. Before the command, be sure that you "
                        "are not connected by it",
                        fmt::join(own, ", ")),
            fmt::format("ip address flush dev {}", f.name));
}

}  // namespace

std::vector<Finding> judge_interface(const InterfaceFacts& facts) {
    Findings all;
    judge_kind(facts, all);
    judge_link(facts, all);
    judge_delays(facts, all);
    judge_interrupts(facts, all);
    judge_irq_threads(facts, all);
    judge_sockets(facts, all);
    judge_timing(facts, all);
    judge_others(facts, all);
    return all;
}

}  // namespace margay::nic_check
