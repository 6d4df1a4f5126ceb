// ENI files: what the reader reads, what it refuses, and what it names as not supported.
#include <margay/files/eni.hpp>

#include "files/examples.hpp"

#include <gtest/gtest.h>

namespace margay::files {
namespace {

using namespace std::chrono_literals;

std::string problem_with(const std::string& replace, const std::string& by) {
    std::string text = kExampleEni;
    const auto at = text.find(replace);
    EXPECT_NE(at, std::string::npos) << replace;
    text.replace(at, replace.size(), by);
    const auto eni = read_eni(text);
    return eni ? std::string("read") : to_text(eni.problem);
}

TEST(EniReader, MakesConfigurations) {
    const auto eni = read_eni(kExampleEni);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    EXPECT_EQ(eni->master_name, "Line 4");
    ASSERT_EQ(eni->slaves.size(), 2U);
    EXPECT_EQ(eni->slaves[1].name, "Second");
    EXPECT_EQ(eni->slaves[1].number, 2);
    EXPECT_EQ(eni->slaves[1].station_address, 1002);
    const ExpectedSlave& first = eni->expected()[0];
    EXPECT_EQ(first.number, 1);
    EXPECT_EQ(first.vendor, std::nullopt) << "only what the file checks";
    EXPECT_EQ(first.product, 77U);
    EXPECT_EQ(first.revision, 5U);
    EXPECT_TRUE(first.newer_revision);
    EXPECT_EQ(eni->expected()[1].vendor, 2U) << "a file without checks says which slave it is made for";
    const SlaveConfiguration& config = *first.config;
    EXPECT_EQ(config.source, ConfigurationSource::file);
    ASSERT_EQ(config.sm_count, 1);
    EXPECT_EQ(config.sms[0], (ProcessSm{2, Direction::outputs, 0x64, 0x1100, 16}));
    EXPECT_TRUE(config.mailbox_status);
    EXPECT_EQ(config.place().outputs_bit, 0U);
    EXPECT_EQ(config.times().to_safeop, 7s);
    ASSERT_EQ(config.startup().size(), 3U);
    EXPECT_EQ(config.startup()[0].kind, StartupCommand::Kind::write_object);
    EXPECT_EQ(config.startup()[0].index, 0x1C12);
    EXPECT_EQ(config.startup()[0].timeout, 500ms);
    EXPECT_EQ(config.startup()[1].index, 0x0420);
    EXPECT_EQ(config.startup()[1].transitions, Transition::preop_to_safeop);
    EXPECT_EQ(config.startup()[1].retries, 2);
    EXPECT_FALSE(config.startup()[1].any_counter);
    EXPECT_EQ(config.startup()[2].index, 0x0200) << "a broadcast of the master";
    EXPECT_TRUE(config.startup()[2].any_counter);
    ASSERT_EQ(config.pdos().size(), 1U);
    EXPECT_EQ(config.pdos()[0].pdos[0].entries[0], (PdoEntry{0x7000, 1, 16}));
    EXPECT_TRUE(eni->expected()[1].config->no_mailbox);
    ASSERT_EQ(eni->groups.size(), 1U);
    EXPECT_EQ(eni->groups[0].cycle, 2ms);
    EXPECT_EQ(eni->groups[0].config.start.value, 0x0100'0000U);
    EXPECT_TRUE(eni->groups[0].config.block_lrw);
    EXPECT_TRUE(eni->groups[0].config.al_status);
    EXPECT_FALSE(eni->clocks);
    EXPECT_EQ(eni->image_bytes, 5U) << "three octets, and at most two for a mailbox status bit";
}

TEST(EniReader, VariablesAreFoundInTheDataOfTheirSlaves) {
    const auto eni = read_eni(kExampleEni);
    ASSERT_TRUE(eni);
    const EniVariable* out = eni->find("First.Out");
    ASSERT_NE(out, nullptr);
    EXPECT_EQ(out->slave, 1);
    EXPECT_EQ(out->bit, 8U);
    EXPECT_EQ(out->direction, Direction::outputs);
    EXPECT_EQ(eni->find("Second.In")->slave, 2);
    EXPECT_EQ(eni->find("SlaveCount")->slave, 0) << "a variable of the tool, not on the wire";
    EXPECT_EQ(eni->find("nothing"), nullptr);
}

TEST(EniReader, NamesWhatIsNotSupportedByLine) {
    const auto eni = read_eni(kExampleEni);
    ASSERT_TRUE(eni);
    std::vector<std::string> said;
    for (const Remark& one : eni.remarks) said.push_back(to_text(one));
    EXPECT_EQ(said,
              (std::vector<std::string>{
                  "line 20, column 38: the transition 'PP' is not supported: nothing is sent then",
                  "line 12, column 17: the start-up command of EoE is not sent: its data is neither that of IP "
                  "parameters nor of "
                  "an address filter",
                  "line 30, column 2: the inputs are at logical address 0x01000800 in the file; the library exchanges "
                  "them behind the outputs, at 0x01000002",
                  "line 31, column 2: Cnt is 2, and the FMMUs of the slaves give 1: the library expects what the "
                  "FMMUs give"}));
}

TEST(EniReader, RefusesWithLineAndCause) {
    EXPECT_EQ(problem_with("<Cmd>8</Cmd>", "<Cmd>15</Cmd>"),
              "line 4, column 66: Cmd is 15, which is no EtherCAT command");
    EXPECT_EQ(problem_with("<Adp>0</Adp>", "<Adp>70000</Adp>"),
              "line 4, column 78: Adp is '70000', which is not between 0 and 65535");
    EXPECT_EQ(problem_with("<AutoIncAddr>65535</AutoIncAddr>", "<AutoIncAddr>0</AutoIncAddr>"),
              "line 23, column 2: two slaves have the same AutoIncAddr");
    EXPECT_EQ(problem_with("00000001020000070011000201000000", "0000000102000007001200020100000"),
              "line 19, column 80: Data has an odd number of hexadecimal digits");
    EXPECT_EQ(problem_with("00000001020000070011000201000000", "00000001020000070012000201000000"),
              "line 19, column 2: FMMU 0 maps memory of no SyncManager that the file sets, which is not supported");
    EXPECT_EQ(problem_with("00000001020000070011000201000000", "00000001030000070011000201000000"),
              "line 18, column 2: SyncManager 2 has 2 octets, and its FMMU maps 24 bits");
    EXPECT_EQ(
        problem_with("00000001020000070011000201000000", "00000001000000070011000201000000"),
        "line 19, column 2: FMMU 0 has values that no FMMU of process data has: length, bits or direction are wrong");
    EXPECT_EQ(problem_with("<Addr>16777216</Addr>", "<Addr>9</Addr>"),
              "line 7, column 2: no Cyclic element exchanges the process data of the slave");
    EXPECT_EQ(to_text(read_eni("<EtherCATConfig><Config/></EtherCATConfig>").problem),
              "line 1, column 18: the file describes no slave");
    EXPECT_EQ(
        to_text(read_eni("<EtherCATMailbox/>").problem),
        "line 1, column 2: the file is a list of start-up commands (EtherCATMailbox) and not the configuration of a "
        "segment");
    EXPECT_EQ(to_text(read_eni("<EtherCATInfo/>").problem),
              "line 1, column 2: the root element is EtherCATInfo: an ENI has EtherCATConfig");
}

TEST(EniReader, AMaskOfAnotherSizeThanItsDataIsRefused) {
    const std::string other = "<InitCmd><Transition>IP</Transition><Cmd>2</Cmd>";
    for (const std::string ado : {"4096", "1288"})  // any register; the data of the SII
        for (const std::size_t octets : {1U, 3U, 5U, 8U, 9U, 400U}) {
            const auto init = "<InitCmd><Transition>IP</Transition><Cmd>4</Cmd><Adp>1001</Adp><Ado>" + ado +
                              "</Ado><DataLength>400</DataLength><Validate><Data>01000000</Data><DataMask>" +
                              std::string(octets * 2, 'f') + "</DataMask></Validate></InitCmd>";
            const auto problem = problem_with(other, init + other);
            EXPECT_TRUE(problem.ends_with("DataMask of Validate has another size than Data")) << problem;
        }
}

// Without the error, the first element would be used, and no remark would name the second element.
TEST(EniReader, WhatIsThereTwiceIsRefused) {
    EXPECT_EQ(problem_with("</Config>", "</Config><Config/>"),
              "line 37, column 11: a second Config in EtherCATConfig: the first one is in line 2");
    EXPECT_EQ(problem_with("<VendorId>2</VendorId>", "<VendorId>2</VendorId><VendorId>3</VendorId>"),
              "line 7, column 108: a second VendorId in Info: the first one is in line 7");
    EXPECT_EQ(problem_with("<Cmd>8</Cmd>", "<Cmd>8</Cmd><Cmd>7</Cmd>"),
              "line 4, column 78: a second Cmd in InitCmd: the first one is in line 4");
    EXPECT_EQ(problem_with("</Recv><Protocol>", "</Recv><Recv/><Protocol>"),
              "line 10, column 147: a second Recv in Mailbox: the first one is in line 10");
    EXPECT_EQ(problem_with("<Outputs>", "<Inputs/><Outputs>"),
              "line 36, column 2: a second Inputs in ProcessImage: the first one is in line 34");
    EXPECT_EQ(problem_with("</Send><Sm2>", "</Send><Send><BitStart>0</BitStart><BitLength>0</BitLength></Send><Sm2>"),
              "read")
        << "a slave may have several";
    EXPECT_EQ(problem_with("Fixed=\"1\"", "Fixed=\"1\" A='x' Fixed=\"0\""),
              "line 11, column 17: no well-formed XML: InitCmd has two attributes 'Fixed'");
}

TEST(EniReader, AValueThatIsWrongIsNoRemarkBesides) {
    for (const auto& [what, by] :
         {std::pair{"<Data>1027</Data>", "<Data>102</Data>"}, std::pair{"<Ado>1056</Ado>", "<Ado>x</Ado>"},
          std::pair{"<Data>00</Data></InitCmd></InitCmds></CoE>", "<Data>0</Data></InitCmd></InitCmds></CoE>"}}) {
        std::string text = kExampleEni;
        text.replace(text.find(what), std::string_view(what).size(), by);
        const auto eni = read_eni(text);
        ASSERT_FALSE(eni) << by;
        for (const Remark& one : eni.remarks) {
            EXPECT_EQ(one.text.find("0x0000"), std::string::npos) << to_text(one);
            EXPECT_EQ(one.text.find("no octet"), std::string::npos) << to_text(one);
            EXPECT_EQ(one.text.find("no data"), std::string::npos) << to_text(one);
        }
    }
}

TEST(EniReader, ACommandOfSoeThatWritesNoValueIsNamed) {
    const auto said = [](const std::string& command) {
        std::string text = kExampleEni;
        const std::string end = "</Mailbox>";
        text.insert(text.find(end), "<SoE><InitCmds><InitCmd><Transition>PS</Transition>" + command +
                                        "<IDN>32769</IDN><Data>0100</Data></InitCmd></InitCmds></SoE>");
        const auto eni = read_eni(text);
        EXPECT_TRUE(eni) << to_text(eni.problem);
        for (const Remark& remark : eni.remarks)
            if (remark.text.find("SoE") != std::string::npos) return remark.text;
        EXPECT_EQ(eni->expected()[0].config->startup().size(), 4U);
        return std::string();
    };
    const std::string begin = "the SoE command for IDN 0x8001 is not supported: ";
    EXPECT_EQ(said("<OpCode>3</OpCode>"), "");
    EXPECT_EQ(said("<OpCode>3</OpCode><DriveNo>7</DriveNo><Elements>64</Elements>"), "");
    EXPECT_EQ(said("<OpCode>2</OpCode>"), begin + "only writing a value is");
    EXPECT_EQ(said("<DriveNo>8</DriveNo>"), begin + "the drive number 8 is more than 7");
    EXPECT_EQ(said("<Elements>16</Elements>"), begin + "Elements is 16, and only the value (64) is written");
}

TEST(EniReader, TheCommandForTheTimeNamesTheReferenceClock) {
    struct Result {
        std::uint16_t reference;
        std::string said;
    };
    const auto read = [](const std::string& command, unsigned with_dc) {
        std::string text = kExampleEni;
        text.insert(text.find("</Frame></Cyclic>"),
                    "<Cmd><State>OP</State>" + command + "<Ado>2320</Ado><DataLength>8</DataLength></Cmd>");
        std::size_t at = text.find("</Slave>");
        if (with_dc == 2) at = text.find("</Slave>", at + 1);
        if (with_dc != 0) text.insert(at, "<DC><ReferenceClock>1</ReferenceClock></DC>");
        const auto eni = read_eni(text);
        EXPECT_TRUE(eni) << to_text(eni.problem);
        Result result{eni->clocks ? eni->clocks->reference : std::uint16_t{99}, {}};
        for (const Remark& remark : eni.remarks)
            if (remark.text.find("for the time") != std::string::npos) result.said = remark.text;
        return result;
    };
    const std::string begin = "the cyclic command for the time addresses ";
    for (const std::string to_second : {"<Cmd>14</Cmd><Adp>1002</Adp>", "<Cmd>13</Cmd><Adp>65535</Adp>"}) {
        EXPECT_EQ(read(to_second, 0).reference, 2);
        EXPECT_EQ(read(to_second, 0).said, "");
        EXPECT_EQ(read(to_second, 2).said, "");
        EXPECT_EQ(read(to_second, 1).reference, 2);
        EXPECT_EQ(read(to_second, 1).said, begin + "slave 2, and ReferenceClock is at slave 1: the command decides");
    }
    EXPECT_EQ(read("<Cmd>14</Cmd><Adp>7</Adp>", 0).reference, 0);
    EXPECT_EQ(read("<Cmd>14</Cmd><Adp>7</Adp>", 0).said,
              begin + "no slave of the file: the reference clock is the first one");
    EXPECT_EQ(read("<Cmd>13</Cmd><Adp>9</Adp>", 2).reference, 2);
    EXPECT_EQ(read("<Cmd>13</Cmd><Adp>9</Adp>", 2).said,
              begin + "no slave of the file: the reference clock is that of slave 2");
}

TEST(EniReader, ValuesThatMeanNothingAreNamed) {
    const auto said = [](const std::string& before, const std::string& element) {
        std::string text = kExampleEni;
        text.insert(text.find(before), element);
        const auto eni = read_eni(text);
        EXPECT_TRUE(eni) << to_text(eni.problem);
        for (const Remark& remark : eni.remarks)
            if (remark.text.ends_with(": it is not used")) return remark.text;
        return std::string();
    };
    EXPECT_EQ(said("<Ado>304</Ado><DataLength>2", "<Cnt>2</Cnt>"), "");
    EXPECT_EQ(said("<Ado>304</Ado><DataLength>2", "<Cnt>zz</Cnt>"),
              "Cnt is 'zz', which is no number from 0 to 65535: it is not used");
    EXPECT_EQ(said("</Mailbox>", "<Protocol>IP</Protocol>"),
              "Protocol is 'IP', which is no protocol of a mailbox: it is not used");
    EXPECT_EQ(said("<Pdo>#x1600</Pdo></Sm2>", "<Type>Outwards</Type>"),
              "Type is 'Outwards', which is no use of a SyncManager: it is not used");
    EXPECT_EQ(said("</Slave>", "<DC><CycleTime1>1e3</CycleTime1></DC>"),
              "CycleTime1 is '1e3', which is no number from 0 to 4294967295: it is not used");
    EXPECT_EQ(said("</Slave>", "<DC><PotentialReferenceClock>zz</PotentialReferenceClock></DC>"),
              "PotentialReferenceClock is 'zz', which is neither true nor false: it is not used");
    const std::string identify =
        "<HotConnect><GroupName>G</GroupName><GroupMemberCnt>1</GroupMemberCnt><IdentifyCmd>@<Ado>18</Ado>"
        "<Validate><Data>0710</Data></Validate></IdentifyCmd></HotConnect>";
    for (const auto& [element, cause] : std::initializer_list<std::pair<std::string, std::string>>{
             {"<Transition>zz</Transition>", "no transition"},
             {"<Adp>zz</Adp>", "no number from 0 to 65535"},
             {"<Data>zz</Data>", "no whole number of octets"},
             {"<Cmd>zz</Cmd>", "no number from 0 to 255"},
             {"<Transition>IP</Transition><Cmd>1</Cmd><Adp>0</Adp><Data>0000</Data>", ""}}) {
        std::string node = identify;
        node.replace(node.find('@'), 1, element);
        const auto name = element.substr(1, element.find('>') - 1);
        EXPECT_EQ(said("</Slave>", node),
                  cause.empty() ? "" : name + " is 'zz', which is " + cause + ": it is not used");
    }
}

// The expected working counter of the command shows that the slave must answer.
TEST(EniReader, AReadWithACounterIsACheck) {
    const auto startup = [](const std::string& counter) {
        std::string text = kExampleEni;
        text.insert(
            text.find("<InitCmd><Transition>IP</Transition><Cmd>2</Cmd>"),
            "<InitCmd><Transition>PS</Transition><Cmd>4</Cmd><Adp>1001</Adp><Ado>3968</Ado><Data>000000000000000000"
            "00</Data>" +
                counter + "<Retries>3</Retries></InitCmd>");
        auto eni = read_eni(text);
        EXPECT_TRUE(eni) << to_text(eni.problem);
        std::optional<StartupCommand> found;
        for (const StartupCommand& one : eni->expected()[0].config->startup())
            if (one.index == 0x0F80) found = one;
        return found;
    };
    EXPECT_FALSE(startup(""));
    const auto check = startup("<Cnt>1</Cnt>");
    ASSERT_TRUE(check);
    EXPECT_EQ(check->kind, StartupCommand::Kind::check_register);
    EXPECT_EQ(check->octets().size(), 8U);
    EXPECT_EQ(check->mask, (std::array<std::byte, 8>{})) << "no bit is compared";
    EXPECT_EQ(check->retries, 3);
    EXPECT_FALSE(check->any_counter);
}

TEST(EniReader, HotConnectGroupsAreIdentifiedByAliasOrId) {
    std::string text = kExampleEni;
    const auto at = text.find("</Slave>\n<Cyclic>");
    text.insert(
        at,
        "<HotConnect><GroupName>G</GroupName><GroupMemberCnt>1</GroupMemberCnt><IdentifyCmd><Cmd>1</Cmd><Adp>0</Adp>"
        "<Ado>18</Ado><Data>0000</Data><Validate><Data>0710</Data></Validate></IdentifyCmd></HotConnect>");
    const auto eni = read_eni(text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    const ExpectedSlave& second = eni->expected()[1];
    EXPECT_EQ(second.number, 0);
    EXPECT_EQ(second.hot_connect, 1);
    EXPECT_EQ(second.alias, 0x1007);
    EXPECT_TRUE(second.optional);
    EXPECT_EQ(eni->slaves[1].number, 2);
    text.replace(text.find("<Ado>18<"), 8, "<Ado>99<");
    EXPECT_NE(to_text(read_eni(text).problem).find("identified neither by its alias"), std::string::npos);
}

TEST(FieldFiles, AnEniThatItsVendorHasLockedIsRefused) {
    if (std::string_view(MARGAY_XML_DIR).empty()) GTEST_SKIP() << "MARGAY_XML_DIR is not set";
    const std::string folder = std::string(MARGAY_XML_DIR) + "/eni/";
    const auto locked = read_eni(read_file(folder + "variox_eni.xml").octets);
    ASSERT_FALSE(locked);
    EXPECT_EQ(
        to_text(locked.problem),
        "line 1, column 76: the ENI is locked by its vendor (EncryptedEtherCATConfig): it contains FMMUs that only "
        "this vendor's master can read");
    const auto project = read_eni(read_file(folder + "variox_EtherCATConfiguration.ecc").octets);
    ASSERT_FALSE(project);
    EXPECT_EQ(to_text(project.problem), "line 1, column 1: the file is compressed by gzip, and is no XML");
}

// The same file with another root and with readable FMMUs. Everything else is unchanged.
TEST(FieldFiles, AllElseOfTheLockedEniIsRead) {
    if (std::string_view(MARGAY_XML_DIR).empty()) GTEST_SKIP() << "MARGAY_XML_DIR is not set";
    std::string text = read_file(std::string(MARGAY_XML_DIR) + "/eni/variox_eni.xml").octets;
    const auto replace = [&](const std::string& what, const std::string& by) {
        for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
            text.replace(at, what.size(), by);
    };
    replace("EncryptedEtherCATConfig", "EtherCATConfig");
    replace("5f0b03ebc40b03fcb91c03f9630b03fb", "00000010a4000007d817000201000000");  // 0x10000000, SM2
    replace("5f0b03ebcc0b03fcf91503fa630b03fb", "00000010ac000007981e000101000000");  // 0x10000000, SM3
    const auto eni = read_eni(text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    ASSERT_EQ(eni->slaves.size(), 2U);
    EXPECT_EQ(eni->slaves[0].name, "Slave_1001 [EBC 3-PORT]");
    EXPECT_EQ(eni->expected()[1].product, 54632U);
    const SlaveConfiguration& config = *eni->expected()[1].config;
    ASSERT_EQ(config.sm_count, 2);
    EXPECT_EQ(config.sms[0], (ProcessSm{2, Direction::outputs, 0x64, 6104, 1312}));
    EXPECT_EQ(config.sms[1], (ProcessSm{3, Direction::inputs, 0x20, 7832, 1376}));
    EXPECT_TRUE(config.mailbox_status);
    EXPECT_TRUE(eni->groups[0].config.overlapped);
    EXPECT_EQ(eni->groups[0].cycle, 1ms);
    EXPECT_GT(config.startup().size(), 10U);
    const EniVariable* variable = eni->find("Slave_1002 [54632].TxPDO Mapping of Status Data.State of IO-Link Port X0");
    ASSERT_NE(variable, nullptr);
    EXPECT_EQ(variable->slave, 2);
    EXPECT_EQ(variable->bit, 24U);
}

}  // namespace
}  // namespace margay::files
