// Recordings of a ring with two NICs. A replay shows the same segment to the same program, including the breaks.
#include "oshw/filters/drop_nic.hpp"
#include "oshw/pcap/packet_reader.hpp"
#include "oshw/pcap/replay.hpp"
#include "oshw/pcap/ring_recorder.hpp"
#include "redundancy/ring_bus.hpp"
#include "replay/files.hpp"

#include <cstdlib>

namespace margay {
namespace {

constexpr unsigned kCycles = 400;

// The observations of a program in a ring: the inputs of each cycle, the state of the ring, and all events.
std::vector<std::string> run_program(Nic& nic, Nic& second, VirtualOsal& osal,
                                     const std::function<void(unsigned)>& before_cycle) {
    std::vector<std::string> seen;
    std::vector<std::byte> image(1024);
    HostContext ctx(RingBus::limits());
    SuperviseRequest supervision;
    if (const auto ready = init_redundant(ctx, nic, second, osal); !ready) return {RingBus::words(ready.error())};
    if (const auto found = config_init(ctx); !found) return {RingBus::words(found.error())};
    if (const auto mapped = config_map(ctx, image); !mapped) return {RingBus::words(mapped.error())};
    if (const auto begun = submit(ctx, supervision); !begun) return {RingBus::words(begun.error())};
    for (unsigned cycle = 0; cycle < kCycles; ++cycle) {
        before_cycle(cycle);
        osal.advance(1ms);
        for (const Slave& slave : ctx.slaves())
            if (!slave.image.outputs.bytes.empty()) slave.image.outputs.bytes[0] = static_cast<std::byte>(cycle);
        (void)send_processdata(ctx);
        const auto wkc = receive_processdata(ctx, 500us);
        (void)poll(ctx, osal.now());
        std::string line = std::to_string(cycle) + (wkc ? " wkc " + std::to_string(*wkc) : " error");
        for (const Slave& slave : ctx.slaves()) {
            line += " " + std::to_string(static_cast<int>(slave.al.state)) + ":";
            for (const std::byte octet : slave.image.inputs.bytes)
                line += std::to_string(std::to_integer<int>(octet)) + ",";
        }
        const auto status = redundancy(ctx);
        line += " ring " + std::to_string(static_cast<int>(status.ring)) + " " +
                std::to_string(status.cables[0].slaves) + "+" + std::to_string(status.cables[1].slaves) + " links " +
                std::to_string(static_cast<int>(status.cables[0].link)) +
                std::to_string(static_cast<int>(status.cables[1].link));
        seen.push_back(line);
        while (const auto event = ctx.events().take()) {
            std::array<char, 256> text{};
            seen.emplace_back(describe(*event, text));
        }
    }
    supervision.cancel();
    return seen;
}

struct RingRecording : testing::Test {
    TemporaryFolder folder;

    // Runs the program on a ring whose cables break and heal, and records it.
    std::vector<std::string> record(const std::string& path, std::uint32_t loss, bool absent_at_the_start = false) {
        RingBus bus;
        bus.build_line(5);
        bus.plug();
        DropNic one(*bus.nics[0], {.seed = 1, .received = Rate::percent(loss)});
        DropNic two(*bus.nics[1], {.seed = 2, .received = Rate::percent(loss)});
        PcapRingRecorder recorder(one, two, bus.osal);
        EXPECT_TRUE(recorder.open(path).ok()) << recorder.problem();
        if (absent_at_the_start) bus.cable(bus.ring_cables.back(), false);
        const auto seen = run_program(recorder.first(), recorder.second(), bus.osal, [&bus](unsigned cycle) {
            for (std::size_t n = 1; n <= 5; ++n)
                if (auto inputs = bus.io(n)->inputs(); !inputs.empty()) {
                    inputs[0] = static_cast<std::byte>(cycle + n);
                    bus.io(n)->poke();
                }
            bus.segment.advance(bus.osal.now());
            if (cycle == 150) bus.cable(bus.ring_cables[2], false);
            if (cycle == 220) bus.cable(bus.ring_cables[2], true);
            if (cycle == 280) bus.cable(bus.ring_cables[5], false);  // the cable of the second NIC
            if (cycle == 340) bus.cable(bus.ring_cables[5], true);
        });
        EXPECT_TRUE(recorder.close().ok()) << recorder.problem();
        return seen;
    }
    static std::vector<std::string> replay(const std::string& path) {
        VirtualOsal osal;
        PcapReplayNic first(osal);
        PcapReplayNic second(osal);
        EXPECT_TRUE(first.load_ring(path, second).ok()) << first.problem() << second.problem();
        auto seen = run_program(first, second, osal, [](unsigned) {});
        EXPECT_EQ(first.problem(), "");
        EXPECT_EQ(second.problem(), "");
        return seen;
    }
    static void expect_equal(const std::vector<std::string>& recorded, const std::vector<std::string>& replayed) {
        ASSERT_GE(recorded.size(), kCycles) << RingBus::joined(recorded);
        for (std::size_t n = 0; n < std::min(recorded.size(), replayed.size()); ++n)
            ASSERT_EQ(recorded[n], replayed[n]) << n;
        EXPECT_EQ(recorded.size(), replayed.size());
    }
};

TEST_F(RingRecording, ShowsBreaksAndRepairsAgain) {
    const auto path = folder.file("ring.pcapng");
    const auto recorded = record(path, 0);
    const auto text = RingBus::joined(recorded);
    EXPECT_NE(text.find("redundancy"), std::string::npos);
    EXPECT_NE(text.find(" ring 2 2+3"), std::string::npos) << "two slaves before the break, three behind it";
    EXPECT_NE(text.find("links 21"), std::string::npos) << "the second NIC is down for a while";
    expect_equal(recorded, replay(path));
}

TEST_F(RingRecording, ShowsLostFramesAgain) {
    const auto path = folder.file("lossy.pcapng");
    const auto recorded = record(path, 3);
    expect_equal(recorded, replay(path));
}

TEST_F(RingRecording, ShowsAStartWithoutTheSecondCable) {
    const auto path = folder.file("one.pcapng");
    const auto recorded = record(path, 0, true);
    EXPECT_NE(RingBus::joined(recorded).find("the second NIC reaches no slave"), std::string::npos);
    expect_equal(recorded, replay(path));
}

TEST_F(RingRecording, TwoRunsWriteTheSameOctets) {
    (void)record(folder.file("a"), 2);
    (void)record(folder.file("b"), 2);
    EXPECT_GT(read_file(folder.file("a")).size(), 100'000U);
    EXPECT_TRUE(read_file(folder.file("a")) == read_file(folder.file("b")));
}

// Another program reads the format: interfaces, directions and comments of each packet.
TEST_F(RingRecording, TsharkReadsInterfacesAndDirections) {
    if (std::system("command -v tshark >/dev/null 2>&1") != 0) GTEST_SKIP() << "tshark is not installed";
    RingBus bus;
    bus.build_line(2);
    bus.plug();
    const auto path = folder.file("t.pcapng");
    PcapRingRecorder recorder(*bus.nics[0], *bus.nics[1], bus.osal);
    ASSERT_TRUE(recorder.open(path, 1'000'000s).ok());
    Frame frame(100);
    wire::FrameBuilder builder(frame, bus.nics[0]->source_mac());
    (void)builder.append(wire::Command::BRD, 1, {RingPosition{0}, 0x0130}, 2);
    frame.resize(builder.finish().size());
    Frame into(1518);
    ASSERT_EQ(recorder.first().send(frame), SendStatus::sent);
    bus.osal.advance(1ms + 7ns);
    ASSERT_NE(recorder.second().receive(into), 0U);
    bus.cable(bus.ring_cables.back(), false);
    ASSERT_EQ(recorder.second().send(frame), SendStatus::failed);
    ASSERT_TRUE(recorder.close().ok());
    const auto printed = folder.file("printed");
    const auto command = "tshark -n -r '" + path +
                         "' -T fields -e frame.time_epoch -e frame.interface_id -e frame.interface_name "
                         "-e frame.packet_flags_direction -e ecat.cmd -e frame.comment >'" +
                         printed + "' 2>/dev/null";
    ASSERT_EQ(std::system(command.c_str()), 0);
    EXPECT_EQ(read_file(printed),
              "1000000.000000000\t0\tfirst NIC\t0x00000002\t0x07\t\n"
              "1000000.001000007\t1\tsecond NIC\t0x00000001\t0x07\t\n"
              "1000000.001000007\t1\tsecond NIC\t0x00000002\t0x07\tnot accepted by the NIC\n");
}

TEST_F(RingRecording, TellsWhyAFileIsNoRing) {
    VirtualOsal osal;
    PcapReplayNic first(osal);
    PcapReplayNic second(osal);
    EXPECT_FALSE(first.load_ring(folder.file("no such"), second).ok());
    EXPECT_NE(first.problem().find("no such"), std::string::npos);
    Frame frame(60, std::byte{1});
    frame[0] = frame[6] = std::byte{0};
    frame[12] = std::byte{0x88};
    frame[13] = std::byte{0xA4};
    const auto one = folder.write("one.pcap", pcap_header() + pcap_packet(1, 0, frame));
    PcapReplayNic third(osal);
    EXPECT_FALSE(third.load_ring(one, second).ok());
    EXPECT_NE(third.problem().find("two NICs"), std::string::npos) << third.problem();
    PcapRingRecorder recorder(first, second, osal);
    EXPECT_FALSE(recorder.open(folder.file("no/such/folder")).ok());
    EXPECT_NE(recorder.problem().find("No such file"), std::string::npos) << recorder.problem();
}

TEST_F(RingRecording, AFullDiskIsNoSuccess) {
    if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
    RingBus bus;
    bus.build_line(2);
    bus.plug();
    PcapRingRecorder recorder(*bus.nics[0], *bus.nics[1], bus.osal);
    ASSERT_TRUE(recorder.open("/dev/full").ok());
    for (int n = 0; n < 100; ++n) (void)recorder.first().send(Frame(1000));
    EXPECT_FALSE(recorder.close().ok());
    EXPECT_NE(recorder.problem().find("not complete"), std::string::npos) << recorder.problem();
    EXPECT_TRUE(recorder.close().ok());
}

// With a damaged file the reader never reads beyond the end.
std::uint64_t packets_of(const std::string& path) {
    PacketReader reader;
    if (!reader.open(path)) return 0;
    while (reader.next()) {
    }
    return reader.packets();
}

TEST_F(RingRecording, DamagedFilesEndThePackets) {
    const auto path = folder.file("whole");
    (void)record(path, 0);
    const auto whole = read_file(path).substr(0, 4000);
    const auto all = packets_of(folder.write("w", whole));
    ASSERT_GT(all, 20U);
    for (std::size_t cut = 0; cut < whole.size(); cut += 37)
        EXPECT_LE(packets_of(folder.write("c", whole.substr(0, cut))), all);
    std::uint32_t random = 1;
    for (int n = 0; n < 300; ++n) {
        auto bad = whole;
        for (int k = 0; k < 5; ++k) {
            random = random * 1664525 + 1013904223;
            bad[(random >> 8) % bad.size()] = static_cast<char>(random >> 24);
        }
        EXPECT_LE(packets_of(folder.write("d", bad)), bad.size() / 12);
    }
}

}  // namespace
}  // namespace margay
