#include "oshw/linux/packet_nic.hpp"

#include "wire/ethernet.hpp"

#include <arpa/inet.h>
#include <linux/filter.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>

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
    timed_.close();
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
}

Result<> PacketNic::open(std::string_view interface, Side side) noexcept {
    close();
    last_error_ = 0;
    overruns_ = 0;
    forget_stamps();
    send_time_ = kAtOnce;
    too_late_ = 0;
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
    if (stamps_sent_) frames_.fetch_add(1, std::memory_order_relaxed);  // several threads may send
    if (send_time_ != kAtOnce) return send_timed(frame);
    if (::send(socket_, frame.data(), frame.size(), MSG_DONTWAIT) < 0) return not_sent(errno);
    interface_.note_sent();
    return SendStatus::sent;
}

SendStatus PacketNic::not_sent(int error) noexcept {
    last_error_ = error;
    if (error == EAGAIN || error == EINTR) return SendStatus::busy;
    // Without the queueing discipline the kernel returns ENOBUFS both for a full ring and for a missing carrier.
    if (error == ENOBUFS && !interface_.lacks_carrier()) return SendStatus::busy;
    return SendStatus::failed;
}

std::size_t PacketNic::receive(std::span<std::byte> into) noexcept {
    const auto length =
        stamps_received_ ? receive_stamped(into) : ::recv(socket_, into.data(), into.size(), MSG_DONTWAIT);
    if (length >= 0) return static_cast<std::size_t>(length);
    if (errno != EAGAIN && errno != EINTR) last_error_ = errno;
    // Unread stamps make each wait for a frame end at once.
    if (stamps_sent_) read_stamps();
    return 0;
}

}  // namespace margay
