#include "attach/client.hpp"

#include "attach/socket_address.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace margay::attach {
namespace {

constexpr std::size_t kMostPayload = (std::size_t{1} << 30) + 65536;  // a server never sends more

constexpr int kLookMs = 1000;  // interval between two calls of the Silence function

constexpr const char* kGivenUp = "the application has not answered";

Reply broken(std::string text) { return {.status = Status::refused, .text = std::move(text), .broken = true}; }

}  // namespace

Client::~Client() {
    if (fd_ >= 0) ::close(fd_);
}

std::string Client::connect(const std::string& path) {
    path_ = path;
    given_up_ = false;
    SocketAddress address;
    if (auto error = address.set(path); !error.empty()) return error;
    fd_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd_ < 0) return path + ": no application can be reached: " + std::strerror(errno);
    // A stopped application accepts no connections. If too many connections wait already, connect() fails with EAGAIN.
    for (const auto begin = Clock::now(); ::connect(fd_, address.pointer(), address.bytes()) != 0;) {
        const int error = errno;
        if (error != EAGAIN && error != EINTR) return path + ": no application can be reached: " + std::strerror(error);
        if (!goes_on(begin)) return path + ": " + kGivenUp;
        (void)::poll(nullptr, 0, kLookMs / 10);
    }
    std::array<std::byte, 8> hello{};
    Writer into(hello);
    into(kMagic, kProtocolVersion);
    const auto reply = exchange(Operation::hello, hello, {});
    if (!reply.ok()) return path + ": " + reply.text;
    Reader from(reply.payload);
    std::uint32_t magic = 0;
    std::uint32_t version = 0;
    from(magic, version, version_, name_, read_only_, transfer_bytes_);
    if (!from.complete() || magic != kMagic || version != kProtocolVersion)
        return path + ": the server is no Margay application of this version";
    return {};
}

// Waits until the socket is ready. False: the Silence function has ended the waiting, and the connection is closed.
bool Client::wait_for(short events) {
    const auto begin = Clock::now();
    for (;;) {
        pollfd one{.fd = fd_, .events = events, .revents = 0};
        const int ready = ::poll(&one, 1, kLookMs);
        if (ready > 0 || (ready < 0 && errno != EINTR)) return true;
        if (!goes_on(begin)) return false;
    }
}

bool Client::goes_on(Clock::time_point since) {
    if (!silence_ || silence_(std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - since))) return true;
    // Closes the connection, because a request was sent partly, or an answer was read partly.
    ::close(std::exchange(fd_, -1));
    given_up_ = true;
    return false;
}

std::string Client::send_all(Bytes octets) {
    while (!octets.empty()) {
        if (!wait_for(POLLOUT)) return kGivenUp;
        const auto put = ::send(fd_, octets.data(), octets.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
        if (put < 0 && (errno == EINTR || errno == EAGAIN)) continue;
        if (put <= 0) return "the application has ended the connection";
        octets = octets.subspan(static_cast<std::size_t>(put));
    }
    return {};
}

std::string Client::receive_all(MutableBytes into) {
    while (!into.empty()) {
        if (!wait_for(POLLIN)) return kGivenUp;
        const auto got = ::recv(fd_, into.data(), into.size(), 0);
        if (got < 0 && (errno == EINTR || errno == EAGAIN)) continue;
        if (got <= 0) return "the application has ended the connection";
        into = into.subspan(static_cast<std::size_t>(got));
    }
    return {};
}

Reply Client::exchange(Operation operation, Bytes payload, const Progress& progress) {
    if (fd_ < 0) return broken(given_up_ ? kGivenUp : "not connected");
    const Header request{.bytes = static_cast<std::uint32_t>(payload.size()),
                         .number = ++number_,
                         .what = static_cast<std::uint16_t>(operation)};
    std::array<std::byte, Header::kBytes> octets{};
    request.store(octets);
    auto error = send_all(octets);
    if (error.empty()) error = send_all(payload);
    // A server without a free place answers before it reads. So the answer is read even if sending has failed.
    if (error == kGivenUp) return broken(error);
    for (;;) {
        if (auto ended = receive_all(octets); !ended.empty()) return broken(error.empty() ? ended : error);
        const auto header = Header::load(octets);
        const bool of_connection = header.number == 0 && header.what == static_cast<std::uint16_t>(Status::refused);
        if (header.bytes > kMostPayload || (header.number != request.number && !of_connection))
            return broken("the answer does not belong to the request");
        Reply reply{.status = static_cast<Status>(header.what), .payload = std::vector<std::byte>(header.bytes)};
        if (auto ended = receive_all(reply.payload); !ended.empty()) return broken(ended);
        Reader from(reply.payload);
        switch (reply.status) {
            case Status::done: return reply;
            case Status::failed: from(reply.error, reply.text); break;
            case Status::refused: from(reply.text); break;
            case Status::progress: {
                std::uint64_t done = 0;
                std::uint64_t total = 0;
                from(done, total);
                if (progress && from.complete()) progress(done, total);
                continue;
            }
            default: return broken("the answer has an unknown status");
        }
        if (!from.complete()) return broken("the answer is not complete");
        return reply;
    }
}

Reply Client::call(Operation operation, const Arguments& arguments, const Progress& progress) {
    std::vector<std::byte> payload(64 + arguments.name.size() + arguments.data.size());
    Writer into(payload);
    into(arguments);
    return exchange(operation, into.written(), progress);
}

}  // namespace margay::attach
