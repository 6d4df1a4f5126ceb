// An application on a simulated line in virtual time, which serves clients beside its cycle.
#pragma once

#include "attach/client.hpp"
#include "attach/socket_address.hpp"
#include "segment/clients_bench.hpp"

#include <margay/attach/server.hpp>

#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

namespace margay::testing_attach {

using namespace std::chrono_literals;
using attach::Arguments;
using attach::Client;
using attach::Operation;
using attach::Reader;
using attach::Status;

class Attach : public ClientsTest {
  protected:
    std::string folder = [] {
        std::string name = "/tmp/margay-attach-XXXXXX";
        return std::string(::mkdtemp(name.data()));
    }();
    std::string path = folder + "/line.sock";
    std::array<std::byte, 1024> image{};
    std::unique_ptr<AttachServer> server;

    void SetUp() override {
        plug_line({"coupler", "digital_in_8", "digital_out_8", "drive"});
        switch_on();
        ASSERT_TRUE(bring_up());
        ASSERT_TRUE(config_map(ctx, image));
        ASSERT_TRUE(reach(ctx, AlState::op, 5s));
        serve({.name = "the line"});
    }
    void TearDown() override {
        server.reset();
        EXPECT_NE(::access(path.c_str(), F_OK), 0) << "the socket is still there";
        ::rmdir(folder.c_str());
    }
    void serve(AttachSettings settings) {
        server.reset();
        server = std::make_unique<AttachServer>(ctx, path, std::move(settings));
        ASSERT_EQ(server->error(), "");
    }
};

inline std::uint16_t slave_count(Client& client) {
    const auto reply = client.call(Operation::master, {});
    attach::MasterFacts facts;
    Reader from(reply.payload);
    from(facts);
    return reply.ok() && from.complete() ? facts.slaves : 0;
}

// A client that sends any octets.
class Raw {
  public:
    explicit Raw(const std::string& path) : fd_(::socket(AF_UNIX, SOCK_STREAM, 0)) {
        attach::SocketAddress address;
        connected_ = address.set(path).empty() && ::connect(fd_, address.pointer(), address.bytes()) == 0;
    }
    ~Raw() { ::close(fd_); }
    Raw(const Raw&) = delete;
    Raw& operator=(const Raw&) = delete;
    bool send(Bytes octets) {
        // Returns false when the server has ended, or its socket accepts no more data.
        return ::send(fd_, octets.data(), octets.size(), MSG_NOSIGNAL | MSG_DONTWAIT) ==
               static_cast<ssize_t>(octets.size());
    }
    // Waits for the end of the connection.
    bool ended() {
        std::array<std::byte, 512> some{};
        for (;;) {
            const auto got = ::recv(fd_, some.data(), some.size(), 0);
            if (got <= 0) return true;
        }
    }
    // Waits until `into` is full.
    bool receive(MutableBytes into) {
        return ::recv(fd_, into.data(), into.size(), MSG_WAITALL) == static_cast<ssize_t>(into.size());
    }
    bool hello() {
        std::array<std::byte, 20> octets{};
        attach::Writer into(octets);
        into(std::uint32_t{8}, std::uint32_t{1}, std::uint32_t{0}, attach::kMagic, attach::kProtocolVersion);
        std::array<std::byte, 12> answer{};
        if (!send(octets) || !receive(answer)) return false;
        std::vector<std::byte> rest(attach::Header::load(answer).bytes);
        return receive(rest);
    }
    bool message(Operation operation, std::uint32_t bytes, Bytes payload) {
        std::array<std::byte, 12> header{};
        attach::Header{bytes, 7, static_cast<std::uint16_t>(operation), 0}.store(header);
        return send(header) && (payload.empty() || send(payload));
    }

  private:
    int fd_;
    bool connected_ = false;
};

}  // namespace margay::testing_attach
