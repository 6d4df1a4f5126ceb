// Compares the page with the facts of the session.
#include "report/report_fixture.hpp"

#include "segment_report/image_entries.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace margay::segment_report {
namespace {

using process::contains;

using ReportSegment = ReportTest;

const std::string kDamaged =
    "[[slave]]\ndevice = \"coupler\"\nerrors = [[1, 0, 1]]\n[[slave]]\ndevice = \"digital_in_8\"\nerrors = [[0, 14, "
    "1], "
    "[1, 0, 2]]\n[[slave]]\ndevice = \"digital_out_8\"\n[[slave]]\ndevice = \"drive\"\nparent = \"slave1\"\nerrors = "
    "[[0, "
    "3, 0]]\n";

TEST_F(ReportSegment, TheTableOfSlavesSaysWhatTheSessionSays) {
    for (const std::string segment : {"demo", "tree", "drives", "servodrives"}) {
        ethercat::StandaloneSession session(source(segment));
        const auto slaves = session.slaves();
        ASSERT_TRUE(slaves);
        const ReadPage page(made(segment).page.html);
        ASSERT_EQ(page.rows("slave-table"), slaves->size());
        for (const SlaveFacts& slave : *slaves) {
            const auto row = slave.position + 1U;
            EXPECT_EQ(page.cell("slave-table", row, "Pos."), fmt::to_string(slave.position));
            EXPECT_EQ(page.cell("slave-table", row, "Name"), slave.name);
            EXPECT_EQ(page.cell("slave-table", row, "State"), "SAFEOP") << "mapped for the image";
            EXPECT_EQ(page.cell("slave-table", row, "Product"), fmt::format("0x{:08x}", slave.identity.product));
            EXPECT_EQ(page.cell("slave-table", row, "Revision"), fmt::format("0x{:08x}", slave.identity.revision));
            EXPECT_EQ(page.cell("slave-table", row, "Serial"), fmt::format("0x{:08x}", slave.identity.serial));
            const auto details = page.text(fmt::format("//div[@id='slave{}']", slave.position));
            EXPECT_TRUE(contains(details, fmt::format("0x{:04x}", slave.station_address))) << details;
            EXPECT_TRUE(contains(details, fmt::format("type 0x{:02x}, revision {}, build {}; {} FMMUs", slave.dl.type,
                                                      slave.dl.revision, slave.dl.build, slave.dl.fmmus)))
                << details;
        }
        EXPECT_EQ(page.verdicts("fault"), std::vector<std::string>()) << segment;
        EXPECT_TRUE(contains(page.headline(), fmt::format("{} slaves, all in SAFEOP", slaves->size())))
            << page.headline();
    }
}

TEST_F(ReportSegment, TheVerdictNamesTheCableThePortsAndWhatToDo) {
    folder.write("damaged.toml", kDamaged);
    ethercat::StandaloneSession session(source("damaged.toml"));
    EXPECT_EQ(session.error_counters(1)->invalid_frames[0], 14) << "the segment is as this test wants it";
    const auto made_page = made("damaged.toml").page;
    EXPECT_EQ(made_page.worst, Severity::fault);
    const ReadPage page(made_page.html);
    EXPECT_TRUE(contains(page.headline(), "E-bus contact between slave 0 and slave 1 damaged 14 frames"))
        << page.headline();
    EXPECT_TRUE(contains(page.headline(), "cable between slave 0 and slave 3 damaged 3 frames")) << page.headline();
    const auto faults = page.verdicts("fault");
    ASSERT_EQ(faults.size(), 1U);
    EXPECT_EQ(
        faults[0].substr(0, faults[0].find(" details")),
        "E-bus contact between slave 0 and slave 1: 14 damaged frames from slave 0, port 1 arrived at slave 1, port "
        "0; the link was interrupted 1 time. ");
    // In the order of the slaves: master to 0, 0 to 1, 1 to 2, 0 to 3.
    ASSERT_EQ(page.rows("cable-table"), 4U);
    EXPECT_EQ(page.cell("cable-table", 2, "From"), "0 port 1");
    EXPECT_EQ(page.cell("cable-table", 2, "To"), "1 port 0");
    EXPECT_EQ(page.cell("cable-table", 2, "Medium"), "E-bus");
    EXPECT_EQ(page.cell("cable-table", 2, "Counters at From"), "0 / 0 / 0 / 1");
    EXPECT_EQ(page.cell("cable-table", 2, "Counters at To"), "14 / 0 / 0 / 1");
    EXPECT_TRUE(contains(page.cell("cable-table", 2, "Verdict and what to do"), "Push the terminals together"));
    EXPECT_TRUE(contains(page.cell("cable-table", 3, "Verdict and what to do"), "interrupted 2 times"));
    EXPECT_TRUE(contains(page.cell("cable-table", 4, "Verdict and what to do"), "Exchange this cable"));
    EXPECT_EQ(page.cell("cable-table", 1, "Verdict and what to do"), "nothing counted");
    // The picture: colours and counts.
    EXPECT_EQ(page.count("//*[@id='topology']"), 1U);
    EXPECT_EQ(page.count("//svg[@id='topology']//g[@class='cable bad']"), 1U);
    EXPECT_EQ(page.count("//svg[@id='topology']//g[@class='cable doubtful']"), 2U);
    EXPECT_EQ(page.count("//svg[@id='topology']//g[@class='cable good']"), 1U);
    EXPECT_EQ(page.text("//svg[@id='topology']//g[@class='cable bad']/text[@class='count']"), "✕14");
}

// The slaves behind a broken cable do not answer. Only the error counters of the port before the cable show the fault.
TEST_F(ReportSegment, APortWithoutALinkThatHasCountedErrorsIsNamed) {
    folder.write("dead.toml",
                 "[[slave]]\ndevice = \"digital_io_16\"\nerrors = [[1, 200, 60]]\n"
                 "[[slave]]\ndevice = \"digital_io_16\"\ncable_broken = true\n");
    const auto out = made("dead.toml");
    const ReadPage page(out.page.html);
    const auto faults = page.verdicts("fault");
    ASSERT_EQ(faults.size(), 1U);
    EXPECT_TRUE(
        faults[0].starts_with("Slave 0, port 1 has no link, and has counted 200 damaged frames, 61 interruptions: "
                              "if a device belongs there, check its supply and the cable."))
        << faults[0];
    EXPECT_FALSE(page.has("No error was counted"));
}

TEST_F(ReportSegment, ErrorsThatComeMeanwhileAreNamed) {
    folder.write("noise.toml", "noise = { corrupted = 0.02, seed = 3 }\n[[slave]]\ndevice = \"drive\"\ncount = 3\n");
    const auto out = made("noise.toml");
    const auto cables = cables_of(out.report);
    EXPECT_TRUE(std::ranges::any_of(cables, [](const Cable& cable) { return cable.growth != 0; }));
    EXPECT_TRUE(ReadPage(out.page.html).has("of it came during this report"));
}

TEST_F(ReportSegment, ThePictureHasABoxForEachSlaveAndALineForEachCable) {
    for (const std::string segment : {"demo", "tree", "mixed200"}) {
        const auto out = made(segment, {}, {.dictionaries = false});
        const ReadPage page(out.page.html);
        const std::string svg = "//svg[@id='topology']";
        EXPECT_EQ(page.count(svg + "//a[@class='slave']"), out.report.slaves.size());
        EXPECT_EQ(page.count(svg + "//g[starts-with(@class,'cable')]"), out.report.slaves.size());
        EXPECT_EQ(page.count(svg + "//g[@class='master']"), 1U);
        // No two boxes have the same place, and all boxes are inside the picture.
        std::set<std::pair<std::string, std::string>> places;
        for (std::size_t n = 1; n <= out.report.slaves.size(); ++n) {
            const auto rect = "(" + svg + "//a[@class='slave'])[" + std::to_string(n) + "]/rect";
            const auto x = page.text(rect + "/@x"), y = page.text(rect + "/@y");
            EXPECT_TRUE(places.emplace(x, y).second) << segment << " " << n;
            EXPECT_LE(std::stod(x) + std::stod(page.text(rect + "/@width")), std::stod(page.text(svg + "/@width")));
            EXPECT_LE(std::stod(y) + std::stod(page.text(rect + "/@height")), std::stod(page.text(svg + "/@height")));
        }
        EXPECT_LE(std::stod(page.text(svg + "/@width")), 1500) << segment;
    }
}

TEST_F(ReportSegment, ARingHasBothCablesAndTheBreak) {
    const std::string slaves =
        "[[slave]]\nname = \"a\"\ndevice = \"drive\"\ncount = 2\n[[slave]]\nname = \"z\"\ndevice = \"drive\"\n";
    folder.write("whole.toml", "ring = { slave = \"z\", port = 1 }\n" + slaves);
    const ReadPage whole(made("whole.toml").page.html);
    EXPECT_EQ(whole.count("//svg[@id='topology']//g[@class='master']"), 2U);
    EXPECT_EQ(whole.rows("cable-table"), 4U);
    EXPECT_EQ(whole.cell("cable-table", 1, "From"), "master");
    EXPECT_EQ(whole.cell("cable-table", 4, "From"), "2 port 1");
    EXPECT_EQ(whole.cell("cable-table", 4, "To"), "NIC at the end of the ring");
    EXPECT_TRUE(contains(whole.verdicts("good").at(2), "The ring is closed."));
    folder.write("broken.toml", "ring = { slave = \"z\", port = 1 }\n" + slaves + "cable_broken = true\n");
    const auto out = made("broken.toml");
    EXPECT_EQ(out.page.worst, Severity::fault);
    const ReadPage broken(out.page.html);
    ASSERT_EQ(broken.verdicts("fault").size(), 1U) << broken.verdicts("fault").at(1);
    EXPECT_TRUE(contains(broken.verdicts("fault")[0], "The ring is broken between slave 1 and slave 2."));
    EXPECT_EQ(broken.text("//svg[@id='topology']//g[@class='cable bad']/text[@class='count']"), "broken");
    EXPECT_EQ(broken.count("//svg[@id='topology']//g[@class='cable good']"), 3U);
}

// A ring of the slaves 0, 1, 4 and 5, with the slaves 2 and 3 at a branch of slave 1. The cable above the slave with
// the name `broken` is broken.
std::string ring_with_branch(const std::string& broken) {
    std::string text = "ring = { slave = \"d\", port = 1 }\n";
    for (const std::string slave : {"a", "b", "x", "y", "c", "d"}) {
        text += "[[slave]]\nname = \"" + slave + "\"\ndevice = \"digital_io_16\"\nchip = \"junction\"\n";
        if (slave == "x") text += "parent = \"b\"\nport = 3\n";
        if (slave == "c") text += "parent = \"b\"\nport = 1\n";
        if (slave == broken) text += "cable_broken = true\n";
    }
    return text;
}

// The slave before the break has a branch. Unused ports have no link either. The counters show which port has lost its
// link.
TEST_F(ReportSegment, ABreakBesideABranch) {
    folder.write("broken.toml", ring_with_branch("c"));
    auto report = made("broken.toml", {}, {.dictionaries = false}).report;
    ASSERT_EQ(report.slaves.size(), 6U);
    for (SlaveState& slave : report.slaves) slave.counters_before->lost_links = {};
    const auto fault = [&] { return ReadPage(write_page(report).html).verdicts("fault").at(0); };
    EXPECT_TRUE(contains(fault(), "The ring is broken before slave 4.")) << fault();
    EXPECT_EQ(cable_text(cables_of(report).at(4)), "cable between a slave before the break and slave 4");
    report.slaves[4].counters_before->lost_links[0] = 1;
    report.slaves[1].counters_before->lost_links[1] = 1;
    EXPECT_TRUE(contains(fault(), "The ring is broken between slave 1 and slave 4.")) << fault();
    EXPECT_EQ(cables_of(report).at(4).near.port, 1U);
    report.slaves[3].counters_before->lost_links[1] = 1;  // a device was there once
    EXPECT_TRUE(contains(fault(), "The ring is broken before slave 4.")) << fault();
}

TEST_F(ReportSegment, TheCableOfTheFirstNicIsBroken) {
    folder.write("broken.toml", ring_with_branch("a"));
    const auto out = made("broken.toml", {}, {.dictionaries = false});
    ASSERT_EQ(out.report.slaves.size(), 6U);
    EXPECT_EQ(out.page.worst, Severity::fault);
    const auto faults = ReadPage(out.page.html).verdicts("fault");
    EXPECT_TRUE(contains(faults.at(0), "The ring is broken between the master and slave 0.")) << faults.at(0);
}

// An application keeps the places of the whole ring after a break. The links show where the break is.
TEST_F(ReportSegment, ABreakInTheRingOfAnApplication) {
    folder.write("whole.toml", ring_with_branch(""));
    auto report = made("whole.toml", {}, {.dictionaries = false}).report;
    ASSERT_EQ(report.slaves.size(), 6U);
    EXPECT_TRUE(ring_of(report).whole());
    ASSERT_EQ(report.slaves[4].facts.parent, 1U);
    const auto set_link = [&](std::size_t slave, std::size_t port, bool link) {
        auto& facts = report.slaves[slave].facts.ports[port];
        facts.link = facts.open = link;
    };
    set_link(1, 1, false);
    set_link(4, 0, false);
    EXPECT_EQ(ring_of(report).behind, 4U);
    EXPECT_EQ(cable_text(cables_of(report).at(4)), "cable between slave 1 and slave 4");
    EXPECT_TRUE(cables_of(report).at(4).broken);
    set_link(1, 1, true);
    set_link(4, 0, true);
    set_link(0, 0, false);
    EXPECT_EQ(cable_text(cables_of(report).at(0)), "cable between the master and slave 0");
    EXPECT_FALSE(ring_of(report).whole());
}

// An application lists the slaves that it uses. Other slaves got power later: they are in the ring, but not in the
// list.
TEST_F(ReportSegment, ABreakBehindSlavesThatAreNotInTheList) {
    folder.write("broken.toml",
                 "ring = { slave = \"z\", port = 1 }\n[[slave]]\ndevice = \"drive\"\ncount = 4\n"
                 "[[slave]]\nname = \"z\"\ndevice = \"drive\"\ncable_broken = true\n");
    auto report = made("broken.toml", {}, {.dictionaries = false}).report;
    ASSERT_EQ(report.slaves.size(), 5U);
    const auto all = cables_of(report);
    ASSERT_EQ(all.size(), 6U);
    EXPECT_EQ(cable_text(all[4]), "cable between slave 3 and slave 4");
    report.slaves.erase(report.slaves.begin() + 1, report.slaves.begin() + 4);
    auto& ports = report.slaves[0].facts.ports;
    for (auto& port : ports)
        if (port.neighbour == 2) port.neighbour = 0;  // a slave that the application does not know
    EXPECT_EQ(ring_of(report).behind, 4U);
    const auto cables = cables_of(report);
    ASSERT_EQ(cables.size(), 3U);
    EXPECT_EQ(cable_text(cables[1]), "cable between slave 0 and slave 4");
    EXPECT_TRUE(cables[1].broken);
    EXPECT_EQ(cables[1].near.port, 1U);
    EXPECT_EQ(cable_text(cables[2]), "cable between slave 4 and the NIC at the end of the ring");
    const ReadPage page(write_page(report).html);
    EXPECT_TRUE(contains(page.verdicts("fault").at(0), "The ring is broken between slave 0 and slave 4."));
    // All slaves before the break are unknown.
    report.slaves.erase(report.slaves.begin());
    EXPECT_EQ(cable_text(cables_of(report).at(0)), "cable between the master and slave 4");
    EXPECT_TRUE(cables_of(report).at(0).broken);
}

// The slaves between two slaves of the list are not used, and the ring is whole.
TEST_F(ReportSegment, AWholeRingWithSlavesThatAreNotInTheList) {
    folder.write("whole.toml",
                 "ring = { slave = \"z\", port = 1 }\n[[slave]]\ndevice = \"drive\"\ncount = 3\n"
                 "[[slave]]\nname = \"z\"\ndevice = \"drive\"\n");
    auto report = made("whole.toml", {}, {.dictionaries = false}).report;
    ASSERT_EQ(report.slaves.size(), 4U);
    report.slaves.erase(report.slaves.begin() + 1, report.slaves.begin() + 3);
    report.slaves[1].facts.parent = 0;  // the next known slave in the direction of the master
    for (auto& port : report.slaves[0].facts.ports)
        if (port.neighbour == 2) port.neighbour = 0;
    EXPECT_TRUE(ring_of(report).whole());
    EXPECT_EQ(cable_text(cables_of(report).at(2)), "cable between slave 3 and the NIC at the end of the ring");
    // The first slave is not used either.
    report.slaves.erase(report.slaves.begin());
    report.slaves[0].facts.parent.reset();
    EXPECT_TRUE(ring_of(report).whole());
}

TEST_F(ReportSegment, TheImageHasItsEntriesByNameAndTheirValues) {
    ethercat::StandaloneSession session(source("demo"));
    const auto domains = session.domains();
    ASSERT_TRUE(domains);
    const auto out = made("demo");
    ASSERT_EQ(out.report.domains.size(), 1U);
    const auto entries = image_entries(out.report, out.report.domains[0]);
    // Every bit of the image belongs to one entry, in the order of the image; up to seven bits fill an octet.
    std::uint32_t end = 0;
    for (const ImageEntry& entry : entries) {
        EXPECT_GE(entry.bit, end) << entry.name;
        EXPECT_LT(entry.bit - end, 8U) << entry.name;
        end = entry.bit + entry.bits;
    }
    EXPECT_LE(end, domains->at(0).data.size() * 8);
    EXPECT_LT(domains->at(0).data.size() * 8 - end, 8U);
    // Each slave shows the entries of its PDOs.
    for (const SlaveState& slave : out.report.slaves) {
        std::vector<std::string> expected, got;
        for (const auto& sm : slave.sync_managers)
            for (const auto& pdo : sm.pdos)
                for (const auto& entry : pdo.entries)
                    expected.push_back(fmt::format("{:04x}:{}", entry.index, entry.name));
        for (const ImageEntry& entry : entries)
            if (entry.position == slave.facts.position)
                got.push_back(fmt::format("{:04x}:{}", entry.index, entry.name));
        EXPECT_EQ(got, expected) << slave.facts.position;
    }
    const ReadPage page(out.page.html);
    EXPECT_TRUE(page.has("working counter " + fmt::format("{0} of {0}", domains->at(0).expected_wkc)));
    const auto unmapped = made("demo", {}, {.map = false});
    EXPECT_EQ(ReadPage(unmapped.page.html).cell("slave-table", 1, "State"), "PREOP");
    EXPECT_EQ(ReadPage(unmapped.page.html).count("//section[@id='image']"), 0U);
}

TEST_F(ReportSegment, ClocksHaveDelaysAndOffsets) {
    const auto out = made("dc_bench");
    ethercat::StandaloneSession session(source("dc_bench"));
    const ReadPage page(out.page.html);
    std::size_t row = 0;
    for (const SlaveState& slave : out.report.slaves) {
        const auto clock = session.clock(slave.facts.position);
        ASSERT_TRUE(clock);
        if (!clock->runs) continue;
        ++row;
        EXPECT_EQ(page.cell("clock-table", row, "Pos."), fmt::to_string(slave.facts.position));
        EXPECT_EQ(page.cell("clock-table", row, "Delay, ns"), fmt::to_string(clock->delay_ns));
        EXPECT_EQ(contains(page.cell("clock-table", row, "Clock"), "reference clock"), clock->reference);
    }
    EXPECT_EQ(page.rows("clock-table"), row);
    EXPECT_GE(row, 3U);
}

TEST_F(ReportSegment, AWrongChecksumIsAFault) {
    write_image("digital_in_8", "bad.bin", [](std::string& octets) { octets[14] = static_cast<char>(octets[14] + 1); });
    folder.write("bad.toml", "[[slave]]\ndevice = \"coupler\"\n[[slave]]\nsii = \"bad.bin\"\n");
    const auto out = made("bad.toml");
    EXPECT_EQ(out.page.worst, Severity::fault);
    const ReadPage page(out.page.html);
    EXPECT_TRUE(contains(page.cell("eeprom-table", 2, "Checksum"), "wrong"));
    EXPECT_TRUE(contains(page.cell("eeprom-table", 1, "Checksum"), "right"));
    const auto faults = page.verdicts("fault");
    EXPECT_TRUE(std::ranges::any_of(
        faults, [](const auto& text) { return contains(text, "The EEPROM of slave 1 has a wrong checksum"); }));
}

TEST_F(ReportSegment, TheEbusCurrentIsAddedUp) {
    folder.write("few.toml", "[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = \"digital_in_8\"\ncount = 22\n");
    const auto few = made("few.toml");
    EXPECT_EQ(few.report.slaves[1].facts.ebus_current_ma, 90);
    EXPECT_EQ(few.page.worst, Severity::good) << "1980 of 2000 mA";
    folder.write("many.toml", "[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = \"digital_in_8\"\ncount = 23\n");
    const ReadPage many(made("many.toml").page.html);
    ASSERT_EQ(many.verdicts("look at it").size(), 1U);
    EXPECT_TRUE(contains(many.verdicts("look at it")[0],
                         "E-bus: the slaves behind slave 0 take 2070 mA, and it supplies 2000 mA, by their EEPROMs."));
}

TEST_F(ReportSegment, NamesOfSlavesAreText) {
    const std::string name = "EtherCAT coupler";
    for (const std::string hostile : {"<script>alert(1)", "\"'><b onclick=x>", "\xE2\x80\xAE\xFF\x01]]>&#0;&amp"}) {
        ASSERT_EQ(hostile.size(), name.size());
        write_image("coupler", "hostile.bin", [&](std::string& octets) {
            const auto at = octets.find(name);
            ASSERT_NE(at, std::string::npos);
            octets.replace(at, name.size(), hostile);
        });
        const auto out = made("hostile.bin");
        const ReadPage page(out.page.html);
        EXPECT_EQ(page.count("//script"), 0U);
        EXPECT_EQ(page.count("//b"), 0U);
        EXPECT_EQ(page.count("//@onclick"), 0U);
        const auto shown = page.cell("slave-table", 1, "Name");
        if (hostile[0] != '\xE2') {
            EXPECT_EQ(shown, hostile);
        }
        EXPECT_TRUE(contains(shown, hostile.substr(5, 3)) || contains(shown, "]]>")) << shown;
    }
}

TEST_F(ReportSegment, WhatThePageRefersToIsInIt) {
    const auto html = made("tree").page.html;
    const ReadPage page(html);
    for (const std::string outside : {"//@src", "//link", "//script", "//img", "//iframe", "//object", "//base",
                                      "//a[not(starts-with(@href, '#'))]"})
        EXPECT_EQ(page.count(outside), 0U) << outside;
    EXPECT_EQ(html.find("url("), std::string::npos);
    EXPECT_EQ(html.find("@import"), std::string::npos);
    EXPECT_TRUE(contains(page.text("//meta[@http-equiv='Content-Security-Policy']/@content"), "default-src 'none'"));
    // Every link leads to a place of the page.
    EXPECT_EQ(page.count("//a[not(substring(@href, 2) = //@id)]"), 0U);
    EXPECT_GT(page.count("//a"), 20U);
}

}  // namespace
}  // namespace margay::segment_report
