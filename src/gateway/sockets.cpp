#include "gateway/sockets.hpp"

#include <netdb.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>

namespace margay::gateway {
namespace {

constexpr std::chrono::seconds kStall{10};
constexpr std::size_t kAtOnce = 16 * 1024;
constexpr int kTries = 16;  // attempts to find a port that is free for TCP and UDP

std::string failed(const std::string& place, const char* what) {
    return place + ": " + what + ": " + std::strerror(errno);
}

std::string place_of(const MailboxGatewaySettings& s, std::uint16_t port) {
    const bool six = s.address.find(':') != std::string::npos;
    return (six ? "[" + s.address + "]" : s.address) + ":" + std::to_string(port);
}

// Parses a numeric address.
bool parse(const std::string& address, std::uint16_t port, SocketAddress& into) {
    addrinfo hints{};
    hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    if (address.empty() || ::getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &found) != 0)
        return false;
    const std::unique_ptr<addrinfo, void (*)(addrinfo*)> owned(found, ::freeaddrinfo);
    std::memcpy(&into.storage, found->ai_addr, found->ai_addrlen);
    into.bytes = found->ai_addrlen;
    return true;
}

std::uint16_t port_of(int fd) {
    SocketAddress bound;
    if (::getsockname(fd, bound.pointer(), &bound.bytes) != 0) return 0;
    const auto* const octets = reinterpret_cast<const unsigned char*>(&bound.storage);
    // The port is at the same place in both kinds of addresses.
    static_assert(offsetof(sockaddr_in, sin_port) == offsetof(sockaddr_in6, sin6_port));
    const auto* const port = octets + offsetof(sockaddr_in, sin_port);
    return static_cast<std::uint16_t>(port[0] << 8 | port[1]);
}

}  // namespace

bool operator==(const SocketAddress& a, const SocketAddress& b) {
    return a.bytes == b.bytes && std::memcmp(&a.storage, &b.storage, a.bytes) == 0;
}

// ------------------------------------------------------------------ the sockets of the gateway

Sockets::~Sockets() { close(); }

void Sockets::close() {
    for (int* fd : {&udp_, &tcp_}) {
        if (*fd >= 0) ::close(*fd);
        *fd = -1;
    }
}

std::string Sockets::open(const MailboxGatewaySettings& settings) {
    const auto wrong = [](const std::string& what) { return "mailbox gateway: " + what; };
    if (!settings.udp && !settings.tcp) return wrong("neither UDP nor TCP is wanted");
    if (settings.clients < 1 || settings.clients > 16)
        return wrong(std::to_string(settings.clients) + " clients are wanted, and 1 to 16 are possible");
    if (settings.waiting < 1 || settings.waiting > 256)
        return wrong(std::to_string(settings.waiting) + " messages may wait, and 1 to 256 are possible");
    if (settings.reply_timeout < std::chrono::milliseconds(10) || settings.reply_timeout > std::chrono::minutes(1))
        return wrong("the reply timeout is " + std::to_string(settings.reply_timeout.count()) +
                     " ms, and 10 ms to 1 min are possible");
    if (settings.pause_in_transfer < std::chrono::milliseconds(1) ||
        settings.pause_in_transfer > std::chrono::minutes(1))
        return wrong("a pause in a transfer is " + std::to_string(settings.pause_in_transfer.count()) +
                     " ms, and 1 ms to 1 min are possible");
    if (settings.name.size() > 256) return wrong("the name has more than 256 octets");
    std::string error;
    for (int tries = settings.port == 0 ? kTries : 1; tries > 0; --tries) {
        error = bind_all(settings);
        if (error.empty()) return {};
        close();
    }
    return error;
}

// With port 0, UDP uses the port that TCP has got from the system.
std::string Sockets::bind_all(const MailboxGatewaySettings& settings) {
    port_ = settings.port;
    for (const int kind : {SOCK_STREAM, SOCK_DGRAM}) {
        const bool stream = kind == SOCK_STREAM;
        if (!(stream ? settings.tcp : settings.udp)) continue;
        const std::string place = place_of(settings, port_) + (stream ? " (TCP)" : " (UDP)");
        SocketAddress address;
        if (!parse(settings.address, port_, address)) return settings.address + ": is no IP address in digits";
        int& fd = stream ? tcp_ : udp_;
        fd = ::socket(address.storage.ss_family, kind | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
        if (fd < 0) return failed(place, "no socket");
        const int on = 1;
        if (stream) (void)::setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
        if (address.storage.ss_family == AF_INET6) (void)::setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &on, sizeof on);
        if (::bind(fd, address.pointer(), address.bytes) != 0) return failed(place, "cannot be bound");
        if (stream && ::listen(fd, 8) != 0) return failed(place, "cannot listen");
        port_ = port_of(fd);
    }
    return {};
}

// ------------------------------------------------------------------ clients

bool UdpClient::send(Octets frame, Moment) {
    return ::sendto(fd_, frame.data(), frame.size(), MSG_DONTWAIT | MSG_NOSIGNAL, address_.pointer(), address_.bytes) ==
           static_cast<ssize_t>(frame.size());
}

void TcpClient::close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
    Octets().swap(in_);
    Octets().swap(out_);
    sent_ = 0;
}

TcpClient::Came TcpClient::receive(Moment now) {
    std::array<std::byte, kAtOnce> block;
    const auto got = ::recv(fd_, block.data(), block.size(), MSG_DONTWAIT);
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) return Came::nothing;
    if (got <= 0) return Came::gone;
    moved_ = now;
    if (in_.empty()) begun_ = now;
    in_.insert(in_.end(), block.begin(), block.begin() + got);
    return Came::octets;
}

bool TcpClient::is_stalled(Moment now, bool complete_ones) const {
    if (has_output() && now - due_since_ > kStall) return true;
    return complete_ones && !in_.empty() && now - begun_ > kStall;
}

bool TcpClient::send(Octets frame, Moment now) {
    if (closed()) return false;
    if (!has_output()) {  // the time of the client begins now
        moved_ = due_since_ = now;
        due_ = frame.size();
    }
    out_.insert(out_.end(), frame.begin(), frame.end());
    return true;
}

bool TcpClient::flush(Moment now) {
    while (has_output()) {
        const auto put =
            ::send(fd_, out_.data() + sent_, std::min(out_.size() - sent_, kAtOnce), MSG_DONTWAIT | MSG_NOSIGNAL);
        if (put < 0 && (errno == EAGAIN || errno == EINTR)) {
            out_.erase(out_.begin(), out_.begin() + static_cast<std::ptrdiff_t>(std::exchange(sent_, 0)));
            return true;
        }
        if (put <= 0) return false;
        moved_ = now;
        sent_ += static_cast<std::size_t>(put);
        due_ -= std::min(due_, static_cast<std::size_t>(put));
        if (due_ != 0) continue;
        due_ = out_.size() - sent_;
        due_since_ = now;
    }
    Octets().swap(out_);
    sent_ = 0;
    return true;
}

}  // namespace margay::gateway
