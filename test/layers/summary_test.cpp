// The short list "What works" of README.md says what test/matrix.md says.
#include <places.hpp>
#include "layers/summary_check.hpp"

#include <gtest/gtest.h>

namespace margay::layers {
namespace {

// clang-format off
constexpr SummaryProof kProofs[] = {
    {"bring-up", "scan", "Count slaves, station addresses"},
    {"bring-up", "topology", "Topology as a tree"},
    {"bring-up", "expected slaves", "Expected slaves by number"},
    {"bring-up", "hooks", "Hook between PREOP and SAFEOP"},
    {"bring-up", "start-up lists", "Start-up lists"},
    {"bring-up", "identification by alias or device id", "Expected slaves by number, alias or explicit device id"},
    {"bring-up", "BOOT", "BOOT, and back"},
    {"bring-up", "ENI and ESI files with modules", "Configuration from ENI and ESI files"},
    {"bring-up", "ENI and ESI files with modules", "Commands of EoE (IP parameters, filter) and AoE"},
    {"bring-up", "EoE and AoE commands of both", "Commands of EoE (IP parameters, filter) and AoE"},
    {"bring-up", "start-up commands of FoE and VoE in these files", "Configuration from ENI and ESI files"},
    {"process data", "discovery from CoE", "PDO discovery from CoE"},
    {"process data", "SoE", "PDO discovery from CoE, SII, SoE"},
    {"process data", "SII", "PDO discovery from CoE, SII"},
    {"process data", "groups", "Groups (domains)"},
    {"process data", "bit packing", "Process image: byte-wise, bit-packed"},
    {"process data", "overlapped images", "Process image: byte-wise, bit-packed, overlapped"},
    {"process data", "entries by name", "PDO entries registered by index"},
    {"process data", "slave-to-slave copies", "External or double-buffered image, slave-to-slave copy"},
    {"mailbox", "CoE with objects of any size", "SDO upload and download"},
    {"mailbox", "SDO information and emergencies", "SDO information"},
    {"mailbox", "SDO information and emergencies", "Emergencies"},
    {"mailbox", "SoE", "SoE: read and write IDNs"},
    {"mailbox", "FoE", "Read and write files whole"},
    {"mailbox", "EoE", "EoE: Ethernet frames beside the cycle"},
    {"mailbox", "VoE", "VoE: vendor header"},
    {"mailbox", "AoE", "AoE: read, write, read-write"},
    {"mailbox", "messages of any protocol", "Messages of any protocol"},
    {"mailbox", "AoE commands longer than a mailbox…", "AoE: commands and answers longer than a mailbox"},
    {"running", "supervision", "Lost slave noticed and named"},
    {"running", "recovery", "Lost slave noticed and named, returned to OP"},
    {"running", "hot connect groups", "Hot connect groups"},
    {"running", "cable diagnosis", "Error counters of ports"},
    {"running", "requests from any thread", "Submitting, cancelling and waiting from other threads"},
    {"running", "redundancy over two NICs", "Ring with two NICs"},
    {"running", "recordings of both", "Record and replay frames as pcap"},
    {"running", "frames that leave at a time…", "A cycle whose frames leave at a time"},
    {"running", "hardware time stamps and…", "Times of frames by the NIC"},
    {"running", "one case of exchanged slaves…", "The accepted working counter by coincidence"},
    {"running", "debug level…", "Error ring, statistics, debug level"},
    {"distributed clocks", "delays", "Propagation delays in any topology"},
    {"distributed clocks", "offsets", "Propagation delays in any topology, 32 and 64 bit clocks, offsets"},
    {"distributed clocks", "drift", "Drift compensation"},
    {"distributed clocks", "SYNC0 and SYNC1", "SYNC0, SYNC1"},
    {"distributed clocks", "latch inputs", "Latch inputs"},
    {"distributed clocks", "supervision", "DCM status, errors in words"},
    {"distributed clocks", "master shift and bus shift", "DCM master shift"},
    {"distributed clocks", "master shift and bus shift", "DCM bus shift"},
    {"distributed clocks", "the time stamps of the NIC", "DCM link layer as reference clock"},
    {"distributed clocks", "two segments in step (DCX)", "Two segments held in step"},
    {"distributed clocks", "the application's own time", "The application's own time"},
    {"distributed clocks", "log", "DCM status, errors in words, limits, events"},
    {"systems", "Linux with AF_PACKET", "Linux AF_PACKET"},
    {"systems", "POSIX", "Systems with POSIX clocks"},
    {"systems", "Cortex-M4 without an operating system…", "Without an operating system"},
    {"systems", "Cortex-M4 without an operating system and with FreeRTOS", "FreeRTOS"},
    {"systems", "compiles for Cortex-M0+", "Processors without compare-and-swap (ARMv6-M)"},
    {"systems", "Cortex-M7", "Processors without compare-and-swap"},
    {"systems", "RISC-V 32", "Processors without compare-and-swap"},
    {"systems", "big-endian", "Big-endian processors"},
    {"systems", "AF_XDP (SOURCE…", "AF_XDP: native and generic mode"},
    {"systems", "in the facades without a test", "AF_XDP as SOURCE of programs and facades"},
    {"tools", "`slaveinfo`", "`slaveinfo`: all slaves"},
    {"tools", "`eepromtool`", "Whole image to and from file"},
    {"tools", "`firmware_update`", "Firmware of a slave written"},
    {"tools", "`eoe_bridge`", "EoE: a TAP device for each slave"},
    {"tools", "`mailbox_gateway` (ETG.8200)", "Mailbox gateway (ETG.8200)"},
    {"tools", "`simple_io`", "First application"},
    {"tools", "`dc_motion`", "CiA 402 drives in csp"},
    {"tools", "`dc_plot`", "DCM status, errors in words, limits, events"},
    {"tools", "`segment_monitor`", "Monitor in the terminal"},
    {"tools", "`segment_report`…", "A support bundle as one HTML page"},
    {"tools", "`subdevice_check`", "Conformance check of a device"},
    {"tools", "`virtual_segment`", "Served on an interface or a TAP device"},
    {"tools", "pcap recorder", "Record and replay frames as pcap"},
    {"tools", "`ethercat` with the commands…", "States, registers, SII, rescan"},
    {"tools", "also attached to a running application", "`ethercat` attached to a running application"},
    {"tools", "`ethercat analyse`…", "Recordings of other masters"},
    {"tools", "the service `margayd`", "Service (`margayd`)"},
    {"tools", "`nic_check`: ran on veth…", "What interface, kernel and machine can do"},
    {"tools", "object dictionary of the master…", "Object dictionary of the master (ETG.1510)"},
    {"slave stack", "state machine", "EtherCAT state machine"},
    {"slave stack", "CoE", "CoE server"},
    {"slave stack", "SoE", "SoE server"},
    {"slave stack", "FoE", "FoE server"},
    {"slave stack", "EoE", "EoE server"},
    {"slave stack", "VoE", "VoE server"},
    {"slave stack", "AoE", "VoE server, AoE server"},
    {"slave stack", "SM- and DC-synchronous operation", "Polling, mixed and interrupt operation"},
    {"slave stack", "EEPROM emulation", "EEPROM emulation"},
    {"programs for other masters", "programs compile unchanged…", "SOEM 1.4 and 2.0"},
    {"programs for other masters", "programs compile unchanged…", "`ecrt.h` of IgH's userspace library"},
    {"programs for other masters", "SOEM 1.4 and 2.0: without…", "SOEM 1.4 and 2.0"},
    {"programs for other masters", "`ecrt.h` of IgH's userspace library…", "`ecrt.h` of IgH's userspace library"},
    {"simulation", "ESC registers", "ESC model: registers"},
    {"simulation", "FMMUs", "ESC model: registers, all commands, FMMUs"},
    {"simulation", "SyncManagers", "ESC model: registers, all commands, FMMUs, SMs"},
    {"simulation", "SII", "ESC model: registers, all commands, FMMUs, SMs, SII"},
    {"simulation", "clocks", "Distributed clocks: receive times"},
    {"simulation", "wire breaks", "Line, tree, drop lines, ring; wire breaks"},
    {"simulation", "55 quirks of real devices", "Deviations of real devices by name: 55"},
};
// clang-format on

TEST(Summary, SaysWhatTheMatrixSays) {
    const auto faults =
        summary_faults(text_of(MARGAY_SOURCE_DIR "/README.md"), text_of(MARGAY_SOURCE_DIR "/test/matrix.md"), kProofs);
    EXPECT_TRUE(faults.empty()) << joined(faults);
}

// The short list with these two cells, and the matrix with these rows.
std::string faults_of(const std::string& works, const std::string& rest, const std::string& rows) {
    static constexpr SummaryProof kTwo[] = {{"a", "scan", "Scan of slaves"}, {"a", "tree…", "Topology"}};
    const auto readme = "## What works\n\n| area | works | rest |\n|---|---|---|\n| a | " + works + " | " + rest +
                        " |\n\n## Next\n\n| b | tree | more |\n";
    return joined(summary_faults(readme, "| what | status | proof |\n|---|---|---|\n" + rows, kTwo));
}

TEST(Summary, CatchesWhatDiffersFromTheMatrix) {
    const std::string scan = "| Scan of slaves, all at once | works | `x` |\n";
    const std::string tree = "| Topology | works | `x` |\n";
    const std::string some = "| Topology | partly | no rings |\n";
    EXPECT_EQ(faults_of("scan, tree", "", scan + tree), "");
    EXPECT_EQ(faults_of("scan; and tree", "", scan + tree), "");
    EXPECT_EQ(faults_of("scan", "tree: in part (no rings; no stars)", scan + some), "");
    EXPECT_EQ(faults_of("scan, tree", "tree without rings", scan + some), "");
    EXPECT_EQ(faults_of("scan, tree", "tree: planned", scan + some), "");
    const std::string begin = "\nREADME.md, What works: ";
    EXPECT_EQ(faults_of("scan, tree, cars", "", scan + tree), begin + "no row of test/matrix.md for \"cars\"");
    EXPECT_EQ(faults_of("scan", "", scan + tree), begin + "no such item: a: tree…");
    EXPECT_EQ(faults_of("scan, tree", "", scan), begin + "test/matrix.md has no such row: Topology");
    EXPECT_EQ(faults_of("scan, tree", "", scan + some), begin + "\"tree\" works, and \"Topology\" is partly" + begin +
                                                            "\"Topology\" is partly: not in the last column");
    EXPECT_EQ(faults_of("scan", "tree: planned", scan + tree), begin + "\"tree: planned\", and \"Topology\" works");
    EXPECT_EQ(faults_of("scan, tree", "", scan + tree + "| Cars | planned | |\n"),
              begin + "\"Cars\" is planned: not in the last column");
    EXPECT_EQ(faults_of("scan, tree", "", scan + "| Topology | no | |\n"),
              begin + "\"tree\" works, and \"Topology\" is no");
    EXPECT_EQ(joined(summary_faults("## Nothing\n", scan, {})), "\nREADME.md: no table below \"What works\"");
}

}  // namespace
}  // namespace margay::layers
