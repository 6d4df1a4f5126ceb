// The commands of ethercat about the segment: slaves, master, states, rescan, debug, crc, graph, alias, version.
#include "ethercat/ethercat_fixture.hpp"

#include <nlohmann/json.hpp>

namespace margay::process {
namespace {

using EthercatSegment = EthercatTest;

const std::string kAliases =
    "[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = \"digital_in_8\"\nalias = 5555\n[[slave]]\ndevice = "
    "\"digital_out_8\"\n[[slave]]\ndevice = \"analog_in_4\"\nalias = 16\n[[slave]]\ndevice = \"analog_out_2\"\n";

TEST_F(EthercatSegment, ListsSlavesInTheColumnsOfTheManual) {
    folder.write("a.toml", kAliases);
    EXPECT_EQ(out("sim:a.toml", "slaves"),
              "0     0:0  PREOP  +  EtherCAT coupler\n"
              "1  5555:0  PREOP  +  8-channel digital input\n"
              "2  5555:1  PREOP  +  8-channel digital output\n"
              "3    16:0  PREOP  +  4-channel analogue input\n"
              "4    16:1  PREOP  +  2-channel analogue output\n");
    // A script reads the fields.
    const auto fields = folder.run("export MARGAY_MASTER0=sim:a.toml; " + program +
                                   " slaves | awk '{ split($2, a, \":\"); print $1, a[1], a[2], $3, $4 }'");
    EXPECT_EQ(fields.out, "0 0 0 PREOP +\n1 5555 0 PREOP +\n2 5555 1 PREOP +\n3 16 0 PREOP +\n4 16 1 PREOP +\n");
}

TEST_F(EthercatSegment, SelectsByPositionAndAlias) {
    folder.write("a.toml", kAliases);
    const auto selected = [&](const std::string& options) {
        const auto text = out("sim:a.toml", "slaves " + options);
        std::string positions;
        for (std::size_t at = 0; at < text.size(); at = text.find('\n', at) + 1) positions += text[at];
        return positions;
    };
    EXPECT_EQ(selected(""), "01234");
    EXPECT_EQ(selected("-p 2"), "2");
    EXPECT_EQ(selected("--position=0,2-3"), "023");
    EXPECT_EQ(selected("-p0x1"), "1");
    EXPECT_EQ(selected("-p 3-"), "34");
    EXPECT_EQ(selected("-p -"), "01234");
    EXPECT_EQ(selected("-a 5555"), "12");
    EXPECT_EQ(selected("-a 5555,16"), "1234");
    EXPECT_EQ(selected("-a 5555 -p 0"), "1");
    EXPECT_EQ(selected("-a 5555 -p 1"), "2");
    EXPECT_EQ(selected("-a 5555 -p 2"), "3") << "a relative position may reach beyond the next alias";
    EXPECT_EQ(selected("-a 0 -p 4"), "4");
    fails("sim:a.toml", "slaves -p 9", 1, "no slave of master 0 is selected by --position 9");
    fails("sim:a.toml", "slaves -a 7", 1, "no slave of master 0 is selected by --alias 7");
    // Each element of a list selects a slave, or the call fails before it does a part of its work.
    fails("sim:demo", "slaves -p 1,77", 1, "no slave of master 0 is selected by --position 77");
    fails("sim:demo", "slaves -p 0-2,7-9", 1, "no slave of master 0 is selected by --position 7-9");
    fails("sim:demo", "slaves -a 0,7", 1, "no slave of master 0 is selected by --alias 7");
    EXPECT_EQ(ethercat("sim:demo", "slaves -p 3-100").status, 0) << "a range may reach beyond the last slave";
    fails("sim:a.toml", "slaves -p x", 2, "--position: 'x' is no number, list or range of numbers");
    fails("sim:a.toml", "slaves -p 3-1", 2, "--position: '3-1'");
}

TEST_F(EthercatSegment, TellsWhatIsKnownOfASlave) {
    const auto text = out("sim:tree", "slaves -v -p 3");
    EXPECT_TRUE(
        text.starts_with("=== Master 0, Slave 3 ===\nAlias: 0\nStation address: 0x1004\nState: PREOP\nFlag: +\n"))
        << text;
    EXPECT_TRUE(contains(text, "  Vendor Id:       0x00004d47\n")) << text;
    EXPECT_TRUE(contains(text, "  Device name: EtherCAT coupler\n")) << text;
    EXPECT_TRUE(contains(text, "\n   0  MII   up    open    yes             1  ")) << text;
    EXPECT_TRUE(contains(text, "\n   1  EBUS  up    open    yes             4  ")) << text;
    EXPECT_TRUE(contains(text, "\n   2  MII   down  closed  no              -            -          -\n")) << text;
    EXPECT_TRUE(contains(text, "Distributed clocks: yes, 64 bit")) << text;
    const auto json = out("sim:tree", "slaves -v -p 3 --json");
    EXPECT_TRUE(contains(json, "\"order\": \"")) << json;
    EXPECT_TRUE(contains(json, "\"delay_ns\": ")) << json;
}

TEST_F(EthercatSegment, MarksASlaveWhoseScanFailed) {
    folder.write("blank.bin", std::string(1024, '\xFF'));
    folder.write("b.toml", "[[slave]]\ndevice = \"coupler\"\n[[slave]]\nsii = \"blank.bin\"\n");
    const auto ran = ethercat("sim:b.toml", "slaves");
    EXPECT_EQ(ran.status, 1);
    EXPECT_TRUE(contains(ran.out, "  E  0x")) << ran.out;
    EXPECT_TRUE(contains(ran.err, "ethercat: warning: position 1: ")) << ran.err;
    EXPECT_EQ(ethercat("sim:b.toml", "slaves -q").err, "");
}

// When the EEPROM of one slave cannot be read, the commands still show the other slaves, and the known facts of this
// slave.
TEST_F(EthercatSegment, ShowsTheOthersBesideASlaveWhoseEepromCannotBeRead) {
    folder.write("b.toml",
                 "[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = \"digital_in_8\"\nsii_status = 0x2000\n"
                 "[[slave]]\ndevice = \"drive\"\n");
    const std::string cause = "the EEPROM did not acknowledge";
    const auto details = ethercat("sim:b.toml", "slaves -v");
    EXPECT_EQ(details.status, 1);
    for (const std::string text : {"Slave 0 ===", "Slave 1 ===", "Slave 2 ===", "Flag: E\nProblem: ",
                                   "General: not known: position 1: ", "Device name: Servo drive"})
        EXPECT_TRUE(contains(details.out, text)) << text << "\n" << details.out;
    EXPECT_TRUE(contains(details.err, cause)) << details.err;
    const auto json = nlohmann::json::parse(ethercat("sim:b.toml", "slaves -v --json").out)["masters"][0];
    ASSERT_EQ(json["slaves"].size(), 3U);
    EXPECT_EQ(json["slaves"][1]["error"], true);
    EXPECT_FALSE(json["slaves"][1].contains("order"));
    EXPECT_EQ(json["slaves"][2]["name"], "Servo drive");
    const auto pdos = ethercat("sim:b.toml", "pdos");
    EXPECT_EQ(pdos.status, 1);
    EXPECT_TRUE(contains(pdos.out, "RxPDO 0x1600")) << "of the drive: " << pdos.out;
    EXPECT_TRUE(contains(pdos.err, cause)) << pdos.err;
    const auto listed = nlohmann::json::parse(ethercat("sim:b.toml", "pdos --json").out)["masters"][0]["slaves"];
    ASSERT_EQ(listed.size(), 3U);
    EXPECT_TRUE(contains(listed[1]["error"].get<std::string>(), cause)) << listed[1];
    EXPECT_EQ(listed[2]["position"], 2);
}

TEST_F(EthercatSegment, WorksOnSeveralMasters) {
    const std::string both = "--source sim:demo --source sim:drives ";
    EXPECT_EQ(out("", "slaves -p 0 " + both),
              "Master0\n0  0:0  PREOP  +  EtherCAT coupler\nMaster1\n0  0:0  PREOP  +  Servo drive\n");
    EXPECT_EQ(out("", "slaves -p 0 -m 1 " + both), "0  0:0  PREOP  +  Servo drive\n");
    const auto json = out("", "slaves -p 0 --json " + both);
    EXPECT_TRUE(contains(json, "\"master\": 1,")) << json;
    fails("", "slaves -p 0 -m 0,5 " + both, 2, "no master is selected by --master 5");
    fails("", "slaves -p 0 -m 1,4-6 " + both, 2, "no master is selected by --master 4-6");
    fails("", "slaves -m 5 " + both, 2, "no master is selected by --master 5: 2 masters have a source");
    fails("", "upload -p 0 0x1018 1 " + both, 2, "upload works on one master, and 2 are selected: use --master");
    fails("", "slaves --attach ''", 2, "--attach is empty");
    fails("", "slaves --source sim:demo --source ''", 2, "--source is empty");
    const auto none = folder.run("unset MARGAY_MASTER0; " + program + " slaves");
    EXPECT_EQ(none.status, 2);
    EXPECT_TRUE(contains(none.err, "ethercat: no source: use --source, or set MARGAY_MASTER0")) << none.err;
    EXPECT_TRUE(contains(none.err, "  sim:demo  ")) << none.err;
}

TEST_F(EthercatSegment, ShowsTheMaster) {
    const auto text = out("sim:demo", "master");
    EXPECT_TRUE(text.starts_with("Master0\n  Source: sim:demo\n  Phase: Idle\n  Active: no\n  Slaves: 5\n")) << text;
    EXPECT_TRUE(contains(text, "    Main: 00:4d:41:52:47:59\n      Link: UP\n")) << text;
    EXPECT_TRUE(contains(out("sim:demo", "master --json"), "\"slaves\": 5")) << text;
    fails("no-such-if", "master", 3, "there is no interface \"no-such-if\"");
    fails("sim:demo", "master x", 2, "unexpected argument 'x'; see ethercat master --help");
}

TEST_F(EthercatSegment, BringsSlavesToStates) {
    EXPECT_EQ(out("sim:demo", "states OP"), "");
    EXPECT_EQ(out("sim:demo", "states op -v"), "0  OP\n1  OP\n2  OP\n3  OP\n4  OP\n");
    EXPECT_EQ(out("sim:demo", "states SAFEOP -p 1,3 -v"), "1  SAFEOP\n3  SAFEOP\n");
    EXPECT_EQ(out("sim:demo", "states INIT -p 2 -v"), "2  INIT\n");
    folder.write("slow.toml", "round_trip_us = 1000\n[[slave]]\ndevice = \"drive\"\n");
    EXPECT_EQ(out("sim:slow.toml", "states OP -v"), "0  OP\n") << "a cycle takes longer than its period";
    EXPECT_EQ(out("sim:bootloader", "states BOOT -p 1 -v"), "1  BOOT\n");
    fails("sim:demo", "states BOOT -p 1", 1, "position 1: ");
    fails("sim:demo", "states FAST", 2, "'FAST' is no state: INIT, PREOP, BOOT, SAFEOP or OP");
    fails("sim:demo", "states", 2, "arguments are missing: states STATE; see ethercat states --help");
}

TEST_F(EthercatSegment, ScansAgainAndSetsItsMessages) {
    EXPECT_EQ(out("sim:demo", "rescan"), "");
    EXPECT_EQ(out("sim:demo", "rescan -v"), "5 slaves\n");
    EXPECT_EQ(out("sim:demo", "debug 1"), "");
    const auto traced = ethercat("sim:demo", "debug 2");
    EXPECT_EQ(traced.status, 0);
    EXPECT_TRUE(contains(traced.err, "BRD")) << "every datagram";
    fails("sim:demo", "debug 3", 2, "LEVEL: '3' is no whole number from 0 to 2");
    fails("sim:demo", "rescan --type bool", 2, "rescan has no option --type");
}

TEST_F(EthercatSegment, ShowsAndResetsErrorCounters) {
    folder.write("noisy.toml",
                 "noise = { corrupted = 0.2, seed = 3 }\n[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = "
                 "\"digital_in_8\"\ncount = 2\n");
    const auto text = out("sim:demo", "crc");
    EXPECT_EQ(text.substr(0, text.find("\n    1")),
              "      | Port 0          | Port 1          | Port 2          | Port 3\n"
              "Slave | CRC PHY FWD NXT | CRC PHY FWD NXT | CRC PHY FWD NXT | CRC PHY FWD NXT\n"
              "    0 |   0   0   0   - |   0   0   0   1 |   0   0   0   - |   -   -   -   -");
    EXPECT_EQ(out("sim:demo", "crc -p 4").substr(text.find("\n    0")),
              "\n    4 |   0   0   0   3 |   0   0   0   - |   0   0   0   - |   -   -   -   -\n");
    EXPECT_TRUE(contains(out("sim:demo", "crc -p 1 --json"), "\"next\": 2")) << "NXT";
    const auto watched = out("sim:demo", "crc -p 1 --watch --count 3 --interval 5");
    EXPECT_EQ(std::count(watched.begin(), watched.end(), '\n'), 9);
    EXPECT_EQ(out("sim:demo", "crc reset"), "");
    // Damaged frames are counted.
    const auto noisy = ethercat("sim:noisy.toml", "crc -p 0 --json");
    EXPECT_EQ(noisy.status, 0) << noisy.err;
    EXPECT_TRUE(contains(noisy.out, "\"crc\": ")) << noisy.out;
    EXPECT_FALSE(contains(noisy.out,
                          "\"crc\": 0,\n              \"phy\": 0,\n              \"forwarded\": 0,\n              "
                          "\"lost_links\": 0,\n              \"next\": 1"))
        << noisy.out;
    EXPECT_TRUE(contains(ethercat("sim:noisy.toml", "graph").out, "slave0 -> slave1 [color=\"orange\""));
    fails("sim:demo", "crc set", 2, "'set': crc has the argument reset, or none");
    fails("sim:demo", "crc --interval x", 2, "--interval: 'x' is no whole number");
}

TEST_F(EthercatSegment, DrawsTheTopology) {
    const auto tree = out("sim:tree", "graph");
    EXPECT_TRUE(tree.starts_with("digraph bus {\n")) << tree;
    EXPECT_TRUE(
        contains(tree, "    master -> slave0 [color=\"darkgreen\" label=\"MII\" taillabel=\"\" headlabel=\"0\"];\n"));
    EXPECT_TRUE(
        contains(tree, "    slave6 -> slave9 [color=\"darkgreen\" label=\"MII\" taillabel=\"2\" headlabel=\"0\"];\n"));
    EXPECT_TRUE(
        contains(tree, "    slave6 -> slave7 [color=\"darkgreen\" label=\"E-bus\" style=\"bold\" taillabel=\"1\""));
    const auto dc = out("sim:drives", "graph DC");
    EXPECT_TRUE(contains(dc, "PREOP\\nreference clock\"")) << dc;
    EXPECT_TRUE(contains(dc, "PREOP\\ndelay ")) << dc;
    EXPECT_TRUE(contains(out("sim:drives", "graph CRC"), "taillabel=\"1\\nCRC 0 PHY 0 FWD 0\""));
    EXPECT_TRUE(
        contains(out("sim:tree", "graph --json"), "\"from\": 6,\n          \"from_port\": 2,\n          \"to\": 9"));
    fails("sim:tree", "graph XX", 2, "'XX' is no information for the graph: DC or CRC");
}

TEST_F(EthercatSegment, WritesAliases) {
    EXPECT_EQ(out("sim:demo", "alias -p 1 0x10"), "");
    EXPECT_EQ(out("sim:demo", "alias -p 1 010 -v"), "Slave 1: alias 8, it was 0\n") << "the original's octal numbers";
    EXPECT_EQ(out("sim:demo", "alias 7 -f -v -p 1-2"), "Slave 1: alias 7, it was 0\nSlave 2: alias 7, it was 0\n");
    fails("sim:demo", "alias 7", 2, "5 slaves are selected: use --force to write the alias of all of them");
    fails("sim:demo", "alias 65536 -p 1", 2, "ALIAS: '65536' is no whole number from 0 to 65535");
}

TEST_F(EthercatSegment, ReplaysTheRecordingOfTheSameCall) {
    for (const std::string command : {"slaves", "crc", "domains -v", "pdos -p 3"}) {
        const auto live = out("sim:demo", command + " --record r.pcap");
        EXPECT_EQ(out("pcap:r.pcap", command), live) << command;
    }
    fails("pcap:r.pcap", "xml", 1, "a recording answers only what the recorded master asked");
    fails("pcap:r.pcap", "xml", 1, "ethercat analyse FILE");
    fails("pcap:none", "slaves", 3, "none");
    fails("sim:demo", "slaves --record no/such/folder", 3, "no/such/folder");
}

TEST_F(EthercatSegment, PrintsItsVersion) {
    EXPECT_TRUE(out("", "version").starts_with("ethercat (Margay) "));
    EXPECT_TRUE(contains(out("", "version --json"), "\"program\": \"ethercat\""));
}

}  // namespace
}  // namespace margay::process
