// The common behaviour of all programs: help, usage errors, exit codes, and lost output.
#include <places.hpp>
#include "process/shell.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

namespace margay::process {
namespace {

const std::string kBin = std::string(MARGAY_BIN_DIR) + "/";

class EachProgram : public testing::TestWithParam<std::string> {
  protected:
    ShellFolder folder;
    std::string name = GetParam();
    std::string program = kBin + name;
};

// Each samples/NAME.cpp is a program. subdevice_lan9252 is for a microcontroller.
std::vector<std::string> all_programs() {
    std::vector<std::string> names;
    for (const auto& file : std::filesystem::directory_iterator(MARGAY_SOURCE_DIR "/samples"))
        if (file.path().extension() == ".cpp" && file.path().stem() != "subdevice_lan9252")
            names.push_back(file.path().stem().string());
    std::ranges::sort(names);
    return names;
}

INSTANTIATE_TEST_SUITE_P(Programs, EachProgram, testing::ValuesIn(all_programs()),
                         [](const auto& each) { return each.param; });

TEST_P(EachProgram, SaysItsExitCodesAndItsVersion) {
    const auto help = folder.run(program + " --help");
    EXPECT_EQ(help.status, 0) << help.err;
    // margayd waits for a missing segment, so it has no exit code 1.
    const std::string segment = name == "margayd" ? "" : " 1 error of the segment or a device;";
    EXPECT_TRUE(contains(help.out, "Exit codes: 0 no error;" + segment + " 2 wrong arguments")) << help.out;
    EXPECT_TRUE(contains(help.out, " 3 system error")) << help.out;
    const auto version = folder.run(program + " --version");
    EXPECT_EQ(version.status, 0) << version.err;
    EXPECT_TRUE(version.out.starts_with(name + " (Margay) ")) << version.out;
    EXPECT_TRUE(contains(version.out, ".")) << version.out;
}

TEST_P(EachProgram, NamesAnOptionThatItDoesNotHave) {
    for (const auto* arguments : {" --nope", " --nope a b", " a b --nope"}) {
        if (name == "margayd" && arguments[1] == 'a') continue;  // margayd takes only options: it names `a` first
        const auto ran = folder.run(program + arguments);
        EXPECT_EQ(ran.status, 2) << arguments;
        EXPECT_EQ(ran.err, name + ": there is no option '--nope'; see " + name + " --help\n") << arguments;
        EXPECT_EQ(ran.out, "");
    }
}

TEST_P(EachProgram, NoticesThatItsHelpIsLost) {
    for (const auto* option : {" --help", " --version"}) {
        const auto ran = folder.run(program + option + " >/dev/full");
        EXPECT_EQ(ran.status, 3) << option;
        EXPECT_EQ(ran.err, name + ": standard output cannot be written: No space left on device\n");
    }
}

TEST(Programs, ListInterfacesAndSegmentsWithoutArguments) {
    const ShellFolder folder;
    for (const auto* name : {"slaveinfo", "eepromtool", "simple_io", "segment_monitor", "virtual_segment"}) {
        const auto ran = folder.run(kBin + name);
        EXPECT_EQ(ran.status, 2) << name;
        EXPECT_TRUE(contains(ran.err, "Ethernet interfaces:\n  ")) << ran.err;
        const bool serves = name == std::string("virtual_segment");
        EXPECT_TRUE(contains(ran.err, serves ? "\n  demo      " : "\n  sim:demo  ")) << ran.err;
        EXPECT_TRUE(contains(ran.err, serves ? "\n  drives               Line of drives\n"
                                             : "\n  sim:drives           Line of drives\n"))
            << ran.err;
    }
}

// The output of all programs, on a full disk and into a closed pipe.
TEST(Programs, NoticeOutputThatIsLost) {
    const ShellFolder folder;
    ASSERT_EQ(folder.run(kBin + "slaveinfo sim:demo --record r.pcap").status, 0);
    // The pipe has a reader while the writer opens it; then the reader closes it.
    const std::string closed = "mkfifo p && exec 3<>p && exec 4>p && exec 3<&- && rm p; ";
    for (const std::string command :
         {"slaveinfo sim:demo", "slaveinfo sim:demo --json", "slaveinfo sim:demo --map",
          "slaveinfo sim:mixed200 --json", "simple_io sim:demo --cycles 10", "dc_motion sim:drives",
          "segment_monitor sim:demo --plain --cycles 10", "segment_monitor sim:demo --cycles 10",
          "eepromtool sim:demo 1 dump", "eepromtool sim:demo 1 read", "eepromtool sim:demo 1 alias",
          "subdevice_check sim:demo 1 --only eeprom", "segment_fidelity r.pcap demo",
          "sii_from_capture r.pcap images"}) {
        const auto name = command.substr(0, command.find(' '));
        const auto full = folder.run(kBin + command + " >/dev/full");
        EXPECT_EQ(full.status, 3) << command << full.err;
        // The message with the reason is the only message.
        EXPECT_EQ(full.err, name + ": standard output cannot be written: No space left on device\n") << command;
        const auto pipe = folder.run(closed + kBin + command + " >&4");
        EXPECT_EQ(pipe.status, 3) << command << pipe.err;
        EXPECT_TRUE(pipe.err.ends_with(name + ": standard output cannot be written: Broken pipe\n")) << pipe.err;
    }
}

TEST(Programs, SayWhyAFileCannotBeReadOrWritten) {
    const ShellFolder folder;
    const std::string missing = ": No such file or directory\n";
    const auto error = [&](const std::string& command) {
        const auto ran = folder.run(kBin + command);
        EXPECT_EQ(ran.status, 3) << command;
        return ran.err;
    };
    EXPECT_EQ(error("dc_plot no/log"), "dc_plot: no/log: cannot be read" + missing);
    EXPECT_EQ(error("slaveinfo sim:demo --eni no/eni"), "slaveinfo: no/eni: cannot be read" + missing);
    EXPECT_EQ(error("slaveinfo sim:no.toml"), "slaveinfo: cannot read the segment description 'no.toml'" + missing);
    EXPECT_EQ(error("segment_report sim:demo --dc-log no/log"), "segment_report: no/log: cannot be read" + missing);
    EXPECT_EQ(error("slaveinfo sim:demo --write-esi no/esi"), "slaveinfo: no/esi: cannot be written" + missing);
    EXPECT_EQ(error("dc_motion sim:drives --sines 1 --log no/log"), "dc_motion: no/log: cannot be written" + missing);
    EXPECT_EQ(error("slaveinfo sim:demo --write-esi /dev/full"),
              "slaveinfo: /dev/full: cannot be written: No space left on device\n");
    EXPECT_EQ(error("dc_plot ."), "dc_plot: .: cannot be read: Is a directory\n");
}

// errors() also contains the error that the call returned.
TEST(Programs, PrintTheErrorOfAStartOnce) {
    const ShellFolder folder;
    folder.write("dark.toml", "[[slave]]\ndevice = \"coupler\"\npower = false\n");
    for (const std::string name : {"slaveinfo", "simple_io", "segment_monitor", "dc_motion", "segment_report"}) {
        const auto ran = folder.run(kBin + name + " sim:dark.toml");
        EXPECT_EQ(ran.status, 1) << name;
        const auto first = ran.err.find("waiting for link: ");
        EXPECT_NE(first, std::string::npos) << ran.err;
        EXPECT_EQ(ran.err.find("waiting for link: ", first + 1), std::string::npos) << ran.err;
    }
}

TEST(Programs, ShowDefaultsAndBoundsInHelp) {
    const ShellFolder folder;
    const auto help = folder.run(kBin + "simple_io --help").out;
    EXPECT_TRUE(contains(help, "how many cycles in OP [5000]\n")) << help;
    EXPECT_TRUE(contains(help, "cycle period in µs (50 to 1000000) [1000]\n")) << help;
    EXPECT_TRUE(contains(folder.run(kBin + "slaveinfo --help").out, "it answers only what the recorded master asked"));
}

TEST(Programs, OfferOnlyTheSourcesThatTheyAccept) {
    const ShellFolder folder;
    const auto help = folder.run(kBin + "eoe_bridge --help").out;
    EXPECT_TRUE(contains(help, "two interfaces at the ends of a ring")) << help;
    EXPECT_FALSE(contains(help, "sim:")) << help;
    EXPECT_FALSE(contains(help, "pcap:")) << help;
    const auto bare = folder.run(kBin + "eoe_bridge");
    EXPECT_EQ(bare.status, 2);
    EXPECT_TRUE(contains(bare.out + bare.err, "Ethernet interfaces:")) << bare.out << bare.err;
    EXPECT_FALSE(contains(bare.out + bare.err, "sim:")) << bare.out << bare.err;
}

TEST(Programs, ShowNoDefaultThatIsNoValueAndNoBracketsAroundWhatIsRequired) {
    const ShellFolder folder;
    const auto help = folder.run(kBin + "simple_io --help").out;
    EXPECT_FALSE(contains(help, "[any]")) << help;
    EXPECT_FALSE(contains(help, "[none]")) << help;
    const auto none = folder.run(kBin + "simple_io sim:demo --cycles 5 --stamps none");
    EXPECT_EQ(none.status, 0) << none.err;
    for (const std::string program : {"firmware_update", "subdevice_check"}) {
        const auto usage = folder.run(kBin + program + " --help").out;
        EXPECT_TRUE(contains(usage, " SOURCE NUMBER")) << usage;
        const auto without = folder.run(kBin + program + " sim:demo");
        EXPECT_EQ(without.status, 2);
        EXPECT_TRUE(contains(without.err, "NUMBER is required")) << without.err;
    }
}

TEST(Programs, AskForTheTypeOfADeviceOfAnEsiThatDescribesSeveral) {
    const ShellFolder folder;
    ASSERT_EQ(folder.run(kBin + "slaveinfo sim:demo --write-esi several.xml").status, 0);
    const auto ran = folder.run(kBin + "eepromtool esi several.xml");
    EXPECT_EQ(ran.status, 2) << ran.out;
    EXPECT_TRUE(contains(ran.err, "devices; choose one of them by TYPE or TYPE/REVISION")) << ran.err;
}

TEST(Programs, SayThatARecordingHasRepeatedItsLastAnswers) {
    const ShellFolder folder;
    ASSERT_EQ(folder.run(kBin + "simple_io sim:demo --cycles 20 --record r.pcap").status, 0);
    const auto exact = folder.run(kBin + "simple_io pcap:r.pcap --cycles 20");
    EXPECT_EQ(exact.status, 0) << exact.err;
    EXPECT_FALSE(contains(exact.err, "more often")) << exact.err;
    const auto longer = folder.run(kBin + "simple_io pcap:r.pcap --cycles 500");
    EXPECT_TRUE(contains(longer.err, "datagrams that were sent more often than in the recording")) << longer.err;
}

TEST(Programs, TellUsageFromWhatTheSystemLacks) {
    const ShellFolder folder;
    for (const auto* usage :
         {"slaveinfo sim:demo more", "slaveinfo sim:demo --cstruct", "simple_io sim:demo --period 5",
          "simple_io sim:demo --cycles many", "simple_io sim:demo --cycles -3", "eepromtool sim:demo",
          "eepromtool sim:demo dump", "virtual_segment eth0", "subdevice_check sim:demo", "subdevice_check sim:demo 99",
          "subdevice_check sim:demo 1 --only nonsense"}) {
        const auto ran = folder.run(kBin + usage);
        EXPECT_EQ(ran.status, 2) << usage << ran.err;
        EXPECT_NE(ran.err, "") << usage;
    }
    for (const auto* system :
         {"slaveinfo no-such-if", "slaveinfo sim:nothing.toml", "slaveinfo pcap:nothing", "simple_io no-such-if",
          "segment_monitor no-such-if", "nic_check no-such-if", "slaveinfo xdp:no-such-if",
          "eepromtool no-such-if 1 dump", "eepromtool file:nothing dump", "virtual_segment no-such-if demo",
          "subdevice_check no-such-if 1", "segment_fidelity nothing demo", "sii_from_capture nothing x",
          "slaveinfo sim:demo --record no/such/folder", "slaveinfo sim:demo --record /dev/full"}) {
        const auto ran = folder.run(kBin + system);
        EXPECT_EQ(ran.status, 3) << system << ran.err;
        EXPECT_NE(ran.err, "") << system;
    }
}

TEST(Programs, TakeReadyMadeSegmentsByName) {
    const ShellFolder folder;
    const auto named = folder.run(kBin + "slaveinfo sim:tree");
    EXPECT_EQ(named.status, 0) << named.err;
    EXPECT_EQ(named.out, folder.run(kBin + "slaveinfo 'sim:" MARGAY_SOURCE_DIR "/samples/segments/tree.toml'").out);
    const auto unknown = folder.run(kBin + "slaveinfo sim:trees");
    EXPECT_EQ(unknown.status, 3);
    EXPECT_TRUE(contains(unknown.err,
                         "'trees' is neither a file nor a ready-made segment; ready-made segments: demo, bootloader, "))
        << unknown.err;
}

TEST(Programs, PrintALineOfSlavesAsALine) {
    const ShellFolder folder;
    folder.write("line.toml", "[[slave]]\ndevice = \"pulse_axis\"\nname = \"axis\"\ncount = 100\n");
    const auto line = folder.run(kBin + "slaveinfo sim:line.toml").out;
    const auto topology = line.substr(line.find("Topology\n"));
    EXPECT_TRUE(contains(topology, "  master\n  └─ 1 Pulse train axis\n     2 Pulse train axis (port 1)\n     3 "))
        << topology;
    EXPECT_TRUE(topology.ends_with("\n     99 Pulse train axis (port 1)\n     100 Pulse train axis (port 1)\n"))
        << topology;

    const auto tree = folder.run(kBin + "slaveinfo sim:tree").out;
    EXPECT_EQ(tree.substr(tree.find("Topology\n")),
              "Topology\n"
              "  master\n"
              "  └─ 1 Junction with four ports\n"
              "     ├─ 2 Junction with four ports (port 3)\n"
              "     │  ├─ 3 Pulse train axis (port 3)\n"
              "     │  └─ 4 EtherCAT coupler (port 1)\n"
              "     │     5 16-channel digital input (port 1)\n"
              "     │     6 16-channel digital output (port 1)\n"
              "     ├─ 7 EtherCAT coupler (port 1)\n"
              "     │  ├─ 8 4-channel analogue input (port 1)\n"
              "     │  │  9 2-channel analogue output (port 1)\n"
              "     │  └─ 10 Pulse train axis (port 2)\n"
              "     │     11 Pulse train axis (port 1)\n"
              "     └─ 12 Pulse train axis (port 2)\n");
}

TEST(Programs, WaitNearlyAPeriodForTheFrames) {
    const ShellFolder folder;
    folder.write("slow.toml", "round_trip_us = 1000\n[[slave]]\ndevice = \"digital_io_16\"\n");
    const auto slow = folder.run(kBin + "simple_io sim:slow.toml --cycles 100 --period 4000");
    EXPECT_EQ(slow.status, 0) << slow.err;
    EXPECT_TRUE(contains(slow.out, "\n100 cycles, 0 without all frames, ")) << slow.out;
    EXPECT_EQ(slow.err, "");
    const std::string wait = ": a cycle waits 900 µs for its frames: if they need longer, use a longer --period (";
    for (const std::string name : {"simple_io", "segment_monitor --plain"}) {
        const auto fast = folder.run(kBin + name + " sim:slow.toml --cycles 100");
        EXPECT_EQ(fast.status, 1) << fast.err;
        EXPECT_TRUE(contains(fast.err, wait)) << fast.err;
        EXPECT_TRUE(contains(fast.err, " frames came back that no cycle waited for: late, doubled or unknown)\n"))
            << fast.err;
    }
}

TEST(Programs, SayWhichOptionsHaveNoEffectInVirtualTime) {
    const ShellFolder folder;
    const auto cpu = folder.run(kBin + "segment_monitor sim:demo --plain --cycles 10 --cpu 0");
    EXPECT_EQ(cpu.status, 0) << cpu.err;
    EXPECT_EQ(cpu.err, "segment_monitor: --cpu has no effect: time is virtual on this SOURCE\n");
    const auto all = folder.run(kBin + "simple_io sim:demo --cycles 10 --priority 5 --spin 10 --period 2000");
    EXPECT_EQ(all.err,
              "simple_io: --spin has no effect: time is virtual on this SOURCE\n"
              "simple_io: --priority has no effect: time is virtual on this SOURCE\n");
}

// The round trip of the simulated segment is longer than the period.
TEST(Programs, AnOverrunSkipsCatchesUpOrStops) {
    const ShellFolder folder;
    const auto stopped = folder.run(kBin + "simple_io sim:demo --cycles 10 --period 50 --overrun stop");
    EXPECT_EQ(stopped.status, 1);
    EXPECT_EQ(stopped.err,
              "simple_io: stopped (--overrun stop): cycle 1 could not begin in its period, and 1 cycle was missed\n");
    const auto skipped = folder.run(kBin + "simple_io sim:demo --cycles 100 --period 50 --histogram h.json");
    EXPECT_EQ(skipped.status, 0) << skipped.err;
    EXPECT_TRUE(contains(skipped.out, "100 cycles, 100 overruns")) << skipped.out;
    EXPECT_TRUE(contains(skipped.out, " left out, 0 made up for")) << skipped.out;
    const auto made_up =
        folder.run(kBin + "simple_io sim:demo --cycles 100 --period 50 --overrun catch-up --histogram h.json");
    EXPECT_EQ(made_up.status, 0) << made_up.err;
    EXPECT_TRUE(contains(made_up.out, " made up for")) << made_up.out;
    EXPECT_FALSE(contains(made_up.out, " 0 made up for")) << made_up.out;
    EXPECT_NE(folder.run(kBin + "simple_io sim:demo --overrun sometimes").status, 0);
    const auto no_effect = folder.run(kBin + "simple_io sim:demo --cycles 10 --runtime 100");
    EXPECT_EQ(no_effect.err, "simple_io: --runtime has no effect: time is virtual on this SOURCE\n");
}

TEST(SegmentMonitor, RecordsAndEndsWithOneAfterLostFrames) {
    const ShellFolder folder;
    const auto well = folder.run(kBin + "segment_monitor sim:demo --plain --cycles 50 --record r.pcap");
    EXPECT_EQ(well.status, 0) << well.err;
    EXPECT_EQ(well.err, "");
    EXPECT_EQ(folder.run(kBin + "segment_monitor pcap:r.pcap --plain --cycles 50").status, 0);

    folder.write("noisy.toml", "noise = { lost = 0.05, seed = 3 }\n[[slave]]\ndevice = \"digital_in_8\"\n");
    const auto lost = folder.run(kBin + "segment_monitor sim:noisy.toml --plain --cycles 400");
    EXPECT_EQ(lost.status, 1) << lost.err;
    EXPECT_TRUE(contains(lost.err, "cycles without all frames or with a wrong working counter\n")) << lost.err;
}

// The errors of the bring-up are visible on the screen and at the end.
TEST(SegmentMonitor, PrintsTheErrorsOfTheSegment) {
    const ShellFolder folder;
    folder.write("blank.bin", std::string(1024, '\xFF'));
    folder.write("blank.toml", "[[slave]]\ndevice = \"digital_in_8\"\n[[slave]]\nsii = \"blank.bin\"\n");
    const auto ran = folder.run(kBin + "segment_monitor sim:blank.toml --plain --cycles 50");
    EXPECT_EQ(ran.status, 1) << ran.out << ran.err;
    EXPECT_TRUE(contains(ran.err, "segment_monitor: error: slave 2")) << ran.err;
    EXPECT_TRUE(contains(ran.out, ": error: slave 2")) << ran.out;
}

}  // namespace
}  // namespace margay::process
