// ESI files: what the reader reads, what it refuses at which line, and the configuration that it makes of a device.
#include <margay/files/esi.hpp>
#include <margay/host_configuration.hpp>

#include "files/esi_types.hpp"
#include "files/examples.hpp"

#include <gtest/gtest.h>

namespace margay::files {
namespace {

Read<EsiFile> read_example(const std::string& replace = {}, const std::string& by = {}) {
    std::string text = kExampleEsi;
    if (!replace.empty()) {
        const auto at = text.find(replace);
        EXPECT_NE(at, std::string::npos);
        text.replace(at, replace.size(), by);
    }
    return read_esi(text);
}

std::string problem(const std::string& replace, const std::string& by) {
    const auto esi = read_example(replace, by);
    return esi ? std::string("read") : to_text(esi.problem);
}

TEST(EsiReader, ReadsADeviceCompletely) {
    const auto esi = read_example();
    ASSERT_TRUE(esi) << to_text(esi.problem);
    EXPECT_EQ(esi->vendor, 0x0F00U);
    EXPECT_EQ(esi->vendor_name, "Example works");
    ASSERT_EQ(esi->devices.size(), 1U);
    const EsiDevice& device = esi->devices[0];
    EXPECT_EQ(device.type, "EX100");
    EXPECT_EQ(device.name, "Drive 100 µm");  // English, though German comes first
    EXPECT_EQ(device.group_name, "Drives");
    EXPECT_EQ(device.identity, (Identity{0x0F00, 0x1234, 0x00020001, 0}));
    EXPECT_EQ(device.revision_check, RevisionCheck::equal_or_greater);
    EXPECT_EQ(device.ports[0], PortType::mii);
    EXPECT_EQ(device.ports[2], PortType::ebus);
    EXPECT_EQ(device.ports[1], PortType::not_implemented);
    EXPECT_EQ(device.ebus_current_ma, 70);  // 070 is decimal
    EXPECT_EQ(device.times.to_preop, std::chrono::seconds(3));
    EXPECT_EQ(device.times.to_op, std::chrono::seconds(9));
    ASSERT_EQ(device.sync_managers.size(), 4U);
    EXPECT_EQ(device.sync_managers[2].type, SmType::outputs);
    EXPECT_EQ(device.sync_managers[2].start, 0x1100);
    EXPECT_EQ(device.sync_managers[2].control, 0x64);
    EXPECT_TRUE(device.sync_managers[2].enabled);
    ASSERT_EQ(device.fmmus.size(), 3U);
    EXPECT_EQ(device.fmmus[2].use, FmmuUse::mailbox_status);
    ASSERT_EQ(device.pdos.size(), 3U);
    EXPECT_EQ(device.pdos[0].index, 0x1600);
    EXPECT_EQ(device.pdos[0].sync_manager, 2);
    ASSERT_EQ(device.pdos[0].entries.size(), 3U);
    EXPECT_EQ(device.pdos[0].entries[0].name, "Control word");
    EXPECT_EQ(device.pdos[0].entries[1].index, 0);
    EXPECT_EQ(device.pdos[0].bits(), 16U + 8 + 32);
    EXPECT_FALSE(device.pdos[1].sync_manager);
    EXPECT_EQ(device.pdos[1].excludes, std::vector<std::uint16_t>{0x1600});
    ASSERT_TRUE(device.mailbox);
    EXPECT_EQ(device.mailbox->protocols, mailbox_protocol::kCoE | mailbox_protocol::kFoE);
    EXPECT_EQ(device.mailbox->coe_details, coe_detail::kSdo | coe_detail::kSdoInformation | coe_detail::kPdoAssignment |
                                               coe_detail::kCompleteAccess);
    ASSERT_EQ(device.mailbox->commands.size(), 1U);
    EXPECT_EQ(device.mailbox->commands[0].transitions, Transition::preop_to_safeop | Transition::safeop_to_op);
    EXPECT_EQ(device.mailbox->commands[0].data, (std::vector{std::byte{0xE9}, std::byte{0x03}}));
    ASSERT_EQ(device.modes.size(), 2U);
    EXPECT_EQ(device.modes[1].assign_activate, 0x0300);
    EXPECT_EQ(device.modes[1].sync0_shift_ns, -3);
    ASSERT_TRUE(device.eeprom);
    EXPECT_EQ(device.eeprom->bytes, 2048U);
    EXPECT_EQ(device.eeprom->configuration.size(), 10U);
    ASSERT_EQ(device.dictionary.size(), 2U);
    ASSERT_EQ(device.dictionary[1].items.size(), 3U);
    EXPECT_EQ(device.dictionary[1].items[2].name, "Gain I");
    EXPECT_EQ(device.dictionary[1].items[2].bits, 16U);
    EXPECT_EQ(device.watchdog_divider, 2498);
}

TEST(EsiReader, AWrongValueIsNamedByLineAndCause) {
    EXPECT_EQ(problem("<BitLen>16</BitLen>", "<BitLen>sixteen</BitLen>"),
              "line 42, column 14: BitLen is 'sixteen', which is no number of 64 bits");
    EXPECT_EQ(problem("<Index>#x1600</Index>", "<Index>#x11600</Index>"),
              "line 39, column 37: Index is '#x11600', which is not between 0 and 65535");
    EXPECT_EQ(problem("<SubIndex>0</SubIndex>", "<SubIndex>-1</SubIndex>"),
              "line 41, column 38: SubIndex is '-1', which is not between 0 and 255");
    EXPECT_EQ(problem("PdoAssign=\"1\"", "PdoAssign=\"maybe\""),
              "line 61, column 12: attribute PdoAssign of CoE is 'maybe', which is neither true nor false");
    EXPECT_EQ(problem("<Data>E903</Data>", "<Data>E9031</Data>"),
              "line 62, column 121: Data has an odd number of hexadecimal digits");
    EXPECT_EQ(problem("<Data>E903</Data>", "<Data>E9 0g</Data>"),
              "line 62, column 121: Data has 'g', which is no hexadecimal digit");
    EXPECT_EQ(problem("<Id>#xF00</Id>", "<Id>99999999999999999999</Id>"),
              "line 3, column 12: Id is '99999999999999999999', which is no number of 64 bits");
}

// A text of the file in a message: it is cut between two characters, and has no control characters for a terminal.
TEST(EsiReader, AQuotedTextIsWholeAndHarmless) {
    const auto quoted = [](const std::string& text) {
        const auto said = problem("<BitLen>16</BitLen>", "<BitLen>" + text + "</BitLen>");
        const auto begin = said.find('\'');
        return said.substr(begin, said.rfind('\'') + 1 - begin);
    };
    const auto times = [](int n, const std::string& text) {
        std::string all;
        for (; n != 0; --n) all += text;
        return all;
    };
    EXPECT_EQ(quoted(times(40, "x")), "'" + times(40, "x") + "'");
    EXPECT_EQ(quoted(times(41, "x")), "'" + times(40, "x") + "…'");
    EXPECT_EQ(quoted(times(20, "ä")), "'" + times(20, "ä") + "'");
    EXPECT_EQ(quoted(times(30, "ä")), "'" + times(20, "ä") + "…'") << "the last character is whole";
    EXPECT_EQ(quoted(times(20, "€")), "'" + times(13, "€") + "…'");
    EXPECT_EQ(quoted(times(15, "😀")), "'" + times(10, "😀") + "…'");
    EXPECT_EQ(quoted("a&#x9b;31m&#x7f;b\xC2\xA0"), "'a 31m b\xC2\xA0'") << "C1 and DEL, not a space of U+00A0";
}

TEST(EsiReader, MoreThanASlaveCanHaveIsNamed) {
    std::string sms;
    std::string fmmus;
    for (int n = 0; n < 13; ++n) sms += "<Sm>Outputs</Sm>\n";
    for (int n = 0; n < 14; ++n) fmmus += "<Fmmu>Outputs</Fmmu>\n";
    EXPECT_EQ(problem("<Sm ", sms.substr(0, sms.size() - 17) + "<Sm "), "read");
    const auto more_sms = problem("<Sm ", sms + "<Sm ");
    EXPECT_TRUE(more_sms.ends_with(": the device has more than 16 Sm")) << more_sms;
    EXPECT_TRUE(more_sms.starts_with("line ")) << more_sms;
    const auto more_fmmus = problem("<Fmmu", fmmus + "<Fmmu");
    EXPECT_TRUE(more_fmmus.ends_with(": the device has more than 16 Fmmu")) << more_fmmus;
    const auto long_data = read_example("050E03000A0000000000", std::string(200'000, '0'));
    ASSERT_TRUE(long_data) << to_text(long_data.problem);
    ASSERT_EQ(long_data.remarks.size(), read_example().remarks.size() + 1);
    bool named = false;
    for (const Remark& one : long_data.remarks)
        named |=
            to_text(one) == "line 74, column 10: ConfigData has 100000 octets: those behind the first 14 are not used";
    EXPECT_TRUE(named);
    EXPECT_EQ(long_data->devices[0].eeprom->configuration.size(), 14U);
}

TEST(EsiReader, NumbersThatTheDeviceDoesNotHaveAreNamed) {
    const auto has = [](const Read<EsiFile>& esi, const std::string& text) {
        return std::ranges::any_of(esi.remarks, [&](const Remark& one) { return to_text(one) == text; });
    };
    const auto no_sm = read_example(" Sm=\"2\"", " Sm=\"99\"");
    ASSERT_TRUE(no_sm) << to_text(no_sm.problem);
    EXPECT_TRUE(has(no_sm, "line 39, column 8: the PDO is of SyncManager 99, and the device has 4"))
        << to_text(no_sm.remarks.back());
    const auto no_size = read_example("<ByteSize>2048", "<ByteSize>0");
    ASSERT_TRUE(no_size) << to_text(no_size.problem);
    EXPECT_TRUE(has(no_size, "line 72, column 8: ByteSize is 0: the EEPROM is as large as its contents need"))
        << to_text(no_size.remarks.back());
}

// In the schema, Enable is a number. In files from the field, Enable may also be a boolean.
TEST(EsiReader, ASyncManagerIsEnabledByANumberOrAWord) {
    for (const auto& [text, enabled] : {std::pair{"#x1", true}, std::pair{"true", true}, std::pair{"FALSE", false}}) {
        std::string esi(kExampleEsi);
        for (std::size_t at = 0; (at = esi.find(" Enable=\"", at)) != std::string::npos; ++at)
            esi.replace(at + 9, esi.find('"', at + 9) - at - 9, text);
        const auto read = read_esi(esi);
        ASSERT_TRUE(read) << to_text(read.problem);
        EXPECT_EQ(read->devices[0].sync_managers[2].enabled, enabled) << text;
    }
    EXPECT_NE(problem(" Enable=\"1\"", " Enable=\"yes\"").find("attribute Enable of Sm is 'yes'"), std::string::npos);
}

TEST(EsiReader, WhatIsNoEsiIsRefused) {
    EXPECT_EQ(problem("EtherCATInfo Version", "Other Version").substr(0, 30), "line 81, column 3: no well-for");
    EXPECT_EQ(to_text(read_esi("<EtherCATConfig/>").problem),
              "line 1, column 2: the root element is EtherCATConfig: an ESI has EtherCATInfo or EtherCATModule");
    EXPECT_EQ(to_text(read_esi("<EtherCATInfo><Vendor><Id>1</Id></Vendor></EtherCATInfo>").problem),
              "line 1, column 2: the file describes no device and no module");
    EXPECT_EQ(to_text(read_esi("").problem).substr(0, 22), "line 1, column 1: no w");
    EXPECT_EQ(to_text(read_esi("<EtherCATInfo>\n<Name>AB&T</Nam>").problem).substr(0, 7), "line 2,");
}

TEST(EsiReader, HostileXmlIsRefused) {
    EXPECT_EQ(to_text(read_esi("<?xml version=\"1.0\"?>\n<!DOCTYPE x [<!ENTITY a \"b\"><!ENTITY c \"&a;&a;\">]>\n"
                               "<EtherCATInfo>&c;</EtherCATInfo>")
                          .problem),
              "line 2, column 11: a document type (DOCTYPE, entities of its own) is not accepted");
    std::string deep;
    for (int n = 0; n < 100'000; ++n) deep += "<a>";
    for (int n = 0; n < 100'000; ++n) deep += "</a>";
    EXPECT_EQ(to_text(read_esi(deep).problem), "line 1, column 194: elements are nested deeper than 64 levels");
    EXPECT_EQ(to_text(read_esi(std::string("<EtherCATInfo>\n\0</EtherCATInfo>", 31)).problem),
              "line 2, column 1: a zero octet is no XML");
    EXPECT_EQ(to_text(read_esi("\xFF\xFE<\0").problem),
              "line 1, column 1: the file is UTF-16, which is not supported: convert it to UTF-8");
    EXPECT_EQ(to_text(read_esi("\x1F\x8B\b").problem),
              "line 1, column 1: the file is compressed by gzip, and is no XML");
    // Two documents in one file, and the rest of a longer file behind a shorter one.
    EXPECT_EQ(to_text(read_esi("<EtherCATInfo/>\n\n<EtherCATInfo/>\n").problem),
              "line 3, column 2: no well-formed XML: a second element beside the root element");
    EXPECT_EQ(to_text(read_esi("<?xml version=\"1.0\"?>\n<EtherCATInfo/>\n<!-- x -->\nrest").problem),
              "line 4, column 1: no well-formed XML: text outside of the root element");
    EXPECT_EQ(to_text(read_esi("PK\x03\x04").problem), "line 1, column 1: the file is a ZIP archive, and is no XML");
    EXPECT_EQ(to_text(read_esi("<?xml version='1.0' encoding='EBCDIC'?><a/>").problem),
              "line 1, column 1: the encoding 'ebcdic' is not supported: convert the file to UTF-8");
}

// A lenient reader would accept these names, or read them as empty.
TEST(EsiReader, ReferencesAndCharactersThatXmlDoesNotHaveAreRefused) {
    const auto named = [](const std::string& name) { return to_text(read_example("Example works", name).problem); };
    const auto expect = [&](const std::string& name, const std::string& text) {
        const std::string said = named(name);
        EXPECT_TRUE(said.starts_with("line 3, column ")) << said;
        EXPECT_TRUE(said.ends_with(": no well-formed XML: " + text)) << said;
    };
    expect("AB&T", "an '&' that begins no reference: as a text it is &amp;");
    expect("a & b", "an '&' that begins no reference: as a text it is &amp;");
    expect("a&foo;b", "the entity '&foo;' is unknown");
    expect("a&Amp;b", "the entity '&Amp;' is unknown");
    expect("a&#;b", "'&#;' is no reference to a character");
    expect("a&#x;b", "'&#x;' is no reference to a character");
    expect("a&#X41;b", "'&#X41;' is no reference to a character");
    expect("a&#65b", "'&#65b' is no reference to a character");
    expect("a&#4294967361;b", "'&#4294967361;' refers to no character of XML");
    for (const std::string one : {"&#0;", "&#x1F;", "&#xD800;", "&#xFFFF;", "&#x110000;"})
        expect("a" + one, "'" + one + "' refers to no character of XML");
    expect("a\x01z", "the octet 0x01 is no character of XML");
    expect("<!-- \x1B -->", "the octet 0x1b is no character of XML");
    expect("a\xEF\xBF\xBFz", "U+FFFE and U+FFFF are no characters of XML");
    expect("a]]>b", "']]>' in a text");
    expect("<!-- a -- b -->", "'--' in a comment");
    expect("<!-- a --->", "'--' in a comment");
    expect("<a b='&zz;'/>", "the entity '&zz;' is unknown");
    expect("<a b=\"<\"/>", "'<' in the value of an attribute");
    expect("<?xml version='1.0'?>", "an XML declaration that is not at the beginning of the file");
    expect("<?a+b?>", "a processing instruction whose name has no end");
    const std::string all = "a&amp;&lt;&gt;&quot;&apos;&#181;&#xB5;<!-- & ]]> --><![CDATA[&]]><?x &?><a b='>\"&#9;'/>";
    EXPECT_EQ(named(all), "");
    EXPECT_EQ(read_example("Example works", all)->vendor_name, "a&<>\"'µµ&");
    EXPECT_EQ(named("AB&T").substr(0, 18), "line 3, column 45:");
}

TEST(EsiReader, AnXmlDeclarationIsRight) {
    const auto first = [](const std::string& begin) {
        const std::string esi(kExampleEsi);
        const auto read = read_esi(begin + esi.substr(esi.find("?>") + 2));
        return read ? "" : to_text(read.problem);
    };
    for (const char* right : {"", "<?xml version='1.0'?>", "<?xml version = \"1.1\"  encoding='UTF-8' ?>",
                              "<?xml version='1.0' encoding='utf-8' standalone='no'?>", "<?xml-stylesheet a?>"})
        EXPECT_EQ(first(right), "");
    EXPECT_EQ(first("<?xml version='2.0'?>"),
              "line 1, column 1: no well-formed XML: the XML declaration has no version 1.0");
    EXPECT_EQ(first("<?xml encoding='UTF-8' version='1.0'?>"),
              "line 1, column 1: no well-formed XML: the XML declaration has no version 1.0");
    EXPECT_EQ(first("<?xml version='1.0' encoding=''?>"),
              "line 1, column 20: no well-formed XML: the encoding has no name");
    EXPECT_EQ(first("<?xml version='1.0' standalone='maybe'?>"),
              "line 1, column 20: no well-formed XML: standalone is neither yes nor no");
    EXPECT_EQ(first("<?xml version='1.0' more='1'?>"),
              "line 1, column 21: no well-formed XML: the XML declaration has more than version, encoding and "
              "standalone");
    EXPECT_EQ(first("\n<?xml version='1.0'?>"),
              "line 2, column 1: no well-formed XML: an XML declaration that is not at the beginning of the file");
    EXPECT_EQ(first("\xEF\xBB\xBF\xEF\xBB\xBF"), "line 1, column 1: no well-formed XML: a second byte order mark");
}

// Few octets describe many subindices: each object of a type has all of them.
TEST(EsiReader, AFileThatGrowsWithoutBoundIsRefused) {
    std::string text =
        "<EtherCATInfo><Vendor><Id>1</Id></Vendor><Descriptions><Devices><Device><Type>a</Type><Profile>"
        "<Dictionary><DataTypes><DataType><Name>T</Name>";
    for (int n = 0; n < 255; ++n) text += "<SubItem><SubIdx>" + std::to_string(n) + "</SubIdx></SubItem>";
    text += "</DataType></DataTypes><Objects>";
    for (int n = 0; n < 5000; ++n) text += "<Object><Index>1</Index><Type>T</Type></Object>";
    text += "</Objects></Dictionary></Profile></Device></Devices></Descriptions></EtherCATInfo>";
    EXPECT_NE(to_text(read_esi(text).problem).find("the file stands for more than 1000000 commands"),
              std::string::npos);
}

// The reader also checks elements that it does not use.
TEST(EsiReader, ValuesWithoutAMeaningAreNamed) {
    const auto said = [](const std::string& replace, const std::string& by) {
        const auto esi = read_example(replace, by);
        if (!esi) return to_text(esi.problem);
        if (esi.remarks.size() != 1) return std::to_string(esi.remarks.size()) + " remarks";
        return esi.remarks[0].text;
    };
    const auto in_info = [&](const std::string& text) { return said("<Info>", "<Info>" + text); };
    EXPECT_EQ(in_info("<EtherCATController><DpramSize>zz</DpramSize></EtherCATController>"),
              "DpramSize is 'zz', which is no number from 0 to 4294967295: it is not used");
    EXPECT_EQ(in_info("<EtherCATController><StationAliasSupported>zz</StationAliasSupported></EtherCATController>"),
              "StationAliasSupported is 'zz', which is neither true nor false: it is not used");
    EXPECT_EQ(in_info("<StateMachine><Timeout><BackToSafeopTimeout>99999999999</BackToSafeopTimeout></Timeout>"
                      "</StateMachine>"),
              "BackToSafeopTimeout is '99999999999', which is no number from 0 to 4294967295: it is not used");
    EXPECT_EQ(in_info("<EtherCATController><DpramSize>4096</DpramSize><SmCount>#x4</SmCount></EtherCATController>"),
              "0 remarks");
    EXPECT_EQ(said("<Type ", "<Type TcSmClass=\"zz\" "),
              "TcSmClass is 'zz', which is no number from 0 to 255: it is not used");
    EXPECT_EQ(
        said("</Device>", "<Slots><Slot MinInstances='5' MaxInstances='2'><Name>a</Name></Slot></Slots></Device>"),
        "MinInstances is 5, and MaxInstances 2: there are as many slots as MaxInstances says");
    EXPECT_EQ(said("<CoE ", "<CoE DS402Channels=\"256\" ").substr(0, 8), "line 61,");
}

TEST(EsiReader, ADeviceWithAFaultLeavesTheOthers) {
    std::string text = kExampleEsi;
    const auto begin = text.find("    <Device ");
    const auto end = text.find("</Device>") + 10;
    std::string second = text.substr(begin, end - begin);
    second.replace(second.find("<BitLen>16"), 10, "<BitLen>x6");
    text.insert(end, second);
    const auto esi = read_esi(text);
    ASSERT_TRUE(esi) << to_text(esi.problem);
    EXPECT_EQ(esi->devices.size(), 1U);
    ASSERT_FALSE(esi.remarks.empty());
    EXPECT_NE(esi.remarks.back().text.find("Device 'EX100' is left out: line "), std::string::npos)
        << esi.remarks.back().text;
}

TEST(EsiReader, LatinOneAndByteOrderMarks) {
    const auto latin = read_esi(
        "<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>\n<EtherCATInfo><Vendor><Id>1</Id><Name>\xB5"
        "</Name></Vendor><Descriptions><Devices><Device><Type>a</Type></Device></Devices>"
        "</Descriptions></EtherCATInfo>");
    ASSERT_TRUE(latin);
    EXPECT_EQ(latin->vendor_name, "µ");
    const auto windows = read_esi(
        "<?xml version=\"1.0\" encoding=\"Windows-1252\"?>\n<EtherCATInfo><Vendor><Id>1</Id><Name>\xB5 \x80 \x96 "
        "\x84\x9F</Name></Vendor><Descriptions><Devices><Device><Type>a</Type></Device></Devices>"
        "</Descriptions></EtherCATInfo>");
    ASSERT_TRUE(windows);
    EXPECT_EQ(windows->vendor_name, "µ € – „Ÿ");
    const auto marked = read_esi("\xEF\xBB\xBF" + std::string(kExampleEsi));
    ASSERT_TRUE(marked) << to_text(marked.problem);
}

TEST(EsiModel, FindsDevicesByTheirRevisionRule) {
    const auto esi = read_example();
    ASSERT_TRUE(esi);
    EXPECT_NE(find_device(*esi, Identity{0x0F00, 0x1234, 0x00020001, 5}), nullptr);
    EXPECT_NE(find_device(*esi, Identity{0x0F00, 0x1234, 0x00030000, 0}), nullptr);
    EXPECT_EQ(find_device(*esi, Identity{0x0F00, 0x1234, 0x00010000, 0}), nullptr);
    EXPECT_EQ(find_device(*esi, Identity{0x0F01, 0x1234, 0x00020001, 0}), nullptr);
    EXPECT_TRUE(revision_fits(RevisionCheck::low_equal_high_equal_or_greater, 0x00020001, 0x00050001));
    EXPECT_FALSE(revision_fits(RevisionCheck::low_equal_high_equal_or_greater, 0x00020001, 0x00010001));
    EXPECT_FALSE(revision_fits(RevisionCheck::low_equal, 0x00020001, 0x00020002));
}

TEST(EsiModel, NamesEntriesAndTypes) {
    const auto esi = read_example();
    ASSERT_TRUE(esi);
    const EsiDevice& device = esi->devices[0];
    EXPECT_EQ(entry_name(device, Direction::outputs, 0x6040, 0), "Control word");
    EXPECT_EQ(entry_name(device, Direction::inputs, 0x6040, 0), "");
    EXPECT_EQ(entry_name(device, Direction::inputs, 0x2000, 2), "Gain I");  // from the object dictionary
    EXPECT_EQ(data_type_number("UINT"), 6);
    EXPECT_EQ(data_type_number("BIT3"), 0x32);
    EXPECT_EQ(data_type_number("STRING(20)"), 9);
    EXPECT_EQ(data_type_number("BITX"), 0);
    for (const unsigned number :
         {0x0BU, 0x0CU, 0x0DU, 0x10U, 0x12U, 0x13U, 0x14U, 0x16U, 0x18U, 0x19U, 0x1AU, 0x1DU, 0x2DU, 0x2EU})
        EXPECT_EQ(data_type_number(data_type_name(static_cast<std::uint16_t>(number), 24)), number);
    EXPECT_EQ(data_type_name(0x16, 24), "UINT24");
    EXPECT_EQ(data_type_number("DT1018"), 0);
}

TEST(EsiModel, OperationModesBecomeSyncSettings) {
    const auto esi = read_example();
    ASSERT_TRUE(esi);
    const EsiDevice& device = esi->devices[0];
    EXPECT_EQ(sync_settings(device.modes[0], std::chrono::milliseconds(1)).source, SyncSettings::Source::none);
    EXPECT_EQ(find_mode(device, "DC"), 1U);
    EXPECT_EQ(find_mode(device, "nothing"), std::nullopt);
    const SyncSettings sync = sync_settings(device.modes[1], std::chrono::milliseconds(4));
    EXPECT_EQ(sync.source, SyncSettings::Source::application);
    EXPECT_EQ(sync.assign_activate, 0x0300);
    EXPECT_EQ(sync.sync0_cycle, std::chrono::milliseconds(2));  // factor -2: half of the cycle
    EXPECT_EQ(sync.shift, std::chrono::nanoseconds(-3));
    EXPECT_EQ(sync.sync1_cycle, Duration{0});
}

// SYNC1 has no cycle of its own and comes after its SYNC0.
TEST(EsiModel, ATimeOfSync1ThatIsNotUsedIsARemark) {
    const auto esi = read_example(
        "</OpMode>", "<CycleTimeSync1 Factor=\"-2\">0</CycleTimeSync1><ShiftTimeSync1>-5000</ShiftTimeSync1></OpMode>");
    ASSERT_TRUE(esi) << to_text(esi.problem);
    EXPECT_TRUE(read_example().remarks.empty());
    ASSERT_EQ(esi.remarks.size(), 2U);
    EXPECT_EQ(esi.remarks[0].text, "a negative factor of CycleTimeSync1 is not used: SYNC1 has no cycle of its own");
    EXPECT_EQ(esi.remarks[1].text, "a negative ShiftTimeSync1 is not used: SYNC1 is not before its SYNC0");
    EXPECT_GT(esi.remarks[1].line, 1U);
}

TEST(EsiConfiguration, DescribesTheSlave) {
    const auto esi = read_example();
    ASSERT_TRUE(esi);
    HostConfiguration owner;
    const auto made = configure(*esi, esi->devices[0], {.mode = 1}, owner);
    ASSERT_NE(made.config, nullptr) << made.error;
    const SlaveConfiguration& config = *made.config;
    ASSERT_EQ(config.pdos().size(), 2U);
    EXPECT_EQ(config.pdos()[0].sync_manager, 2);
    ASSERT_EQ(config.pdos()[0].pdos.size(), 1U);
    EXPECT_EQ(config.pdos()[0].pdos[0].index, 0x1600);
    EXPECT_EQ(config.pdos()[0].pdos[0].entries[2], (PdoEntry{0x607A, 0, 32}));
    ASSERT_EQ(config.startup().size(), 1U);
    EXPECT_EQ(config.startup()[0].index, 0x2001);
    EXPECT_EQ(config.startup()[0].octets().size(), 2U);
    EXPECT_EQ(config.dc().assign_activate, 0x0300);
    EXPECT_FALSE(config.fixed_pdos);
    EXPECT_EQ(config.process_data_watchdog, std::chrono::milliseconds(100));
    const auto wrong = configure(*esi, esi->devices[0], {.mode = 2}, owner);
    EXPECT_EQ(wrong.config, nullptr);
    EXPECT_EQ(wrong.error, "operation mode 2 does not exist: the device has 2");
}

}  // namespace
}  // namespace margay::files
