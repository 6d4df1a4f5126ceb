// The commands eoe, ip.
#include "ethercat/call.hpp"
#include "ethercat/commands.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstring>

namespace margay::ethercat {
namespace {

using Json = nlohmann::ordered_json;

Problem wrong(std::string text) { return {std::move(text), samples::exit_code::kUsage}; }

// An address of four decimal numbers, or a host name that this system resolves. The resolver also takes 1.2.3 for
// 1.2.0.3 and 010 for 8, a mistake for most people.
Answer<Ipv4Address> resolve(const std::string& word) {
    Ipv4Address numbers{};
    if (::inet_pton(AF_INET, word.c_str(), numbers.data()) == 1) return numbers;
    const bool is_number = std::ranges::all_of(word, [](char c) { return c == '.' || ('0' <= c && c <= '9'); }) ||
                           word.starts_with("0x") || word.starts_with("0X");
    if (is_number)
        return wrong(fmt::format("'{}' is no IPv4 address: four numbers from 0 to 255 without leading zeros, "
                                 "192.168.0.10",
                                 word));
    addrinfo wanted{};
    wanted.ai_family = AF_INET;
    wanted.ai_socktype = SOCK_DGRAM;
    addrinfo* found = nullptr;
    const int error = ::getaddrinfo(word.c_str(), nullptr, &wanted, &found);
    if (error != 0 || found == nullptr)
        return wrong(fmt::format("'{}' is neither an IPv4 address nor a host name that can be resolved: {}", word,
                                 ::gai_strerror(error)));
    sockaddr_in address{};
    std::memcpy(&address, found->ai_addr, sizeof(address));
    ::freeaddrinfo(found);
    Ipv4Address out{};
    std::memcpy(out.data(), &address.sin_addr, out.size());
    return out;
}

Answer<MacAddress> parse_mac(const std::string& word) {
    MacAddress mac{};
    const bool separated = word.size() == 17;
    bool right = separated || word.size() == 12;
    for (std::size_t n = 0; right && n < mac.size(); ++n) {
        const std::size_t at = n * (separated ? 3 : 2);
        const auto octet = parse_unsigned("0x" + word.substr(at, 2), 0xFF);
        right = octet.has_value() && (!separated || n == 5 || word[at + 2] == ':' || word[at + 2] == '-');
        if (right) mac[n] = static_cast<std::uint8_t>(*octet);
    }
    if (!right) return wrong(fmt::format("'{}' is no MAC address (00:11:22:33:44:55)", word));
    if ((mac[0] & 1U) != 0 || mac == MacAddress{})
        return wrong(fmt::format("'{}' is no address of one device: the first octet is odd, or all are 0", word));
    return mac;
}

Answer<> set_address(const std::string& word, EoeIp& ip) {
    const auto slash = word.find('/');
    const auto address = resolve(word.substr(0, slash));
    if (!address) return address.problem();
    ip.address = *address;
    if (slash == std::string::npos) return {};
    const auto prefix = parse_unsigned(word.substr(slash + 1), 32);
    if (!prefix) return wrong(fmt::format("'{}': the prefix is a number from 0 to 32", word));
    const std::uint32_t bits = *prefix == 0 ? 0 : UINT32_MAX << (32 - *prefix);
    ip.subnet_mask = Ipv4Address{static_cast<std::uint8_t>(bits >> 24), static_cast<std::uint8_t>(bits >> 16),
                                 static_cast<std::uint8_t>(bits >> 8), static_cast<std::uint8_t>(bits)};
    return {};
}

template <class T>
Answer<> take(const Answer<T>& answer, std::optional<T>& into) {
    if (!answer) return answer.problem();
    into = *answer;
    return {};
}

Answer<> set_parameter(const std::string& name, const std::string& value, EoeIp& ip) {
    if (name == "ip_address") return set_address(value, ip);
    if (name == "mac_address") return take(parse_mac(value), ip.mac);
    if (name == "default_gateway") return take(resolve(value), ip.default_gateway);
    if (name == "dns_address") return take(resolve(value), ip.dns_server);
    if (name != "hostname")
        return wrong(
            fmt::format("there is no parameter '{}': ip_address, mac_address, default_gateway, dns_address, "
                        "hostname",
                        name));
    if (!ip.set_host_name(value))
        return wrong(fmt::format("'{}' has {} octets: a host name has up to 32", value, value.size()));
    return {};
}

}  // namespace

int run_eoe(Call& call) {
    const auto interval = call.option_number("interval", 1000, 3'600'000);
    if (!interval) return call.fail(interval.problem());
    if (*interval == 0) return call.fail(wrong("--interval: 0 ms are no time to count in"));
    return call.each_master([&](Master& master, Output& output) -> Answer<> {
        const auto ports = master.session->eoe(std::chrono::milliseconds(*interval));
        if (!ports) return ports.problem();
        std::size_t width = std::string_view("Interface").size();
        for (const EoeFacts& port : *ports) width = std::max(width, port.interface.size());
        output.text =
            fmt::format("{:<{}}  Slave  State  RxBytes  RxRate  TxBytes  TxRate  Dropped\n", "Interface", width);
        output.json["interfaces"] = nlohmann::ordered_json::array();
        for (const EoeFacts& port : *ports) {
            output.text += fmt::format("{:<{}}  {:>5}  {:<5}  {:>7}  {:>6}  {:>7}  {:>6}  {:>7}\n",
                                       port.interface.empty() ? "-" : port.interface, width,
                                       port.position ? fmt::to_string(*port.position) : "-", port.open ? "up" : "down",
                                       port.received_octets, port.received_rate, port.sent_octets, port.sent_rate,
                                       port.dropped_frames);
            output.json["interfaces"].push_back(
                {{"name", port.interface.empty() ? Json(nullptr) : Json(port.interface)},
                 {"position", port.position ? Json(*port.position) : Json(nullptr)},
                 {"up", port.open},
                 {"received_octets", port.received_octets},
                 {"received_rate", port.received_rate},
                 {"received_frames", port.received_frames},
                 {"sent_octets", port.sent_octets},
                 {"sent_rate", port.sent_rate},
                 {"sent_frames", port.sent_frames},
                 {"dropped_frames", port.dropped_frames}});
        }
        return {};
    });
}

int run_ip(Call& call) {
    const auto& words = call.words();
    if (words.size() % 2 != 0)
        return call.fail(wrong(fmt::format("'{}' has no value: parameters are pairs of NAME and VALUE", words.back())));
    EoeIp ip;
    for (std::size_t n = 0; n < words.size(); n += 2) {
        for (std::size_t earlier = 0; earlier < n; earlier += 2)
            if (words[earlier] == words[n]) return call.fail(wrong(fmt::format("'{}' is there twice", words[n])));
        const auto set = set_parameter(words[n], words[n + 1], ip);
        if (!set) return call.fail(set.problem());
    }
    const auto slave = call.one_slave();
    if (!slave) return call.fail(slave.problem());
    const auto done = slave->session().set_ip(slave->position(), ip);
    if (!done) return call.fail(done.problem());
    if (!call.json()) return samples::exit_code::kWell;
    Output output;
    output.json = place_json(*slave);
    for (std::size_t n = 0; n < words.size(); n += 2) output.json[words[n]] = words[n + 1];
    return call.print(output);
}

}  // namespace margay::ethercat
