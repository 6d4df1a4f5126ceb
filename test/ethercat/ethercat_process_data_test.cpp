// The commands of ethercat about process data: pdos, cstruct, xml, config, domains, data.
#include "ethercat/ethercat_fixture.hpp"
#include "process/made_eni.hpp"

#include <margay/files/esi.hpp>

#include <chrono>

namespace margay::process {
namespace {

using namespace std::chrono_literals;
using EthercatProcessData = EthercatTest;

TEST_F(EthercatProcessData, ListsPdosOfTheDictionaryAndOfTheSii) {
    EXPECT_EQ(out("sim:drives", "pdos -p 0"),
              "SM0: PhysAddr 0x1000, DefaultSize  256, ControlRegister 0x26, Enable 1\n"
              "SM1: PhysAddr 0x1200, DefaultSize  256, ControlRegister 0x22, Enable 1\n"
              "SM2: PhysAddr 0x1400, DefaultSize   14, ControlRegister 0x64, Enable 1\n"
              "  RxPDO 0x1600 \"RxPDO\"\n"
              "    PDO entry 0x6040:00, 16 bit, \"Controlword\"\n"
              "    PDO entry 0x607a:00, 32 bit, \"Target position\"\n"
              "    PDO entry 0x60ff:00, 32 bit, \"Target velocity\"\n"
              "    PDO entry 0x6071:00, 16 bit, \"Target torque\"\n"
              "    PDO entry 0x6060:00,  8 bit, \"Modes of operation\"\n"
              "    PDO entry 0x0000:00,  8 bit, \"Gap\"\n"
              "SM3: PhysAddr 0x1600, DefaultSize   20, ControlRegister 0x20, Enable 1\n"
              "  TxPDO 0x1a00 \"TxPDO\"\n"
              "    PDO entry 0x6041:00, 16 bit, \"Statusword\"\n"
              "    PDO entry 0x6064:00, 32 bit, \"Position actual value\"\n"
              "    PDO entry 0x606c:00, 32 bit, \"Velocity actual value\"\n"
              "    PDO entry 0x6077:00, 16 bit, \"Torque actual value\"\n"
              "    PDO entry 0x6061:00,  8 bit, \"Modes of operation display\"\n"
              "    PDO entry 0x0000:00,  8 bit, \"Gap\"\n"
              "    PDO entry 0x603f:00, 16 bit, \"Error code\"\n"
              "    PDO entry 0x60fd:00, 32 bit, \"Digital inputs\"\n");
    const auto sii = out("sim:demo", "pdos -p 1");
    EXPECT_TRUE(
        sii.starts_with("SM0: PhysAddr 0x1000, DefaultSize    1, ControlRegister 0x00, Enable 1\n"
                        "  TxPDO 0x1a00 \"Channel 1\"\n    PDO entry 0x6000:01,  1 bit, \"Value\"\n"))
        << sii;
    EXPECT_TRUE(contains(out("sim:demo", "pdos"), "=== Master 0, Slave 1 ===\nSM0: "));
    EXPECT_TRUE(contains(out("sim:demo", "pdos -p 1 --json"), "\"direction\": \"inputs\""));
    const auto etherlab = out("sim:drives", "pdos -p 0 --skin etherlab");
    EXPECT_TRUE(contains(etherlab, "slave_config.vendor = hex2dec('00004d47');\n")) << etherlab;
    EXPECT_TRUE(contains(etherlab, "hex2dec('607a'), hex2dec('00'), 32; ...\n")) << etherlab;
    EXPECT_TRUE(contains(etherlab, "port_config.output(2).pdo_data_type = sint(32);\n")) << etherlab;
    fails("sim:demo", "pdos --skin bare", 2, "--skin: 'bare' is none of default, etherlab");
}

// The output compiles with our ecrt.h, in C and in C++, and configures a slave.
TEST_F(EthercatProcessData, PrintsCThatCompiles) {
    const auto text = out("sim:drives", "cstruct -p 0");
    EXPECT_TRUE(
        text.starts_with("/* Master 0, Slave 0, \"Servo drive\"\n * Vendor ID:       0x00004d47\n"
                         " * Product code:    0x00005402\n * Revision number: 0x00000001\n */\n"))
        << text;
    EXPECT_TRUE(contains(text,
                         "ec_sync_info_t slave_0_syncs[] = {\n"
                         "    {2, EC_DIR_OUTPUT, 1, slave_0_pdos + 0, EC_WD_ENABLE},\n"
                         "    {3, EC_DIR_INPUT, 1, slave_0_pdos + 1, EC_WD_DISABLE},\n"
                         "    {0xff}\n};\n"))
        << text;
    for (const std::string segment : {"drives", "demo", "mixed200"}) {
        const auto all = out("sim:" + segment, "cstruct");
        const bool first = contains(all, "slave_0_syncs");
        folder.write("all.c",
                     "#include <ecrt.h>\n#include <stddef.h>\n" + all +
                         "int use(ec_slave_config_t* sc) {\n    return ecrt_slave_config_pdos(sc, EC_END, slave_" +
                         (first ? "0" : "1") + "_syncs);\n}\n");
        const std::string includes = " -I'" MARGAY_SOURCE_DIR "/src/compat/ecrt/include' ";
        const auto c = folder.run("cc -std=c99 -Wall -Werror -fsyntax-only" + includes + "all.c");
        EXPECT_EQ(c.status, 0) << segment << c.err;
        const auto cpp = folder.run("c++ -x c++ -Wall -Werror -fsyntax-only" + includes + "all.c");
        EXPECT_EQ(cpp.status, 0) << segment << cpp.err;
    }
    EXPECT_TRUE(contains(out("sim:demo", "cstruct -p 0"), "/* No process data. */\n"));
    fails("sim:demo", "cstruct -p 7", 1, "no slave of master 0 is selected by --position 7");
}

TEST_F(EthercatProcessData, WritesAnEsiThatTheReaderAccepts) {
    EXPECT_EQ(out("sim:demo", "xml -o all.xml"), "");
    const auto esi = files::read_esi(content_of(folder.path() / "all.xml"));
    ASSERT_TRUE(esi) << to_text(esi.problem);
    EXPECT_EQ(esi->devices.size(), 5U);
    EXPECT_EQ(out("sim:demo", "xml"), content_of(folder.path() / "all.xml"));
    EXPECT_TRUE(contains(out("sim:demo", "xml -p 1 --json"), "\"devices\": 1"));
    EXPECT_TRUE(contains(out("sim:demo", "xml --json -o both.xml"), "\"xml\": \"<?xml"));
    EXPECT_EQ(content_of(folder.path() / "both.xml"), content_of(folder.path() / "all.xml"));
    fails("sim:demo", "xml -p 1 -o no/such/folder", 3, "no/such/folder: cannot be written");
}

// A blank EEPROM has the vendor 0.
TEST_F(EthercatProcessData, AnEsiHasOneVendorAlsoIfThatIs0) {
    for (const std::string vendor : {"0", "2"})
        folder.write("v" + vendor + ".xml",
                     "<EtherCATInfo><Vendor><Id>" + vendor +
                         "</Id><Name>V</Name></Vendor><Descriptions><Devices><Device><Type ProductCode=\"1\" "
                         "RevisionNo=\"1\">T</Type><Name>N</Name><GroupType>G</GroupType></Device></Devices>"
                         "</Descriptions></EtherCATInfo>");
    fails("sim:v0.xml,v2.xml", "xml", 2, "slave 1 is of vendor 0x00000002, and the slaves before it of 0x00000000");
    EXPECT_TRUE(contains(out("sim:v0.xml", "xml"), "<Id>#x00000000</Id>"));
    const auto ran = folder.run(std::string(MARGAY_BIN_DIR) + "/slaveinfo sim:v0.xml,v2.xml --write-esi all.xml");
    EXPECT_TRUE(contains(ran.err, "slave 2 is of another vendor, and an ESI has one: left out")) << ran.err;
    EXPECT_TRUE(contains(content_of(folder.path() / "all.xml"), "<Id>#x00000000</Id>"));
}

TEST_F(EthercatProcessData, AnEsiHasEachRevisionOfAProduct) {
    for (const std::string revision : {"1", "2"})
        folder.write("r" + revision + ".xml",
                     "<EtherCATInfo><Vendor><Id>2</Id><Name>V</Name></Vendor><Descriptions><Devices><Device>"
                     "<Type ProductCode=\"1\" RevisionNo=\"" +
                         revision +
                         "\">T</Type><Name>N</Name><GroupType>G</GroupType></Device></Devices></Descriptions>"
                         "</EtherCATInfo>");
    const auto devices = [](const std::string& text) {
        unsigned count = 0;
        for (std::size_t at = 0; (at = text.find("<Device>", at)) != std::string::npos; ++at) ++count;
        return count;
    };
    EXPECT_EQ(devices(out("sim:r1.xml,r2.xml,r1.xml", "xml")), 2U);
    const auto ran = folder.run(std::string(MARGAY_BIN_DIR) + "/slaveinfo sim:r1.xml,r2.xml,r1.xml --write-esi r.xml");
    EXPECT_EQ(ran.status, 0) << ran.err;
    EXPECT_EQ(devices(content_of(folder.path() / "r.xml")), 2U);
}

TEST_F(EthercatProcessData, ListsConfigurations) {
    EXPECT_EQ(out("sim:demo", "config"),
              "0:0  0x00004d47/0x00000100  0  SAFEOP\n"
              "0:1  0x00004d47/0x00001008  1  SAFEOP\n"
              "0:2  0x00004d47/0x00002008  2  SAFEOP\n"
              "0:3  0x00004d47/0x00003004  3  SAFEOP\n"
              "0:4  0x00004d47/0x00004002  4  SAFEOP\n");
    EXPECT_EQ(out("sim:demo", "config -p 2"), "0:2  0x00004d47/0x00002008  2  SAFEOP\n");
    const auto details = out("sim:drives", "config -v -p 0");
    EXPECT_TRUE(contains(details, "SM2, Dir: Output, Watchdog: Enable\n  PDO 0x1600 \"RxPDO\"\n")) << details;
    EXPECT_TRUE(contains(details, "SDO configuration:\n  None.\n")) << details;
    EXPECT_TRUE(contains(out("sim:demo", "config --json"), "\"attached\": 4"));
    fails("sim:demo", "config -a 9", 1, "no configuration is selected by --alias and --position");
    fails("sim:demo", "config -p 0,77", 1, "there is no configuration at position 77");
    fails("sim:demo", "config -a 0,9", 1, "there is no configuration with alias 9");
}

TEST_F(EthercatProcessData, CyclesThatDoNotFitEachOtherAreRefused) {
    auto text = eni_of_two_groups();
    const std::string cycle = "<CycleTime>1000<";
    ASSERT_NE(text.rfind(cycle), text.find(cycle));
    text.replace(text.rfind(cycle), cycle.size(), "<CycleTime>1500<");
    folder.write("odd.xml", text);
    fails("sim:drive,drive", "states OP --eni odd.xml", 1,
          "odd.xml: the ENI has a cycle of 1500 µs, which is no multiple of its shortest one, 1000 µs");
}

// The first column is the address, as in the output of `slaves` and `domains`.
TEST_F(EthercatProcessData, ListsConfigurationsByTheirAlias) {
    folder.write(
        "alias.toml",
        "[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = \"digital_in_8\"\nalias = 5555\n[[slave]]\ndevice = "
        "\"digital_out_8\"\n");
    EXPECT_EQ(out("sim:alias.toml", "config"),
              "0:0  0x00004d47/0x00000100  0  SAFEOP\n"
              "5555:0  0x00004d47/0x00001008  1  SAFEOP\n"
              "5555:1  0x00004d47/0x00002008  2  SAFEOP\n");
    EXPECT_EQ(out("sim:alias.toml", "config -a 5555 -p 1"), "5555:1  0x00004d47/0x00002008  2  SAFEOP\n");
    EXPECT_EQ(out("sim:alias.toml", "config -p 0"), "0:0  0x00004d47/0x00000100  0  SAFEOP\n");
    EXPECT_TRUE(contains(out("sim:alias.toml", "config --json"), "\"alias\": 5555"));
}

// The reference clock of the ENI drifts, and a drive accepts only frames at their place before SYNC0.
TEST_F(EthercatProcessData, TheCycleFollowsTheReferenceClockOfAnEni) {
    const std::string bin = std::string(MARGAY_BIN_DIR) + "/";
    for (const auto cycle : {1ms, 4ms}) {
        folder.write("clocked.xml", clocked_eni("sim:coupler,drive,drive", 2, cycle));
        EXPECT_EQ(out("sim:coupler,drive,drive", "states OP --eni clocked.xml"), "") << cycle.count();
        const auto ran = folder.run(bin + "simple_io sim:coupler,drive,drive --eni clocked.xml --cycles 1000");
        EXPECT_EQ(ran.status, 0) << ran.err;
        EXPECT_EQ(ran.err, "");
        EXPECT_TRUE(contains(ran.out, "1000 cycles, 0 without all frames, 0 with a wrong working counter\n"))
            << ran.out;
    }
    const auto other =
        folder.run(bin + "simple_io sim:coupler,drive,drive --eni clocked.xml --cycles 10 --period 3000");
    EXPECT_TRUE(
        contains(other.err,
                 "simple_io: warning: the ENI uses clocks in a cycle of 4000 µs: slaves with SYNC0 may refuse a "
                 "cycle of 3000 µs\n"))
        << other.err;
}

// Each Cyclic element of an ENI has an image of its own.
TEST_F(EthercatProcessData, AllGroupsOfAnEniAreShown) {
    const std::string bin = std::string(MARGAY_BIN_DIR) + "/";
    folder.write("groups.xml", eni_of_two_groups());
    const auto map = folder.run(bin + "slaveinfo sim:drive,drive --eni groups.xml --map");
    EXPECT_EQ(map.status, 0) << map.err;
    EXPECT_TRUE(contains(map.out, "\nGroup 0: Process image: 34 octets")) << map.out;
    EXPECT_TRUE(contains(map.out, "\nGroup 1: Process image: 34 octets")) << map.out;
    EXPECT_TRUE(contains(map.out, "  slave 2 Servo drive, outputs\n")) << map.out;
    const auto json = folder.run(bin + "slaveinfo sim:drive,drive --eni groups.xml --map --json");
    EXPECT_TRUE(contains(json.out, "\"process_images\": [")) << json.out;
    EXPECT_TRUE(contains(json.out, "\"group\": 1,")) << json.out;
    const auto code = folder.run(bin + "slaveinfo sim:drive,drive --eni groups.xml --map --cstruct");
    EXPECT_EQ(code.status, 1);
    EXPECT_EQ(code.err, "slaveinfo: --cstruct describes one process image, and the ENI has several Cyclic elements\n");
    // A slave of the first group fails: the other group is mapped.
    ASSERT_EQ(folder.run("sed -i '0,/<Index>24672/s//<Index>24575/' groups.xml").status, 0);
    const auto domains = ethercat("sim:drive,drive", "domains --eni groups.xml");
    EXPECT_TRUE(contains(domains.out, "Domain1: ")) << domains.out << domains.err;
    EXPECT_TRUE(contains(domains.err, "0x5fff")) << domains.err;
}

// `config` prints the expected ids, also where another slave answers.
TEST_F(EthercatProcessData, ListsTheExpectedIdsOfAConfiguration) {
    folder.write("two.toml", "[[slave]]\ndevice = \"drive\"\ncount = 2\n");
    folder.write("other.toml", "[[slave]]\ndevice = \"drive\"\n[[slave]]\ndevice = \"digital_io_16\"\n");
    ASSERT_EQ(folder.run(std::string(MARGAY_BIN_DIR) + "/slaveinfo sim:two.toml --write-eni two.xml").status, 0);
    const auto other = ethercat("sim:other.toml", "config --eni two.xml");
    EXPECT_TRUE(contains(other.out, "0:1  0x00004d47/0x00005402  1  PREOP\n")) << other.out << other.err;
}

// In the ENI, slot 2 has the module 0x401. In the slave, slot 2 has the module 0x302.
TEST_F(EthercatProcessData, NamesTheSlotWithAnotherModuleThanInTheEni) {
    const std::string bin = std::string(MARGAY_BIN_DIR) + "/";
    folder.write("one.toml", "[[slave]]\ndevice = \"modular_io\"\n");
    const auto command = [](int subindex, const std::string& data) {
        return "<InitCmd><Transition>PS</Transition><Timeout>0</Timeout><Ccs>1</Ccs><Index>61488</Index><SubIndex>" +
               std::to_string(subindex) + "</SubIndex><Data>" + data + "</Data></InitCmd>";
    };
    const auto list = command(0, "00") + command(1, "04010000") + command(2, "08020000") + command(3, "01040000") +
                      command(4, "01040000") + command(0, "04");
    ASSERT_EQ(folder
                  .run(bin + "slaveinfo sim:one.toml --write-eni one.xml && sed -i 's|</Mailbox>|<CoE><InitCmds>" +
                       list + "</InitCmds></CoE></Mailbox>|' one.xml")
                  .status,
              0);
    const std::string cause =
        "SDO upload of 0xf050:3: the value is not the required one (wanted 0x00000401, is 0x00000302); slot 2 has "
        "another module than the ENI file says\n";
    const auto once = [&](const std::string& text) {
        const auto at = text.find(cause);
        return at != std::string::npos && text.find("0xf050", at + 20) == std::string::npos;
    };
    for (const std::string line : {"slaveinfo sim:one.toml", "slaveinfo sim:one.toml --map", "simple_io sim:one.toml",
                                   "ethercat data --source sim:one.toml", "ethercat slaves --source sim:one.toml"}) {
        const auto ran = folder.run(bin + line + " --eni one.xml");
        EXPECT_TRUE(once(ran.err)) << line << "\n" << ran.err;
        EXPECT_TRUE(line.starts_with("ethercat") || ran.status == 1) << line;
    }
}

// Configurations of an ENI: the SDOs of its start-up commands, and an expected slave that is missing.
TEST_F(EthercatProcessData, ListsConfigurationsOfAnEni) {
    const std::string slaveinfo = std::string(MARGAY_BIN_DIR) + "/slaveinfo";
    folder.write("one.toml", "[[slave]]\ndevice = \"drive\"\n");
    folder.write("two.toml", "[[slave]]\ndevice = \"drive\"\ncount = 2\n");
    const auto eni = folder.run(slaveinfo + " sim:two.toml --write-eni two.xml");
    ASSERT_EQ(eni.status, 0) << eni.err;
    EXPECT_EQ(out("sim:two.toml", "config --eni two.xml"),
              "0:0  0x00004d47/0x00005402  0  SAFEOP\n0:1  0x00004d47/0x00005402  1  SAFEOP\n");
    const auto command =
        "sed -i 's|</Mailbox>|<CoE><InitCmds><InitCmd><Transition>PS</Transition><Timeout>0</Timeout><Ccs>1</Ccs>"
        "<Index>24672</Index><SubIndex>0</SubIndex><Data>08</Data></InitCmd></InitCmds></CoE></Mailbox>|' two.xml";
    ASSERT_EQ(folder.run(command).status, 0);
    const auto details = ethercat("sim:two.toml", "config -v -p 1 --eni two.xml");
    EXPECT_TRUE(contains(details.out, "SDO configuration:\n  0x6060:00, 1 byte: 0x08\n")) << details.out << details.err;
    // The start-up command at SO writes an object that does not exist. simple_io and ethercat print the same cause.
    ASSERT_EQ(folder
                  .run("sed 's|<Transition>PS</Transition><Timeout>0|<Transition>SO</Transition><Timeout>0|;"
                       "s|<Index>24672|<Index>20480|' two.xml > refused.xml")
                  .status,
              0);
    const std::string cause =
        "command at SO (no. 1, object 0x5000:0): the slave aborted the transfer (abort code 0x06020000";
    const auto states = ethercat("sim:two.toml", "states OP --eni refused.xml");
    EXPECT_TRUE(contains(states.err, cause)) << states.err;
    const auto simple = folder.run(std::string(MARGAY_BIN_DIR) + "/simple_io sim:two.toml --eni refused.xml");
    EXPECT_EQ(simple.status, 1);
    EXPECT_TRUE(contains(simple.err, ") is in SAFEOP: " + cause)) << simple.err;
    const auto json = ethercat("sim:two.toml", "config --json -p 1 --eni two.xml");
    EXPECT_TRUE(contains(json.out, "\"parameters\": [],\n          \"dc\": null\n")) << json.out;
    const auto clocks =
        "sed 's|</InitCmds>|<InitCmd><Transition>PS</Transition><Cmd>8</Cmd><Adp>0</Adp><Ado>2464</Ado>"
        "<Data>40420f0000000000</Data></InitCmd><InitCmd><Transition>PS</Transition><Cmd>8</Cmd><Adp>0</Adp>"
        "<Ado>2432</Ado><Data>0003</Data></InitCmd></InitCmds>|' one.xml > dc.xml";
    ASSERT_EQ(folder.run(slaveinfo + " sim:one.toml --write-eni one.xml && " + clocks).status, 0);
    const auto timed = ethercat("sim:one.toml", "config --json --eni dc.xml");
    EXPECT_TRUE(contains(timed.out, "\"assign_activate\": 768,\n            \"sync0_cycle_ns\": 1000000,"))
        << timed.out << timed.err;
    const auto missing = ethercat("sim:one.toml", "config --eni two.xml");
    EXPECT_TRUE(contains(missing.out, "0:1  0x00004d47/0x00005402  -  -\n")) << missing.out << missing.err;
    EXPECT_TRUE(contains(missing.err, "configured slave 1: ")) << missing.err;
    fails("sim:two.toml", "config --eni nothing.xml", 3, "nothing.xml");
}

TEST_F(EthercatProcessData, ListsDomains) {
    EXPECT_EQ(out("sim:demo", "domains"), "Domain0: LogBaseAddr 0x00000000, Size  14, WorkingCounter 6/6\n");
    EXPECT_EQ(out("sim:demo", "domains -v -d 0"),
              "Domain0: LogBaseAddr 0x00000000, Size  14, WorkingCounter 6/6\n"
              "  SlaveConfig 0:1, SM0 ( Input), LogAddr 0x00000005, Size 1\n"
              "    00\n"
              "  SlaveConfig 0:2, SM0 (Output), LogAddr 0x00000000, Size 1\n"
              "    00\n"
              "  SlaveConfig 0:3, SM0 ( Input), LogAddr 0x00000006, Size 8\n"
              "    00 00 00 00 00 00 00 00\n"
              "  SlaveConfig 0:4, SM0 (Output), LogAddr 0x00000001, Size 4\n"
              "    00 00 00 00\n");
    EXPECT_TRUE(contains(out("sim:demo", "domains --json"), "\"working_counter\": 6"));
    fails("sim:demo", "domains -d 3", 1, "there is no domain 3");
    fails("sim:demo", "domains -d x", 2, "--domain: 'x' is no number");
}

TEST_F(EthercatProcessData, PrintsProcessData) {
    EXPECT_EQ(out("sim:demo", "data"), std::string(14, '\0'));
    // The status word of a drive is in the inputs of the image, behind the outputs of all drives.
    const auto drives = out("sim:drives", "data");
    ASSERT_EQ(drives.size(), 184U);
    EXPECT_EQ(drives.substr(0x50, 2), "\x50\x02");
    EXPECT_EQ(out("sim:demo", "data -o image"), "");
    EXPECT_EQ(content_of(folder.path() / "image"), std::string(14, '\0'));
    EXPECT_EQ(out("sim:demo", "data --watch --count 2 --interval 3"),
              "Domain0: 00 00 00 00 00 00 00 00 00 00 00 00 00 00\n"
              "Domain0: 00 00 00 00 00 00 00 00 00 00 00 00 00 00\n");
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_EQ(out("sim:demo", "crc --watch --count 4 --interval 100 -p 0 | wc -l"), "12\n");
    EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(300))
        << "a simulated segment, too, is watched live";
    EXPECT_EQ(out("sim:demo", "data --count 2 --interval 3"),
              "Domain0: 00 00 00 00 00 00 00 00 00 00 00 00 00 00\n"
              "Domain0: 00 00 00 00 00 00 00 00 00 00 00 00 00 00\n");
    EXPECT_TRUE(contains(out("sim:demo", "data --json"), "\"data\": \"0000000000000000000000000000\""));
    EXPECT_TRUE(contains(out("sim:demo", "data --json -o octets"), "\"data\": \"0000000000000000000000000000\""));
    EXPECT_EQ(content_of(folder.path() / "octets"), std::string(14, '\0')) << "the file is not forgotten";
    fails("sim:demo", "data --watch -o image", 2, "--output-file takes the octets of one cycle");
    fails("sim:demo", "data -d 2", 1, "there is no domain 2");
    fails("sim:demo", "data -d 0,2", 1, "there is no domain 2");
    fails("sim:demo", "data -o no/such/folder", 3, "cannot be written");
    const auto lost = ethercat("sim:demo", "data --json -o no/such/folder");
    EXPECT_EQ(lost.status, 3);
    EXPECT_TRUE(contains(lost.out, "\"error\": \"no/such/folder: cannot be written")) << lost.out;
    const auto first = ethercat("", "data --json -o part -S sim:no-such.toml -S sim:demo");
    EXPECT_EQ(first.status, 3) << first.err;
    EXPECT_FALSE(std::filesystem::exists(folder.path() / "part")) << "the octets of one master of two";
    const auto full = ethercat("sim:demo", "data >/dev/full");
    EXPECT_EQ(full.status, 3);
    EXPECT_TRUE(contains(full.err, "standard output cannot be written: No space left on device")) << full.err;
    const auto closed = folder.run("mkfifo p && exec 3<>p && exec 4>p && exec 3<&- && rm p; " + program +
                                   " data --watch -S sim:demo >&4");
    EXPECT_EQ(closed.status, 3) << "it ends by itself";
    EXPECT_TRUE(contains(closed.err, "standard output cannot be written: Broken pipe")) << closed.err;
}

}  // namespace
}  // namespace margay::process
