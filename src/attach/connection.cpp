#include "attach/connection.hpp"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

namespace margay::attach {
namespace {

constexpr std::size_t kHelloBytes = 64;
constexpr std::size_t kArgumentsBytes = 128 * 1024;  // of all messages that are no file and no object
constexpr std::size_t kAtOnce = 64 * 1024;

}  // namespace

Connection::~Connection() { close(); }

void Connection::close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
    Octets().swap(in_);
    Octets().swap(out_);
}

bool Connection::header_allowed() const {
    if (header_.reserved != 0 || header_.what >= static_cast<std::uint16_t>(Operation::end)) return false;
    if (!greeted) return operation() == Operation::hello && header_.bytes <= kHelloBytes;
    const bool large = operation() == Operation::foe_write || operation() == Operation::sdo_download;
    return header_.bytes <= kArgumentsBytes + (large ? most_ : 0);
}

bool Connection::gives_way(Moment now) const {
    if (job != nullptr) return false;
    return in_message() ? now - began_ > kSlow : now - moved_ >= kIdle;
}

std::size_t who_gives_way(std::span<const std::unique_ptr<Connection>> clients, Moment now) {
    std::size_t found = clients.size();
    for (std::size_t n = 0; n < clients.size(); ++n)
        if (clients[n]->gives_way(now) && (found == clients.size() || clients[n]->moved() < clients[found]->moved()))
            found = n;
    return found;
}

// The memory grows with the received octets, not with the length in the header.
Connection::Came Connection::receive(Moment now) {
    std::array<std::byte, kAtOnce> block;
    while (!complete()) {
        const auto room = std::min(wanted() - in_.size(), block.size());
        const auto got = ::recv(fd_, block.data(), room, MSG_DONTWAIT);
        if (got < 0 && (errno == EAGAIN || errno == EINTR)) return Came::nothing;
        if (got <= 0) return Came::gone;
        moved_ = now;
        if (in_.empty()) began_ = now;
        const bool had_header = in_.size() >= Header::kBytes;
        in_.insert(in_.end(), block.begin(), block.begin() + got);
        if (!had_header && in_.size() == Header::kBytes) {
            header_ = Header::load(in_);
            if (!header_allowed()) return Came::wrong;
        } else if (static_cast<std::size_t>(got) == block.size()) {
            return complete() ? Came::message : Came::nothing;  // the other clients have their turn first
        }
    }
    return Came::message;
}

bool Connection::send(Moment now) {
    while (sent_ < out_.size()) {
        const auto put =
            ::send(fd_, out_.data() + sent_, std::min(out_.size() - sent_, kAtOnce), MSG_DONTWAIT | MSG_NOSIGNAL);
        if (put < 0 && (errno == EAGAIN || errno == EINTR)) return true;
        if (put <= 0) return false;
        moved_ = now;
        sent_ += static_cast<std::size_t>(put);
    }
    Octets().swap(out_);
    sent_ = 0;
    return true;
}

void Connection::answer(Status status, Octets payload, Moment now) {
    if (closed()) return;
    const Header header{.bytes = static_cast<std::uint32_t>(payload.size()),
                        .number = header_.number,
                        .what = static_cast<std::uint16_t>(status)};
    std::array<std::byte, Header::kBytes> octets{};
    header.store(octets);
    payload.insert(payload.begin(), octets.begin(), octets.end());
    out_ = std::move(payload);
    sent_ = 0;
    moved_ = began_ = now;
}

}  // namespace margay::attach
