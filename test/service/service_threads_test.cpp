// A master of margayd in this process, with its cycle, log, socket, mailbox gateway and an EoE interface, while clients
// of all kinds attack it. In real time. The test is made for ThreadSanitizer, which checks the threads of the service.
#include "margayd/master.hpp"

#include "attach/client.hpp"
#include "gateway/gateway_client.hpp"
#include "process/netns.hpp"

#include <gtest/gtest.h>

#include <net/if.h>
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <random>
#include <thread>

namespace margay::service {
namespace {

using namespace std::chrono_literals;
using attach::Client;
using attach::Operation;
using testing_gateway::GatewayClient;
using testing_gateway::Over;

constexpr auto kAttack = 2s;
constexpr auto kPatience = 60s;
constexpr int kEnough = 20;  // answers of the socket, and replies of the gateway

class ServiceThreads : public testing::Test {
  protected:
    std::string folder = [] {
        std::string name = "/tmp/margay-service-XXXXXX";
        return std::string(::mkdtemp(name.data()));
    }();
    std::string path = folder + "/line.sock";
    std::unique_ptr<Master> master;
    std::atomic<bool> stopping{false};
    std::atomic<int> answers{0};  // of the socket
    std::atomic<int> replies{0};  // of the gateway

    void TearDown() override {
        master.reset();
        EXPECT_NE(::access(path.c_str(), F_OK), 0) << "the socket is still there";
        ::rmdir(folder.c_str());
    }

    // A port of this machine that is free now, for UDP and TCP.
    static std::uint16_t free_port() {
        for (int n = 0; n < 100; ++n) {
            sockaddr_in address{
                .sin_family = AF_INET, .sin_port = 0, .sin_addr = {htonl(INADDR_LOOPBACK)}, .sin_zero = {}};
            socklen_t size = sizeof(address);
            const int tcp = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
            const int udp = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
            auto* const where = reinterpret_cast<sockaddr*>(&address);
            const bool free =
                ::bind(tcp, where, size) == 0 && ::getsockname(tcp, where, &size) == 0 && ::bind(udp, where, size) == 0;
            ::close(tcp);
            ::close(udp);
            if (free) return ntohs(address.sin_port);
        }
        return 0;
    }

    void start(samples::MasterConfiguration configuration) {
        configuration.name = "line";
        master = std::make_unique<Master>(std::move(configuration), path);
        ASSERT_EQ(master->open(), "");
        master->begin();
        for (int n = 0; n < 600 && !contains(master->status(), "slaves in OP"); ++n) std::this_thread::sleep_for(50ms);
        ASSERT_TRUE(contains(master->status(), "slaves in OP")) << master->status();
    }
    static bool contains(const std::string& text, std::string_view part) {
        return text.find(part) != std::string::npos;
    }

    // Requests everything that a client may request, and changes everything that a client may change.
    void curious() {
        Client client;
        if (!client.connect(path).empty()) return;
        for (unsigned n = 0; !stopping; ++n) {
            const std::uint16_t slave = static_cast<std::uint16_t>(n % 3 + 1);
            const bool mailbox = slave != 1;
            for (const auto operation : {Operation::master, Operation::slaves, Operation::group, Operation::events,
                                         Operation::eoe_ports, Operation::startup})
                answers +=
                    client.call(operation, {.slave = operation == Operation::group ? std::uint16_t{0} : slave}).ok();
            answers +=
                client.call(Operation::read_registers, {.slave = slave, .index = 0x130, .bytes = 6}).ok() ? 1 : 0;
            answers += client.call(Operation::read_sii, {.slave = slave, .from = 8, .bytes = 16}).ok() ? 1 : 0;
            if (mailbox)
                answers +=
                    client.call(Operation::sdo_upload, {.slave = slave, .index = 0x1018, .subindex = 1, .bytes = 8})
                            .ok()
                        ? 1
                        : 0;
            (void)client.call(Operation::set_debug_level, {.from = n % 3});
            (void)client.call(Operation::rescan, {});
            if (n % 4 == 0)
                (void)client.call(Operation::set_target,
                                  {.slave = slave, .state = n % 8 == 0 ? AlState::preop : AlState::op});
        }
    }
    // Sends random octets and incomplete messages, and disconnects.
    void hostile(unsigned seed) {
        std::mt19937 random(seed);
        while (!stopping) {
            const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
            sockaddr_un address{.sun_family = AF_UNIX, .sun_path = {}};
            std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
            if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) {
                std::vector<std::byte> octets(random() % 300 + 4);
                for (auto& octet : octets) octet = static_cast<std::byte>(random());
                if (random() % 2 == 0) {  // a greeting first
                    std::array<std::byte, attach::Header::kBytes + 8> hello{};
                    attach::Writer into(hello);
                    into(std::uint32_t{8}, std::uint32_t{1}, std::uint32_t{0}, attach::kMagic,
                         attach::kProtocolVersion);
                    (void)::send(fd, hello.data(), hello.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
                    octets.resize(std::min<std::size_t>(octets.size(), 16));
                    store_le<std::uint16_t>(octets, 0, static_cast<std::uint16_t>(random() % 64));
                    octets[2] = octets[3] = std::byte{0};
                }
                (void)::send(fd, octets.data(), octets.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
            }
            ::close(fd);
        }
    }
    void of_gateway(std::uint16_t port, Over over, bool is_hostile, unsigned seed) {
        std::mt19937 random(seed);
        while (!stopping) {
            GatewayClient client(port, over);
            client.wait_at_most(2000);
            for (unsigned n = 0; n < 20 && !stopping; ++n) {
                const auto address = static_cast<std::uint16_t>(0x1001 + random() % 3);
                if (!is_hostile) {
                    replies += testing_gateway::upload(client, address, 0x1018, 1).size() == 4 ? 1 : 0;
                    continue;
                }
                auto octets = testing_gateway::frame(address, testing_gateway::kCoe, n % 8,
                                                     testing_gateway::sdo(0x40, 0x1018, 1));
                for (auto hits = random() % 4; hits != 0; --hits)
                    octets[random() % octets.size()] = static_cast<std::byte>(random());
                octets.resize(random() % 3 == 0 ? random() % octets.size() + 1 : octets.size());
                if (!client.send_octets(octets, MSG_DONTWAIT)) break;
            }
        }
    }
    // Sends frames into the EoE interface. The slave may accept them or not.
    void frames(const std::string& interface) const {
        const int fd = ::socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, 0);
        ifreq request{};
        std::strncpy(request.ifr_name, interface.c_str(), IFNAMSIZ - 1);
        (void)::ioctl(fd, SIOCGIFINDEX, &request);
        const int index = request.ifr_ifindex;
        request.ifr_flags = IFF_UP;
        (void)::ioctl(fd, SIOCSIFFLAGS, &request);
        struct {
            unsigned short family = AF_PACKET;
            unsigned short protocol = 0;
            int index = 0;
            unsigned char rest[12]{};
        } address{.index = index};
        std::array<std::byte, 400> frame{};
        frame.fill(std::byte{0xFF});
        while (!stopping) {
            (void)::sendto(fd, frame.data(), frame.size(), MSG_DONTWAIT, reinterpret_cast<const sockaddr*>(&address),
                           sizeof(address));
            std::this_thread::sleep_for(1ms);
        }
        ::close(fd);
    }

    void attack(std::uint16_t port, const std::string& interface) {
        std::vector<std::thread> threads;
        for (int n = 0; n < 3; ++n) threads.emplace_back([this] { curious(); });
        for (unsigned n = 0; n < 2; ++n) threads.emplace_back([this, n] { hostile(n); });
        for (const Over over : {Over::udp, Over::tcp})
            for (const bool is_hostile : {false, true})
                threads.emplace_back([=, this] { of_gateway(port, over, is_hostile, is_hostile ? 7 : 8); });
        if (!interface.empty()) threads.emplace_back([this, interface] { frames(interface); });
        const auto begin = std::chrono::steady_clock::now();
        // A busy machine needs more time for the same number of answers.
        const auto goes_on = [&] {
            const auto since = std::chrono::steady_clock::now() - begin;
            return since < kAttack || (since < kPatience && (answers < kEnough || replies < kEnough));
        };
        for (unsigned n = 0; goes_on(); ++n) {
            (void)master->status();
            master->set_debug_level(n % 3);
            std::this_thread::sleep_for(5ms);
        }
        stopping = true;
        for (auto& thread : threads) thread.join();
    }

    // All slaves reach OP again, and the master ends.
    void expect_whole() {
        EXPECT_GE(answers, kEnough);
        EXPECT_GE(replies, kEnough);
        EXPECT_FALSE(master->failed());
        Client client;
        // margayd may not have noticed yet that the hostile clients have disconnected.
        for (int n = 0; n < 100 && !client.connect(path).empty(); ++n) std::this_thread::sleep_for(50ms);
        for (std::uint16_t slave = 1; slave <= 3; ++slave)
            EXPECT_TRUE(client.call(Operation::set_target, {.slave = slave, .state = AlState::op}).ok());
        for (int n = 0; n < 400 && !contains(master->status(), "3 slaves in OP"); ++n)
            std::this_thread::sleep_for(50ms);
        EXPECT_TRUE(contains(master->status(), "3 slaves in OP")) << master->status();
        master->stop();
        master.reset();
    }
};

TEST_F(ServiceThreads, ClientsOfAllKindsAttackAMaster) {
    const auto port = free_port();
    ASSERT_NE(port, 0);
    start({.source = "sim:eoe",
           .cycle_us = 2000,
           .debug = 2,
           .socket = {.clients = 16},
           .gateway = "127.0.0.1:" + std::to_string(port)});
    if (HasFatalFailure()) return;
    attack(port, "");
    expect_whole();
}

// The same with an EoE interface, in a network namespace.
TEST_F(ServiceThreads, FramesOfAnEoeInterfaceBesideThem) {
    process::Cable cable;
    if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
    ASSERT_TRUE(cable.ip(cable.master_namespace(), "link set lo up"));
    process::Cable::inside(cable.master_namespace(), [&] {
        const auto port = free_port();
        ASSERT_NE(port, 0);
        start({.source = "sim:eoe",
               .cycle_us = 2000,
               .debug = 2,
               .socket = {.clients = 16},
               .eoe = true,
               .gateway = "127.0.0.1:" + std::to_string(port)});
        if (HasFatalFailure()) return;
        attack(port, "eoe0s1");
        expect_whole();
    });
}

}  // namespace
}  // namespace margay::service
