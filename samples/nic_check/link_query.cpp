#include "nic_check/link_query.hpp"

#include <linux/if_link.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>

namespace margay::nic_check {
namespace {

// Calls `take(type, data, size)` for each attribute. Lengths that do not fit end the list.
template <class Take>
void for_each_attribute(const std::byte* at, std::size_t size, const Take& take) {
    while (size >= sizeof(rtattr)) {
        rtattr head{};
        std::memcpy(&head, at, sizeof head);
        if (head.rta_len < sizeof head || head.rta_len > size) return;
        take(head.rta_type & NLA_TYPE_MASK, at + RTA_LENGTH(0), head.rta_len - RTA_LENGTH(0));
        const std::size_t step = RTA_ALIGN(head.rta_len);
        if (step >= size) return;
        at += step;
        size -= step;
    }
}

std::string text_at(const std::byte* data, std::size_t size) {
    const auto* text = reinterpret_cast<const char*>(data);
    return std::string(text, ::strnlen(text, size));
}

void read_reply(const std::byte* at, std::size_t size, LinkQuery& link) {
    for_each_attribute(at, size, [&](int type, const std::byte* data, std::size_t length) {
        if (type == IFLA_QDISC) link.qdisc = text_at(data, length);
        if (type == IFLA_MASTER && length == sizeof(std::uint32_t)) {
            std::uint32_t index = 0;
            std::memcpy(&index, data, sizeof index);
            std::array<char, IF_NAMESIZE> name{};
            if (::if_indextoname(index, name.data()) != nullptr) link.master = name.data();
        }
        if (type == IFLA_LINKINFO)
            for_each_attribute(data, length, [&](int inner, const std::byte* text, std::size_t octets) {
                if (inner == IFLA_INFO_KIND) link.kind = text_at(text, octets);
            });
    });
}

std::string ask(int socket, int index, LinkQuery& link) {
    struct {
        nlmsghdr head;
        ifinfomsg link;
    } request{};
    request.head.nlmsg_len = sizeof request;
    request.head.nlmsg_type = RTM_GETLINK;
    request.head.nlmsg_flags = NLM_F_REQUEST;
    request.link.ifi_family = AF_UNSPEC;
    request.link.ifi_index = index;
    if (::send(socket, &request, sizeof request, 0) < 0) return std::strerror(errno);
    alignas(nlmsghdr) std::array<std::byte, 16384> reply{};
    const auto size = ::recv(socket, reply.data(), reply.size(), 0);
    if (size < 0) return std::strerror(errno);
    nlmsghdr head{};
    constexpr std::size_t kBegin = NLMSG_LENGTH(sizeof(ifinfomsg));
    if (static_cast<std::size_t>(size) < kBegin) return "the answer of the kernel is too short";
    std::memcpy(&head, reply.data(), sizeof head);
    if (head.nlmsg_type != RTM_NEWLINK || head.nlmsg_len > static_cast<std::size_t>(size) || head.nlmsg_len < kBegin)
        return "the kernel did not answer the question";
    read_reply(reply.data() + NLMSG_ALIGN(kBegin), head.nlmsg_len - NLMSG_ALIGN(kBegin), link);
    return {};
}

}  // namespace

LinkQuery query_link(int index) {
    LinkQuery link;
    const int socket = ::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE);
    if (socket < 0) {
        link.problem = std::strerror(errno);
        return link;
    }
    link.problem = ask(socket, index, link);
    ::close(socket);
    return link;
}

}  // namespace margay::nic_check
