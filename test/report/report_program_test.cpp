// The program segment_report: files, exit codes, recordings, a running application, a segment of another master.
#include "report/report_fixture.hpp"

#include "process/made_eni.hpp"
#include "process/netns.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <string>
#include <tuple>
#include <vector>

namespace margay::segment_report {
namespace {

namespace fs = std::filesystem;
using process::contains;
using process::content_of;
using namespace std::chrono_literals;

using ReportProgram = ReportTest;

TEST_F(ReportProgram, WritesThePageAndSaysTheHeadline) {
    const auto ran = run("sim:demo -o r.html");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_EQ(ran.err, "");
    EXPECT_EQ(ran.out, "r.html: 5 slaves, all in SAFEOP; nothing is wrong.\n");
    const auto read = page("r.html");
    EXPECT_EQ("r.html: " + read.headline() + "\n", ran.out);
    EXPECT_EQ(read.cell("slave-table", 1, "Found in"), "INIT");
    EXPECT_TRUE(read.has("Margay "));
    EXPECT_TRUE(contains(read.text("//section[@id='run']"), "segment_report sim:demo -o r.html"));
    EXPECT_TRUE(contains(read.text("//section[@id='machine']"), "Linux "));
    const auto piped = run("sim:demo -o - | tee copy.html");
    EXPECT_EQ(piped.out, content_of(folder.path() / "copy.html"));
    EXPECT_EQ(page("copy.html").headline(), read.headline());
}

TEST_F(ReportProgram, HelpSaysTheExitCodes) {
    const auto ran = run("--help");
    EXPECT_EQ(ran.status, 0);
    EXPECT_TRUE(contains(ran.out, "Exit codes: 0 no error; 1 error of the segment or a device; 2 wrong arguments; 3"));
    EXPECT_TRUE(contains(ran.out, "with 1 when it names one"));
}

TEST_F(ReportProgram, AFaultEndsWith1AndThePageIsThere) {
    folder.write("a.toml", "[[slave]]\ndevice = \"drive\"\nerrors = [[0, 20, 0]]\n");
    const auto ran = run("sim:a.toml");
    EXPECT_EQ(ran.status, 1);
    EXPECT_EQ(ran.out,
              "report.html: 1 slave, in SAFEOP; cable between the master and slave 0 damaged 20 frames; 1 fault.\n");
    EXPECT_EQ(page().verdicts("fault").size(), 1U);
}

TEST_F(ReportProgram, TheCyclesAreAsTheEniSays) {
    for (const auto cycle : {1ms, 4ms}) {
        folder.write("clocked.xml", process::clocked_eni("sim:coupler,drive,drive", 2, cycle));
        const auto ran = run("sim:coupler,drive,drive --eni clocked.xml --cycles 500");
        EXPECT_EQ(ran.status, 0) << ran.out << ran.err << page().text("//ul[@class='verdicts']");
        EXPECT_EQ(ran.out, "report.html: 3 slaves, all in OP; nothing is wrong.\n");
        EXPECT_TRUE(page().has("500 cycles with a period of " + std::to_string(cycle / 1us) + " µs"));
    }
    folder.write("groups.xml", process::eni_of_two_groups());
    const auto ran = run("sim:drive,drive --eni groups.xml --cycles 500");
    EXPECT_EQ(ran.status, 0) << ran.out << ran.err << page().text("//ul[@class='verdicts']");
    EXPECT_EQ(ran.out, "report.html: 2 slaves, all in OP; nothing is wrong.\n");
}

// All slaves of a hot connect group may be absent.
TEST_F(ReportProgram, AHotConnectGroupThatIsAwayIsNoFault) {
    folder.write("there.toml",
                 "[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = \"digital_io_16\"\n"
                 "[[slave]]\nname = \"grip\"\ndevice = \"digital_out_8\"\nalias = 5\n");
    folder.write("away.toml", "[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = \"digital_io_16\"\n");
    folder.write("group.xml", process::eni_with_group(folder.path() / "there.toml", 3, 5));
    const auto ran = run("sim:away.toml --eni group.xml");
    EXPECT_EQ(ran.status, 0) << ran.out << ran.err << page().text("//ul[@class='verdicts']");
    EXPECT_EQ(ran.out, "report.html: 2 slaves, all in SAFEOP; nothing is wrong.\n");
    const auto cycles =
        folder.run(std::string(MARGAY_BIN_DIR) + "/simple_io sim:away.toml --eni group.xml --cycles 100");
    EXPECT_EQ(cycles.status, 0) << cycles.out << cycles.err;
}

// The first slave of the group is present, so the other slave of the group must be present, too.
TEST_F(ReportProgram, AMissingMemberOfAHotConnectGroupIsAFault) {
    const std::string group = "[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = \"digital_out_8\"\nalias = 5\n";
    folder.write("there.toml", group + "[[slave]]\ndevice = \"digital_io_16\"\n");
    folder.write("partly.toml", group);
    folder.write("group.xml", process::eni_with_group(folder.path() / "there.toml", 3, 5, 2));
    for (const std::string more : {"", " --no-map"}) {
        const auto ran = run("sim:partly.toml --eni group.xml" + more);
        EXPECT_EQ(ran.status, 1) << ran.out << ran.err;
        const auto faults = page().verdicts("fault");
        EXPECT_TRUE(std::ranges::any_of(faults, [](const auto& one) { return contains(one, "Configured slave 2 "); }))
            << ran.out;
        EXPECT_TRUE(contains(ran.out, more.empty() ? "in SAFEOP" : "in PREOP")) << ran.out;
    }
}

// Reading 200 slaves takes longer than the watchdogs of their outputs.
TEST_F(ReportProgram, SlavesThatLeaveOpAfterTheCyclesAreNoFault) {
    const auto ran = run("sim:mixed200 --cycles 100");
    EXPECT_EQ(ran.status, 0) << ran.out << ran.err;
    EXPECT_TRUE(contains(ran.out, "200 slaves, all in OP")) << ran.out;
}

// The frames of the process data have a long round trip, too: one cycle takes longer than the period.
TEST_F(ReportProgram, LongRoundTripsAreNoFault) {
    folder.write("slow.toml",
                 "round_trip_us = 1000\n[[slave]]\ndevice = \"coupler\"\n"
                 "[[slave]]\ndevice = \"digital_io_16\"\ncount = 149\n");
    const auto ran = run("sim:slow.toml --cycles 100 --no-dictionary");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(contains(ran.out, "150 slaves, all in OP; nothing is wrong.")) << ran.out;
}

TEST_F(ReportProgram, TheStateBeforeTheScanIsKept) {
    folder.write("a.toml",
                 "[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = \"drive\"\npreset = [[0x0120, 0x04, 0x00]]\n");
    const auto ran = run("sim:a.toml");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_EQ(page().cell("slave-table", 1, "Found in"), "INIT");
    EXPECT_EQ(page().cell("slave-table", 2, "Found in"), "INIT + ERROR");
    const auto remarks = page().verdicts("look at it");
    ASSERT_EQ(remarks.size(), 1U);
    EXPECT_TRUE(contains(remarks[0], "Slave 1: found in INIT + ERROR, AL status code 0x0011: ")) << remarks[0];
}

TEST_F(ReportProgram, ASlaveOfTheEniThatIsMissingIsAFault) {
    const auto written =
        folder.run(std::string(MARGAY_BIN_DIR) + "/slaveinfo sim:coupler,digital_in_8,digital_out_8 --write-eni a.xml");
    ASSERT_EQ(written.status, 0) << written.err;
    EXPECT_EQ(run("sim:coupler,digital_in_8,digital_out_8 --eni a.xml").status, 0);
    const auto ran = run("sim:coupler,digital_in_8 --eni a.xml");
    EXPECT_EQ(ran.status, 1) << ran.out;
    const auto faults = page().verdicts("fault");
    EXPECT_TRUE(std::ranges::any_of(faults, [](const auto& text) {
        return contains(text, "Configured slave 2 (vendor 0x00004d47, product 0x00002008) is missing.");
    })) << ran.out;
    EXPECT_EQ(page().rows("slave-table"), 2U);
}

TEST_F(ReportProgram, ASegmentWithoutSlavesIsReported) {
    folder.write("a.toml", "[[slave]]\ndevice = \"drive\"\npower = false\n");
    const auto ran = run("sim:a.toml --record");
    EXPECT_EQ(ran.status, 1);
    EXPECT_NE(ran.err, "");
    EXPECT_TRUE(contains(page().headline(), "The segment could not be read: ")) << page().headline();
    ASSERT_EQ(page().verdicts("fault").size(), 1U);
    EXPECT_EQ(page().count("//svg[@id='topology']"), 0U);
    EXPECT_TRUE(contains(page().text("//section[@id='recording']"), "report.pcap"));
}

TEST_F(ReportProgram, WrongArgumentsEndWith2AndTouchNothing) {
    folder.write("report.html", "old");
    for (const std::string arguments :
         {"", "sim:demo --attach x.sock", "--attach x.sock --cycles 3", "a.pcap --record", "sim:demo --record -o -",
          "sim:demo --cycles 3 --no-map", "sim:demo --period 1", "sim:demo --unknown", "a.pcapng --eni b.xml"}) {
        const auto ran = run(arguments);
        EXPECT_EQ(ran.status, 2) << arguments << ran.err;
        EXPECT_TRUE(ran.err.starts_with("segment_report: ")) << ran.err;
    }
    EXPECT_EQ(content_of(folder.path() / "report.html"), "old");
}

TEST_F(ReportProgram, AFailedRunLeavesTheOldPage) {
    folder.write("report.html", "old");
    folder.write("report.pcap", "old frames");
    folder.write("empty.pcap", "");
    for (const std::string arguments :
         {"sim:nothing.toml --record", "empty.pcap", "missing.pcap", "--attach missing.sock", "nowhere0 --record",
          "sim:demo --record --dc-log missing.csv"}) {
        const auto ran = run(arguments);
        EXPECT_EQ(ran.status, 3) << arguments << ran.err;
        EXPECT_NE(ran.err, "") << arguments;
        EXPECT_EQ(content_of(folder.path() / "report.html"), "old") << arguments;
        EXPECT_EQ(content_of(folder.path() / "report.pcap"), "old frames") << arguments;
        EXPECT_FALSE(fs::exists(folder.path() / "report.html.new")) << arguments;
        EXPECT_FALSE(fs::exists(folder.path() / "report.pcap.new")) << arguments;
    }
}

TEST_F(ReportProgram, LostOutputEndsWith3) {
    auto ran = run("sim:demo -o /dev/full");
    EXPECT_EQ(ran.status, 3);
    EXPECT_TRUE(contains(ran.err, "/dev/full: cannot be written: No space left on device")) << ran.err;
    ran = run("sim:demo -o missing/r.html");
    EXPECT_EQ(ran.status, 3);
    EXPECT_TRUE(contains(ran.err, "missing/r.html: cannot be written")) << ran.err;
    ran = run("sim:demo -o - > /dev/full");
    EXPECT_EQ(ran.status, 3);
    // The file system has no space for the page. The old page stays.
    ran =
        folder.run("mkdir full && mount -t tmpfs -o size=16k none full || exit 77\necho old > full/r.html\n" + program +
                   " sim:drives -o full/r.html; code=$?; cat full/r.html; ls full; umount full; exit $code");
    if (ran.status == 77) GTEST_SKIP() << "no file system can be mounted: " << ran.err;
    EXPECT_EQ(ran.status, 3) << ran.err;
    EXPECT_TRUE(contains(ran.err, "No space left on device")) << ran.err;
    EXPECT_EQ(ran.out, "old\nr.html\n");
}

TEST_F(ReportProgram, RecordsBesideThePageAndTheRecordingCanBeReadAgain) {
    const auto ran = run("sim:demo --record --cycles 200 -o r.html");
    EXPECT_EQ(ran.status, 0) << ran.err;
    const auto read = page("r.html");
    EXPECT_TRUE(contains(read.headline(), "5 slaves, all in OP")) << read.headline();
    const auto recording = read.text("//section[@id='recording']");
    EXPECT_TRUE(contains(recording, "r.pcap, beside this page")) << recording;
    EXPECT_TRUE(contains(recording, "Slaves (5)")) << "the analysis as text";
    const auto cycles = read.text("//section[@id='cycles']");
    EXPECT_TRUE(contains(cycles, "200 cycles with a period of 1000 µs, outputs 0, in virtual time")) << cycles;
    EXPECT_TRUE(contains(cycles, "200 cycles, 0 overruns, 0 without all frames, 0 with a wrong working counter"));
    EXPECT_EQ(read.count("//svg[@class='cycle-figures']"), 1U);
    // The recording is the source of the same program, and gives the same report.
    const auto again = run("pcap:r.pcap --cycles 200 -o again.html");
    EXPECT_EQ(again.status, 0) << again.err;
    EXPECT_EQ(page("again.html").headline(), read.headline());
    // The program analyses the recording, and sends no requests.
    const auto analysed = run("r.pcap -o analysed.html");
    EXPECT_EQ(analysed.status, 0) << analysed.err;
    const auto seen = page("analysed.html");
    EXPECT_EQ(seen.rows("recorded-slaves"), 5U);
    EXPECT_EQ(seen.cell("recorded-slaves", 1, "Name"), "EtherCAT coupler");
    EXPECT_EQ(seen.count("//svg[@id='topology']"), 0U) << "nothing is drawn that the recording does not show";
    EXPECT_TRUE(contains(seen.headline(), "5 slaves seen")) << seen.headline();
}

TEST_F(ReportProgram, WritesNoPageFromARecordingOfAnotherProgram) {
    ASSERT_EQ(folder.run(std::string(MARGAY_BIN_DIR) + "/slaveinfo sim:demo --record other.pcap").status, 0);
    const auto ran = run("pcap:other.pcap -o r.html");
    EXPECT_EQ(ran.status, 1) << ran.out;
    EXPECT_TRUE(contains(ran.err, "a recording answers only what the recorded master asked")) << ran.err;
    EXPECT_FALSE(fs::exists(folder.path() / "r.html"));
}

// The recording has no faults. The test appends its requests again, as requests of another master 256 s later, without
// replies.
TEST_F(ReportProgram, EachMasterOfARecordingIsJudged) {
    ASSERT_EQ(folder.run(std::string(MARGAY_BIN_DIR) + "/slaveinfo sim:demo --record one.pcap").status, 0);
    ASSERT_EQ(run("one.pcap -o one.html").status, 0);
    const std::string one = content_of(folder.path() / "one.pcap");
    constexpr std::size_t kFileHeader = 24, kPacketHeader = 16, kSource = 6;
    std::string two = one;
    for (std::size_t at = kFileHeader; at + kPacketHeader < one.size();) {
        const auto octet = [&](std::size_t n) { return static_cast<std::size_t>(static_cast<unsigned char>(one[n])); };
        const std::size_t size = octet(at + 8) | octet(at + 9) << 8;
        std::string packet = one.substr(at, kPacketHeader + size);
        at += packet.size();
        if ((octet(at - size + kSource) & 0x02) != 0) continue;  // a reply: a slave has set the mark
        ++packet[1];                                             // the seconds: 256 s later
        packet[kPacketHeader + kSource + 5] = static_cast<char>(packet[kPacketHeader + kSource + 5] ^ 1);
        two += packet;
    }
    folder.write("two.pcap", two);
    const auto ran = run("two.pcap -o two.html");
    EXPECT_EQ(ran.status, 1) << ran.err;
    const auto read = page("two.html");
    EXPECT_TRUE(contains(read.headline(), " seen, 2 masters; ")) << read.headline();
    const auto faults = read.verdicts("fault");
    ASSERT_FALSE(faults.empty());
    for (const auto& text : faults) EXPECT_TRUE(contains(text, "Master 2 (")) << text;
    EXPECT_TRUE(contains(faults[0], "No slave answers in the recording.")) << faults[0];
    for (const auto& text : read.verdicts("good")) EXPECT_FALSE(contains(text, "Master 2 (")) << text;
}

// The packets of a recording with their headers, in their order.
std::vector<std::string> packets_of(const std::string& pcap) {
    constexpr std::size_t kFileHeader = 24, kPacketHeader = 16;
    std::vector<std::string> all;
    for (std::size_t at = kFileHeader; at + kPacketHeader < pcap.size(); at += all.back().size()) {
        const auto octet = [&](std::size_t n) { return static_cast<std::size_t>(static_cast<unsigned char>(pcap[n])); };
        all.push_back(pcap.substr(at, kPacketHeader + (octet(at + 8) | octet(at + 9) << 8)));
    }
    return all;
}

// Frames of the cycle, or broadcasts alone, show that slaves answer. They do not show which slaves answer.
TEST_F(ReportProgram, APartOfARecordingIsNoFault) {
    ASSERT_EQ(folder.run(std::string(MARGAY_BIN_DIR) + "/simple_io sim:demo --record io.pcap --cycles 600").status, 0);
    const auto all = content_of(folder.path() / "io.pcap");
    const auto packets = packets_of(all);
    ASSERT_GT(packets.size(), 1153U);
    // The parts of the recording: from a request to a reply, from a reply to a request, the broadcasts of the scan, one
    // reply and one request.
    const std::string every = "requests have their replies.";
    for (const auto& [first, last, good] : {std::tuple(752U, 1152U, every), std::tuple(751U, 1153U, std::string()),
                                            std::tuple(0U, 10U, every), std::tuple(751U, 753U, std::string())}) {
        std::string part = all.substr(0, 24);
        for (auto n = first; n < last; ++n) part += packets[n];
        folder.write("part.pcap", part);
        const auto ran = run("part.pcap -o part.html");
        EXPECT_EQ(ran.status, 0) << first << ran.out << ran.err;
        const auto read = page("part.html");
        const auto remarks = read.verdicts("look at it");
        ASSERT_EQ(remarks.size(), 1U) << first;
        EXPECT_TRUE(contains(remarks[0], "Slaves answer, and the recording does not show which.")) << remarks[0];
        const auto well = read.verdicts("good");
        EXPECT_EQ(well.size(), good.empty() ? 0U : 1U) << first;
        for (const auto& text : well) EXPECT_TRUE(contains(text, good)) << text;
    }
}

TEST_F(ReportProgram, ARecordingThatIsCutOffIsAPointToLookAt) {
    ASSERT_EQ(folder.run(std::string(MARGAY_BIN_DIR) + "/slaveinfo sim:demo --record whole.pcap").status, 0);
    const std::string whole = content_of(folder.path() / "whole.pcap");
    folder.write("cut.pcap", whole.substr(0, whole.size() - 7));
    ASSERT_EQ(run("whole.pcap -o whole.html").status, 0);
    EXPECT_TRUE(contains(page("whole.html").headline(), "nothing is wrong.")) << page("whole.html").headline();
    ASSERT_EQ(run("cut.pcap -o cut.html").status, 0);
    const auto cut = page("cut.html");
    EXPECT_FALSE(contains(cut.headline(), "nothing is wrong")) << cut.headline();
    const auto remarks = cut.verdicts("look at it");
    ASSERT_FALSE(remarks.empty());
    EXPECT_TRUE(contains(remarks[0], "breaks off or is damaged behind packet 99 (")) << remarks[0];
}

// Some replies of the recording come after the next request.
TEST_F(ReportProgram, LateRepliesAreNamed) {
    ASSERT_EQ(folder.run(std::string(MARGAY_BIN_DIR) + "/simple_io sim:demo --record io.pcap --cycles 600").status, 0);
    const auto all = content_of(folder.path() / "io.pcap");
    auto packets = packets_of(all);
    ASSERT_GT(packets.size(), 1153U);
    for (std::size_t n = 901; n < 920; n += 4) {  // swap a reply and the next request, but not their times
        const auto first = packets[n].substr(0, 8);
        const auto second = packets[n + 1].substr(0, 8);
        std::swap(packets[n], packets[n + 1]);
        packets[n].replace(0, 8, first);
        packets[n + 1].replace(0, 8, second);
    }
    auto late = all.substr(0, 24);
    for (const auto& packet : packets) late += packet;
    folder.write("late.pcap", late);
    const auto ran = run("late.pcap -o late.html");
    const auto read = page("late.html");
    const auto remarks = read.verdicts("look at it");
    const std::string text = "5 replies came behind the next request with the same process data.";
    EXPECT_TRUE(std::ranges::any_of(remarks, [&](const auto& one) { return contains(one, text); })) << ran.out;
    for (const auto& one : read.verdicts("good")) EXPECT_FALSE(contains(one, "have their replies")) << one;
    EXPECT_FALSE(contains(read.headline(), "nothing is wrong")) << read.headline();
}

TEST_F(ReportProgram, RecordingsOfOtherMastersAreAnalysed) {
    const fs::path captures = MARGAY_CAPTURES_DIR;
    if (captures.empty() || !fs::exists(captures)) GTEST_SKIP() << "MARGAY_CAPTURES_DIR is not known";
    const auto ran = run((captures / "twincat-run-ek1100-el1004.pcapng").string() + " -o t.html");
    EXPECT_LE(ran.status, 1) << ran.err;
    const auto read = page("t.html");
    EXPECT_TRUE(read.has("TwinCAT")) << "the master by its manners";
    EXPECT_EQ(read.rows("recorded-slaves"), 2U);
    EXPECT_EQ(read.cell("recorded-slaves", 1, "Station"), "0x03e9");
    EXPECT_EQ(read.cell("recorded-slaves", 2, "Vendor"), "not seen");
    const auto drive = run((captures / "soem-sdinfo-akd.pcapng").string() + " -o d.html");
    EXPECT_EQ(drive.status, 1) << "the drive ends in an error state";
    const auto faults = page("d.html").verdicts("fault");
    ASSERT_EQ(faults.size(), 2U);
    EXPECT_TRUE(contains(faults[0], "3 of 3381 frames in the recording did not come back.")) << faults[0];
    EXPECT_TRUE(contains(faults[1], "Slave 0 ends in PREOP + ERROR, AL status code 0x001d: invalid output"))
        << faults[1];
    const auto nobody = run((captures / "soem-sdinfo-no-slaves.pcapng").string() + " -o n.html");
    EXPECT_EQ(nobody.status, 1);
    EXPECT_TRUE(contains(page("n.html").verdicts("fault").at(0), "No slave answers in the recording."));
}

TEST_F(ReportProgram, ALogOfTheMastersClockIsDrawn) {
    folder.write("log.csv",
                 "Time[ms];BusTimeOff[ns];Drift[ppm];CtlErr[ns];SystemTimeDifference[ns]\n0;1;0.5;10;3\n1;2;0.4;-20;"
                 "4\n2;3;0.3;5;2\n");
    const auto ran = run("sim:demo --dc-log log.csv");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_EQ(page().count("//section[@id='clocklog']//svg[@class='plot']"), 4U);
    EXPECT_TRUE(contains(page().text("//section[@id='clocklog']"), "log.csv: 3 lines in 0.002 s."));
    folder.write("bad.csv", "Time[ms]\n1\n");
    EXPECT_EQ(run("sim:demo --dc-log bad.csv").status, 3);
}

TEST_F(ReportProgram, ALogWhoseClocksLostTheirSyncIsAFault) {
    const std::string head = "Time[ms],BusTimeOff,Drift,CtlErr,SystemTimeDifference,DCMErrorCode,DCMInSync,DCInSync\n";
    const std::string start = head + "0,500000,1,2,3,1,0,1\n1,500002,1,2,3,2,1,1\n";
    folder.write("good.csv", start);
    const auto good = run("sim:demo --dc-log good.csv");
    EXPECT_EQ(good.status, 0) << good.out;
    const auto plots = page().text("//section[@id='clocklog']//svg[@class='plot']");
    for (const std::string tick : {"500000", "500001", "500002"}) EXPECT_TRUE(contains(plots, tick)) << plots;
    folder.write("lost.csv", start + "2,500001,1,2,-123456,4,0,0\n");
    const auto lost = run("sim:demo --dc-log lost.csv");
    EXPECT_EQ(lost.status, 1) << lost.out;
    const auto faults = page().verdicts("fault");
    ASSERT_EQ(faults.size(), 1U);
    EXPECT_TRUE(contains(faults[0],
                         "The clocks of the log were in sync from line 3 on, but not in 1 line behind it, "
                         "first in line 4 (DCMErrorCode 4)."))
        << faults[0];
    folder.write("never.csv", head + "0,1,1,2,3,1,0,1\n");
    EXPECT_EQ(run("sim:demo --dc-log never.csv").status, 1);
}

TEST_F(ReportProgram, ShowsTheCyclesOfAnApplicationFromItsFile) {
    const auto io =
        folder.run(std::string(MARGAY_BIN_DIR) +
                   "/simple_io sim:demo --cycles 300 --histogram c.json > io.txt; grep -c '\"p99\"' c.json");
    EXPECT_EQ(io.out, "5\n") << io.err;
    const auto ran = run("sim:demo --cycle-log c.json --cycles 100");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_EQ(page().count("//section[@id='cycles']//svg[@class='cycle-figures']"), 2U);
    const auto cycles = page().text("//section[@id='cycles']");
    EXPECT_TRUE(contains(cycles, "From the file c.json: 300 cycles of the application.")) << cycles;
    EXPECT_TRUE(contains(cycles, "300 cycles, 0 overruns, 0 without all frames, 0 with a wrong working counter"));
    // The program exchanges no cycles here, and the file of the application contains overruns and wrong working
    // counters.
    folder.write("wrong.json", content_of(folder.path() / "c.json"));
    ASSERT_EQ(folder
                  .run("sed -i 's/\"overruns\": 0/\"overruns\": 3/; s/\"wrong_working_counter\": 0/"
                       "\"wrong_working_counter\": 2/' wrong.json")
                  .status,
              0);
    const auto wrong = run("sim:demo --cycle-log wrong.json");
    EXPECT_EQ(wrong.status, 1) << wrong.out;
    EXPECT_EQ(page().count("//section[@id='cycles']//svg[@class='cycle-figures']"), 1U);
    ASSERT_EQ(page().verdicts("fault").size(), 1U);
    EXPECT_TRUE(contains(page().verdicts("fault")[0],
                         "Of 300 cycles of the application, 0 lacked frames and 2 had a wrong working counter."));
    folder.write("bad.json", "{\"cycles\": -3}");
    const auto bad = run("sim:demo --cycle-log bad.json");
    EXPECT_EQ(bad.status, 3);
    EXPECT_TRUE(contains(bad.err, "bad.json: \"cycles\" is no whole number of 0 or above")) << bad.err;
    EXPECT_EQ(run("sim:demo --cycle-log missing.json").status, 3);
}

TEST_F(ReportProgram, RecordsBothNicsOfARing) {
    folder.write(
        "ring.toml",
        "ring = { slave = \"last\", port = 1 }\n[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = \"drive\"\n"
        "[[slave]]\nname = \"last\"\ndevice = \"digital_io_16\"\n");
    const auto ran = run("sim:ring.toml --record --cycles 200");
    EXPECT_EQ(ran.status, 0) << ran.out << ran.err;
    const auto recording = page().text("//section[@id='recording']");
    EXPECT_TRUE(contains(recording, "both NICs of a ring: the copies of a frame are counted as one frame"))
        << recording;
    ASSERT_EQ(run("report.pcap -o analysed.html").status, 0);
    const auto analysed = page("analysed.html");
    EXPECT_EQ(analysed.rows("recorded-slaves"), 3U);
    for (std::size_t row = 1; row <= 3; ++row)
        EXPECT_EQ(analysed.cell("recorded-slaves", row, "Last state"), "PREOP") << row;
    EXPECT_TRUE(contains(recording, " 0 lost, 0 late")) << recording;
    // A line has one NIC.
    ASSERT_EQ(folder.run("sed -i 's/^ring = .*//; s/^name = .*//' ring.toml").status, 0);
    ASSERT_EQ(run("sim:ring.toml --record --cycles 200 -o line.html").status, 0);
    EXPECT_FALSE(contains(page("line.html").text("//section[@id='recording']"), "both NICs"));
}

TEST_F(ReportProgram, ReadsARunningApplication) {
    const auto ran = folder.run(std::string(MARGAY_BIN_DIR) +
                                "/simple_io sim:drive,pulse_axis,drive --cycles 100000000 --period 2000 --attach "
                                "s.sock > io.txt 2>&1 &\nio=$!\n"
                                "n=0; until grep -q 'all slaves in OP' io.txt; do sleep 0.05; n=$((n+1)); "
                                "[ $n -lt 1200 ] || { cat io.txt >&2; kill $io; exit 98; }; done\n" +
                                program + " --attach s.sock -o a.html; code=$?; kill $io; wait $io; exit $code");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_TRUE(contains(ran.out, "3 slaves, all in OP")) << ran.out;
    const auto attached = page("a.html");
    ASSERT_EQ(run("sim:drive,pulse_axis,drive -o own.html").status, 0);
    const auto own = page("own.html");
    ASSERT_EQ(attached.rows("slave-table"), 3U);
    for (std::size_t row = 1; row <= 3; ++row) {
        EXPECT_EQ(attached.cell("slave-table", row, "State"), "OP");
        for (const std::string column : {"Name", "Product", "Revision", "Software"})
            EXPECT_EQ(attached.cell("slave-table", row, column), own.cell("slave-table", row, column)) << row;
    }
    EXPECT_EQ(attached.cell("slave-table", 1, "Clock"), "64 bit, not measured") << "simple_io needs no clocks";
    EXPECT_TRUE(attached.has("read from a running application"));
    EXPECT_TRUE(attached.has("entries of the dictionary compared"));
    EXPECT_EQ(attached.count("//svg[@id='topology']//a[@class='slave']"), 3U);
}

// The application decides which slaves may be absent: a slave whose whole group is absent, but not a slave of a
// group whose first slave is present.
TEST_F(ReportProgram, ReadsFromAnApplicationWhatMayBeMissing) {
    const std::string coupler = "[[slave]]\ndevice = \"coupler\"\n";
    const std::string first = "[[slave]]\ndevice = \"digital_out_8\"\nalias = 5\n";
    folder.write("away.toml", coupler);
    folder.write("partly.toml", coupler + first);
    folder.write("there.toml", coupler + first + "[[slave]]\ndevice = \"digital_io_16\"\n");
    folder.write("group.xml", process::eni_with_group(folder.path() / "there.toml", 3, 5, 2));
    std::filesystem::create_directory(folder.path() / "etc");
    const auto place = folder.path().string() + "/";
    for (const bool away : {true, false}) {
        folder.write("etc/s.toml", "source = \"sim:" + place + (away ? "away" : "partly") +
                                       ".toml\"\ncycle_us = 10000\neni = \"" + place + "group.xml\"\n");
        const auto ran =
            folder.run(std::string(MARGAY_BIN_DIR) +
                       "/margayd --config etc --sockets . 2> log &\nd=$!\nn=0\nuntil grep -q 'all is right' "
                       "log; do sleep 0.05; n=$((n+1)); [ $n -lt 1200 ] || { cat log >&2; kill -9 $d; "
                       "exit 98; }; done\n" +
                       program + " --attach s.sock -o a.html; code=$?; kill $d; wait $d; exit $code");
        const auto faults = page("a.html").verdicts("fault");
        EXPECT_EQ(std::ranges::any_of(faults, [](const auto& one) { return contains(one, "Configured slave 2 "); }),
                  !away)
            << ran.out << ran.err;
        EXPECT_FALSE(std::ranges::any_of(faults, [](const auto& one) { return contains(one, "Configured slave 1 "); }))
            << ran.out << ran.err;
    }
}

TEST_F(ReportProgram, ASegmentInOpIsLeftToItsMaster) {
    constexpr auto kPatience = 60s;
    const std::string bin = std::string(MARGAY_BIN_DIR) + "/";
    process::Cable cable;
    if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
    folder.write("r.html", "old");
    const auto output = (folder.path() / "r.html").string();
    const auto socket = (folder.path() / "s.sock").string();
    const auto report = [&](std::vector<std::string> arguments) {
        arguments.insert(arguments.begin(), program);
        process::Child child(cable.master_namespace(), arguments);
        const int status = child.wait(kPatience);
        return process::Ran{status, child.output(), child.errors()};
    };
    process::Child segment(cable.segment_namespace(), {bin + "virtual_segment", process::Cable::kSegment, "demo"});
    ASSERT_TRUE(segment.says("serving", kPatience)) << segment.errors();
    process::Child master(cable.master_namespace(), {bin + "simple_io", process::Cable::kMaster, "--cycles",
                                                     "100000000", "--period", "2000", "--attach", socket});
    ASSERT_TRUE(master.says("all slaves in OP", kPatience)) << master.output() << master.errors();
    // The interface of the application belongs to this machine, so the report contains the facts of the interface.
    const auto attached = report({"--attach", socket, "-o", (folder.path() / "a.html").string()});
    EXPECT_LE(attached.status, 1) << attached.err;
    const auto nic = page("a.html").text("//section[@id='machine']");
    EXPECT_TRUE(contains(nic, std::string("Interface") + process::Cable::kMaster)) << nic;
    EXPECT_TRUE(contains(nic, "veth")) << nic;
    EXPECT_TRUE(contains(nic, "What nic_check says")) << nic;
    const auto before = segment.output().size();
    const auto refused = report({process::Cable::kMaster, "-o", output});
    EXPECT_EQ(refused.status, 1);
    EXPECT_TRUE(contains(refused.err, "slaves of this segment are in SAFEOP or OP (5 slaves answer)")) << refused.err;
    EXPECT_EQ(content_of(output), "old");
    EXPECT_FALSE(contains(segment.output().substr(before), ": INIT")) << segment.output().substr(before);
    master.terminate();
    (void)master.wait(kPatience);
    // The interface and the kernel are in the report; the findings of nic_check too.
    const auto taken = report({process::Cable::kMaster, "-o", output, "--take-over"});
    EXPECT_LE(taken.status, 1) << taken.err;
    const auto read = page("r.html");
    EXPECT_EQ(read.rows("slave-table"), 5U);
    const auto machine = read.text("//section[@id='machine']");
    EXPECT_TRUE(contains(machine, "veth")) << machine;
    EXPECT_TRUE(contains(machine, "What nic_check says")) << machine;
}

}  // namespace
}  // namespace margay::segment_report
