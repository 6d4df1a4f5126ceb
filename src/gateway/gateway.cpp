// The thread of a MailboxGateway: receives octets, passes their messages to the router, and sends the replies.
#include "api/master.hpp"
#include "attach/service_thread.hpp"
#include "gateway/router.hpp"
#include "gateway/sockets.hpp"

#include <netinet/tcp.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <thread>

namespace margay {
namespace {

using namespace std::chrono_literals;
using gateway::frame_bytes;
using gateway::messages_of;
using gateway::TcpClient;
using gateway::UdpClient;

constexpr auto kIdleTcp = 5s;  // after this time without a message, a client may lose its place to a new client
constexpr auto kIdleUdp = 1s;
constexpr auto kForgetUdp = 60s;
constexpr int kDatagramsOnce = 32;
constexpr std::size_t kUdpBytes = 65536;

}  // namespace

class MailboxGateway::Loop {
  public:
    Loop(Context& ctx, MailboxGatewaySettings settings)
        : ctx_(ctx), settings_(std::move(settings)), router_(ctx, settings_), datagram_(kUdpBytes) {}
    ~Loop() { thread_.stop(); }
    Loop(const Loop&) = delete;
    Loop& operator=(const Loop&) = delete;

    void start() {
        error_ = master_of(ctx_) == nullptr ? "mailbox gateway: there is no master yet: create it after init()"
                                            : sockets_.open(settings_);
        if (!error_.empty()) return;
        if (const auto failed = thread_.start("margay-gateway", [this] { run(); }); !failed.empty())
            error_ = "mailbox gateway: " + failed;
    }
    [[nodiscard]] const std::string& error() const { return error_; }
    [[nodiscard]] std::uint16_t port() const { return sockets_.port(); }
    [[nodiscard]] MailboxGatewayCounts counts() const {
        const auto& routed = router_.counts();
        return {.clients = new_clients_,
                .refused = refused_,
                .messages = routed.messages,
                .replies = routed.replies,
                .errors = routed.errors,
                .malformed = malformed_,
                .stalled = stalled_,
                .lost = routed.lost};
    }

  private:
    void run();
    void wait();
    void serve_tcp(TcpClient& client, short revents);
    void take_frames(TcpClient& client);
    void drop(TcpClient& client);
    void accept();
    void receive_datagrams();
    void take_datagram(UdpClient& client, Bytes datagram);
    [[nodiscard]] UdpClient* udp_client(const gateway::SocketAddress& address);
    [[nodiscard]] bool make_room(gateway::Moment idle_since);
    void forget_idle();

    Context& ctx_;
    MailboxGatewaySettings settings_;
    std::string error_{};
    gateway::Sockets sockets_{};
    gateway::Router router_;
    std::vector<std::byte> datagram_;
    gateway::Moment now_{};
    std::vector<std::unique_ptr<TcpClient>> tcp_{};
    std::vector<std::unique_ptr<UdpClient>> udp_{};
    std::vector<pollfd> polled_{};
    std::atomic<std::uint64_t> new_clients_{0}, refused_{0}, malformed_{0}, stalled_{0};
    attach::ServiceThread thread_{};
};

void MailboxGateway::Loop::wait() {
    polled_.clear();
    polled_.push_back({thread_.wake_fd(), POLLIN, 0});
    polled_.push_back({sockets_.tcp(), POLLIN, 0});  // poll() ignores a negative descriptor
    polled_.push_back({sockets_.udp(), POLLIN, 0});
    for (const auto& client : tcp_) {
        const int events = (router_.has_room(*client) ? POLLIN : 0) | (client->has_output() ? POLLOUT : 0);
        polled_.push_back({client->fd(), static_cast<short>(events | POLLRDHUP), 0});
    }
    const timespec time{.tv_sec = 0, .tv_nsec = router_.patience(now_).count()};
    if (::ppoll(polled_.data(), polled_.size(), &time, nullptr) < 0)
        for (auto& each : polled_) each.revents = 0;
    now_ = std::chrono::steady_clock::now();
}

void MailboxGateway::Loop::run() {
    now_ = std::chrono::steady_clock::now();
    while (!thread_.stopping()) {
        wait();
        for (std::size_t n = 0; n < tcp_.size(); ++n) serve_tcp(*tcp_[n], polled_[n + 3].revents);
        if ((polled_[2].revents & POLLIN) != 0) receive_datagrams();
        router_.step(now_);
        for (const auto& client : tcp_)
            if (!client->closed() && !client->flush(now_)) drop(*client);
        std::erase_if(tcp_, [](const auto& client) { return client->closed(); });
        forget_idle();
        if ((polled_[1].revents & POLLIN) != 0) accept();
    }
}

// ------------------------------------------------------------------ TCP

void MailboxGateway::Loop::drop(TcpClient& client) {
    router_.remove(client);
    client.close();
}

void MailboxGateway::Loop::serve_tcp(TcpClient& client, short revents) {
    if ((revents & (POLLHUP | POLLERR | POLLNVAL)) != 0) return drop(client);
    if ((revents & POLLIN) != 0) {
        if (client.receive(now_) == TcpClient::Came::gone) return drop(client);
    } else if ((revents & POLLRDHUP) != 0) {
        return drop(client);
    }
    take_frames(client);
    if (client.closed()) return;
    if (client.is_stalled(now_, router_.has_room(client))) {
        ++stalled_;
        drop(client);
    }
}

// Invalid octets end the connection, because the beginning of the next frame is not known.
void MailboxGateway::Loop::take_frames(TcpClient& client) {
    while (router_.has_room(client)) {
        const auto bytes = frame_bytes(client.received());
        if (!bytes) {
            ++malformed_;
            return drop(client);
        }
        if (*bytes == 0 || client.received().size() < *bytes) return;
        auto messages = messages_of(client.received().first(*bytes));
        client.drop(*bytes);
        for (auto& mail : messages) router_.receive(client, std::move(mail), now_);
    }
}

void MailboxGateway::Loop::accept() {
    const int fd = ::accept4(sockets_.tcp(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd < 0) {
        // Without free descriptors the connection stays in the queue, so wait before the next attempt.
        if (errno == EMFILE || errno == ENFILE || errno == ENOMEM || errno == ENOBUFS)
            std::this_thread::sleep_for(10ms);
        return;
    }
    if (!make_room(now_ - kIdleTcp)) {
        ++refused_;
        ::close(fd);
        return;
    }
    const int on = 1;
    (void)::setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    (void)::setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
    ++new_clients_;
    tcp_.push_back(std::make_unique<TcpClient>(fd, now_));
    router_.add(*tcp_.back());
}

// ------------------------------------------------------------------ UDP

void MailboxGateway::Loop::receive_datagrams() {
    for (int n = 0; n < kDatagramsOnce; ++n) {
        gateway::SocketAddress from;
        const auto got =
            ::recvfrom(sockets_.udp(), datagram_.data(), datagram_.size(), MSG_DONTWAIT, from.pointer(), &from.bytes);
        if (got < 0) return;
        const auto datagram = Bytes(datagram_).first(static_cast<std::size_t>(got));
        if (frame_bytes(datagram).value_or(0) == 0) {
            ++malformed_;
            continue;
        }
        UdpClient* const client = udp_client(from);
        if (client == nullptr) {
            ++refused_;
            UdpClient nobody(sockets_.udp(), from);
            for (const auto& mail : messages_of(datagram)) router_.refuse(nobody, mail, now_);
            continue;
        }
        client->moved = now_;
        take_datagram(*client, datagram);
    }
}

// A datagram contains one frame or several frames, and then padding.
void MailboxGateway::Loop::take_datagram(UdpClient& client, Bytes datagram) {
    for (bool first = true;; first = false) {
        const auto bytes = frame_bytes(datagram).value_or(0);
        if (bytes == 0) return;
        if (bytes > datagram.size() && !first) return;
        const auto frame = datagram.first(std::min(bytes, datagram.size()));
        datagram = datagram.subspan(frame.size());
        for (auto& mail : messages_of(frame)) router_.receive(client, std::move(mail), now_);
    }
}

UdpClient* MailboxGateway::Loop::udp_client(const gateway::SocketAddress& address) {
    for (const auto& client : udp_)
        if (client->address() == address) return client.get();
    if (!make_room(now_ - kIdleUdp)) return nullptr;
    ++new_clients_;
    auto client = std::make_unique<UdpClient>(sockets_.udp(), address);
    client->moved = now_;
    router_.add(*client);
    udp_.push_back(std::move(client));
    return udp_.back().get();
}

// ------------------------------------------------------------------ places

// Finds a place for another client: a free place, or the place of an idle client. A new sender of UDP does not end a
// TCP connection.
bool MailboxGateway::Loop::make_room(gateway::Moment idle_since) {
    if (tcp_.size() + udp_.size() < settings_.clients) return true;
    const auto sender = std::ranges::min_element(udp_, {}, [](const auto& client) { return client->moved; });
    if (sender != udp_.end() && (*sender)->moved < now_ - kIdleUdp && !router_.uses(**sender)) {
        router_.remove(**sender);
        udp_.erase(sender);
        return true;
    }
    if (idle_since > now_ - kIdleTcp) return false;
    const auto idle = std::ranges::find_if(tcp_, [&](const auto& client) {
        return client->moved() < idle_since && !client->has_output() && client->received().empty() &&
               !router_.uses(*client);
    });
    if (idle == tcp_.end()) return false;
    drop(**idle);
    tcp_.erase(idle);
    return true;
}

void MailboxGateway::Loop::forget_idle() {
    std::erase_if(udp_, [&](const auto& client) {
        if (now_ - client->moved < kForgetUdp || router_.uses(*client)) return false;
        router_.remove(*client);
        return true;
    });
}

// ------------------------------------------------------------------ MailboxGateway

MailboxGateway::MailboxGateway(Context& ctx, MailboxGatewaySettings settings)
    : loop_(std::make_unique<Loop>(ctx, std::move(settings))) {
    loop_->start();
}
MailboxGateway::~MailboxGateway() = default;
const std::string& MailboxGateway::error() const { return loop_->error(); }
std::uint16_t MailboxGateway::port() const { return loop_->port(); }
MailboxGatewayCounts MailboxGateway::counts() const { return loop_->counts(); }

}  // namespace margay
