// Parts of an ENI that the library does not apply: the reader makes a remark with line and cause. It makes no remark if
// the part has no effect.
#include <margay/files/eni.hpp>

#include "files/examples.hpp"
#include "files/machine.hpp"
#include "files/xml.hpp"

#include <gtest/gtest.h>

namespace margay::files {
namespace {

using Texts = std::vector<std::string>;

std::string replaced(std::string text, const std::string& what, const std::string& by) {
    const auto at = text.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    if (at != std::string::npos) text.replace(at, what.size(), by);
    return text;
}

std::string init(const std::string& transition, unsigned ado, const std::string& data, unsigned station = 1001) {
    return "<InitCmd><Transition>" + transition + "</Transition><Cmd>5</Cmd><Adp>" + std::to_string(station) +
           "</Adp><Ado>" + std::to_string(ado) + "</Ado><Data>" + data + "</Data><Cnt>1</Cnt></InitCmd>";
}
// The example with more init commands of slave 1, in line 14 from column 1 on; or of the master, in line 6.
std::string with_inits(const std::string& more) {
    return replaced(kExampleEni, "<InitCmd><Transition>IP</Transition><Cmd>2</Cmd>",
                    more + "<InitCmd><Transition>IP</Transition><Cmd>2</Cmd>");
}
std::string with_master(const std::string& more) {
    return replaced(kExampleEni, "</InitCmds></Master>", more + "</InitCmds></Master>");
}
// The text with the cyclic command that reads the system time: the file uses clocks.
std::string with_clocks(const std::string& text) {
    return replaced(text, "</Frame></Cyclic>",
                    "<Cmd><State>OP</State><Cmd>14</Cmd><Adp>1001</Adp><Ado>2320</Ado><DataLength>8</DataLength></Cmd>"
                    "</Frame></Cyclic>");
}

// The remarks about a file, without the remarks about the example.
Texts more_said(const std::string& text) {
    const auto known = read_eni(kExampleEni);
    const auto eni = read_eni(text);
    EXPECT_TRUE(eni) << to_text(eni.problem);
    Texts all;
    for (const Remark& one : eni.remarks)
        if (std::ranges::find(known.remarks, one.text, &Remark::text) == known.remarks.end())
            all.push_back(to_text(one));
    return all;
}

TEST(EniUnused, WhatReachesOrChecksRegistersOfTheLibraryIsNamedAndNotSent) {
    const auto names = [](const std::string& text, const std::string& ado, const std::string& why) {
        const auto said = more_said(text);
        return said.size() == 1 &&
               said[0].find("the init command for register " + ado + " is not supported: " + why) != std::string::npos;
    };
    const std::string reaches = "it writes registers behind it that the library sets or reads by itself";
    const std::string checks = "it checks a register that the library sets or reads by itself";
    EXPECT_TRUE(names(with_inits(init("PS", 0x000F, "00ff20")), "0x000f", reaches)) << "the station address";
    EXPECT_TRUE(names(with_inits(init("SO", 0x011F, "000200")), "0x011f", reaches)) << "AL control";
    EXPECT_TRUE(names(with_inits(init("SO", 0x05FF, std::string(34, '0'))), "0x05ff", reaches)) << "FMMU 0";
    const auto commands = [](const std::string& text) {
        const auto eni = read_eni(text);
        EXPECT_TRUE(eni) << to_text(eni.problem);
        return eni->expected()[0].config->startup().size();
    };
    const auto usual = commands(kExampleEni);
    EXPECT_EQ(commands(with_inits(init("SO", 0x05FF, std::string(34, '0')))), usual);
    EXPECT_EQ(commands(with_inits(init("SO", 0x05FF, "00"))), usual + 1) << "up to the register before";
    EXPECT_EQ(more_said(with_inits(init("PS", 0x0100, "01000000"))), Texts()) << "DL control";
    const auto check = [](unsigned ado) {
        return "<InitCmd><Transition>PS</Transition><Cmd>4</Cmd><Adp>1001</Adp><Ado>" + std::to_string(ado) +
               "</Ado><DataLength>2</DataLength><Cnt>1</Cnt><Validate><Data>eeee</Data></Validate></InitCmd>";
    };
    EXPECT_TRUE(names(with_inits(check(0x0134)), "0x0134", checks));
    EXPECT_TRUE(names(with_inits(check(0x0600)), "0x0600", checks));
    EXPECT_EQ(more_said(with_inits(check(0x0130))), Texts());
}

TEST(EniUnused, AnIdentityThatTheFileContradictsOrLeavesOpenIsNamed) {
    const auto other = more_said(replaced(kExampleEni, "<ProductCode>77", "<ProductCode>79"));
    ASSERT_EQ(other.size(), 1u);
    EXPECT_TRUE(other[0].starts_with("line 7, column "));
    EXPECT_TRUE(
        other[0].ends_with("ProductCode is 0x0000004f, and an init command checks for 0x0000004d: the init "
                           "command decides which slave is accepted"))
        << other[0];
    const auto open = more_said(replaced(kExampleEni, "<VendorId>2</VendorId><ProductCode>78</ProductCode>", ""));
    ASSERT_EQ(open.size(), 1u);
    EXPECT_TRUE(
        open[0].ends_with(": the slave has neither VendorId nor ProductCode, and no init command checks them: "
                          "any slave is accepted in its place"))
        << open[0];
}

const std::string kNoLatch =
    "the init command for the latch control (0x09a8) is not sent: an application watches latch inputs by a "
    "LatchRequest";
const std::string kNoSpeed =
    "the init command for the speed counter (0x0930) is not sent: the library starts the control loops of the clocks "
    "with 0x1000";
const std::string kNoFilters =
    "the init command for the filters of the clocks (0x0934) is not sent: the slaves keep the filter depths that they "
    "have, after power-up usually 4 and 12";

TEST(EniUnused, LatchControlIsNamedOnceForEachSlave) {
    EXPECT_EQ(more_said(with_inits(init("PS", 0x09A8, "0100") + init("SO", 0x09A9, "03"))),
              Texts{"line 14, column 2: " + kNoLatch});
    EXPECT_EQ(more_said(with_inits(init("PS", 0x09A8, "0000"))), Texts());
    EXPECT_EQ(more_said(with_inits(init("PS", 0x09A0, "40420F000000000001"))), Texts{"line 14, column 2: " + kNoLatch})
        << "behind the cycle times";
}

TEST(EniUnused, ControlLoopsOfTheClocksAreNamedWhereTheyHaveAnEffect) {
    const auto master = [](unsigned ado, const std::string& data) {
        return replaced(init("IP", ado, data, 0), "<Cmd>5<", "<Cmd>8<");
    };
    const std::string other = with_master(master(0x0930, "0020") + master(0x0934, "000c"));
    EXPECT_EQ(more_said(other), Texts()) << "the file uses no clocks";
    EXPECT_EQ(more_said(with_clocks(other)),
              (Texts{"line 6, column 2: " + kNoSpeed,
                     "line 6, column " + std::to_string(master(0x0930, "0020").size() + 2) + ": " + kNoFilters}));
    EXPECT_EQ(more_said(with_clocks(with_master(master(0x0930, "0010") + master(0x0934, "040c")))), Texts());
    EXPECT_EQ(more_said(with_clocks(with_inits(init("PS", 0x0935, "08")))), Texts{"line 14, column 2: " + kNoFilters});
}

TEST(EniUnused, AStartTimeOfSyncAndTheSecondAddressAreNamed) {
    const auto start = [](const std::string& data) { return with_clocks(with_inits(init("PS", 0x0990, data))); };
    EXPECT_EQ(more_said(start("40420f0000000000")),
              Texts{"line 14, column 2: the init command for the start time of SYNC0 (0x0990) is not sent: the library "
                    "calculates it, from the system time and the ShiftTime of DC"});
    EXPECT_EQ(more_said(start("0000000000000000")), Texts());
    const std::string second =
        "the init command that switches the second address on (0x0103) is not sent: the library "
        "addresses all slaves by their station addresses";
    EXPECT_EQ(more_said(with_inits(init("PS", 0x0103, "01"))), Texts{"line 14, column 2: " + second});
    EXPECT_EQ(more_said(with_inits(init("PS", 0x0103, "00"))), Texts());
}

// The library sets the SYNC signals of other steps at PS, too, unless the commands of PS set other signals.
TEST(EniUnused, SyncSignalsOfAnotherStepAreUsedAndNamed) {
    const auto sync = [](const std::string& text) {
        const auto eni = read_eni(with_clocks(text));
        EXPECT_TRUE(eni) << to_text(eni.problem);
        return eni ? eni->expected()[0].config->dc() : SyncSettings{};
    };
    const std::string at_ps = init("PS", 0x09A0, "40420f0000000000") + init("PS", 0x0980, "0003");
    EXPECT_EQ(sync(with_inits(at_ps)).assign_activate, 0x0300);
    EXPECT_TRUE(more_said(with_inits(at_ps + init("SP", 0x0980, "0000") + init("IP", 0x0980, "0000"))).empty());
    for (const std::string step : {"IP", "SO"}) {
        const auto text = with_inits(init(step, 0x09A0, "80841e0000000000") + init(step, 0x0980, "0007"));
        EXPECT_EQ(sync(text).source, SyncSettings::Source::application) << step;
        EXPECT_EQ(sync(text).assign_activate, 0x0700) << step;
        EXPECT_EQ(sync(text).sync0_cycle, std::chrono::milliseconds(2)) << step;
        const auto said = more_said(text);
        ASSERT_EQ(said.size(), 2U);
        EXPECT_TRUE(
            said[1].ends_with("the init command for SYNC signals (0x0980) is not of PS: the library sets SYNC "
                              "signals at PS"))
            << said[1];
    }
    const auto both = with_inits(at_ps + init("SO", 0x09A0, "80841e0000000000"));
    EXPECT_EQ(sync(both).sync0_cycle, std::chrono::milliseconds(1));
    ASSERT_EQ(more_said(both).size(), 1U);
    EXPECT_TRUE(more_said(both)[0].ends_with("it is not sent, what the commands of PS give is used"));
    const auto twice = with_inits(init("IP", 0x0980, "0003") + init("SO", 0x0980, "0007"));
    EXPECT_EQ(sync(twice).assign_activate, 0x0300);
    ASSERT_EQ(more_said(twice).size(), 2U);
    EXPECT_TRUE(more_said(twice)[1].ends_with("it is not sent, what a command before it gives is used"));
    const auto down = with_inits(init("SP", 0x0980, "0003"));
    EXPECT_EQ(sync(down).source, SyncSettings::Source::none);
    ASSERT_EQ(more_said(down).size(), 1U);
    EXPECT_TRUE(more_said(down)[0].ends_with("it is not sent, the library sets SYNC signals at PS"));
}

TEST(EniUnused, WhatIsSentOtherwiseThanTheInitCommandSaysIsNamed) {
    const auto said = [](const std::string& inits) {
        const auto all = more_said(with_inits(inits));
        EXPECT_EQ(all.size(), 1U);
        return all.empty() ? std::string() : all[0];
    };
    EXPECT_NE(
        said("<InitCmd><Transition>PS</Transition><Cmd>8</Cmd><Adp>0</Adp><Ado>3856</Ado><Data>01</Data></InitCmd>")
            .find("the BWR of register 0x0f10 is an init command of this slave: it is sent to this slave only"),
        std::string::npos);
    EXPECT_NE(said("<InitCmd><Transition>PS</Transition><Cmd>11</Cmd><Addr>0</Addr><Data>01</Data></InitCmd>")
                  .find("an init command for a logical address is not supported"),
              std::string::npos);
    const std::string fmmu = "<InitCmd><Transition>PS</Transition><Cmd>5</Cmd><Adp>1001</Adp><Ado>1536</Ado>";
    ASSERT_NE(kExampleEni.find(fmmu), std::string::npos);
    const auto late = more_said(replaced(kExampleEni, fmmu, replaced(fmmu, ">PS<", ">SO<")));
    ASSERT_EQ(late.size(), 1U);
    EXPECT_TRUE(late[0].ends_with("the FMMU is set at SO: the library sets it at PS")) << late[0];
}

TEST(EniUnused, PollTimesAreNamedOnce) {
    const std::string status = "<StatusBitAddr>0</StatusBitAddr>";
    EXPECT_EQ(more_said(replaced(kExampleEni, status, "<PollTime>3000</PollTime>")),
              Texts{"line 10, column 108: PollTime is not used (1 slave has another one than 20 ms): watch_mailboxes() "
                    "gives all slaves one interval, and without it the library reads a mailbox only for a request"});
    EXPECT_EQ(more_said(replaced(kExampleEni, status, "<PollTime>20</PollTime>")), Texts());
}

TEST(EniUnused, ABitStartAtAnotherPlaceThanThatOfTheOtherSlavesIsNamed) {
    Machine machine({"digital_in_8", "digital_in_16", "digital_in_8"});
    ASSERT_TRUE(config_init(machine.ctx));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    const std::string text = write_eni(machine.ctx).text;
    ASSERT_TRUE(read_eni(text).remarks.empty());
    const auto eni = read_eni(replaced(text, "<BitStart>8</BitStart>", "<BitStart>16</BitStart>"));
    ASSERT_TRUE(eni) << to_text(eni.problem);
    ASSERT_EQ(eni.remarks.size(), 1u);
    EXPECT_EQ(eni.remarks[0].text,
              "BitStart is 16, and by the cyclic command and the FMMU the data begins at 8: the variables of the slave "
              "are found by BitStart");
}

TEST(EniUnused, ATimeThatIsLongerThanAnyRealOneIsNamed) {
    const std::string wait = " ms: a slave that does not answer as the file wants may keep the start waiting for ";
    EXPECT_EQ(more_said(replaced(kExampleEni, "<Timeout>7000</Timeout>", "<Timeout>600000</Timeout>")), Texts());
    EXPECT_EQ(more_said(replaced(kExampleEni, "<Timeout>7000</Timeout>", "<Timeout>4294967295</Timeout>")),
              Texts{"line 21, column 148: Timeout is 4294967295" + wait + "71582 minutes"});
    EXPECT_EQ(more_said(replaced(kExampleEni, "<Timeout>500</Timeout>", "<Timeout>3600000</Timeout>")),
              Texts{"line 11, column 63: Timeout is 3600000" + wait + "60 minutes"});
}

// If a slave cannot be compared with other slaves, its BitStart must be the place that the offset of the command gives,
// or 80 bits behind this place.
TEST(EniUnused, ABitStartThatTheOffsetContradictsIsNamed) {
    const auto said = more_said(replaced(kExampleEni, "<BitStart>208</BitStart>", "<BitStart>216</BitStart>"));
    EXPECT_EQ(said,
              Texts{"line 8, column 15: BitStart is 216, and by the cyclic command and the FMMU the data begins at "
                    "208: the variables of the slave are found by BitStart"});
    // A file with one slave, which has inputs only.
    Machine machine({"digital_in_8"});
    ASSERT_TRUE(config_init(machine.ctx));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    const std::string text = write_eni(machine.ctx).text;
    ASSERT_TRUE(read_eni(text).remarks.empty());
    const auto eni = read_eni(replaced(text, "<BitStart>0</BitStart>", "<BitStart>8</BitStart>"));
    ASSERT_EQ(eni.remarks.size(), 1u);
    EXPECT_TRUE(
        eni.remarks[0].text.starts_with("BitStart is 8, and by the cyclic command and the FMMU the data begins "
                                        "at 0: "))
        << eni.remarks[0].text;
    // Some files count BitStart from the header of the datagram, which has 80 bits.
    EXPECT_TRUE(read_eni(replaced(text, "<BitStart>0</BitStart>", "<BitStart>80</BitStart>")).remarks.empty());
}

TEST(EniUnused, BitStartsOfACommandWithoutAnOffsetAreComparedWithEachOther) {
    Machine machine({"digital_in_8", "digital_in_16", "digital_in_8"});
    ASSERT_TRUE(config_init(machine.ctx));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    std::string text = write_eni(machine.ctx).text;
    for (const std::string name : {"InputOffs", "OutputOffs"})
        for (auto at = text.find("<" + name + ">"); at != std::string::npos; at = text.find("<" + name + ">"))
            text.erase(at, text.find("</" + name + ">") + name.size() + 3 - at);
    ASSERT_TRUE(read_eni(text).remarks.empty());
    const auto eni = read_eni(replaced(text, "<BitStart>8</BitStart>", "<BitStart>16</BitStart>"));
    ASSERT_EQ(eni.remarks.size(), 1u);
    EXPECT_TRUE(
        eni.remarks[0].text.starts_with("BitStart is 16, and by the FMMU and the BitStart of other slaves the "
                                        "data begins at 8: "))
        << eni.remarks[0].text;
}

// Elements that are not used. Nonsense in them shows that the file has a fault.
TEST(EniUnused, NonsenseInElementsThatAreNotUsedIsNamed) {
    EXPECT_EQ(more_said(replaced(kExampleEni, "<ByteSize>1536</ByteSize>", "<ByteSize>abc</ByteSize>")),
              Texts{"line 34, column 24: ByteSize is 'abc', which is no number from 0 to 4294967295: it is not used"});
    EXPECT_EQ(more_said(replaced(kExampleEni, "<Sm2><Pdo>", "<Sm2><ControlByte>-1</ControlByte><Pdo>")),
              Texts{"line 8, column 82: ControlByte is '-1', which is no number from 0 to 255: it is not used"});
    EXPECT_EQ(more_said(replaced(kExampleEni, "<State>OP</State>", "<State>SAFEOPX</State>")),
              Texts{"line 30, column 7: State is 'SAFEOPX', which is no AL state: it is not used"});
    EXPECT_EQ(more_said(replaced(kExampleEni, "<Sm2><Pdo>", "<Sm2><ControlByte>#x64</ControlByte><Pdo>")), Texts());
}

// Words and addresses that a tool writes and that this library does not need.
TEST(EniUnused, NonsenseInWordsThatAreNotUsedIsNamed) {
    const auto named = [](const std::string& text) {
        const Texts all = more_said(text);
        if (all.size() != 1) return std::to_string(all.size()) + " remarks";
        return all[0].substr(all[0].find(": ") + 2);
    };
    const auto in_sm = [](const std::string& element) {
        return replaced(kExampleEni, "<Sm2><Pdo>", "<Sm2>" + element + "<Pdo>");
    };
    const auto in_info = [](const std::string& element) {
        return replaced(kExampleEni, "<Master><Info>", "<Master><Info>" + element);
    };
    const auto port = [](const std::string& name) {
        return replaced(kExampleEni, "</Slave>", "<PreviousPort><Port>" + name + "</Port></PreviousPort></Slave>");
    };
    EXPECT_EQ(named(in_sm("<Enable>x</Enable>")), "Enable is 'x', which is neither true nor false: it is not used");
    EXPECT_EQ(named(in_sm("<Enable>99999999999</Enable>")),
              "Enable is '99999999999', which is neither true nor false: it is not used");
    EXPECT_EQ(more_said(in_sm("<Enable>1</Enable>")), Texts());
    EXPECT_EQ(more_said(in_sm("<Enable>True</Enable>")), Texts());
    EXPECT_EQ(named(port("B00")), "Port is 'B00', which is no port from A to D: it is not used");
    EXPECT_EQ(more_said(port("B")), Texts());
    EXPECT_EQ(named(in_info("<Destination>x</Destination>")),
              "Destination is 'x', which is no MAC address of 12 hexadecimal digits: it is not used");
    EXPECT_EQ(named(in_info("<Source>0013955211b</Source>")),
              "Source is '0013955211b', which is no MAC address of 12 hexadecimal digits: it is not used");
    EXPECT_EQ(more_said(in_info("<Source>0013955211b4</Source><EtherType>a488</EtherType>")), Texts());
    EXPECT_EQ(more_said(in_info("<EtherType>88A4</EtherType>")), Texts());
    EXPECT_EQ(named(in_info("<EtherType>a480</EtherType>")),
              "EtherType is 'a480', which is not the type of EtherCAT, a488: it is not used");
}

// A file contains the process data twice: as elements for people and tools, and as init commands.
TEST(EniUnused, ProcessDataThatTheFileContradictsAreNamed) {
    const Texts start = more_said(replaced(kExampleEni, "<Sm2><Pdo>", "<Sm2><StartAddress>1</StartAddress><Pdo>"));
    ASSERT_EQ(start.size(), 1U);
    EXPECT_NE(start[0].find("StartAddress of Sm2 is 0x0001, and an init command sets the SyncManager to 0x"),
              std::string::npos)
        << start[0];
    for (const char* longer : {"<BitLength>9</BitLength>", "<BitLength>112</BitLength>"}) {
        const Texts length = more_said(replaced(kExampleEni, "<BitLength>8</BitLength>", longer));
        ASSERT_EQ(length.size(), 1U) << longer;
        EXPECT_NE(length[0].find(" bits by BitLength, and the slave exchanges 8: "), std::string::npos) << length[0];
    }
}

TEST(EniUnused, VariablesOfWrongSizeOrPlaceAreNamed) {
    EXPECT_EQ(more_said(replaced(kExampleEni, "<DataType>USINT</DataType>", "<DataType>UINT</DataType>")),
              Texts{"line 34, column 49: the variable 'Second.In' has BitSize 8, and a UINT has 16 bits: BitSize is "
                    "used"});
    EXPECT_EQ(more_said(replaced(kExampleEni, "<DataType>USINT</DataType>", "<DataType>BOOL</DataType>")), Texts());
    EXPECT_EQ(more_said(replaced(kExampleEni, "<DataType>USINT</DataType>", "<DataType>MY_TYPE</DataType>")), Texts());
    const auto with = [](unsigned bit, unsigned bits) {
        const std::string member = "<Variable><Name>Member</Name><DataType>T</DataType><BitSize>" +
                                   std::to_string(bits) + "</BitSize><BitOffs>" + std::to_string(bit) +
                                   "</BitOffs></Variable>";
        return more_said(replaced(kExampleEni, "<Variable><Name>SlaveCount", member + "<Variable><Name>SlaveCount"));
    };
    EXPECT_EQ(with(320, 8), Texts()) << "the same place";
    EXPECT_EQ(with(324, 4), Texts()) << "inside";
    EXPECT_EQ(with(312, 32), Texts()) << "around";
    EXPECT_EQ(with(328, 8), Texts()) << "behind";
    const Texts straddles = with(324, 8);
    ASSERT_EQ(straddles.size(), 1U);
    EXPECT_NE(straddles[0].find("the variable 'Member' begins inside of 'Second.In' and ends behind it: its BitOffs is "
                                "324"),
              std::string::npos)
        << straddles[0];
}

TEST(EniUnused, ACoeCommandThatIsNoDownloadIsNamed) {
    EXPECT_EQ(more_said(replaced(kExampleEni, "<Ccs>1</Ccs>", "<Ccs>3</Ccs>")),
              Texts{"line 11, column 17: Ccs is 3, which is no SDO download: it is sent as a download"});
    EXPECT_EQ(more_said(replaced(kExampleEni, "<Ccs>1</Ccs>", "<Ccs>2</Ccs>")), Texts())
        << "as some producers write it";
}

// The written file contains the place of the data of a cyclic command in the image, because tools and other masters
// need it.
TEST(EniUnused, TheWriterSaysWhereTheDataOfACommandIs) {
    for (const bool overlapped : {false, true}) {
        Machine machine({"digital_out_8", "digital_in_8", "digital_out_8"});
        ASSERT_TRUE(config_init(machine.ctx));
        machine.ctx.group(0).config.overlapped = overlapped;
        ASSERT_TRUE(config_map(machine.ctx, machine.image));
        const std::string text = write_eni(machine.ctx).text;
        EXPECT_NE(text.find("<InputOffs>0</InputOffs>"), std::string::npos) << text;
        EXPECT_NE(text.find("<OutputOffs>0</OutputOffs>"), std::string::npos) << text;
        const auto eni = read_eni(text);
        ASSERT_TRUE(eni) << to_text(eni.problem);
        EXPECT_TRUE(eni.remarks.empty());
        // The logical addresses begin at 0 here, so the place of a variable is the logical address of its FMMU.
        for (const EniVariable& variable : eni->variables) {
            const Slave& slave = machine.ctx.slave(variable.slave);
            const auto logical_start =
                read_register<std::uint32_t>(machine.ctx, slave.number, 0x0600);  // its only FMMU
            ASSERT_TRUE(logical_start);
            EXPECT_EQ(variable.file_bit, *logical_start * 8 + variable.bit) << variable.name;
        }
        EXPECT_EQ(eni->variables.size(), 24u);
    }
}

TEST(EniUnused, ASlaveAtAnotherPortIsNamedAfterTheScan) {
    const std::vector<std::string> devices{"coupler", "digital_in_8", "digital_out_8"};
    Machine machine(devices);
    ASSERT_TRUE(config_init(machine.ctx));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    const std::string text = write_eni(machine.ctx).text;
    const auto remarks_with = [&](const std::string& what, const std::string& by) {
        const auto eni = read_eni(replaced(text, what, by));
        EXPECT_TRUE(eni) << to_text(eni.problem);
        EXPECT_TRUE(eni.remarks.empty());
        Machine second(devices, eni->limits());
        EXPECT_TRUE(remarks_after_scan(second.ctx, *eni).empty()) << "before the scan nothing is known";
        const auto up = bring_up(second.ctx, *eni, second.image);
        EXPECT_TRUE(up) << words(up.error());
        Texts all;
        for (const Remark& one : remarks_after_scan(second.ctx, *eni)) all.push_back(one.text);
        return all;
    };
    const std::string port = "<Port>B</Port>";
    EXPECT_EQ(remarks_with(port, port), Texts());
    EXPECT_EQ(remarks_with(port, "<Port>C</Port>"),
              Texts{"slave 2 is at port C of slave 1 in the file, and here at port B of slave 1: the library requires "
                    "the order of the slaves only"});
    const std::string other = "<PreviousPort><Port>D</Port><PhysAddr>" +
                              std::to_string(machine.ctx.slave(1).station_address.value) +
                              "</PhysAddr></PreviousPort><PreviousPort";
    EXPECT_EQ(remarks_with("<PreviousPort", other), Texts()) << "one of two alternatives";
}

TEST(EniUnused, MailboxesThatTheFileContradictsAreNamed) {
    const std::string out = init("IP", 0x0800, "0010800026000100");
    const std::string in = init("IP", 0x0808, "8010800022000100");
    const std::string clear = init("IP", 0x0800, "00000000000000000000000000000000");
    EXPECT_EQ(more_said(with_inits(clear + out + in)), Texts());
    EXPECT_EQ(more_said(with_inits(init("IP", 0x0800, "00108000360001008010800032000100"))), Texts())
        << "interrupts of the EtherCAT side, both in one command";
    EXPECT_EQ(
        more_said(with_inits(init("IP", 0x0800, "0010000126000100"))),
        Texts{"line 14, column 2: the init commands set SyncManager 0 to 0x1000, 256 octets, and Mailbox gives it "
              "0x1000, 128 octets: neither is used, but what the SII of the slave gives it"});
    const std::string no_mailbox =
        "line 14, column 2: an init command at IP sets SyncManager 1 to something else than "
        "an enabled mailbox of its direction: it is not sent";
    EXPECT_EQ(more_said(with_inits(init("IP", 0x0808, "8010800026000100") + init("IP", 0x0808, "8010800020000100"))),
              Texts{no_mailbox});
    EXPECT_EQ(more_said(with_inits(init("IP", 0x0808, "8010800022000000"))), Texts{no_mailbox});
    EXPECT_EQ(more_said(with_inits(init("IP", 0x0806, "0100"))),
              Texts{"line 14, column 2: an init command at IP writes a part of a SyncManager of the mailbox: it is not "
                    "sent"});
    const std::string second = "<InitCmd><Transition>PS</Transition><Cmd>5</Cmd><Adp>1002</Adp><Ado>2048<";
    EXPECT_EQ(more_said(replaced(kExampleEni, second, init("IP", 0x0800, "0010800026000100", 1002) + second)),
              Texts{"line 26, column 2: SyncManager 0 is set at IP, and the slave has no Mailbox: the init command is "
                    "not sent"});
}

TEST(EniUnused, MailboxesThatDifferFromTheSiiAreNamedAfterTheScan) {
    const std::vector<std::string> devices{"coupler", "drive", "digital_in_8"};
    Machine machine(devices);
    ASSERT_TRUE(config_init(machine.ctx));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    const MailboxInfo own = machine.ctx.slave(2).mailbox;
    ASSERT_TRUE(own.present());
    const std::string text = write_eni(machine.ctx).text;
    const auto same = read_eni(text);
    ASSERT_TRUE(same) << to_text(same.problem);
    EXPECT_EQ(same->slaves[1].mailbox.out_bytes, own.out_bytes);
    EXPECT_TRUE(remarks_after_scan(machine.ctx, *same).empty());

    // A user of the tool has chosen a smaller mailbox, in the element and in the command that the tool makes from it.
    const auto octets = [](std::uint16_t value) {
        return hex(static_cast<std::uint16_t>(value << 8 | value >> 8)).substr(2);
    };
    constexpr std::uint16_t kOther = 64;
    ASSERT_NE(own.out_bytes, kOther);
    std::string other = replaced(text, "<Length>" + std::to_string(own.out_bytes) + "<", "<Length>64<");
    other = replaced(other, octets(own.out_start) + octets(own.out_bytes), octets(own.out_start) + octets(kOther));
    const auto eni = read_eni(other);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    EXPECT_TRUE(eni.remarks.empty()) << to_text(eni.remarks[0]);
    Machine second(devices, eni->limits());
    EXPECT_TRUE(remarks_after_scan(second.ctx, *eni).empty()) << "before the scan nothing is known";
    const auto up = bring_up(second.ctx, *eni, second.image);
    ASSERT_TRUE(up) << words(up.error());
    EXPECT_EQ(second.ctx.slave(2).mailbox.out_bytes, own.out_bytes);
    const auto named = remarks_after_scan(second.ctx, *eni);
    ASSERT_EQ(named.size(), 1U);
    std::size_t line =
        1 + static_cast<std::size_t>(
                std::count(other.begin(), other.begin() + static_cast<std::ptrdiff_t>(other.find("set sm 0")), '\n'));
    EXPECT_LE(named[0].line, line);
    EXPECT_GT(named[0].line + 8, line) << "the init command of SyncManager 0";
    EXPECT_NE(named[0].text.find("the mailboxes that the file gives slave 2 (0x"), std::string::npos) << named[0].text;
    EXPECT_NE(named[0].text.find(", 64 octets, and 0x"), std::string::npos) << named[0].text;
    EXPECT_NE(named[0].text.find(") are not used: its SII gives 0x"), std::string::npos) << named[0].text;
    EXPECT_NE(named[0].text.find(std::to_string(own.out_bytes) + " octets, and 0x"), std::string::npos)
        << named[0].text;
}

// The remarks about a file that was written from a segment and then changed.
Texts said_of(const std::vector<std::string>& devices, const std::string& text) {
    const auto eni = read_eni(text);
    EXPECT_TRUE(eni) << to_text(eni.problem);
    for (const Remark& one : eni.remarks) ADD_FAILURE() << to_text(one);
    Machine machine(devices, eni->limits());
    const auto up = bring_up(machine.ctx, *eni, machine.image);
    EXPECT_TRUE(up) << words(up.error());
    Texts all;
    for (const Remark& one : remarks_after_scan(machine.ctx, *eni)) {
        EXPECT_NE(one.line, 0u);
        all.push_back(one.text);
    }
    return all;
}

TEST(EniUnused, MailboxesOfBootThatDifferFromTheSiiAreNamedAfterTheScan) {
    const std::vector<std::string> devices{"coupler", "bootloader"};
    Machine machine(devices);
    ASSERT_TRUE(config_init(machine.ctx));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    const MailboxInfo own = machine.ctx.slave(2).boot_mailbox;
    ASSERT_TRUE(own.present());
    const std::string text = write_eni(machine.ctx).text;
    EXPECT_EQ(said_of(devices, text), Texts());
    const auto at = text.find("<BootStrap>");
    ASSERT_NE(at, std::string::npos) << text;
    const std::string length = "<Length>" + std::to_string(own.out_bytes) + "</Length>";
    const std::string other = text.substr(0, at) + replaced(text.substr(at), length, "<Length>77</Length>");
    const auto said = said_of(devices, other);
    ASSERT_EQ(said.size(), 1U);
    EXPECT_NE(said[0].find("the mailboxes of BOOT that the file gives slave 2 ("), std::string::npos) << said[0];
    EXPECT_NE(said[0].find(", 77 octets, and 0x"), std::string::npos) << said[0];
    EXPECT_NE(said[0].find(") are not used: its SII gives 0x"), std::string::npos) << said[0];

    const std::string no_send = replaced(text.substr(at), "<Send>", "<Send><Start>1</Start></Send><Send>");
    const auto twice = read_eni(text.substr(0, at) + no_send);
    EXPECT_FALSE(twice);
    EXPECT_NE(to_text(twice.problem).find("a second Send in BootStrap"), std::string::npos) << to_text(twice.problem);
    const std::string both = with_inits(init("IB", 0x0800, "00108000260001008010800022000100"));
    EXPECT_EQ(more_said(both), Texts());
    EXPECT_EQ(read_eni(both)->slaves[0].boot_mailbox.in_start, 0x1080) << "init commands without the element";
    EXPECT_EQ(more_said(with_inits(init("IB", 0x0800, "0010800022000100"))),
              Texts{"line 14, column 2: an init command at IB sets SyncManager 0 to something else than an enabled "
                    "mailbox of its direction: it is not sent"});
}

TEST(EniUnused, ControlOctetsThatDifferFromTheSiiAreNamedAfterTheScan) {
    const std::vector<std::string> devices{"coupler", "drive"};
    Machine machine(devices);
    ASSERT_TRUE(config_init(machine.ctx));
    ASSERT_TRUE(config_map(machine.ctx, machine.image));
    const std::string text = write_eni(machine.ctx).text;
    // The control octet in the init command of a SyncManager: octet 4 of its data.
    const auto with_control = [&](unsigned number, unsigned flipped) {
        const auto comment = text.find("set sm " + std::to_string(number) + "]");
        const auto plain = text.find("set sm " + std::to_string(number) + "<");
        const auto data = text.find("<Data>", std::min(comment, plain)) + 6 + 8;
        const auto octet = std::stoul(text.substr(data, 2), nullptr, 16) ^ flipped;
        return text.substr(0, data) + hex(octet, 2).substr(2) + text.substr(data + 2);
    };
    EXPECT_EQ(said_of(devices, with_control(0, 0x10)), Texts()) << "the interrupt to the master";
    const auto mailbox = said_of(devices, with_control(1, 0x20));
    ASSERT_EQ(mailbox.size(), 1U);
    EXPECT_EQ(mailbox[0],
              "the file gives SyncManager 1 of slave 2 the control octet 0x02 (without an interrupt to the "
              "slave's processor), and its SII 0x22: that of the SII is used");
    const auto outputs = said_of(devices, with_control(2, 0x40));
    ASSERT_EQ(outputs.size(), 1U);
    EXPECT_NE(outputs[0].find("the file gives SyncManager 2 of slave 2 the control octet 0x"), std::string::npos)
        << outputs[0];
    EXPECT_NE(outputs[0].find("a trigger of the watchdog), and its SII 0x"), std::string::npos) << outputs[0];
    EXPECT_NE(outputs[0].find(": that of the file is used"), std::string::npos) << outputs[0];
}

TEST(FieldFiles, WhatAToolWritesAnywayIsNoRemark) {
    if (std::string_view(MARGAY_XML_DIR).empty()) GTEST_SKIP() << "MARGAY_XML_DIR is not set";
    std::string text = read_file(std::string(MARGAY_XML_DIR) + "/eni/variox_eni.xml").octets;
    const auto all = [&](const std::string& what, const std::string& by) {
        for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
            text.replace(at, what.size(), by);
    };
    all("EncryptedEtherCATConfig", "EtherCATConfig");
    all("5f0b03ebc40b03fcb91c03f9630b03fb", "00000010a4000007d817000201000000");
    all("5f0b03ebcc0b03fcf91503fa630b03fb", "00000010ac000007981e000101000000");
    const auto eni = read_eni(text);
    ASSERT_TRUE(eni) << to_text(eni.problem);
    for (const Remark& one : eni.remarks)
        for (const char* word : {"PollTime", "0x0930", "0x0934", "SyncManager 0", "SyncManager 1"})
            EXPECT_EQ(one.text.find(word), std::string::npos) << to_text(one);
    EXPECT_EQ(eni->slaves[1].mailbox.out_bytes, 1004);
    EXPECT_EQ(eni->slaves[1].mailbox.in_start, 5100);
    EXPECT_FALSE(eni->slaves[0].mailbox.present());
    EXPECT_EQ(eni->slaves[1].previous_ports.size(), 1U);
}

}  // namespace
}  // namespace margay::files
