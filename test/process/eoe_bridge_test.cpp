// The program eoe_bridge: two network namespaces, and between them a cable with EtherCAT. One end is virtual_segment,
// whose gateways have TAP devices; the other end is eoe_bridge. The stacks of the kernel exchange ARP, ICMP and TCP
// over EoE, and tshark decodes what passed the cable.
#include <places.hpp>
#include "netns.hpp"
#include "shell.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <net/if.h>
#include <netinet/in.h>
#include <netpacket/packet.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <thread>

namespace margay::process {
namespace {

using namespace std::chrono_literals;

const std::string kEoeBridge = std::string(MARGAY_BIN_DIR) + "/eoe_bridge";
const std::string kEoeSegment = std::string(MARGAY_BIN_DIR) + "/virtual_segment";
constexpr auto kPatience = 60s;
constexpr const char* kMasterIp = "192.168.77.1";
constexpr const char* kGatewayIp = "192.168.77.2";

sockaddr_in at_ip(const char* ip, std::uint16_t port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    EXPECT_EQ(::inet_pton(AF_INET, ip, &address.sin_addr), 1);
    return address;
}
void set_patience(int socket, int seconds) {
    const timeval patience{seconds, 0};
    ASSERT_EQ(::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience), 0);
    ASSERT_EQ(::setsockopt(socket, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience), 0);
}

std::uint16_t checksum(const std::vector<std::uint8_t>& octets) {
    std::uint32_t sum = 0;
    for (std::size_t n = 0; n + 1 < octets.size(); n += 2)
        sum += static_cast<std::uint32_t>(octets[n] << 8 | octets[n + 1]);
    while (sum >> 16 != 0) sum = (sum & 0xFFFF) + (sum >> 16);
    return static_cast<std::uint16_t>(~sum);
}

std::vector<std::uint8_t> echo_request(std::size_t bytes) {
    std::vector<std::uint8_t> request(8 + bytes);
    request[0] = 8;
    request[5] = 77;  // identifier
    for (std::size_t n = 8; n < request.size(); ++n) request[n] = static_cast<std::uint8_t>(n * 3);
    const auto sum = checksum(request);
    request[2] = static_cast<std::uint8_t>(sum >> 8);
    request[3] = static_cast<std::uint8_t>(sum);
    return request;
}

// Waits for the reply to an ICMP echo request.
bool is_echoed(int socket, const std::vector<std::uint8_t>& request) {
    std::array<std::uint8_t, 8192> reply{};
    for (ssize_t got = 1; got > 0;) {
        got = ::recv(socket, reply.data(), reply.size(), 0);
        const std::size_t header = (reply[0] & 0xFU) * 4;
        if (got != static_cast<ssize_t>(header + request.size()) || reply[header] != 0) continue;
        EXPECT_TRUE(std::equal(request.begin() + 4, request.end(), reply.begin() + static_cast<long>(header) + 4));
        return true;
    }
    return false;
}

// Sends ICMP echo requests of some sizes, and counts the replies of the kernel at the other end. A busy machine may
// lose packets, as Ethernet may, so the function repeats a request without a reply.
unsigned pings() {
    constexpr int kTries = 20;
    const int socket = ::socket(AF_INET, SOCK_RAW | SOCK_CLOEXEC, IPPROTO_ICMP);
    EXPECT_GE(socket, 0);
    set_patience(socket, 1);
    const auto to = at_ip(kGatewayIp, 0);
    unsigned replies = 0;
    for (const std::size_t bytes : {16U, 500U, 1472U, 4000U}) {  // the last request needs three IP fragments
        const auto request = echo_request(bytes);
        bool echoed = false;
        for (int n = 0; n < kTries && !echoed; ++n) {
            (void)::sendto(socket, request.data(), request.size(), 0, reinterpret_cast<const sockaddr*>(&to),
                           sizeof to);
            echoed = is_echoed(socket, request);
        }
        replies += echoed ? 1 : 0;
    }
    ::close(socket);
    return replies;
}

// Sends an ARP request for the address of the gateway, and returns the MAC address of the answer.
std::string arping(const char* interface) {
    const int socket = ::socket(AF_PACKET, SOCK_DGRAM | SOCK_CLOEXEC, htons(0x0806));
    EXPECT_GE(socket, 0);
    set_patience(socket, 10);
    ifreq hardware{};
    std::snprintf(hardware.ifr_name, sizeof hardware.ifr_name, "%s", interface);
    EXPECT_EQ(::ioctl(socket, SIOCGIFHWADDR, &hardware), 0);
    sockaddr_ll to{};
    to.sll_family = AF_PACKET;
    to.sll_protocol = htons(0x0806);
    to.sll_ifindex = static_cast<int>(::if_nametoindex(interface));
    to.sll_halen = 6;
    std::fill_n(to.sll_addr, 6, std::uint8_t{0xFF});
    std::array<std::uint8_t, 28> request{0, 1, 8, 0, 6, 4, 0, 1};
    std::copy_n(hardware.ifr_hwaddr.sa_data, 6, request.begin() + 8);
    const auto own = at_ip(kMasterIp, 0);
    const auto asked = at_ip(kGatewayIp, 0);
    std::memcpy(request.data() + 14, &own.sin_addr, 4);
    std::memcpy(request.data() + 24, &asked.sin_addr, 4);
    std::string answer;
    if (::sendto(socket, request.data(), request.size(), 0, reinterpret_cast<sockaddr*>(&to), sizeof to) > 0) {
        std::array<std::uint8_t, 64> reply{};
        while (::recv(socket, reply.data(), reply.size(), 0) > 0) {
            if (reply[7] != 2 || std::memcmp(reply.data() + 14, &asked.sin_addr, 4) != 0) continue;
            char text[18];
            std::snprintf(text, sizeof text, "%02x:%02x:%02x:%02x:%02x:%02x", reply[8], reply[9], reply[10], reply[11],
                          reply[12], reply[13]);
            answer = text;
            break;
        }
    }
    ::close(socket);
    return answer;
}

std::vector<std::uint8_t> transfer_of(std::size_t bytes) {
    std::vector<std::uint8_t> data(bytes);
    std::uint32_t state = 1;
    for (auto& octet : data) octet = static_cast<std::uint8_t>((state = state * 1664525 + 1013904223) >> 24);
    return data;
}

// Sends `data` by TCP from one namespace to the other. Returns what has arrived.
std::vector<std::uint8_t> transfer(const std::string& from, const std::string& to, const char* ip,
                                   const std::vector<std::uint8_t>& data) {
    int listener = -1;
    int sender = -1;
    Cable::inside(to, [&] { listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0); });
    Cable::inside(from, [&] { sender = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0); });
    const auto address = at_ip(ip, 5001);
    const auto* const name = reinterpret_cast<const sockaddr*>(&address);
    const int yes = 1;
    (void)::setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    EXPECT_EQ(::bind(listener, name, sizeof address), 0) << std::strerror(errno);
    EXPECT_EQ(::listen(listener, 1), 0);
    set_patience(sender, 30);
    set_patience(listener, 30);
    std::thread sending([&] {
        if (::connect(sender, name, sizeof address) != 0) return;
        for (std::size_t at = 0; at < data.size();) {
            const auto sent = ::send(sender, data.data() + at, data.size() - at, MSG_NOSIGNAL);
            if (sent <= 0) break;
            at += static_cast<std::size_t>(sent);
        }
        (void)::shutdown(sender, SHUT_WR);
    });
    std::vector<std::uint8_t> got;
    const int receiver = ::accept(listener, nullptr, nullptr);
    if (receiver >= 0) {
        set_patience(receiver, 30);
        std::vector<std::uint8_t> part(1 << 16);
        for (ssize_t n = 1; n > 0;) {
            n = ::recv(receiver, part.data(), part.size(), 0);
            if (n > 0) got.insert(got.end(), part.begin(), part.begin() + n);
        }
        ::close(receiver);
    }
    sending.join();
    ::close(listener);
    ::close(sender);
    return got;
}

class EoeBridge : public testing::Test {
  protected:
    const Cable cable;
    std::unique_ptr<Child> segment;
    std::unique_ptr<Child> bridge;

    void SetUp() override {
        if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
        if (!std::filesystem::exists("/dev/net/tun")) GTEST_SKIP() << "no TAP devices here: /dev/net/tun is missing";
    }
    // `chosen`: a ready-made segment, or a file.
    void start(const std::string& chosen = "eoe") {
        segment = std::make_unique<Child>(
            cable.segment_namespace(), std::vector<std::string>{kEoeSegment, Cable::kSegment, chosen, "--ports", "gw"});
        ASSERT_TRUE(segment->says("serving", kPatience)) << segment->output() << segment->errors();
        bridge =
            std::make_unique<Child>(cable.master_namespace(), std::vector<std::string>{kEoeBridge, Cable::kMaster});
        ASSERT_TRUE(bridge->says("running", kPatience)) << bridge->output() << bridge->errors();
        if (chosen != "eoe") return;
        ASSERT_TRUE(cable.ip(cable.master_namespace(), std::string("addr add ") + kMasterIp + "/24 dev eoe0s1"));
        ASSERT_TRUE(cable.ip(cable.segment_namespace(), std::string("addr add ") + kGatewayIp + "/24 dev gw1"));
    }
    void stop() {
        bridge->terminate();
        EXPECT_EQ(bridge->wait(kPatience), 0) << bridge->errors();
        segment->terminate();
        EXPECT_EQ(segment->wait(kPatience), 0) << segment->errors();
    }
};

TEST_F(EoeBridge, TheStacksOfTwoKernelsTalkOverEoe) {
    start();
    Cable::inside(cable.master_namespace(), [] {
        EXPECT_EQ(arping("eoe0s1").size(), 17U);
        EXPECT_EQ(pings(), 4U);
    });
    const auto data = transfer_of(std::size_t{16} * 1024 * 1024);
    EXPECT_EQ(transfer(cable.master_namespace(), cable.segment_namespace(), kGatewayIp, data), data);
    const std::vector<std::uint8_t> less(data.begin(), data.begin() + 2 * 1024 * 1024);
    EXPECT_EQ(transfer(cable.segment_namespace(), cable.master_namespace(), kMasterIp, less), less);
    stop();
    const auto said = bridge->output();
    EXPECT_NE(said.find("eoe0s1: slave 2 (Gateway with EoE)\neoe0s2: slave 3 (Gateway with EoE)\n"), std::string::npos)
        << said;
    EXPECT_NE(said.find(" octets, 0 dropped; from the slave "), std::string::npos) << said;
    std::string gone;
    EXPECT_FALSE(run("ip -n " + cable.master_namespace() + " link show eoe0s1", &gone)) << gone;
}

// Two gateways have the same alias, and the system already has an interface with the name of the third gateway.
TEST_F(EoeBridge, NamesThatAreTakenLeaveTheOthersTheirInterfaces) {
    const ShellFolder folder;
    folder.write("twins.toml",
                 "[[slave]]\ndevice = \"eoe_gateway\"\nalias = 7\n[[slave]]\ndevice = \"eoe_gateway\"\nalias = 7\n"
                 "[[slave]]\ndevice = \"eoe_gateway\"\nalias = 8\n[[slave]]\ndevice = \"eoe_gateway\"\nalias = 9\n");
    ASSERT_TRUE(cable.ip(cable.master_namespace(), "link add eoe0a8 type veth peer name other"));
    start(folder.path() / "twins.toml");
    const auto said = bridge->output();
    for (const char* line : {"eoe0s0: slave 1 (Gateway with EoE)\n", "eoe0s1: slave 2 (Gateway with EoE)\n",
                             "eoe0a9: slave 4 (Gateway with EoE)\n"})
        EXPECT_NE(said.find(line), std::string::npos) << said;
    const auto warned = bridge->errors();
    for (const char* line : {"slave 1 has the alias 7 of slave 2: its interface is named after its position\n",
                             "slave 2 has the alias 7 of slave 1: its interface is named after its position\n",
                             "slave 3 gets no interface: the system has an interface eoe0a8 already\n"})
        EXPECT_NE(warned.find(line), std::string::npos) << warned;
    EXPECT_TRUE(cable.ip(cable.master_namespace(), "link show eoe0a9"));
    stop();
}

// A second bridge on the same interface does not scan the segment of the first one.
TEST_F(EoeBridge, ASecondOneIsRefusedBeforeItScans) {
    start();
    const auto before = segment->output();
    Child second(cable.master_namespace(), {kEoeBridge, Cable::kMaster, "--master", "1"});
    EXPECT_EQ(second.wait(kPatience), 3) << second.output();
    EXPECT_EQ(second.errors(),
              std::string("eoe_bridge: ") + Cable::kMaster + ": another eoe_bridge uses this interface\n");
    EXPECT_EQ(segment->output(), before) << "a slave has left its state";
    Cable::inside(cable.master_namespace(), [] { EXPECT_EQ(pings(), 4U); });
    stop();
}

TEST(EoeBridgeArguments, ErrorsAreSaidInWords) {
    const ShellFolder folder;
    const auto simulated = folder.run(kEoeBridge + " sim:eoe");
    EXPECT_EQ(simulated.status, 2);
    EXPECT_TRUE(contains(simulated.err, "SOURCE must be a network interface")) << simulated.err;
    EXPECT_EQ(folder.run(kEoeBridge + " no-such-if").status, 3);
    EXPECT_EQ(folder.run(kEoeBridge + " eth0 --master 100").status, 2);
    EXPECT_TRUE(contains(folder.run(kEoeBridge + " --help").out, "Exit codes: 0"));
}

// A segment without EoE.
TEST_F(EoeBridge, EndsWhenThereIsNothingToBridge) {
    Child portless(cable.segment_namespace(), {kEoeSegment, Cable::kSegment, "demo", "--ports", "gw"});
    EXPECT_EQ(portless.wait(kPatience), 3);
    EXPECT_NE(portless.errors().find("no slave of the segment has an Ethernet port (EoE)"), std::string::npos);
    segment = std::make_unique<Child>(cable.segment_namespace(),
                                      std::vector<std::string>{kEoeSegment, Cable::kSegment, "demo"});
    ASSERT_TRUE(segment->says("serving", kPatience)) << segment->output() << segment->errors();
    Child none(cable.master_namespace(), {kEoeBridge, Cable::kMaster});
    EXPECT_EQ(none.wait(kPatience), 1);
    EXPECT_NE(none.errors().find("no slave of the segment exchanges Ethernet frames (EoE)"), std::string::npos);
}

}  // namespace
}  // namespace margay::process
