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

    // Returns a sentence if the sockets cannot be opened; empty: they are open.
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

// A sender of UDP. All senders of UDP share one socket.
class UdpClient final : public Client {
  public:
    UdpClient(int fd, const SocketAddress& address) : address_(address), fd_(fd) {}
    [[nodiscard]] const SocketAddress& address() const { return address_; }
    // If the system does not accept a reply at once, the reply is lost, as any datagram may be lost.
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
    // Reads the available octets, up to a limit.
    [[nodiscard]] Came receive(Moment now);
    // The received octets that were not processed yet; drop() removes the first octets.
    [[nodiscard]] Bytes received() const { return in_; }
    void drop(std::size_t octets) {
        in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(octets));
        begun_ = moved_;
    }
    // Whether a frame has been incomplete for 10 s (`complete_ones`: all complete frames were removed), or some of the
    // replies that waited 10 s ago are still unread. So a client that reads octet by octet does not keep its place.
    [[nodiscard]] bool is_stalled(Moment now, bool complete_ones) const;

    bool send(Octets frame, Moment now) override;
    [[nodiscard]] bool takes_replies() const override { return out_.size() - sent_ < kMostOutput; }
    [[nodiscard]] bool has_output() const { return sent_ < out_.size(); }
    // False: the client has closed the connection.
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
