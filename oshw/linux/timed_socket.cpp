#include "oshw/linux/timed_socket.hpp"

#include <linux/errqueue.h>
#include <linux/if_packet.h>
#include <linux/net_tstamp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>

#ifndef SO_TXTIME
#define SO_TXTIME 61
#define SCM_TXTIME SO_TXTIME
#endif

namespace margay {
namespace {

// The time between the comparison with the clock and the moment when the frame is in the queue.
constexpr Duration kHandover = std::chrono::microseconds(10);

std::int64_t clock_ns(clockid_t clock) noexcept {
    timespec now{};
    (void)::clock_gettime(clock, &now);
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

// The time of the other clock at `at`. Its offset changes when PTP disciplines it, so it is read for each frame.
std::uint64_t in_clock(clockid_t clock, Time at) noexcept {
    const std::int64_t at_ns = at.time_since_epoch().count();
    if (clock == CLOCK_MONOTONIC) return static_cast<std::uint64_t>(at_ns);
    const std::int64_t before = clock_ns(CLOCK_MONOTONIC);
    const std::int64_t there = clock_ns(clock);
    const std::int64_t after = clock_ns(CLOCK_MONOTONIC);
    return static_cast<std::uint64_t>(at_ns + there - (before + (after - before) / 2));
}

}  // namespace

std::string_view TimedSocket::open(int interface_index, const TimedWay& way, unsigned priority) noexcept {
    close();
    clock_ = way.clock;
    early_ = way.early;
    dropped_ = 0;
    const auto refused = [this](std::string_view what) {
        const int error = errno;
        close();
        errno = error;
        return what;
    };
    socket_ = ::socket(AF_PACKET, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);  // protocol 0 receives nothing
    if (socket_ < 0) return refused("no second packet socket");
    const sock_txtime times{.clockid = way.clock, .flags = SOF_TXTIME_REPORT_ERRORS};
    if (::setsockopt(socket_, SOL_SOCKET, SO_TXTIME, &times, sizeof times) != 0)
        return refused(errno == EPERM ? "send times of CLOCK_TAI were refused, the capability CAP_NET_ADMIN is missing"
                                      : "send times were refused (SO_TXTIME)");
    const int wanted = static_cast<int>(priority);
    if (::setsockopt(socket_, SOL_SOCKET, SO_PRIORITY, &wanted, sizeof wanted) != 0)
        return refused("the priority of the frames was refused");
    sockaddr_ll address{};
    address.sll_family = AF_PACKET;
    address.sll_ifindex = interface_index;
    if (::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
        return refused("the second socket cannot be bound to it");
    return {};
}

void TimedSocket::close() noexcept {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
}

// The clock of LinuxOsal is CLOCK_MONOTONIC.
bool TimedSocket::is_late(Time at) const noexcept {
    return at.time_since_epoch() - Duration(clock_ns(CLOCK_MONOTONIC)) < kHandover;
}

bool TimedSocket::send(std::span<const std::byte> frame, Time at) noexcept {
    const std::uint64_t time_ns = in_clock(clock_, at + early_);
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof time_ns)> control{};
    iovec part{const_cast<std::byte*>(frame.data()), frame.size()};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    cmsghdr* const time = CMSG_FIRSTHDR(&message);
    time->cmsg_level = SOL_SOCKET;
    time->cmsg_type = SCM_TXTIME;
    time->cmsg_len = CMSG_LEN(sizeof time_ns);
    std::memcpy(CMSG_DATA(time), &time_ns, sizeof time_ns);
    return ::sendmsg(socket_, &message, MSG_DONTWAIT) >= 0;
}

bool TimedSocket::take_report(const void* control_message) noexcept {
    const auto* control = static_cast<const cmsghdr*>(control_message);
    if (control->cmsg_level != SOL_PACKET || control->cmsg_type != PACKET_TX_TIMESTAMP) return false;
    sock_extended_err report{};
    if (control->cmsg_len < CMSG_LEN(sizeof report)) return false;
    std::memcpy(&report, CMSG_DATA(control), sizeof report);
    if (report.ee_origin != SO_EE_ORIGIN_TXTIME) return false;
    ++dropped_;
    return true;
}

}  // namespace margay
