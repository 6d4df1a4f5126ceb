// Propagation delays. The receive times of each test follow by hand from the delays that the test names.
#include "clock/delays.hpp"
#include <places.hpp>
#include "network/topology.hpp"
#include "oshw/pcap/capture_file.hpp"
#include "sim/esc_description.hpp"
#include "wire/datagram.hpp"
#include "wire/esc.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>

namespace margay {
namespace {

// A ring of slaves whose receive times the test gives.
class Ring {
  public:
    static constexpr std::uint16_t kProcessing = 40;
    std::vector<PortTimes> times = std::vector<PortTimes>(16);
    std::vector<DelayNode> nodes;

    // `ports`: the receive times since the arrival at the entry port. A port that is not listed has no neighbour.
    void add(std::uint16_t parent, std::uint8_t parent_port, const std::map<unsigned, std::uint32_t>& ports,
             std::uint8_t entry = 0, std::uint32_t start_ns = 1000) {
        DelayNode node{.parent = parent, .parent_port = parent_port, .entry_port = entry, .processing_ns = kProcessing};
        ReceiveTimes latched;
        latched.port_ns.fill(0xDEADBEEF);
        latched.port_ns[entry] = start_ns;
        for (const auto& [port, since] : ports) {
            latched.port_ns[port] = start_ns + since;
            node.neighbours = static_cast<std::uint8_t>(node.neighbours | 1U << port);
        }
        PortTimes& mine = times[nodes.size()];
        mine.add(latched, entry);
        node.times = &mine;
        nodes.push_back(node);
    }
    void add_without_times(std::uint16_t parent, std::uint8_t parent_port) {
        nodes.push_back({.parent = parent, .parent_port = parent_port});
        connect(parent, parent_port);
    }
    void connect(std::uint16_t parent, std::uint8_t port) {
        if (parent == 0) return;
        std::uint8_t& of_parent = nodes[parent - 1U].neighbours;
        of_parent = static_cast<std::uint8_t>(of_parent | 1U << port);
    }
    std::int64_t delay(std::size_t place, std::size_t reference = 1) {
        compute_delays(nodes);
        return delay_between_ns(nodes[reference - 1], nodes[place - 1]);
    }
};

// Every slave needs 140 ns through its processing unit and 100 ns without it; the cables need 500 and 300 ns. So the
// frame is at B after 140 + 500 = 640 and at C after 640 + 140 + 300 = 1080. C turns it (140); it is back at B at 1520
// and, after 100 through B, at A at 2120.
TEST(Delays, OfALine) {
    Ring ring;
    ring.add(0, 0, {{1, 2120}});
    ring.add(1, 1, {{1, 1520 - 640}});
    ring.add(2, 1, {});
    EXPECT_EQ(ring.delay(1), 0);
    EXPECT_EQ(ring.delay(2), 640);
    EXPECT_EQ(ring.delay(3), 1080);
    EXPECT_EQ(ring.delay(1, 2), -640) << "before the reference";
    EXPECT_EQ(ring.delay(3, 2), 440);
}

// A junction: the frame leaves by port 3, then 1, then 2. X is there after 140 + 200 = 340, turns the frame, which is
// back at port 3 after 680; 100 further, and after 400 of cable, at Y at 1180; back at port 1 at 1720; 100 further, and
// after 50 of cable, at Z at 1870; back at port 2 at 2060.
TEST(Delays, OfAStar) {
    Ring ring;
    ring.add(0, 0, {{3, 680}, {1, 1720}, {2, 2060}});
    ring.add(1, 3, {});
    ring.add(1, 1, {});
    ring.add(1, 2, {});
    EXPECT_EQ(ring.delay(2), 340);
    EXPECT_EQ(ring.delay(3), 1180);
    EXPECT_EQ(ring.delay(4), 1870);
}

// A drop line: a trunk slave with a slave at port 3 and the rest of the trunk at port 1. D turns at 140 + 100 + 140 =
// 380: back at 480. The trunk goes on at 580 with 1000 of cable: 1580; turned at 1720, back at 2720.
TEST(Delays, OfADropLine) {
    Ring ring;
    ring.add(0, 0, {{1, 140 + 300 + (2720 + 100) + 300}});
    ring.add(1, 1, {{3, 480}, {1, 2720}});
    ring.add(2, 3, {});
    ring.add(2, 1, {});
    EXPECT_EQ(ring.delay(2), 440);
    EXPECT_EQ(ring.delay(3), 440 + 240);
    EXPECT_EQ(ring.delay(4), 440 + 1580);
}

// B has no receive times. Its own 140 and 100 ns count as cable: half of 140 + 100 + 2 · 500 + 2 · 300 each way.
TEST(Delays, PastASlaveWithoutReceiveTimes) {
    Ring ring;
    ring.add(0, 0, {{1, 2120}});
    ring.add_without_times(1, 1);
    ring.add(2, 1, {});
    // (2120 - 40 - 40) / 2 + 40: the asymmetry of B (40 / 2) is not known.
    EXPECT_EQ(ring.delay(3), 1060);
}

// A junction without receive times, with two slaves behind it: the three cables count equally. 140 to leave A, three
// times 600, and twice 140 to turn.
TEST(Delays, BehindAJunctionWithoutReceiveTimes) {
    Ring ring;
    ring.add(0, 0, {{1, 140 + 600 + 140 + 600 + 140 + 600}});
    ring.add_without_times(1, 1);
    ring.add(2, 3, {});
    ring.add(2, 1, {});
    // The 100 ns that every pass has count as cable: (2220 - 3 · 40) / 3 = 700 each.
    EXPECT_EQ(ring.delay(3), 40 + 700);
    EXPECT_EQ(ring.delay(4), 40 + 700 + 40 + 700);
}

// A junction behind a junction, both without receive times: the frame passes A, J, B, J, K, C, K, J and A. Each of the
// eight ways between them needs 600 ns, and A, B and C 40 ns through their processing units.
TEST(Delays, BehindJunctionsWithoutReceiveTimes) {
    Ring ring;
    ring.add(0, 0, {{1, 3 * 40 + 8 * 600}});
    ring.add_without_times(1, 1);
    ring.add(2, 3, {});
    ring.add_without_times(2, 1);
    ring.add(4, 1, {});
    ring.connect(2, 3);
    ring.connect(4, 1);
    EXPECT_EQ(ring.delay(3), 40 + 2 * 600);
    EXPECT_EQ(ring.delay(5), 40 + 2 * 600 + 40 + 3 * 600);
    EXPECT_NE(ring.nodes[2].assumed, 0);
    EXPECT_NE(ring.nodes[4].assumed, ring.nodes[2].assumed);
}

// The frame passes a slave without receive times, at a branch of another one, before it arrives at B: A, J, X, J, B, J
// and A.
TEST(Delays, BehindABranchWithoutReceiveTimes) {
    Ring ring;
    ring.add(0, 0, {{1, 2 * 40 + 6 * 600}});
    ring.add_without_times(1, 1);
    ring.add_without_times(2, 3);
    ring.add(2, 1, {});
    EXPECT_EQ(ring.delay(4), 40 + 4 * 600);
    EXPECT_NE(ring.nodes[3].assumed, 0);
    // X is lost: nothing answers at that port.
    ring.nodes[1].neighbours = 1U << 1;
    ring.times[0].clear();
    ring.times[0].add({.port_ns = {1000, 1000 + 2 * 40 + 4 * 600, 0, 0}}, 0);
    EXPECT_EQ(ring.delay(4), 40 + 2 * 600);
    EXPECT_EQ(ring.nodes[3].assumed, 0);
}

TEST(Delays, OfTheFirstSlaveWithTimesAfterOneWithout) {
    Ring ring;
    ring.add_without_times(0, 0);
    ring.add(1, 1, {{1, 140 + 500 + 140 + 500}});
    ring.add(2, 1, {});
    EXPECT_EQ(ring.delay(3, 2), 640);
}

// B is connected by its port 1, and nothing is at its port 0: the frame passes its processing unit 60 ns after the
// arrival, as register 0x0918 shows.
TEST(Delays, ByAnotherEntryPort) {
    Ring ring;
    ring.add(0, 0, {{1, 140 + 500 + 140 + 500}});
    ReceiveTimes latched{.port_ns = {7, 5000, 7, 7}, .processing_ns = 5060, .has_processing = true};
    ring.times[1].add(latched, 1);
    ring.nodes.push_back(
        {.parent = 1, .parent_port = 1, .entry_port = 1, .processing_ns = 40, .times = &ring.times[1]});
    EXPECT_EQ(ring.delay(2), 640 + 60);
}

// The last slave of a ring that is closed to a second NIC: its port 1 is open, but no slave is there. The time of this
// port is old and is not used.
TEST(Delays, OfTheLastSlaveInAClosedRing) {
    Ring ring;
    ring.add(0, 0, {{1, 140 + 500 + 140 + 500}});
    ring.add(1, 1, {});
    EXPECT_EQ(ring.delay(2), 640);
}

// Two parts of a broken ring: the frames of the second NIC come to slave 3 first, and slave 2 turns them. So the frame
// is at slave 2 after 100 + 500 = 600, at its processing unit 60 later, and back at slave 3 after 600 + 140 + 500.
TEST(Delays, InTwoPartsWhoseFramesArriveAtTheSameTime) {
    Ring ring;
    ring.add(0, 0, {});
    ring.times[1].add({.port_ns = {7, 9000, 7, 7}, .processing_ns = 9060, .has_processing = true}, 1);
    ring.times[2].add({.port_ns = {6240, 5000, 7, 7}, .processing_ns = 6240, .has_processing = true}, 1);
    DelayNode turns{.parent = 3, .parent_port = 0, .entry_port = 1, .processing_ns = 40, .times = &ring.times[1]};
    DelayNode last{.entry_port = 1, .neighbours = 1, .processing_ns = 40, .times = &ring.times[2]};
    ring.nodes.push_back(turns);
    ring.nodes.push_back(last);
    EXPECT_EQ(ring.delay(2), 600 + 60);
    EXPECT_EQ(ring.delay(3), 1240) << "on the way back";
}

TEST(Delays, WhenTheTimesWrap) {
    for (const std::uint32_t start : {0xFFFF'FFFFU, 0xFFFF'FC00U, 0U, 0x7FFF'FF00U}) {
        Ring ring;
        ring.add(0, 0, {{1, 2120}}, 0, start);
        ring.add(1, 1, {{1, 880}}, 0, start - 100);
        ring.add(2, 1, {}, 0, start + 5);
        EXPECT_EQ(ring.delay(3), 1080) << start;
    }
}

// A real chip counts in steps of 10 ns, and the frame comes up to 5 ns earlier or later.
TEST(Delays, AreTheMeanOfSeveralMeasurements) {
    Ring ring;
    ring.add(0, 0, {{1, 2120}});
    ring.add(1, 1, {});
    ring.times[0].clear();
    for (const std::uint32_t away : {1280U, 1290U, 1270U, 1290U, 1270U, 1280U})
        ring.times[0].add({.port_ns = {0xFFFF'FFF0U, 0xFFFF'FFF0U + away, 0, 0}}, 0);
    EXPECT_EQ(ring.times[0].count(), 6);
    EXPECT_EQ(ring.delay(2), 640);
}

// 300 slaves: the halves of odd sums do not add up.
TEST(Delays, OfALongLineAreNotRoundedAtEachSlave) {
    std::vector<PortTimes> times(300);
    std::vector<DelayNode> nodes(300);
    std::uint32_t away = 0;  // of the slave that the loop is at, from the last one on
    for (std::size_t n = 300; n-- > 0;) {
        times[n].add({.port_ns = {1, 1 + away, 0, 0}}, 0);
        nodes[n] = {.parent = static_cast<std::uint16_t>(n), .parent_port = 1, .processing_ns = 40, .times = &times[n]};
        if (n != 299) nodes[n].neighbours = 2;
        away += 140 + 100 + 2 * 75 + (n == 299 ? 40U : 0U) + 1;  // an odd sum
    }
    compute_delays(nodes);
    EXPECT_EQ(delay_between_ns(nodes[0], nodes[299]), (299 * 431 + 1) / 2);
}

// The values of a slave may contradict each other. The only effect is wrong numbers.
TEST(Delays, OfNonsenseAreFinite) {
    Ring ring;
    ring.add(2, 3, {{1, 0xFFFF'0000}});
    ring.add(1, 1, {{0, 5}, {2, 3}}, 3);
    ring.add(9, 1, {{1, 1}});
    compute_delays(ring.nodes);
    for (const DelayNode& node : ring.nodes) EXPECT_LT(std::abs(node.passed_ps), 1'000'000'000'000'000) << node.parent;
}

// ------------------------------------------------------------------ a recording of real slaves

struct Recorded {
    ReceiveTimes times;
    std::uint16_t dl_status = 0;
    std::uint32_t written_delay_ns = 0;  // by the recorded master, where the slave has the register
    bool has_clock = false;
};

// `first`: the station address of the first slave.
std::array<Recorded, 3> recorded(const std::string& path, std::uint16_t first = 0x1000) {
    std::array<Recorded, 3> slaves;
    CaptureFile capture;
    EXPECT_TRUE(capture.load(path).ok()) << capture.problem();
    for (const CapturedFrame& frame : capture.frames()) {
        if (!frame.reply) continue;
        wire::DatagramReader reader(capture.bytes(frame));
        while (const auto d = reader.next()) {
            const wire::DatagramAddress address = d->header.address;
            const auto n = static_cast<std::size_t>(address.adp() - first);
            if (n >= slaves.size() || d->wkc != 1) continue;
            const bool read = d->header.command == wire::Command::FPRD;
            if (read && address.ado() == wire::reg::kDlStatus.address)
                slaves[n].dl_status = load_le<std::uint16_t>(d->data);
            // Some masters read one port at a time.
            const unsigned port = (address.ado() - wire::reg::kPortReceiveTime.address) / 4U;
            if (read && port < 4)
                for (unsigned p = port; p < 4 && 4 * (p - port) < d->data.size(); ++p)
                    slaves[n].times.port_ns[p] = load_le<std::uint32_t>(d->data, 4 * (p - port));
            if (read && address.ado() == wire::reg::kProcessingUnitReceiveTime.address) {
                slaves[n].times.processing_ns = load_le<std::uint32_t>(d->data);
                slaves[n].times.has_processing = true;
            }
            if (!read && address.ado() == wire::reg::kSystemTimeDelay.address) {
                slaves[n].written_delay_ns = load_le<std::uint32_t>(d->data);
                slaves[n].has_clock = true;
            }
        }
    }
    return slaves;
}

// The delays from the first slave, if each chip needs `processing` ns longer through its processing unit.
std::vector<std::int64_t> computed(std::span<const Recorded> slaves, std::uint16_t processing) {
    std::vector<RingPlace> places(slaves.size());
    for (std::size_t n = 0; n < places.size(); ++n)
        places[n] = {.slave = static_cast<std::uint16_t>(n + 1), .dl_status = slaves[n].dl_status};
    EXPECT_TRUE(find_topology(places).ok());
    std::vector<PortTimes> times(slaves.size());
    std::vector<DelayNode> nodes(slaves.size());
    for (std::size_t n = 0; n < nodes.size(); ++n) {
        times[n].add(slaves[n].times, places[n].entry_port);
        nodes[n] = {.parent = places[n].parent,
                    .parent_port = places[n].parent_port,
                    .entry_port = places[n].entry_port,
                    .processing_ns = processing,
                    .times = &times[n]};
        for (unsigned p = 0; p < 4; ++p)
            if (p != places[n].entry_port && places[n].ports[p].neighbour != 0)
                nodes[n].neighbours = static_cast<std::uint8_t>(nodes[n].neighbours | 1U << p);
    }
    compute_delays(nodes);
    std::vector<std::int64_t> delays;
    for (const DelayNode& node : nodes) delays.push_back(delay_between_ns(nodes[0], node));
    return delays;
}

// EK1100, EL2828 (receive times, and no clock), EL2889. By hand: the frame was away from the EK1100 for 0x3C6211AA -
// 0x3C620F52 = 600 ns, and from the EL2828 for 0x3D0BD7E4 - 0x3D0BD6AE = 310 ns. So the cables (with all that is in
// them) take (600 - 310) / 2 = 145 and 310 / 2 = 155 ns one way: 300 together, which is what ethercrab has written. A
// processing unit that takes 40 ns longer than the way back adds half of that at the EK1100, where the way back is
// without it; behind the EL2828 both ways have one.
TEST(DelaysRecorded, OfRealSlaves) {
    const std::string path = std::string(MARGAY_CAPTURES_DIR) + "/replay-dc.pcapng";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "no captures of real segments";
    const auto slaves = recorded(path);
    EXPECT_EQ(slaves[0].times.port_ns[1] - slaves[0].times.port_ns[0], 600U);
    EXPECT_EQ(slaves[1].times.port_ns[1] - slaves[1].times.port_ns[0], 310U);
    EXPECT_FALSE(slaves[1].has_clock);
    EXPECT_EQ(slaves[2].written_delay_ns, 300U);

    for (const std::uint16_t processing : {std::uint16_t{0}, std::uint16_t{40}}) {
        const auto delays = computed(slaves, processing);
        EXPECT_EQ(delays[1], 145 + processing / 2);
        EXPECT_EQ(delays[2], 300 + processing / 2);
    }
}

// Two boards with a LAN9252, read by SOEM port by port. By hand: the frame was away from the first board for 0x1553D5C2
// - 0x1553D022 = 1440 ns, half of it one way, because either way has one processing unit: SOEM has written 720. Port 1
// of the second board is closed, and keeps an old time.
TEST(DelaysRecorded, OfBoardsWithMiiPorts) {
    const std::string path = std::string(MARGAY_CAPTURES_DIR) + "/soem-dual-lan9252.pcapng";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "no captures of real segments";
    const auto slaves = recorded(path, 0x1001);
    EXPECT_EQ(slaves[0].times.port_ns[1] - slaves[0].times.port_ns[0], 1440U);
    EXPECT_NE(slaves[1].times.port_ns[1], 0U);
    EXPECT_EQ(slaves[1].written_delay_ns, 720U);
    for (const std::uint16_t processing : {std::uint16_t{0}, std::uint16_t{40}})
        EXPECT_EQ(computed(std::span(slaves).first(2), processing)[1], 720);
}

// EK1100 and EL1004 (receive times at port 0, and no clock). By hand: 0xE5516266 - 0xE551613A = 300 ns, 150 one way.
TEST(DelaysRecorded, OfACouplerAndATerminal) {
    const std::string path = std::string(MARGAY_CAPTURES_DIR) + "/soem-sdinfo-ek1100-el1004.pcapng";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "no captures of real segments";
    const auto slaves = recorded(path, 0x1001);
    EXPECT_FALSE(slaves[1].has_clock);
    EXPECT_EQ(computed(std::span(slaves).first(2), 0)[1], 150);
}

// EK1100, EL2828 (receive times, no clock) and EL2889, by another master. By hand: the frame was away from the EK1100
// for 0x158AAEE0 - 0x158AAC92 = 590 ns, and from the EL2828 for 0x16361884 - 0x1636174E = 310 ns. One way to the EL2828
// is half of the difference, 140 ns; one way to the EL2889 is half of 590 ns. The master has written 0x127 = 295. With
// 20 ns more in a processing unit, the way out has one of them more than half of the time: 150 and 305.
TEST(DelaysRecorded, PastATerminalWithoutAClock) {
    const std::string path = std::string(MARGAY_CAPTURES_DIR) + "/replay-ek1100-el2828-el2889.pcapng";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "no captures of real segments";
    const auto slaves = recorded(path);
    EXPECT_FALSE(slaves[1].has_clock);
    EXPECT_EQ(slaves[2].written_delay_ns, 295U);
    const auto plain = computed(std::span(slaves).first(3), 0);
    EXPECT_EQ(plain[1], 140);
    EXPECT_EQ(plain[2], 295);
    const auto with_units = computed(std::span(slaves).first(3), 20);
    EXPECT_EQ(with_units[1], 150);
    EXPECT_EQ(with_units[2], 305);
}

// How much longer a frame needs through the processing unit than without it: in both recordings, the EL2889 turns the
// frame (through its processing unit), and the EL2828 forwards the same frame on its way back (without). The frame is
// away from the EL2828 for the way out, the turn and the way back; it is away from the EK1100 for the same time, and a
// way out, the forwarding and a way back more. Cables on the E-bus are equal, so twice the first time less the second
// one is the turn less the forwarding: 2 · 310 - 600 = 20 ns and 2 · 310 - 590 = 30 ns. The counters have steps of
// 10 ns.
TEST(DelaysRecorded, TheProcessingUnitOfRealSlaves) {
    std::int64_t sum = 0;
    for (const char* name : {"/replay-dc.pcapng", "/replay-ek1100-el2828-el2889.pcapng"}) {
        const std::string path = std::string(MARGAY_CAPTURES_DIR) + name;
        if (!std::filesystem::exists(path)) GTEST_SKIP() << "no captures of real segments";
        const auto slaves = recorded(path);
        const auto away = [&](std::size_t n) { return slaves[n].times.port_ns[1] - slaves[n].times.port_ns[0]; };
        sum += 2 * std::int64_t{away(1)} - std::int64_t{away(0)};
    }
    EXPECT_EQ(sum, 20 + 30);
    const auto et1200 = sim::et1200();  // what the simulation and, for its chip type, the master take
    const Duration modelled = et1200.processing_delay - et1200.forwarding_delay;  // the master takes the same
    EXPECT_NEAR(static_cast<double>(sum) / 2, static_cast<double>(modelled.count()), 10);
}

}  // namespace
}  // namespace margay
