// Which queueing disciplines send a frame at a given time. The messages are as the kernel writes them.
#include "oshw/linux/qdisc.hpp"

#include <gtest/gtest.h>
#include <linux/netlink.h>
#include <linux/pkt_sched.h>
#include <linux/rtnetlink.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <string>
#include <vector>

namespace margay {
namespace {

using Octets = std::vector<std::byte>;
constexpr int kInterface = 7;
constexpr std::uint32_t kHandle = 0x0064'0000;  // 100:

template <class T>
void append(Octets& to, const T& value) {
    const auto at = to.size();
    to.resize(at + sizeof value);
    std::memcpy(to.data() + at, &value, sizeof value);
    to.resize(NLMSG_ALIGN(to.size()));
}
void append_attribute(Octets& to, int type, const Octets& data) {
    append(to, rtattr{static_cast<unsigned short>(RTA_LENGTH(data.size())), static_cast<unsigned short>(type)});
    to.insert(to.end(), data.begin(), data.end());
    to.resize(NLMSG_ALIGN(to.size()));
}
Octets text(const std::string& of) {
    Octets octets(of.size() + 1);
    std::memcpy(octets.data(), of.c_str(), octets.size());
    return octets;
}
template <class T>
Octets octets(const T& value) {
    Octets all(sizeof value);
    std::memcpy(all.data(), &value, sizeof value);
    return all;
}

nlmsghdr head_of(std::uint16_t type, std::size_t octets_behind) {
    nlmsghdr head{};
    head.nlmsg_len = static_cast<std::uint32_t>(NLMSG_LENGTH(octets_behind));
    head.nlmsg_type = type;
    return head;
}

// The list that the kernel returns for an interface.
struct List {
    Octets all;
    Qdiscs qdiscs;

    void add(const std::string& kind, std::uint32_t handle, std::uint32_t parent, const Octets& options = {},
             int interface = kInterface) {
        Octets body;
        tcmsg traffic{};
        traffic.tcm_ifindex = interface;
        traffic.tcm_handle = handle;
        traffic.tcm_parent = parent;
        append(body, traffic);
        append_attribute(body, TCA_KIND, text(kind));
        append_attribute(body, TCA_OPTIONS, options);
        append(all, head_of(RTM_NEWQDISC, body.size()));
        all.insert(all.end(), body.begin(), body.end());
    }
    void add_etf(std::uint32_t parent, std::uint32_t flags, int clock = CLOCK_TAI, std::int32_t delta = 200'000) {
        Octets options;
        append_attribute(options, TCA_ETF_PARMS, octets(tc_etf_qopt{.delta = delta, .clockid = clock, .flags = flags}));
        add("etf", 0, parent, options);
    }
    // Priority 3: class 0, queue 1. Priority 2: class 1, queues 2 and 3. All others: class 2, queue 4.
    static tc_mqprio_qopt classes() {
        tc_mqprio_qopt options{};
        options.num_tc = 3;
        std::memset(options.prio_tc_map, 2, sizeof options.prio_tc_map);
        options.prio_tc_map[3] = 0;
        options.prio_tc_map[2] = 1;
        options.count[0] = 1;
        options.count[1] = 2;
        options.offset[1] = 1;
        options.count[2] = 1;
        options.offset[2] = 3;
        return options;
    }
    TimedWay way(unsigned priority = 3) {
        EXPECT_TRUE(qdiscs.add(all, kInterface));
        return timed_way(qdiscs.all(), priority);
    }
};

std::string why(const TimedWay& way) {
    EXPECT_EQ(way.holder, TimedWay::Holder::nobody);
    return std::string(way.kind) + ": " + std::string(way.why);
}

TEST(QdiscTest, MostOfThemSendAtOnce) {
    EXPECT_EQ(why(List().way()), ": the interface has no queueing discipline, so that frames leave at once");
    for (const std::string kind : {"noqueue", "pfifo_fast", "fq_codel", "tbf"}) {
        List list;
        list.add(kind, 0, TC_H_ROOT);
        EXPECT_EQ(why(list.way()), kind + ": it sends them at once");
    }
}

TEST(QdiscTest, EtfWithoutOffloadSendsByATimerAndEarlier) {
    List list;
    list.add("etf", 0, TC_H_ROOT, {}, 99);  // an interface that is not asked for
    list.add("ingress", 0xFFFF'0000, TC_H_INGRESS);
    list.add_etf(TC_H_ROOT, 0);
    const TimedWay way = list.way();
    EXPECT_EQ(list.qdiscs.all().size(), 1U);
    EXPECT_EQ(way.holder, TimedWay::Holder::qdisc) << way.why;
    EXPECT_EQ(way.clock, CLOCK_TAI);
    EXPECT_EQ(way.early, std::chrono::microseconds(200)) << "it hands a frame to the driver this long before its time";
    EXPECT_EQ(way.kind, "etf");
}

TEST(QdiscTest, EtfThatDoesNotFitIsRefused) {
    List deadline;
    deadline.add_etf(TC_H_ROOT, TC_ETF_DEADLINE_MODE_ON);
    EXPECT_EQ(why(deadline.way()), "etf: in its deadline mode it sends them before their time");
    List clock;
    clock.add_etf(TC_H_ROOT, 0, CLOCK_MONOTONIC);
    EXPECT_EQ(why(clock.way()), "etf: its clock is not CLOCK_TAI");
    List only;
    only.add_etf(TC_H_ROOT, TC_ETF_OFFLOAD_ON);
    EXPECT_EQ(why(only.way()),
              "etf: frames without a time use its queue too, and the NIC may hold them: it needs mqprio above it");
}

TEST(QdiscTest, FqSendsByATimer) {
    List list;
    list.add("fq", kHandle, TC_H_ROOT);
    const TimedWay way = list.way();
    EXPECT_EQ(way.holder, TimedWay::Holder::qdisc);
    EXPECT_EQ(way.clock, CLOCK_MONOTONIC);
    EXPECT_EQ(way.early, Duration(0));
    List queues;
    queues.add("mq", 0, TC_H_ROOT);
    queues.add("fq", 0, 1);
    queues.add("fq", 0, 2);
    EXPECT_EQ(queues.way().holder, TimedWay::Holder::qdisc);
    queues.add("pfifo_fast", 0, 3);
    queues.qdiscs = {};
    EXPECT_EQ(why(queues.way()), "pfifo_fast: it sends them at once") << "a frame may take any of the queues";
    List none;
    none.add("mq", kHandle, TC_H_ROOT);
    EXPECT_EQ(why(none.way()), "mq: no queueing discipline below it holds them: it needs etf for their queue");
}

TEST(QdiscTest, MqprioAndTaprioWithEtfForTheQueueOfThePriority) {
    for (const std::string kind : {"mqprio", "taprio"}) {
        SCOPED_TRACE(kind);
        List list;
        Octets options = octets(List::classes());
        if (kind == "taprio") {
            options.clear();
            append_attribute(options, TCA_TAPRIO_ATTR_PRIOMAP, octets(List::classes()));
        }
        list.add(kind, kHandle, TC_H_ROOT, options);
        list.add_etf(kHandle | 1, TC_ETF_OFFLOAD_ON);
        list.add_etf(kHandle | 2, TC_ETF_OFFLOAD_ON);
        list.add("pfifo_fast", 0, kHandle | 4);
        const TimedWay way = list.way(3);
        EXPECT_EQ(way.holder, TimedWay::Holder::nic) << way.why;
        EXPECT_EQ(way.early, Duration(0)) << "the NIC knows the time";
        EXPECT_EQ(why(timed_way(list.qdiscs.all(), 2)), kind + ": etf does not hold all queues of their class");
        EXPECT_EQ(why(timed_way(list.qdiscs.all(), 5)), "pfifo_fast: it sends them at once");
    }
}

TEST(QdiscTest, FramesWithoutATimeMustNotShareTheQueueOfTheNic) {
    List list;
    tc_mqprio_qopt options = List::classes();
    options.prio_tc_map[0] = 0;
    list.add("mqprio", kHandle, TC_H_ROOT, octets(options));
    list.add_etf(kHandle | 1, TC_ETF_OFFLOAD_ON);
    EXPECT_EQ(why(list.way(3)),
              "mqprio: frames of priority 0 share their queue: those have no time, and the NIC may hold them");
    options.num_tc = 0;
    List without;
    without.add("mqprio", kHandle, TC_H_ROOT, octets(options));
    EXPECT_EQ(why(without.way(3)), "mqprio: their priority has no traffic class");
    List different;
    different.add("mqprio", kHandle, TC_H_ROOT, octets(List::classes()));
    different.add_etf(kHandle | 2, TC_ETF_OFFLOAD_ON);
    different.add_etf(kHandle | 3, 0);
    EXPECT_EQ(why(different.way(2)), "mqprio: its queues hold them in different ways");
}

TEST(QdiscTest, MessagesThatAreCutOrWrongEndTheList) {
    List list;
    list.add_etf(TC_H_ROOT, 0);
    for (std::size_t size = 0; size < list.all.size(); ++size) {
        Qdiscs cut;
        const Octets part(list.all.begin(), list.all.begin() + static_cast<std::ptrdiff_t>(size));
        (void)cut.add(part, kInterface);
        EXPECT_TRUE(cut.all().empty()) << size;
    }
    // Attributes with wrong lengths are not read.
    for (std::size_t at = NLMSG_HDRLEN + sizeof(tcmsg); at + 1 < list.all.size(); ++at) {
        Octets wrong = list.all;
        wrong[at] = wrong[at + 1] = std::byte{0xFF};
        Qdiscs read;
        (void)read.add(wrong, kInterface);
        (void)timed_way(read.all(), 3);
    }
    Octets error;
    nlmsgerr refusal{};
    refusal.error = -EPERM;
    append(error, head_of(NLMSG_ERROR, sizeof refusal));
    append(error, refusal);
    Qdiscs refused;
    EXPECT_FALSE(refused.add(error, kInterface));
    EXPECT_EQ(refused.error(), EPERM);
    Octets many;
    for (int n = 0; n < 100; ++n) {
        List one;
        one.add("pfifo_fast", 0, TC_H_ROOT);
        many.insert(many.end(), one.all.begin(), one.all.end());
    }
    Qdiscs full;
    EXPECT_TRUE(full.add(many, kInterface));
    EXPECT_EQ(full.all().size(), 72U);
}

TEST(QdiscTest, TheLoopbackInterfaceIsRead) {
    Qdiscs qdiscs;
    EXPECT_TRUE(qdiscs.read(1)) << qdiscs.error();
    EXPECT_EQ(timed_way(qdiscs.all(), 3).holder, TimedWay::Holder::nobody);
}

}  // namespace
}  // namespace margay
