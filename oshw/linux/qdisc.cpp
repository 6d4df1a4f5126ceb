#include "oshw/linux/qdisc.hpp"

#include <linux/netlink.h>
#include <linux/pkt_sched.h>
#include <linux/rtnetlink.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>

namespace margay {
namespace {

static_assert(Qdisc::kClasses == TC_QOPT_MAX_QUEUE && Qdisc::kClasses == TC_QOPT_BITMASK + 1);

template <class T>
bool load(std::span<const std::byte> from, T& to) noexcept {
    if (from.size() < sizeof to) return false;
    std::memcpy(&to, from.data(), sizeof to);
    return true;
}

// Calls `take(type, data)` for each attribute. A length that does not fit ends the list.
template <class Take>
void for_each_attribute(std::span<const std::byte> list, const Take& take) noexcept {
    rtattr head{};
    while (load(list, head)) {
        if (head.rta_len < sizeof head || head.rta_len > list.size()) return;
        take(head.rta_type & NLA_TYPE_MASK, list.first(head.rta_len).subspan(RTA_LENGTH(0)));
        list = list.subspan(std::min<std::size_t>(RTA_ALIGN(head.rta_len), list.size()));
    }
}

void take_classes(std::span<const std::byte> data, Qdisc& qdisc) noexcept {
    tc_mqprio_qopt options{};
    if (!load(data, options)) return;
    qdisc.classes = std::min<std::uint8_t>(options.num_tc, Qdisc::kClasses);
    std::copy_n(options.prio_tc_map, Qdisc::kClasses, qdisc.class_of.begin());
    std::copy_n(options.offset, Qdisc::kClasses, qdisc.first_queue.begin());
    std::copy_n(options.count, Qdisc::kClasses, qdisc.queues.begin());
}

void take_options(std::span<const std::byte> data, Qdisc& qdisc) noexcept {
    if (qdisc.name() == "mqprio") return take_classes(data, qdisc);
    for_each_attribute(data, [&qdisc](int type, std::span<const std::byte> value) {
        tc_etf_qopt options{};
        if (qdisc.name() == "taprio" && type == TCA_TAPRIO_ATTR_PRIOMAP) take_classes(value, qdisc);
        if (qdisc.name() != "etf" || type != TCA_ETF_PARMS || !load(value, options)) return;
        qdisc.delta_ns = options.delta;
        qdisc.clock = options.clockid;
        qdisc.deadline = (options.flags & TC_ETF_DEADLINE_MODE_ON) != 0;
        qdisc.offload = (options.flags & TC_ETF_OFFLOAD_ON) != 0;
    });
}

bool ask(int socket, int interface_index) noexcept {
    struct {
        nlmsghdr head;
        tcmsg traffic;
    } request{};
    request.head.nlmsg_len = sizeof request;
    request.head.nlmsg_type = RTM_GETQDISC;
    request.head.nlmsg_flags = NLM_F_REQUEST | NLM_F_DUMP;
    request.traffic.tcm_family = AF_UNSPEC;
    request.traffic.tcm_ifindex = interface_index;
    const timeval limit{1, 0};
    (void)::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    return ::send(socket, &request, sizeof request, 0) >= 0;
}

TimedWay refused(const Qdisc& by, std::string_view why) noexcept { return {.kind = by.name(), .why = why}; }

// The way through a queueing discipline without other ones below it.
TimedWay way_of(const Qdisc& qdisc) noexcept {
    if (qdisc.name() == "fq")
        return {.holder = TimedWay::Holder::qdisc, .clock = CLOCK_MONOTONIC, .kind = qdisc.name()};
    if (qdisc.name() != "etf") return refused(qdisc, "it sends them at once");
    if (qdisc.clock != CLOCK_TAI) return refused(qdisc, "its clock is not CLOCK_TAI");
    if (qdisc.deadline) return refused(qdisc, "in its deadline mode it sends them before their time");
    if (qdisc.offload) return {.holder = TimedWay::Holder::nic, .clock = CLOCK_TAI, .kind = qdisc.name()};
    return {
        .holder = TimedWay::Holder::qdisc, .clock = CLOCK_TAI, .early = Duration(qdisc.delta_ns), .kind = qdisc.name()};
}

// The way through the queues first … first + count - 1 of `root`; kAll: through any queue.
constexpr std::uint32_t kAll = 0xFFFF'FFFF;
TimedWay way_below(std::span<const Qdisc> all, const Qdisc& root, std::uint32_t first, std::uint32_t count) noexcept {
    TimedWay way = refused(root, "no queueing discipline below it holds them: it needs etf for their queue");
    std::uint32_t found = 0;
    for (const Qdisc& below : all) {
        const std::uint32_t queue = TC_H_MIN(below.parent) - 1;  // the classes of queues count from 1
        if (below.parent == TC_H_ROOT || TC_H_MAJ(below.parent) != TC_H_MAJ(root.handle)) continue;
        if (count != kAll && queue - first >= count) continue;
        const TimedWay one = way_of(below);
        if (one.holder == TimedWay::Holder::nobody) return one;
        if (found != 0 && (one.holder != way.holder || one.clock != way.clock || one.early != way.early))
            return refused(root, "its queues hold them in different ways");
        way = one;
        ++found;
    }
    if (found != 0 && count != kAll && found < count)
        return refused(root, "etf does not hold all queues of their class");
    return way;
}

TimedWay way_by_class(std::span<const Qdisc> all, const Qdisc& root, unsigned priority) noexcept {
    const std::uint8_t of_timed = root.class_of[priority % Qdisc::kClasses];
    if (of_timed >= root.classes) return refused(root, "their priority has no traffic class");
    const TimedWay way = way_below(all, root, root.first_queue[of_timed], root.queues[of_timed]);
    if (way.holder == TimedWay::Holder::nic && root.class_of[0] == of_timed)
        return refused(root, "frames of priority 0 share their queue: those have no time, and the NIC may hold them");
    return way;
}

}  // namespace

void Qdiscs::add_one(std::span<const std::byte> message) noexcept {
    if (count_ == all_.size()) return;
    Qdisc& qdisc = all_[count_];
    qdisc = {};
    tcmsg traffic{};
    (void)load(message, traffic);
    qdisc.handle = traffic.tcm_handle;
    qdisc.parent = traffic.tcm_parent;
    if (qdisc.parent == TC_H_INGRESS || qdisc.parent == TC_H_CLSACT) return;
    const auto attributes = message.subspan(std::min<std::size_t>(NLMSG_ALIGN(sizeof traffic), message.size()));
    for_each_attribute(attributes, [&qdisc](int type, std::span<const std::byte> value) {
        if (type != TCA_KIND) return;
        const auto length = std::min(value.size(), qdisc.kind.size() - 1);
        std::memcpy(qdisc.kind.data(), value.data(), length);
    });
    for_each_attribute(attributes, [&qdisc](int type, std::span<const std::byte> value) {
        if (type == TCA_OPTIONS) take_options(value, qdisc);
    });
    ++count_;
}

bool Qdiscs::add(std::span<const std::byte> messages, int interface_index) noexcept {
    nlmsghdr head{};
    while (load(messages, head)) {
        if (head.nlmsg_len < sizeof head || head.nlmsg_len > messages.size()) return false;
        const auto message = messages.first(head.nlmsg_len).subspan(NLMSG_HDRLEN);
        if (head.nlmsg_type == NLMSG_DONE) return false;
        if (head.nlmsg_type == NLMSG_ERROR) {
            nlmsgerr refusal{};
            error_ = load(message, refusal) && refusal.error != 0 ? -refusal.error : EPROTO;
            return false;
        }
        tcmsg traffic{};
        if (head.nlmsg_type == RTM_NEWQDISC && load(message, traffic) && traffic.tcm_ifindex == interface_index)
            add_one(message);
        messages = messages.subspan(std::min<std::size_t>(NLMSG_ALIGN(head.nlmsg_len), messages.size()));
    }
    return true;
}

bool Qdiscs::read(int interface_index) noexcept {
    count_ = 0;
    error_ = 0;
    const int socket = ::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE);
    if (socket < 0 || !ask(socket, interface_index)) error_ = errno;
    for (bool more = error_ == 0; more;) {
        alignas(nlmsghdr) std::array<std::byte, 16384> reply;
        const auto size = ::recv(socket, reply.data(), reply.size(), 0);
        if (size <= 0) error_ = size < 0 ? errno : EPROTO;
        more = size > 0 && add(std::span(reply).first(static_cast<std::size_t>(size)), interface_index);
    }
    if (socket >= 0) ::close(socket);
    return error_ == 0;
}

TimedWay timed_way(std::span<const Qdisc> all, unsigned priority) noexcept {
    const auto root = std::ranges::find(all, TC_H_ROOT, &Qdisc::parent);
    if (root == all.end()) return {.why = "the interface has no queueing discipline, so that frames leave at once"};
    if (root->name() == "mq") return way_below(all, *root, 0, kAll);
    if (root->name() == "mqprio" || root->name() == "taprio") return way_by_class(all, *root, priority);
    const TimedWay way = way_of(*root);
    if (way.holder == TimedWay::Holder::nic)
        return refused(*root,
                       "frames without a time use its queue too, and the NIC may hold them: it needs mqprio above "
                       "it");
    return way;
}

}  // namespace margay
