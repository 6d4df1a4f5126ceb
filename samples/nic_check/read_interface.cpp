#include "nic_check/files.hpp"
#include "nic_check/link_query.hpp"
#include "nic_check/read.hpp"
#include "oshw/linux/interface.hpp"
#include "oshw/linux/qdisc.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <linux/ethtool.h>
#include <linux/net_tstamp.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

namespace margay::nic_check {
namespace {

namespace fs = std::filesystem;

// Executes a command of ethtool. Nothing when driver or kernel refuse it; then the reason is noted for the fact.
template <class T>
std::optional<T> ethtool(const Interface& interface, std::uint32_t command, InterfaceFacts& facts, const char* fact) {
    T value{};
    value.cmd = command;
    ifreq request{};
    request.ifr_data = reinterpret_cast<char*>(&value);
    if (interface.request(SIOCETHTOOL, request)) return value;
    facts.unread[fact] = errno == EOPNOTSUPP ? "the driver does not say" : std::strerror(errno);
    return {};
}

void read_link(const Interface& interface, InterfaceFacts& facts) {
    ifreq asked{};
    if (interface.request(SIOCGIFFLAGS, asked)) facts.up = (asked.ifr_flags & IFF_UP) != 0;
    if (interface.request(SIOCGIFMTU, asked)) facts.mtu = asked.ifr_mtu;
    if (facts.up) facts.carrier = interface.link_state() != LinkState::down;
    if (const auto driver = ethtool<ethtool_drvinfo>(interface, ETHTOOL_GDRVINFO, facts, "driver"))
        facts.driver = std::string(driver->driver, ::strnlen(driver->driver, sizeof driver->driver));
    // ETHTOOL_GSET has all that is asked here, also of new drivers: the kernel converts.
    const auto settings = ethtool<ethtool_cmd>(interface, ETHTOOL_GSET, facts, "speed");
    if (!settings) return;
    const std::uint32_t speed = ethtool_cmd_speed(&*settings);
    if (speed != 0 && speed != static_cast<std::uint32_t>(SPEED_UNKNOWN) && speed != 0xFFFF) facts.speed_mbit = speed;
    if (settings->duplex == DUPLEX_FULL || settings->duplex == DUPLEX_HALF)
        facts.full_duplex = settings->duplex == DUPLEX_FULL;
    if (!facts.speed_mbit) facts.unread["speed"] = "the driver does not know it (there is no link, or it is virtual)";
}

void read_offloads(const Interface& interface, InterfaceFacts& facts) {
    if (const auto gro = ethtool<ethtool_value>(interface, ETHTOOL_GGRO, facts, "gro")) facts.gro = gro->data != 0;
    if (const auto flags = ethtool<ethtool_value>(interface, ETHTOOL_GFLAGS, facts, "lro"))
        facts.lro = (flags->data & ETH_FLAG_LRO) != 0;
    if (const auto eee = ethtool<ethtool_eee>(interface, ETHTOOL_GEEE, facts, "eee")) facts.eee = eee->eee_enabled != 0;
    if (const auto pause = ethtool<ethtool_pauseparam>(interface, ETHTOOL_GPAUSEPARAM, facts, "pause"))
        facts.pause = pause->rx_pause != 0 || pause->tx_pause != 0;
    if (const auto c = ethtool<ethtool_coalesce>(interface, ETHTOOL_GCOALESCE, facts, "coalescing"))
        facts.coalescing =
            Coalescing{c->rx_coalesce_usecs,       c->rx_max_coalesced_frames,       c->tx_coalesce_usecs,
                       c->tx_max_coalesced_frames, c->use_adaptive_rx_coalesce != 0, c->use_adaptive_tx_coalesce != 0};
    if (const auto stamps = ethtool<ethtool_ts_info>(interface, ETHTOOL_GET_TS_INFO, facts, "time stamping")) {
        const auto can = [&](unsigned bit) { return (stamps->so_timestamping & bit) != 0; };
        facts.time_stamping = TimeStamping{can(SOF_TIMESTAMPING_RX_SOFTWARE),
                                           can(SOF_TIMESTAMPING_TX_SOFTWARE),
                                           can(SOF_TIMESTAMPING_RX_HARDWARE),
                                           can(SOF_TIMESTAMPING_TX_HARDWARE),
                                           (stamps->rx_filters & (1U << HWTSTAMP_FILTER_ALL)) != 0,
                                           stamps->phc_index};
    }
}

void read_send_at(InterfaceFacts& facts) {
    using Holder = SendingAtATime::Holder;
    constexpr unsigned kPriority = 3;  // that of PacketNic::allow_send_at()
    Qdiscs qdiscs;
    if (!qdiscs.read(facts.index)) {
        facts.unread["send at"] = std::strerror(qdiscs.error());
        return;
    }
    const TimedWay way = timed_way(qdiscs.all(), kPriority);
    Holder holder = Holder::nobody;
    if (way.holder == TimedWay::Holder::qdisc) holder = Holder::kernel;
    if (way.holder == TimedWay::Holder::nic) holder = Holder::nic;
    facts.send_at = SendingAtATime{holder, std::string(way.kind), std::string(way.why)};
}

void read_irq_threads(const Places& places, InterfaceFacts& facts) {
    IrqThreads threads;
    (void)threads.find(facts.name, {places.proc.c_str(), places.sys.c_str()});
    facts.irq_threads.emplace(threads.all().begin(), threads.all().end());
}

void read_addresses(InterfaceFacts& facts) {
    ifaddrs* all = nullptr;
    if (::getifaddrs(&all) != 0) return;
    for (const auto* one = all; one != nullptr; one = one->ifa_next) {
        if (one->ifa_addr == nullptr || facts.name != one->ifa_name) continue;
        std::array<char, INET6_ADDRSTRLEN> text{};
        const void* octets = nullptr;
        if (one->ifa_addr->sa_family == AF_INET)
            octets = &reinterpret_cast<const sockaddr_in*>(one->ifa_addr)->sin_addr;
        if (one->ifa_addr->sa_family == AF_INET6)
            octets = &reinterpret_cast<const sockaddr_in6*>(one->ifa_addr)->sin6_addr;
        if (octets != nullptr && ::inet_ntop(one->ifa_addr->sa_family, octets, text.data(), text.size()) != nullptr)
            facts.addresses.emplace_back(text.data());
    }
    ::freeifaddrs(all);
}

void read_managers(const Places& places, InterfaceFacts& facts) {
    const fs::path run = places.run;
    const auto index = std::to_string(facts.index);
    std::error_code ignored;
    const auto device = text_of(run / "NetworkManager/devices" / index);
    if (!fs::exists(run / "NetworkManager", ignored))
        facts.network_manager = false;
    else if (device && device->find("managed=") != std::string::npos)
        facts.network_manager = device->find("managed=true") != std::string::npos;
    else
        facts.unread["NetworkManager"] = "there is a folder of NetworkManager without a file of the interface";
    const auto link = text_of(run / "systemd/netif/links" / index);
    if (!fs::exists(run / "systemd/netif", ignored))
        facts.systemd_networkd = false;
    else if (link && link->find("ADMIN_STATE=") != std::string::npos)
        facts.systemd_networkd = link->find("ADMIN_STATE=unmanaged") == std::string::npos;
    else
        facts.unread["systemd-networkd"] = "there is a folder of systemd-networkd without a file of the interface";
}

}  // namespace

std::vector<Interrupt> read_interrupts(const std::string& name, const Places& places) {
    std::vector<Interrupt> found;
    const auto add = [&](unsigned number, std::string text) {
        const auto folder = fs::path(places.proc) / "irq" / std::to_string(number);
        auto cpus = text_of(folder / "effective_affinity_list");
        if (!cpus || cpus->empty()) cpus = text_of(folder / "smp_affinity_list");
        found.push_back({number, std::move(text), cpus.value_or("")});
    };
    const auto table = text_of(fs::path(places.proc) / "interrupts").value_or("");
    // The interrupts of the device, or of the device on whose bus it is (virtio).
    const auto device = fs::path(places.sys) / "class/net" / name / "device";
    std::error_code ignored;
    std::vector<unsigned> numbers;
    for (const auto& folder : {device / "msi_irqs", device / ".." / "msi_irqs"})
        for (const auto& entry : fs::directory_iterator(folder, ignored))
            numbers.push_back(static_cast<unsigned>(std::strtoul(entry.path().filename().c_str(), nullptr, 10)));
    for (std::size_t begin = 0; begin < table.size();) {
        const auto end = std::min(table.find('\n', begin), table.size());
        const auto line = table.substr(begin, end - begin);
        begin = end + 1;
        char* rest = nullptr;
        const auto number = static_cast<unsigned>(std::strtoul(line.c_str(), &rest, 10));
        if (rest == line.c_str() || *rest != ':') continue;  // the title, and NMI, LOC …
        const auto text = line.substr(line.find_last_of(' ') + 1);
        const bool named = text == name || text.starts_with(name + "-");
        if (named || std::find(numbers.begin(), numbers.end(), number) != numbers.end()) add(number, text);
    }
    return found;
}

std::string read_interface(const std::string& name, const Places& places, InterfaceFacts& facts) {
    facts.name = name;
    Interface interface;
    if (!interface.open(name)) return std::string(interface.problem());
    ifreq asked{};
    if (!interface.request(SIOCGIFHWADDR, asked) || asked.ifr_hwaddr.sa_family != ARPHRD_ETHER)
        return "interface " + name + ": it is not an Ethernet interface; EtherCAT needs a wired Ethernet port";
    facts.index = interface.index();
    read_link(interface, facts);
    read_offloads(interface, facts);
    read_send_at(facts);
    read_addresses(facts);
    read_managers(places, facts);
    const auto link = query_link(facts.index);
    facts.kind = link.kind;
    facts.master = link.master;
    facts.qdisc = link.qdisc;
    if (!link.problem.empty()) facts.unread["qdisc"] = link.problem;
    if (const auto off = number_of(fs::path(places.proc) / "sys/net/ipv6/conf" / name / "disable_ipv6"))
        facts.ipv6 = *off == 0;
    else
        facts.ipv6 = false;  // a kernel without IPv6
    // /sys shows the network namespace in which it was mounted. Another interface may have the same name there.
    const auto folder = fs::path(places.sys) / "class/net" / name;
    std::error_code ignored;
    if (number_of(folder / "ifindex") == facts.index) {
        facts.wireless = fs::exists(folder / "wireless", ignored) || fs::exists(folder / "phy80211", ignored);
        if (facts.kind.empty()) facts.interrupts = read_interrupts(name, places);
        if (facts.kind.empty()) read_irq_threads(places, facts);
    } else if (facts.kind.empty()) {
        facts.unread["interrupts"] = "/sys shows another network namespace";
    }
    return {};
}

}  // namespace margay::nic_check
