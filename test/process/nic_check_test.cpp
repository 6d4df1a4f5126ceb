// The program nic_check on a cable in network namespaces of the test, and on the loopback interface.
#include <places.hpp>
#include "netns.hpp"
#include "shell.hpp"

#include <gtest/gtest.h>

#include <filesystem>

namespace margay::process {
namespace {

using namespace std::chrono_literals;

const std::string kNicCheck = std::string(MARGAY_BIN_DIR) + "/nic_check";
const std::string kVirtualSegment = std::string(MARGAY_BIN_DIR) + "/virtual_segment";
constexpr auto kLimit = 60s;

struct NicCheck : testing::Test {
    Cable cable;
    void SetUp() override {
        if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
    }
    Ran check(std::vector<std::string> arguments) const {
        arguments.insert(arguments.begin(), kNicCheck);
        Child child(cable.master_namespace(), arguments);
        const int status = child.wait(kLimit);
        return {status, child.output(), child.errors()};
    }
};

TEST_F(NicCheck, ReadsACable) {
    const auto ran = check({Cable::kMaster});
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_EQ(ran.err, "");
    EXPECT_TRUE(ran.out.starts_with(std::string(Cable::kMaster) + ": ")) << ran.out;
    for (const auto* line : {"  driver: a virtual interface (veth)", "\n  link: up\n", "\n  MTU: 1500\n",
                             "  speed: 10000 Mbit/s", "\n  duplex: full\n", "  queueing discipline: ",
                             "  AF_XDP: it was not tried", "  kernel: ", "  NetworkManager: ", "  IP addresses: "})
        EXPECT_TRUE(contains(ran.out, line)) << line << "\n" << ran.out;
}

// nic_check reports changes that commands of the system have made. The commands that nic_check prints mend them.
TEST_F(NicCheck, SeesWhatIsChangedAndItsCommandsMendIt) {
    const auto in_namespace = "ip netns exec " + cable.master_namespace() + " ";
    const std::string name = Cable::kMaster;
    ASSERT_TRUE(cable.ip(cable.master_namespace(), "link set dev " + name + " mtu 1400"));
    ASSERT_TRUE(cable.ip(cable.master_namespace(), "address add 10.9.8.7/24 dev " + name));
    ASSERT_TRUE(cable.ip(cable.master_namespace(), "link add br-t type bridge"));
    ASSERT_TRUE(cable.ip(cable.master_namespace(), "link set dev " + name + " master br-t"));
    const auto before = check({name});
    for (const std::string& command : {"ip link set dev " + name + " mtu 1500", "ip address flush dev " + name,
                                       "ip link set dev " + name + " nomaster"}) {
        EXPECT_TRUE(contains(before.out, "\n      " + command + "\n")) << command << "\n" << before.out;
        EXPECT_TRUE(run(in_namespace + command)) << command;
    }
    EXPECT_TRUE(contains(before.out, "10.9.8.7")) << before.out;
    EXPECT_TRUE(contains(before.out, "belongs to br-t")) << before.out;
    const auto after = check({name});
    EXPECT_TRUE(contains(after.out, "\n  MTU: 1500\n")) << after.out;
    EXPECT_TRUE(contains(after.out, "\n  IP addresses: none\n")) << after.out;
    EXPECT_FALSE(contains(after.out, "bridge:")) << after.out;
    ASSERT_TRUE(cable.ip(cable.master_namespace(), "link set dev " + name + " down"));
    const auto down = check({name});
    EXPECT_EQ(down.status, 0) << down.err;
    EXPECT_TRUE(contains(down.out, "link: the interface is switched off\n      ip link set dev " + name + " up\n"))
        << down.out;
}

TEST_F(NicCheck, ProbesSlaves) {
    if (!std::filesystem::exists(kVirtualSegment)) GTEST_SKIP() << kVirtualSegment << " is not built";
    Child segment(cable.segment_namespace(), {kVirtualSegment, Cable::kSegment, "demo"});
    ASSERT_TRUE(segment.says("serv", kLimit)) << segment.output() << segment.errors();
    const auto ran = check({Cable::kMaster, "--probe", "--frames", "50"});
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(contains(ran.out, "  round trip: ")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "5 slaves; min ")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "\nround trips\n  from ")) << ran.out;
    const auto json = check({Cable::kMaster, "--probe", "--frames", "50", "--json"});
    EXPECT_EQ(json.status, 0) << json.err;
    EXPECT_TRUE(contains(json.out, "\"sent\": 50,")) << json.out;
    EXPECT_TRUE(contains(json.out, "\"slaves\": 5,")) << json.out;
}

TEST_F(NicCheck, AProbeWithoutAnAnswerEndsWithOne) {
    const auto ran = check({Cable::kMaster, "--probe", "--frames", "3"});
    EXPECT_EQ(ran.status, 1);
    EXPECT_EQ(ran.err, "nic_check: no slave answers\n");
    EXPECT_TRUE(contains(ran.out, "round trip: no slave answers")) << ran.out;
}

TEST_F(NicCheck, TriesXdpOnlyWhenAsked) {
    const auto ran = check({Cable::kMaster, "--try-xdp"});
    EXPECT_EQ(ran.status, 0) << ran.err;
    if (contains(ran.out, "built without libxdp and libbpf")) GTEST_SKIP() << "built without libxdp and libbpf";
    EXPECT_TRUE(contains(ran.out, "  AF_XDP: copy mode; the driver has no zero copy")) << ran.out;
    std::string link;
    run("ip -n " + cable.master_namespace() + " -d link show dev " + Cable::kMaster, &link);
    EXPECT_FALSE(contains(link, "prog/xdp")) << link;
}

TEST_F(NicCheck, AnInterfaceThatCannotBeUsedIsNamed) {
    const auto loopback = check({"lo"});
    EXPECT_EQ(loopback.status, 3);
    EXPECT_EQ(loopback.out, "");
    EXPECT_EQ(loopback.err,
              "nic_check: interface lo: it is not an Ethernet interface; EtherCAT needs a wired Ethernet port\n");
    const auto none = check({"no-such-if"});
    EXPECT_EQ(none.status, 3);
    EXPECT_TRUE(contains(none.err, "there is no interface \"no-such-if\"; there are: ")) << none.err;
    EXPECT_EQ(check({}).status, 2);
    EXPECT_EQ(check({Cable::kMaster, "--frames", "0"}).status, 2);
}

}  // namespace
}  // namespace margay::process
