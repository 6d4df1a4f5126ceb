// What margayd offers to ethercat beside facts and slaves: a rescan, the level of its messages, its EoE ports.
#include "service/service_fixture.hpp"

#include <algorithm>
#include <fstream>

namespace margay::process {
namespace {

TEST_F(ServiceTest, ARescanDoesNotEndTheProcessData) {
    configure("a.toml", "source = \"sim:demo\"\n");
    configure("b.toml", "source = \"sim:demo\"\nsocket = { read_only = true }\n");
    const auto ran = shell(
        "start; says 'a: all is right'; says 'b: all is right'\n"
        "n=0; while [ $n -lt 10 ]; do e a rescan || exit 1; n=$((n+1)); done; e a rescan --verbose; e a slaves -p 4\n"
        "e b rescan; echo \"refused $?\"; stop\n");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(ran.out.starts_with("5 slaves; compared with those of the application, whose process data goes on\n"))
        << ran.out;
    EXPECT_TRUE(contains(ran.out, "  OP  +")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "refused 1\n")) << ran.out;
    EXPECT_EQ(ran.err, "ethercat: the application allows reading only\n");
    const auto log = content_of(folder.path() / "log");
    EXPECT_FALSE(contains(log, "not all is right")) << log;
    EXPECT_FALSE(contains(log, "scanned again")) << log;
    const auto found = log.find("a: 5 slaves found");
    EXPECT_EQ(log.find("a: 5 slaves found", found + 1), std::string::npos) << log;
}

// A client writes another assignment of PDOs: the slave does not fit the image any more.
TEST_F(ServiceTest, ASlaveWithOtherPdosLeadsToANewScan) {
    configure("a.toml", "source = \"sim:drives\"\ncycle_us = 4000\n");
    const auto ran = shell(
        "start; says 'a: all is right: 8 slaves in OP'; e a states -p 5 PREOP; says 'slave 6: OP to PREOP'\n"
        "e a states -p 1 PREOP; says 'slave 2: OP to PREOP'\n"
        "e a download -p 1 -t uint8 0x1c13 0 0 && e a download -p 1 -t uint16 0x1c13 1 0x1a01 &&\n"
        "e a download -p 1 -t uint8 0x1c13 0 1 || exit 9\n"
        "sleep 4; grep -c 'scanned again' log; e a states -p 1 OP 2>refused\n"
        "says 'other PDOs than when it was laid out: the segment is scanned again'\n"
        "says 'slave 6 (Pulse train axis) is kept in PREOP: a client has set it'\n"
        "says 'slave 2: SAFEOP to OP'; e a states -p 1 OP; e a slaves -p 1,5; stop\n");
    const auto log = content_of(folder.path() / "log");
    EXPECT_EQ(ran.status, 0) << ran.err << log;
    EXPECT_EQ(ran.out, "0\n1  0:1  OP     +  Servo drive\n5  0:5  PREOP  +  Pulse train axis\n")
        << "a slave that shall be in PREOP stays there\n"
        << log;
    EXPECT_FALSE(contains(log, "slave 6: SAFEOP to PREOP")) << "it is not started before\n" << log;
}

TEST_F(ServiceTest, ARescanNamesWhatIsMissing) {
    const auto written = folder.run(std::string(MARGAY_BIN_DIR) +
                                    "/slaveinfo sim:coupler,digital_in_8,digital_out_8 --write-eni etc/machine.xml");
    ASSERT_EQ(written.status, 0) << written.err;
    configure("a.toml", "source = \"sim:coupler,digital_in_8\"\neni = \"machine.xml\"\ntolerate = [\"missing\"]\n");
    const auto ran = shell(
        "start; says 'a: all is right: 2 slaves in OP'; e a rescan --json; e a rescan --quiet 2>quiet; e a rescan; "
        "stop\n");
    EXPECT_EQ(ran.status, 0) << ran.err << content_of(folder.path() / "log");
    EXPECT_TRUE(contains(ran.out, "\"slaves\": 2,\n      \"scanned\": false,\n      \"missing\": 1,")) << ran.out;
    EXPECT_TRUE(contains(ran.err, "1 expected slave does not answer\n")) << ran.err;
    EXPECT_EQ(content_of(folder.path() / "quiet"), "");
}

// Attached to margayd, `slaves` prints the flag E and a warning with the reason of the error. Its exit code is 1. The
// warning is printed once.
TEST_F(ServiceTest, ASlaveWithAnErrorIsNamed) {
    std::ofstream(folder.path() / "b.toml")
        << "[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = \"digital_in_8\"\nsii_status = 0x2000\n";
    configure("a.toml", "source = \"sim:" + (folder.path() / "b.toml").string() + "\"\n");
    const auto ran = shell(
        "start; says 'a: slave 1: SAFEOP to OP'; e a slaves; echo \"ends $?\"; e a slaves -q 2>quiet; wc -c <quiet\n"
        "stop\n");
    EXPECT_TRUE(contains(ran.out, "  E  ")) << ran.out << content_of(folder.path() / "log");
    EXPECT_TRUE(ran.out.ends_with("ends 1\n" + ran.out.substr(0, ran.out.find("ends 1\n")) + "0\n")) << ran.out;
    EXPECT_TRUE(ran.err.starts_with("ethercat: warning: position 1: ")) << ran.err;
    EXPECT_EQ(std::ranges::count(ran.err, '\n'), 1) << ran.err;
}

TEST_F(ServiceTest, TheLevelOfMessagesChangesWhileItRuns) {
    configure("a.toml", "source = \"sim:demo\"\n");
    configure("b.toml", "source = \"sim:demo\"\ndebug = 0\n");
    const auto ran = shell(
        "start; says 'a: all is right'; says 'b: 5 slaves found'; grep -c 'frames:' log; e a debug 2; says 'a: frames: "
        "'\n"
        "e a debug 1 --json; e b debug 9; echo \"refused $?\"\n"
        // The key of the file, by a reload that starts no master again.
        "sed -i 's/debug = 0/debug = 2/' etc/b.toml; kill -HUP $d\n"
        "says 'configuration reloaded: 0 masters started, 2 in all'; says 'b: frames: [0-9]* sent, '; stop\n");
    EXPECT_EQ(ran.status, 0) << ran.err << content_of(folder.path() / "log");
    EXPECT_TRUE(ran.out.starts_with("0\n{")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "\"level\": 1,\n      \"slaves\": 5")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "refused 2\n")) << ran.out;
    const auto log = content_of(folder.path() / "log");
    EXPECT_FALSE(contains(log, "b: all is right")) << log;
    EXPECT_FALSE(contains(log, "b: ends")) << log;
}

// The test has a network namespace with its own interfaces.
TEST_F(ServiceTest, TheEoePortsAreShownWithTheirInterfaces) {
    if (!std::filesystem::exists("/dev/net/tun")) GTEST_SKIP() << "no TAP devices here: /dev/net/tun is missing";
    if (folder.run("unshare --net ip link set lo up").status != 0) GTEST_SKIP() << "no network namespaces here";
    configure("a.toml", "source = \"sim:eoe\"\neoe = [{ position = 1, name = \"gw-of-line\" }, { position = 2 }]\n");
    folder.write("commands",
                 functions() +
                     "start; says 'a: all is right'; e a eoe --interval 50; echo again\n"
                     // The kernel asks for the address by ARP: broadcasts for the slave.
                     "ip addr add 192.168.78.1/24 dev gw-of-line; n=0\n"
                     "until e a eoe --interval 10 --json | grep -q '\"sent_frames\": [1-9]'; do\n"
                     "  bash -c 'echo > /dev/udp/192.168.78.2/9'; n=$((n+1)); [ $n -lt 100 ] || exit 97; done\n"
                     "e a eoe --interval 50; stop\n");
    const auto ran = folder.run("unshare --net sh commands");
    EXPECT_EQ(ran.status, 0) << ran.err << ran.out << content_of(folder.path() / "log");
    EXPECT_TRUE(ran.out.starts_with("Interface   Slave  State  RxBytes  RxRate  TxBytes  TxRate  Dropped\n"))
        << ran.out;
    EXPECT_TRUE(contains(ran.out, "\ngw-of-line      1  up    ")) << ran.out;
    EXPECT_TRUE(contains(ran.out, "\neoe0s2          2  up    ")) << ran.out;
}

}  // namespace
}  // namespace margay::process
