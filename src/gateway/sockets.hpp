// The sockets of the gateway, and the clients behind them.
#pragma once

#include "gateway/client.hpp"

#include <margay/gateway/mailbox_gateway.hpp>

#include <netinet/in.h>
#include <sys/socket.h>

#include <string>

namespace margay::gateway {

// The address of a client or of the gateway.
struct SocketAddress {
    sockaddr_storage storage{};
    socklen_t bytes = sizeof(sockaddr_storage);
    [[nodiscard]] sockaddr* pointer() { return reinterpret_cast<sockaddr*>(&storage); }
    [[nodiscard]] const sockaddr* pointer() const { return reinterpret_cast<const sockaddr*>(&storage); }
    friend bool operator==(const SocketAddress& a, const SocketAddress& b);
};

// The port of UDP and the listening port of TCP, at the same address.
class Sockets {
  public:
    Sockets() = default;
    ~Sockets();
    Sockets(const Sockets&) = delete;
    Sockets& operator=(const Sockets&) = delete;

    // A sentence when they cannot be opened; empty: they are.
    [[nodiscard]] std::string open(const MailboxGatewaySettings& settings);
    [[nodiscard]] int udp() const { return udp_; }  // -1: not wanted
    [[nodiscard]] int tcp() const { return tcp_; }
    [[nodiscard]] std::uint16_t port() const { return port_; }

  private:
    [[nodiscard]] std::string bind_all(const MailboxGatewaySettings& settings);
    void close();

    int udp_ = -1;
    int tcp_ = -1;
    std::uint16_t port_ = 0;
};

// A sender of UDP. The socket is that of all of them.
class UdpClient final : public Client {
  public:
    UdpClient(int fd, const SocketAddress& address) : address_(address), fd_(fd) {}
    [[nodiscard]] const SocketAddress& address() const { return address_; }
    // A reply that the system does not take at once is lost, as a datagram may be anyway.
    bool send(Octets frame, Moment now) override;
    [[nodiscard]] bool takes_replies() const override { return true; }

    Moment moved{};  // when a datagram came last

  private:
    SocketAddress address_;
    int fd_;
};

// A TCP connection.
class TcpClient final : public Client {
  public:
    TcpClient(int fd, Moment now) : moved_(now), fd_(fd) {}
    ~TcpClient() override { close(); }

    enum class Came : std::uint8_t { nothing, octets, gone };
    [[nodiscard]] int fd() const { return fd_; }
    [[nodiscard]] bool closed() const { return fd_ < 0; }
    void close();
    // Reads what is there, up to a limit.
    [[nodiscard]] Came receive(Moment now);
    // What has come and is not taken yet; drop() removes its beginning.
    [[nodiscard]] Bytes received() const { return in_; }
    void drop(std::size_t octets) {
        in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(octets));
        begun_ = moved_;
    }
    // For 10 s a frame is not whole, if `complete_ones` were taken out; or the replies that waited 10 s ago are not all
    // read: a client that reads octet by octet does not keep its place.
    [[nodiscard]] bool is_stalled(Moment now, bool complete_ones) const;

    bool send(Octets frame, Moment now) override;
    [[nodiscard]] bool takes_replies() const override { return out_.size() - sent_ < kMostOutput; }
    [[nodiscard]] bool has_output() const { return sent_ < out_.size(); }
    // False: the client is gone.
    [[nodiscard]] bool flush(Moment now);
    [[nodiscard]] Moment moved() const { return moved_; }

  private:
    static constexpr std::size_t kMostOutput = 64 * 1024;

    Octets in_{};
    Octets out_{};
    std::size_t sent_ = 0;
    std::size_t due_ = 0;  // octets of out_ that waited at due_since_
    Moment due_since_{};
    Moment moved_;    // when octets moved last
    Moment begun_{};  // when the first octet of in_ came, or a little later
    int fd_;
};

}  // namespace margay::gateway
