// The program virtual_segment, over a cable to a master in another namespace. It gets commands on its standard input
// and signals while it runs. It reports masters and events, records frames, and serves a TAP device.
#include <places.hpp>
#include "netns.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <utility>

namespace margay::process {
namespace {

using namespace std::chrono_literals;

const std::string kSlaveinfo = std::string(MARGAY_BIN_DIR) + "/slaveinfo";
const std::string kSimpleIo = std::string(MARGAY_BIN_DIR) + "/simple_io";
const std::string kVirtualSegment = std::string(MARGAY_BIN_DIR) + "/virtual_segment";

struct VirtualSegmentTest : testing::Test {
    Cable cable;
    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("margay-virtual-segment-" + std::to_string(::getpid()));
    int commands = -1;

    void SetUp() override {
        if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
        if (!std::filesystem::exists(kVirtualSegment)) GTEST_SKIP() << kVirtualSegment << " is not built";
        std::filesystem::create_directories(folder);
        ASSERT_EQ(::mkfifo(file("commands").c_str(), 0600), 0);
        commands = ::open(file("commands").c_str(), O_RDWR | O_CLOEXEC);
        ASSERT_GE(commands, 0);
    }
    ~VirtualSegmentTest() override {
        if (commands >= 0) ::close(commands);
        std::error_code ignored;
        std::filesystem::remove_all(folder, ignored);
    }
    std::string file(const std::string& name) const { return folder / name; }

    // The command that starts the program: its standard input is a pipe of the test, and a file gets its process id.
    std::vector<std::string> serve(const std::string& arguments) const {
        return {"/bin/sh", "-c",
                "echo $$ > " + file("pid") + "; exec " + kVirtualSegment + " " + arguments + " < " + file("commands")};
    }
    void command(const std::string& text) const {
        const auto line = text + "\n";
        ASSERT_EQ(::write(commands, line.data(), line.size()), static_cast<ssize_t>(line.size()));
    }
    void signal(int number) const {
        pid_t id = 0;
        std::ifstream(file("pid")) >> id;
        ASSERT_GT(id, 1);
        ASSERT_EQ(::kill(id, number), 0);
    }
    std::string run_master(std::vector<std::string> arguments) {
        Child child(cable.master_namespace(), arguments);
        (void)child.wait(60s);
        return child.output() + child.errors();
    }
    std::string found() {
        const auto all = run_master({kSlaveinfo, Cable::kMaster});
        return all.substr(0, all.find('\n'));
    }
};

TEST_F(VirtualSegmentTest, ObeysCommandsAndSignalsWhileItRuns) {
    Child segment(cable.segment_namespace(), serve(std::string(Cable::kSegment) + " sim:demo"));
    ASSERT_TRUE(segment.says("serving 5 slaves on", 20s)) << segment.errors();
    EXPECT_EQ(found(), "5 slaves found");
    EXPECT_TRUE(segment.says("frames from ", 5s)) << "who";
    EXPECT_TRUE(segment.says("slave 2 (inputs): PREOP", 5s)) << segment.output();

    command("break 3");
    ASSERT_TRUE(segment.says("the cable at port 0 of slave 3 is broken", 5s));
    EXPECT_EQ(found(), "2 slaves found");
    command("heal 3");
    ASSERT_TRUE(segment.says("the cable at port 0 of slave 3 is connected", 5s));
    command("power off setting");
    ASSERT_TRUE(segment.says("slave 5 is off", 5s));
    EXPECT_EQ(found(), "4 slaves found");
    command("power on 5");
    ASSERT_TRUE(segment.says("slave 5 is on", 5s));
    EXPECT_EQ(found(), "5 slaves found");
    signal(SIGUSR1);
    ASSERT_TRUE(segment.says("the cable at port 0 of slave 5 is broken", 5s));
    EXPECT_EQ(found(), "4 slaves found");
    signal(SIGUSR2);
    ASSERT_TRUE(segment.says("all cables are connected", 5s));
    EXPECT_EQ(found(), "5 slaves found");

    command("drop 1");
    ASSERT_TRUE(segment.says("1 of all frames are lost", 5s));
    EXPECT_NE(found(), "5 slaves found");
    command("drop 0");
    ASSERT_TRUE(segment.says("0 of all frames are lost", 5s));
    command("drift 1 20ppm");
    ASSERT_TRUE(segment.says("the clock of slave 1 is off by 20000 ppb", 5s));
    command("get 1 0x0000 2");
    ASSERT_TRUE(segment.says("11 00", 5s));
    command("fly 3");
    ASSERT_TRUE(segment.says("'fly' is an unknown command", 5s));
    command("break 9");
    ASSERT_TRUE(segment.says("there is no slave '9'; they are 1 to 5", 5s));
    command("states");
    ASSERT_TRUE(segment.says("measuring", 5s));
    command("quit");
    EXPECT_EQ(segment.wait(10s), 0) << segment.errors();
    EXPECT_NE(segment.output().find("frames answered, "), std::string::npos);
}

TEST_F(VirtualSegmentTest, BringsAMasterToOpAndShowsItsData) {
    Child segment(cable.segment_namespace(), serve(std::string(Cable::kSegment) + " demo"));
    ASSERT_TRUE(segment.says("serving 5 slaves on", 20s)) << segment.errors();
    Child master(cable.master_namespace(), {kSimpleIo, Cable::kMaster, "--cycles", "100000", "--period", "2000"});
    ASSERT_TRUE(segment.says("slave 3 (outputs): OP", 30s)) << segment.output() << master.errors();
    command("set inputs 0 0x5a");
    EXPECT_TRUE(segment.says("5a", 5s));
    // The master writes a counter to the outputs: they change after some time.
    command("get outputs out");
    master.terminate();
    (void)master.wait(20s);
    command("quit");
    EXPECT_EQ(segment.wait(10s), 0) << segment.errors();
}

// Lengths of the frames in a pcap file, and whether a slave marked each frame.
std::vector<std::pair<std::size_t, bool>> frames_in(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    const std::string all{std::istreambuf_iterator<char>(in), {}};
    const auto octet = [&](std::size_t at) { return std::size_t{static_cast<unsigned char>(all.at(at))}; };
    std::vector<std::pair<std::size_t, bool>> frames;
    for (std::size_t at = 24; at + 16 <= all.size();) {
        const auto length = octet(at + 8) | octet(at + 9) << 8;
        frames.emplace_back(length, (octet(at + 16 + 6) & 2) != 0);
        at += 16 + length;
    }
    return frames;
}

TEST_F(VirtualSegmentTest, RecordsRequestsAndAnswers) {
    Child segment(cable.segment_namespace(),
                  serve(std::string(Cable::kSegment) + " demo --quiet --record " + file("served.pcap")));
    ASSERT_TRUE(segment.says("serving 5 slaves on", 20s)) << segment.errors();
    const auto seen = run_master({kSlaveinfo, Cable::kMaster});
    signal(SIGTERM);
    EXPECT_EQ(segment.wait(10s), 0) << segment.errors();
    EXPECT_EQ(segment.output().find("frames from "), std::string::npos) << "quiet";
    EXPECT_NE(seen.find("5 slaves found"), std::string::npos) << seen;
    const auto frames = frames_in(file("served.pcap"));
    ASSERT_GT(frames.size(), 50u);
    ASSERT_EQ(frames.size() % 2, 0u);
    for (std::size_t n = 0; n < frames.size(); n += 2) {
        EXPECT_EQ(frames[n + 1], std::pair(frames[n].first, true)) << n << ": the answer behind its request";
        EXPECT_FALSE(frames[n].second) << n;
    }
}

// Real time: the test lasts a second.
TEST_F(VirtualSegmentTest, WaitsQuietlyForAMaster) {
    Child segment(cable.segment_namespace(), serve(std::string(Cable::kSegment) + " demo --quiet"));
    ASSERT_TRUE(segment.says("serving 5 slaves on", 20s)) << segment.errors();
    const auto ticks = [&] {
        pid_t id = 0;
        std::ifstream(file("pid")) >> id;
        std::ifstream in("/proc/" + std::to_string(id) + "/stat");
        std::string word;
        long total = 0;
        for (int field = 1; field <= 15 && in >> word; ++field)
            if (field >= 14) total += std::stol(word);  // CPU time in user mode and in system mode
        return total;
    };
    const auto before = ticks();
    EXPECT_FALSE(segment.says("something that it never says", 1s));
    EXPECT_LT(ticks() - before, ::sysconf(_SC_CLK_TCK) / 10);
    command("quit");
    EXPECT_EQ(segment.wait(10s), 0) << segment.errors();
}

TEST_F(VirtualSegmentTest, EndsWhenNobodyReadsItsOutput) {
    const auto to_full = serve(std::string(Cable::kSegment) + " demo > /dev/full");
    Child segment(cable.segment_namespace(), to_full);
    EXPECT_EQ(segment.wait(20s), 3);
    EXPECT_NE(segment.errors().find("standard output cannot be written"), std::string::npos) << segment.errors();
}

TEST_F(VirtualSegmentTest, NamesItselfWhenTheRecordingIsLost) {
    Child segment(cable.segment_namespace(), serve(std::string(Cable::kSegment) + " demo --record /dev/full"));
    ASSERT_TRUE(segment.says("serving 5 slaves on", 20s)) << segment.errors();
    EXPECT_EQ(found(), "5 slaves found");
    command("quit");
    EXPECT_EQ(segment.wait(10s), 3);
    EXPECT_NE(segment.errors().find("virtual_segment: recording to /dev/full: "), std::string::npos)
        << segment.errors() << segment.output();
}

TEST_F(VirtualSegmentTest, ServesATapDevice) {
    if (!std::filesystem::exists("/dev/net/tun")) GTEST_SKIP() << "there is no /dev/net/tun";
    Child segment(cable.master_namespace(), serve("ecat-tap demo --tap"));
    if (!segment.says("serving 5 slaves on", 10s)) GTEST_SKIP() << segment.output() << segment.errors();
    (void)cable.ip(cable.master_namespace(), "link set ecat-tap up");
    EXPECT_NE(run_master({kSlaveinfo, "ecat-tap"}).find("5 slaves found"), std::string::npos);
    command("quit");
    EXPECT_EQ(segment.wait(10s), 0) << segment.errors();
}

// A ring: the master has two interfaces at one side, virtual_segment has two interfaces at the other side.
struct VirtualRingTest : VirtualSegmentTest {
    const std::string both = std::string(Cable::kMaster) + "+ecat-m2";
    const std::string both_ends = std::string(Cable::kSegment) + "+ecat-s2 ";

    void SetUp() override {
        VirtualSegmentTest::SetUp();
        if (IsSkipped()) return;
        const auto& master = cable.master_namespace();
        ASSERT_TRUE(
            cable.ip(master, "link add ecat-m2 type veth peer name ecat-s2 netns " + cable.segment_namespace()));
        ASSERT_TRUE(cable.ip(master, "link set ecat-m2 up"));
        ASSERT_TRUE(cable.ip(cable.segment_namespace(), "link set ecat-s2 up"));
        std::ofstream(file("ring.toml")) << "ring = { slave = \"last\", port = 1 }\n"
                                            "[[slave]]\ndevice = \"junction\"\ncount = 3\n"
                                            "[[slave]]\nname = \"last\"\ndevice = \"digital_io_16\"\n";
    }
};

TEST_F(VirtualRingTest, AMasterWithTwoInterfacesFindsAllSlavesWithAnyCableOut) {
    Child segment(cable.segment_namespace(), serve(both_ends + file("ring.toml")));
    ASSERT_TRUE(segment.says("serving 4 slaves on", 10s)) << segment.errors();
    const auto found = [&] { return run_master({kSlaveinfo, both, "--take-over"}); };
    EXPECT_NE(found().find("4 slaves found"), std::string::npos);
    command("break 3");
    ASSERT_TRUE(segment.says("3", 10s));
    EXPECT_NE(found().find("4 slaves found"), std::string::npos);
    command("heal all");
    ASSERT_TRUE(cable.ip(cable.segment_namespace(), "link set ecat-s2 down"));
    ASSERT_TRUE(segment.says("ecat-s2: the cable is out", 10s));
    EXPECT_NE(found().find("4 slaves found"), std::string::npos);
    ASSERT_TRUE(cable.ip(cable.segment_namespace(), "link set ecat-s2 up"));
    ASSERT_TRUE(segment.says("ecat-s2: the cable is plugged in", 10s));
    EXPECT_NE(run_master({kSimpleIo, both, "--take-over", "--cycles", "200"}).find("OP"), std::string::npos);
    command("quit");
    EXPECT_EQ(segment.wait(10s), 0) << segment.errors();
}

// Mistakes with the two interfaces of a ring: the program prints an error or a warning.
TEST_F(VirtualRingTest, WhatIsWrongWithTwoInterfacesIsTold) {
    const auto& name_space = cable.master_namespace();
    const auto told = [&](const std::string& interfaces, int status) {
        Child child(name_space, {kSlaveinfo, interfaces, "--take-over"});
        EXPECT_EQ(child.wait(60s), status) << child.output() << child.errors();
        return child.output() + child.errors();
    };
    const auto says = [](const std::string& text, const std::string& part) {
        EXPECT_NE(text.find(part), std::string::npos) << text;
    };
    const std::string swapped = "ecat-m2+" + std::string(Cable::kMaster);
    says(told("ecat-m+nosuch", 3), "there is no interface \"nosuch\"");
    says(told("ecat-m+ecat-m", 3), "both interfaces are the same, a ring needs two");
    ASSERT_TRUE(cable.ip(name_space, "link set ecat-m2 down"));
    says(told(both, 3), "interface ecat-m2: it is switched off; bring it up with: ip link set ecat-m2 up");
    ASSERT_TRUE(cable.ip(name_space, "link set ecat-m2 up"));
    {
        Child segment(cable.segment_namespace(), serve(both_ends + file("ring.toml")));
        ASSERT_TRUE(segment.says("serving 4 slaves on", 10s)) << segment.errors();
        const auto whole = told(both, 0);
        says(whole, "4 slaves found");
        EXPECT_EQ(whole.find("warning: the"), std::string::npos) << whole;
        says(told(swapped, 0), "warning: the cables of the two interfaces are interchanged");
        command("break 1");  // before the first slave
        ASSERT_TRUE(segment.says("1", 10s));
        says(told(both, 0), "warning: the ring is not closed: the first interface reaches no slave");
        command("heal all");
        command("break 3");
        says(told(both, 0), "warning: the ring is broken: the first interface reaches 2 slaves, the second one 2");
        command("heal all");
        ASSERT_TRUE(cable.ip(cable.segment_namespace(), "link set ecat-s2 down"));
        ASSERT_TRUE(segment.says("ecat-s2: the cable is out", 10s));
        const auto out = told(both, 0);
        says(out, "4 slaves found");
        says(out, "warning: the ring is not closed: the second interface reaches no slave");
        says(run_master({kSimpleIo, both, "--take-over", "--cycles", "20"}),
             "warning: the ring is not closed: the second interface reaches no slave");
        ASSERT_TRUE(cable.ip(cable.segment_namespace(), "link set ecat-s2 up"));
        command("quit");
        EXPECT_EQ(segment.wait(10s), 0) << segment.errors();
    }
    Child one(cable.segment_namespace(), serve(std::string(Cable::kSegment) + " demo"));
    ASSERT_TRUE(one.says("serving", 10s)) << one.errors();
    Child other(cable.segment_namespace(), {kVirtualSegment, "ecat-s2", "drives"});
    ASSERT_TRUE(other.says("serving", 10s)) << other.errors();
    says(told(both, 1), "another segment is connected to the second one");
}

TEST_F(VirtualRingTest, OneInterfaceServesARingWithTheOtherCableOut) {
    Child segment(cable.segment_namespace(), serve(std::string(Cable::kSegment) + " " + file("ring.toml")));
    ASSERT_TRUE(segment.says("second end of the ring is out", 10s)) << segment.errors();
    EXPECT_NE(run_master({kSlaveinfo, Cable::kMaster}).find("4 slaves found"), std::string::npos);
    command("quit");
    EXPECT_EQ(segment.wait(10s), 0) << segment.errors();
}

TEST_F(VirtualRingTest, WhatIsWrongIsTold) {
    const auto told = [&](const std::string& arguments) {
        Child child(cable.segment_namespace(), serve(arguments));
        EXPECT_EQ(child.wait(20s), 3) << child.output();
        return child.errors();
    };
    EXPECT_NE(told(both_ends + "demo").find("the segment has one end"), std::string::npos);
    EXPECT_NE(told("ecat-s2+ecat-s2 " + file("ring.toml")).find("both interfaces are the same"), std::string::npos);
    EXPECT_NE(told("ecat-s2+ " + file("ring.toml")).find("missing beside '+'"), std::string::npos);
}

TEST_F(VirtualSegmentTest, WhatIsWrongIsTold) {
    const auto told = [&](const std::string& arguments) {
        Child child(cable.segment_namespace(), serve(arguments));
        EXPECT_EQ(child.wait(20s), 3) << child.output();
        return child.errors();
    };
    EXPECT_NE(told("no-such-if demo").find("no-such-if"), std::string::npos);
    EXPECT_NE(
        told(std::string(Cable::kSegment) + " nothing.toml").find("cannot read the segment description 'nothing.toml'"),
        std::string::npos);
    std::ofstream(file("bad.toml")) << "[[slave]]\ndevice = \"toaster\"\n";
    EXPECT_NE(told(std::string(Cable::kSegment) + " " + file("bad.toml"))
                  .find("bad.toml: line 2: there is no device 'toaster'"),
              std::string::npos);
}

}  // namespace
}  // namespace margay::process
