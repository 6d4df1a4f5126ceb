// The times of frames of a PacketNic: when they were sent and received, and frames that leave at a time.
#include "oshw/linux/packet_nic.hpp"

#include "util/text_writer.hpp"

#include <linux/errqueue.h>
#include <linux/ethtool.h>
#include <linux/net_tstamp.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace margay {
namespace {

// Room for all control messages of a frame.
struct alignas(cmsghdr) Control : std::array<char, 256> {};

// The time in a control message; nothing if it is another message, or has no time of this kind.
std::optional<std::uint64_t> time_in(const cmsghdr& control, PacketNic::Stamps stamps) noexcept {
    if (control.cmsg_level != SOL_SOCKET || control.cmsg_type != SCM_TIMESTAMPING) return std::nullopt;
    scm_timestamping times{};
    std::memcpy(&times, CMSG_DATA(&control), sizeof times);
    const timespec& time = times.ts[stamps == PacketNic::Stamps::hardware ? 2 : 0];
    if (time.tv_sec == 0 && time.tv_nsec == 0) return std::nullopt;
    return static_cast<std::uint64_t>(time.tv_sec) * 1'000'000'000 + static_cast<std::uint64_t>(time.tv_nsec);
}

unsigned flags_of(PacketNic::Stamps stamps, bool sent, bool received) noexcept {
    if (stamps == PacketNic::Stamps::off) return 0;
    const bool hardware = stamps == PacketNic::Stamps::hardware;
    unsigned flags = hardware ? SOF_TIMESTAMPING_RAW_HARDWARE : SOF_TIMESTAMPING_SOFTWARE;
    if (sent) flags |= hardware ? SOF_TIMESTAMPING_TX_HARDWARE : SOF_TIMESTAMPING_TX_SOFTWARE;
    if (received) flags |= hardware ? SOF_TIMESTAMPING_RX_HARDWARE : SOF_TIMESTAMPING_RX_SOFTWARE;
    return flags;
}

bool set_flags(int socket, unsigned flags) noexcept {
    return socket < 0 || ::setsockopt(socket, SOL_SOCKET, SO_TIMESTAMPING, &flags, sizeof flags) == 0;
}

}  // namespace

FrameTiming PacketNic::timing() noexcept {
    FrameTiming has;
    if (stamps_sent_) has.sent = this;
    if (stamps_received_) has.received = this;
    if (timed_.is_open()) has.send_at = this;
    return has;
}

// Whether the driver has these time stamps. The kernel accepts the socket option for every driver.
bool PacketNic::has_stamps(unsigned wanted) noexcept {
    ifreq request{};
    ethtool_ts_info info{};
    info.cmd = ETHTOOL_GET_TS_INFO;
    request.ifr_data = reinterpret_cast<char*>(&info);
    return interface_.request(SIOCETHTOOL, request) && (info.so_timestamping & wanted) == wanted;
}

// Another program may also use the time stamps of the hardware (PTP), so time stamps that are on are not switched off.
Result<> PacketNic::switch_hardware_on(bool sent, bool received) noexcept {
    hwtstamp_config config{};
    ifreq request{};
    request.ifr_data = reinterpret_cast<char*>(&config);
    if (!interface_.request(SIOCGHWTSTAMP, request)) config = {};
    config.flags = 0;
    if (sent && config.tx_type == HWTSTAMP_TX_OFF) config.tx_type = HWTSTAMP_TX_ON;
    if (received) config.rx_filter = HWTSTAMP_FILTER_ALL;
    if (!interface_.request(SIOCSHWTSTAMP, request)) {
        if (errno == ERANGE && received)
            return fail(errno, "its hardware has no time stamps of all received frames",
                        "most often of PTP frames only");
        return fail(errno, "its time stamps cannot be switched on", "CAP_NET_ADMIN is needed");
    }
    if (received && config.rx_filter != HWTSTAMP_FILTER_ALL)
        return fail(ERANGE, "its hardware has no time stamps of all received frames", "most often of PTP frames only");
    return {};
}

void PacketNic::forget_stamps() noexcept {
    stamps_ = Stamps::off;
    stamps_sent_ = stamps_received_ = false;
    send_times_ = {};
    receive_times_ = {};
}

Result<> PacketNic::stamp_frames(Stamps stamps, Stamped which) noexcept {
    interface_.forget_problem();
    forget_stamps();
    if (socket_ < 0) return fail(EBADF, "it is not open");
    for (const int socket : {socket_, timed_.handle()}) (void)set_flags(socket, 0);
    const bool sent = stamps != Stamps::off && which != Stamped::received;
    const bool received = stamps != Stamps::off && which != Stamped::sent;
    const bool hardware = stamps == Stamps::hardware;
    if (sent && !has_stamps(flags_of(stamps, true, false)))
        return fail(EOPNOTSUPP, hardware ? "its driver has no hardware time stamps of sent frames"
                                         : "its driver has no time stamps of sent frames");
    if (received && !has_stamps(flags_of(stamps, false, true)))
        return fail(EOPNOTSUPP, hardware ? "its driver has no hardware time stamps of received frames"
                                         : "its driver has no time stamps of received frames");
    if (hardware)
        if (auto on = switch_hardware_on(sent, received); !on) return on;
    if (!set_flags(socket_, flags_of(stamps, sent, received)) ||
        !set_flags(timed_.handle(), flags_of(stamps, sent, false)))
        return fail(errno, "time stamps were refused");
    stamps_ = stamps;
    stamps_sent_ = sent;
    stamps_received_ = received;
    return {};
}

std::ptrdiff_t PacketNic::receive_stamped(std::span<std::byte> into) noexcept {
    Control control;
    iovec part{into.data(), into.size()};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const auto length = ::recvmsg(socket_, &message, MSG_DONTWAIT);
    if (length <= 0) return length;
    std::optional<std::uint64_t> time_ns;
    for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr && !time_ns; c = CMSG_NXTHDR(&message, c))
        time_ns = time_in(*c, stamps_);
    receive_times_.add(into.first(static_cast<std::size_t>(length)), time_ns);
    return length;
}

// Reads one message of the error queue: a sent frame with its time, or a frame that was dropped because its send time
// had passed. False: there is none.
bool PacketNic::read_report(int socket) noexcept {
    std::array<std::byte, SendClock::kHeadBytes> head{};
    Control control;
    iovec part{head.data(), head.size()};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const auto length = ::recvmsg(socket, &message, MSG_ERRQUEUE | MSG_DONTWAIT);
    if (length < 0) return false;
    std::optional<std::uint64_t> time_ns;
    bool was_dropped = false;  // for a dropped frame, the time is the intended send time
    for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
        was_dropped |= timed_.take_report(c);
        if (!time_ns) time_ns = time_in(*c, stamps_);
    }
    if (time_ns && !was_dropped)
        send_times_.add(std::span<const std::byte>(head).first(static_cast<std::size_t>(length)), *time_ns,
                        frames_.load(std::memory_order_relaxed));
    return true;
}

void PacketNic::read_reports(int socket) noexcept {
    constexpr int kMost = 64;  // the next call continues
    for (int n = 0; n < kMost && read_report(socket); ++n) {
    }
}

// The kernel returns each sent frame with its time by the error queue of its socket.
void PacketNic::read_stamps() noexcept {
    read_reports(socket_);
    if (timed_.is_open()) read_reports(timed_.handle());
}

std::optional<std::uint64_t> PacketNic::send_time_ns(std::span<const std::byte> head) noexcept {
    if (!stamps_sent_) return std::nullopt;
    read_stamps();
    return send_times_.find(head, frames_.load(std::memory_order_relaxed));  // a report may be lost
}

std::optional<std::uint64_t> PacketNic::receive_time_ns(std::span<const std::byte> head) noexcept {
    return receive_times_.find(head);
}

Result<> PacketNic::allow_send_at(unsigned priority) noexcept {
    interface_.forget_problem();
    timed_.close();
    if (socket_ < 0) return fail(EBADF, "it is not open");
    Qdiscs qdiscs;
    if (!qdiscs.read(interface_.index())) return fail(qdiscs.error(), "its queueing disciplines cannot be read");
    const TimedWay way = timed_way(qdiscs.all(), priority);
    if (way.holder == TimedWay::Holder::nobody) {
        std::array<char, 256> what{};
        std::array<char, 128> advice{};
        TextWriter sentence(what);
        sentence << "no frame can leave at a time by its queueing discipline " << way.kind
                 << (way.kind.empty() ? "" : ": ") << way.why;
        TextWriter command(advice);
        command << "mend it with: tc qdisc replace dev " << interface_.name()
                << " root etf clockid CLOCK_TAI delta 200000";
        return fail(EOPNOTSUPP, sentence.text(), command.text());
    }
    if (const auto refused = timed_.open(interface_.index(), way, priority); !refused.empty())
        return fail(errno, refused);
    if (set_flags(timed_.handle(), flags_of(stamps_, stamps_sent_, false))) return {};
    const int error = errno;
    timed_.close();
    return fail(error, "time stamps of frames with a send time were refused");
}

SendStatus PacketNic::send_timed(std::span<const std::byte> frame) noexcept {
    constexpr std::uint64_t kReadAfter = 64;  // so that reports do not fill the memory of the socket
    if (!timed_.is_open() || timed_.is_late(send_time_)) {
        if (::send(socket_, frame.data(), frame.size(), MSG_DONTWAIT) < 0) return not_sent(errno);
        interface_.note_sent();
        ++too_late_;
        return SendStatus::sent;
    }
    if (!timed_.send(frame, send_time_)) return not_sent(errno);
    interface_.note_sent();
    if (++timed_frames_ % kReadAfter == 0) read_reports(timed_.handle());
    return SendStatus::sent;
}

std::uint64_t PacketNic::missed() noexcept {
    if (timed_.is_open()) read_reports(timed_.handle());
    return too_late_ + timed_.dropped();
}

}  // namespace margay
