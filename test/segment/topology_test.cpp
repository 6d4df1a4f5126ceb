// find_topology() with trees whose DL status is written by hand: ESC register 0x0110, ETG.1000.4 "DL status".
#include "network/topology.hpp"

#include "wire/esc.hpp"

#include <gtest/gtest.h>

#include <initializer_list>
#include <vector>

namespace margay {
namespace {

// DL status with these ports open (link, communication, loop open) and the other ports closed.
std::uint16_t open_ports(std::initializer_list<unsigned> ports) {
    std::uint16_t status = 0x5500;  // all loops closed
    for (const unsigned p : ports) {
        status = static_cast<std::uint16_t>(status & ~wire::dl_status::loop_closed(p));
        status =
            static_cast<std::uint16_t>(status | wire::dl_status::communication(p) | wire::dl_status::physical_link(p));
    }
    return status;
}

std::vector<RingPlace> segment(std::initializer_list<std::initializer_list<unsigned>> all) {
    std::vector<RingPlace> slaves;
    for (const auto& ports : all) {
        RingPlace slave;
        slave.dl_status = open_ports(ports);
        slaves.push_back(slave);
    }
    return slaves;
}

TEST(Topology, DlStatusOfTheTablesOfTheEsc) {
    EXPECT_EQ(open_ports({0, 1}), 0x5A30);  // the value of the EK1100 with one terminal in the recordings
}

TEST(Topology, LineHangsOneAtAnother) {
    auto slaves = segment({{0, 1}, {0, 1}, {0}});
    ASSERT_TRUE(find_topology(slaves));
    EXPECT_EQ(slaves[0].parent, 0);
    EXPECT_EQ(slaves[1].parent, 1);
    EXPECT_EQ(slaves[1].parent_port, 1);
    EXPECT_EQ(slaves[2].parent, 2);
    EXPECT_EQ(slaves[1].ports[0].neighbour, 1);
    EXPECT_EQ(slaves[1].ports[1].neighbour, 3);
}

TEST(Topology, FramesLeaveByPort3Before1Before2) {
    // A junction with a slave at each port, and one more slave behind the first of them.
    auto slaves = segment({{0, 1, 2, 3}, {0, 1}, {0}, {0}, {0}});
    ASSERT_TRUE(find_topology(slaves));
    EXPECT_EQ(slaves[1].parent_port, 3);
    EXPECT_EQ(slaves[2].parent, 2);
    EXPECT_EQ(slaves[3].parent, 1);
    EXPECT_EQ(slaves[3].parent_port, 1);
    EXPECT_EQ(slaves[4].parent, 1);
    EXPECT_EQ(slaves[4].parent_port, 2);
}

TEST(Topology, EntryByAnotherPortThan0) {
    auto slaves = segment({{0, 1}, {1, 2}, {0}});
    ASSERT_TRUE(find_topology(slaves));
    EXPECT_EQ(slaves[1].entry_port, 1);
    EXPECT_EQ(slaves[1].ports[1].neighbour, 1);
    EXPECT_EQ(slaves[2].parent, 2);
    EXPECT_EQ(slaves[2].parent_port, 2);
}

TEST(Topology, PortThatLeadsNowhereIsNamed) {
    auto slaves = segment({{0, 1}, {0, 1}});
    const auto result = find_topology(slaves);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().slave, 2);
    EXPECT_EQ(result.error().index, 1);
    EXPECT_EQ(slaves[1].parent, 1);
}

TEST(Topology, SlaveWithoutAPortToHangAtIsNamed) {
    auto slaves = segment({{0}, {0}});
    const auto result = find_topology(slaves);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().slave, 2);
    EXPECT_EQ(result.error().step, Step::topology);
}

TEST(Topology, SurvivesEveryDlStatus) {
    for (unsigned status = 0; status <= 0xFFFF; status += 7) {
        std::vector<RingPlace> slaves(4);
        for (std::size_t i = 0; i < slaves.size(); ++i) {
            slaves[i].dl_status = static_cast<std::uint16_t>(status * (i + 1));
        }
        (void)find_topology(slaves);
        for (std::size_t i = 1; i < slaves.size(); ++i) EXPECT_LE(slaves[i].parent, i);
    }
}

}  // namespace
}  // namespace margay
