#include "oshw/linux/packet_nic.hpp"

#include "wire/ethernet.hpp"

#include <arpa/inet.h>
#include <linux/errqueue.h>
#include <linux/ethtool.h>
#include <linux/filter.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <linux/net_tstamp.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace margay {
namespace {

constexpr int kReceiveBufferBytes = 4 << 20;  // room for a burst of more than a thousand full-size frames

// Accepts incoming EtherCAT frames without a VLAN tag. The kernel has already removed the tag from the frame, and only
// the ancillary word shows it. A tagged frame belongs to another virtual network.
bool attach_filter(int socket) {
    constexpr auto ancillary = [](int word) { return static_cast<std::uint32_t>(SKF_AD_OFF + word); };
    sock_filter program[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, ancillary(SKF_AD_PKTTYPE)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, PACKET_OUTGOING, 5, 0),
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, ancillary(SKF_AD_VLAN_TAG_PRESENT)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, 0, 0, 3),
        BPF_STMT(BPF_LD | BPF_H | BPF_ABS, 12),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, wire::kEtherTypeEtherCat, 0, 1),
        BPF_STMT(BPF_RET | BPF_K, 0xFFFFFFFF),
        BPF_STMT(BPF_RET | BPF_K, 0),
    };
    const sock_fprog filter{static_cast<unsigned short>(std::size(program)), program};
    return ::setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter) == 0;
}

bool set_option(int socket, int level, int option, int value) {
    return ::setsockopt(socket, level, option, &value, sizeof value) == 0;
}

}  // namespace

PacketNic::~PacketNic() { close(); }

void PacketNic::close() noexcept {
    interface_.close();
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
}

Result<> PacketNic::open(std::string_view interface, Side side) noexcept {
    close();
    last_error_ = 0;
    overruns_ = 0;
    stamps_ = Stamps::off;
    send_times_ = {};
    auto done = interface_.open(interface);
    if (!done) last_error_ = static_cast<int>(done.error().actual);
    if (!done) return done;
    done = set_up(side);
    if (!done) close();
    return done;
}

Result<> PacketNic::set_up(Side side) noexcept {
    // Protocol 0 receives nothing until bind(), so no frame can arrive before the filter is installed.
    socket_ = ::socket(AF_PACKET, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (socket_ < 0 && (errno == EPERM || errno == EACCES)) {
        last_error_ = EPERM;
        return interface_.fail_no_permission("no permission for raw frames, the capability CAP_NET_RAW is missing",
                                             "cap_net_raw");
    }
    if (socket_ < 0 && errno == EAFNOSUPPORT)
        return fail(errno, "this kernel has no packet sockets", "load the module af_packet");
    if (socket_ < 0) return fail(errno, "no packet socket");
    if (auto checked = interface_.check(); !checked) {
        last_error_ = static_cast<int>(checked.error().actual);
        return checked;
    }
    source_mac_ = interface_.address();
    if (side == Side::master) source_mac_[0] &= 0xFC;

    if (!attach_filter(socket_)) return fail(errno, "the receive filter was refused");
    // Avoids a copy of each sent frame. Kernels before 4.20 do not support the option; then only the filter drops these
    // frames.
    (void)set_option(socket_, SOL_PACKET, PACKET_IGNORE_OUTGOING, 1);
    qdisc_bypassed_ = set_option(socket_, SOL_PACKET, PACKET_QDISC_BYPASS, 1);
    // SO_RCVBUFFORCE needs CAP_NET_ADMIN, SO_RCVBUF is limited to net.core.rmem_max. A smaller buffer is not an error,
    // it only stores shorter bursts.
    if (!set_option(socket_, SOL_SOCKET, SO_RCVBUFFORCE, kReceiveBufferBytes))
        (void)set_option(socket_, SOL_SOCKET, SO_RCVBUF, kReceiveBufferBytes);

    sockaddr_ll address{};
    address.sll_family = AF_PACKET;
    // Not the EtherCAT protocol: a socket bound to one protocol receives a frame after the kernel has removed its VLAN
    // tag, so that the tag can no longer be detected, and after a bridge that may consume all frames.
    address.sll_protocol = htons(ETH_P_ALL);
    address.sll_ifindex = interface_.index();
    if (side == Side::segment) {
        packet_mreq all{};
        all.mr_ifindex = address.sll_ifindex;
        all.mr_type = PACKET_MR_PROMISC;
        if (::setsockopt(socket_, SOL_PACKET, PACKET_ADD_MEMBERSHIP, &all, sizeof all) != 0)
            return fail(errno, "promiscuous mode was refused");
    }
    if (::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
        return fail(errno, "the socket cannot be bound to it");
    return {};
}

Result<> PacketNic::fail(int error, std::string_view what, std::string_view advice) noexcept {
    last_error_ = error;
    return interface_.fail(error, what, advice);
}

std::uint64_t PacketNic::overruns() noexcept {
    tpacket_stats stats{};
    socklen_t size = sizeof stats;
    // Reading clears the counter of the kernel.
    if (::getsockopt(socket_, SOL_PACKET, PACKET_STATISTICS, &stats, &size) == 0) overruns_ += stats.tp_drops;
    return overruns_;
}

SendStatus PacketNic::send(std::span<const std::byte> frame) noexcept {
    if (::send(socket_, frame.data(), frame.size(), MSG_DONTWAIT) >= 0) return SendStatus::sent;
    const int error = errno;
    last_error_ = error;
    if (error == EAGAIN || error == EINTR) return SendStatus::busy;
    // Without the queueing discipline the kernel returns ENOBUFS both for a full ring and for a missing carrier.
    if (error == ENOBUFS && link_state() != LinkState::down) return SendStatus::busy;
    return SendStatus::failed;
}

std::size_t PacketNic::receive(std::span<std::byte> into) noexcept {
    const auto length = ::recv(socket_, into.data(), into.size(), MSG_DONTWAIT);
    if (length >= 0) return static_cast<std::size_t>(length);
    if (errno != EAGAIN && errno != EINTR) last_error_ = errno;
    // Stamps that nobody reads make each wait for a frame end at once.
    if (stamps_ != Stamps::off) read_stamps();
    return 0;
}

// Whether the driver has these time stamps. The kernel accepts the socket option for every driver.
bool PacketNic::has_stamps(Stamps stamps) noexcept {
    ifreq request{};
    ethtool_ts_info info{};
    info.cmd = ETHTOOL_GET_TS_INFO;
    request.ifr_data = reinterpret_cast<char*>(&info);
    if (!interface_.request(SIOCETHTOOL, request)) return false;
    constexpr unsigned kSoftware = SOF_TIMESTAMPING_TX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE;
    constexpr unsigned kHardware = SOF_TIMESTAMPING_TX_HARDWARE | SOF_TIMESTAMPING_RAW_HARDWARE;
    const unsigned wanted = stamps == Stamps::hardware ? kHardware : kSoftware;
    return (info.so_timestamping & wanted) == wanted;
}

Result<> PacketNic::stamp_frames(Stamps stamps) noexcept {
    interface_.forget_problem();
    if (socket_ < 0) return fail(EBADF, "it is not open");
    if (stamps != Stamps::off && !has_stamps(stamps))
        return fail(EOPNOTSUPP, stamps == Stamps::hardware ? "its driver has no hardware time stamps of sent frames"
                                                           : "its driver has no time stamps of sent frames");
    if (stamps == Stamps::hardware) {
        ifreq request{};
        hwtstamp_config config{};
        config.tx_type = HWTSTAMP_TX_ON;
        request.ifr_data = reinterpret_cast<char*>(&config);
        if (!interface_.request(SIOCSHWTSTAMP, request))
            return fail(errno, "its time stamps cannot be switched on", "CAP_NET_ADMIN is needed");
    }
    int flags = 0;
    if (stamps == Stamps::software) flags = SOF_TIMESTAMPING_TX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE;
    if (stamps == Stamps::hardware) flags = SOF_TIMESTAMPING_TX_HARDWARE | SOF_TIMESTAMPING_RAW_HARDWARE;
    if (!set_option(socket_, SOL_SOCKET, SO_TIMESTAMPING, flags)) return fail(errno, "time stamps were refused");
    stamps_ = stamps;
    send_times_ = {};
    return {};
}

// The kernel returns each sent frame with its time by the error queue of the socket.
void PacketNic::read_stamps() noexcept {
    constexpr int kMost = 64;  // then the next call goes on
    for (int n = 0; n < kMost; ++n) {
        std::array<std::byte, kHeadBytes> head{};
        alignas(cmsghdr) std::array<char, 256> control{};
        iovec part{head.data(), head.size()};
        msghdr message{};
        message.msg_iov = &part;
        message.msg_iovlen = 1;
        message.msg_control = control.data();
        message.msg_controllen = control.size();
        const auto length = ::recvmsg(socket_, &message, MSG_ERRQUEUE | MSG_DONTWAIT);
        if (length < 0) return;
        for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
            if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_TIMESTAMPING) continue;
            scm_timestamping times{};
            std::memcpy(&times, CMSG_DATA(c), sizeof times);
            const timespec& time = times.ts[stamps_ == Stamps::hardware ? 2 : 0];
            send_times_.add(
                std::span<const std::byte>(head).first(static_cast<std::size_t>(length)),
                static_cast<std::uint64_t>(time.tv_sec) * 1'000'000'000 + static_cast<std::uint64_t>(time.tv_nsec));
        }
    }
}

std::optional<std::uint64_t> PacketNic::send_time_ns(std::span<const std::byte> head) noexcept {
    if (stamps_ == Stamps::off) return std::nullopt;
    read_stamps();
    return send_times_.find(head);
}

}  // namespace margay
