// Differences between alike devices.
#include "report/report_fixture.hpp"

#include "segment_report/differences.hpp"

#include <algorithm>

namespace margay::segment_report {
namespace {

using process::contains;

using ReportAlike = ReportTest;

const Difference* find(const AlikeGroup& group, const std::string& what) {
    const auto at =
        std::ranges::find_if(group.differences, [&](const Difference& d) { return d.what.starts_with(what); });
    return at == group.differences.end() ? nullptr : &*at;
}

TEST_F(ReportAlike, AnObjectOfOneDriveHasAnotherValue) {
    folder.write("four.toml", "[[slave]]\ndevice = \"drive\"\ncount = 4\n");
    const auto same = made("four.toml");
    EXPECT_TRUE(ReadPage(same.page.html).has("Revision, firmware, EEPROM and settings are the same."));
    EXPECT_EQ(same.page.worst, Severity::good);
    const auto out = made("four.toml", [](ethercat::Session& session) {
        const Octets value{std::byte{0xD2}, std::byte{0x04}, std::byte{0}, std::byte{0}};
        ASSERT_TRUE(session.download(2, 0x6081, 0, false, value));
    });
    const auto groups = find_differences(out.report);
    ASSERT_EQ(groups.size(), 1U);
    EXPECT_GT(groups[0].objects, 30U);
    const auto* difference = find(groups[0], "object 0x6081:00");
    ASSERT_NE(difference, nullptr);
    EXPECT_EQ(difference->kind, Difference::Kind::setting);
    ASSERT_EQ(difference->variants.size(), 2U);
    EXPECT_EQ(difference->variants[0].positions, (std::vector<std::uint16_t>{0, 1, 3}));
    EXPECT_EQ(difference->variants[1].positions, (std::vector<std::uint16_t>{2}));
    EXPECT_EQ(difference->variants[1].value, "1234 (0x000004d2)");
    EXPECT_EQ(groups[0].count(Difference::Kind::setting), 1U);
    const ReadPage page(out.page.html);
    EXPECT_TRUE(contains(page.text("//section[@id='alike']"), "1234 (0x000004d2) slave 2"));
    EXPECT_TRUE(contains(page.verdicts("look at it").at(0), "differ in 1 setting"));
    EXPECT_EQ(out.page.worst, Severity::remark);
}

TEST_F(ReportAlike, WhatCouldNotBeReadIsNoDifference) {
    for (const std::string quirk : {"never_replies", "error_replies"}) {
        folder.write("two.toml",
                     "[[slave]]\ndevice = \"drive\"\n[[slave]]\ndevice = \"drive\"\nquirks = [\"" + quirk + "\"]\n");
        const auto out = made("two.toml");
        const auto groups = find_differences(out.report);
        ASSERT_EQ(groups.size(), 1U);
        EXPECT_EQ(groups[0].count(Difference::Kind::device), 0U) << quirk;
        EXPECT_EQ(groups[0].count(Difference::Kind::setting), 0U) << quirk;
        EXPECT_TRUE(groups[0].partly_read) << quirk;
        EXPECT_TRUE(std::ranges::any_of(groups[0].remarks, [](const std::string& remark) {
            return remark.starts_with("slave 1: ") && remark.ends_with(" values could not be read");
        })) << quirk;
        const ReadPage page(out.page.html);
        EXPECT_FALSE(contains(page.text("//section[@id='alike']"), "(not there)")) << quirk;
        EXPECT_TRUE(page.has("What could be read of revision, firmware, EEPROM and settings is the same.")) << quirk;
    }
}

// Versions that could not be read are named without dictionaries, too. The page does not report them as the same.
TEST_F(ReportAlike, VersionsThatCouldNotBeReadAreNotTheSame) {
    folder.write("two.toml",
                 "[[slave]]\ndevice = \"drive\"\n[[slave]]\ndevice = \"drive\"\nquirks = [\"never_replies\"]\n");
    const auto out = made("two.toml", {}, {.dictionaries = false});
    const ReadPage page(out.page.html);
    EXPECT_FALSE(page.has("settings are the same"));
    EXPECT_TRUE(std::ranges::any_of(page.verdicts("look at it"), [](const std::string& text) {
        return contains(text, "Slave 1: could not be read: versions: ");
    }));
    const auto groups = find_differences(out.report);
    ASSERT_EQ(groups.size(), 1U);
    EXPECT_EQ(groups[0].count(Difference::Kind::device), 0U);
}

// A slave that answers with an abort has no such object, perhaps because its firmware is older.
TEST_F(ReportAlike, AVersionThatASlaveDoesNotHaveIsADifference) {
    folder.write("two.toml", "[[slave]]\ndevice = \"drive\"\ncount = 2\n");
    ethercat::StandaloneSession session(source("two.toml"));
    const auto aborted = session.upload(0, 0x5FFF, 0, false);
    ASSERT_FALSE(aborted);
    EXPECT_TRUE(aborted.problem().aborted);
    auto report = made("two.toml").report;
    EXPECT_TRUE(report.slaves[1].versions.unread.empty());
    report.slaves[1].versions.software.clear();
    const auto groups = find_differences(report);
    ASSERT_EQ(groups.size(), 1U);
    EXPECT_NE(find(groups[0], "software version"), nullptr);
}

TEST_F(ReportAlike, RevisionAndEepromDiffer) {
    write_image("digital_in_8", "a.bin", [](std::string&) {});
    write_image("digital_in_8", "b.bin", [](std::string& octets) { octets[26] = 7; });  // words 0x0C and 0x0D
    folder.write("two.toml",
                 "[[slave]]\ndevice = \"coupler\"\n[[slave]]\nsii = \"a.bin\"\nserial = 17\n[[slave]]\nsii = "
                 "\"b.bin\"\nserial = 18\nalias = 5\n");
    const auto out = made("two.toml");
    const auto groups = find_differences(out.report);
    ASSERT_EQ(groups.size(), 1U);
    const auto* revision = find(groups[0], "revision");
    ASSERT_NE(revision, nullptr);
    EXPECT_EQ(revision->kind, Difference::Kind::device);
    EXPECT_EQ(revision->variants[1].value.substr(0, 6), "0x0007");
    EXPECT_NE(find(groups[0], "EEPROM: content"), nullptr) << "the revision is a part of the content";
    EXPECT_EQ(find(groups[0], "EEPROM: configuration area"), nullptr) << "the alias does not count";
    ASSERT_NE(find(groups[0], "serial number"), nullptr);
    EXPECT_EQ(find(groups[0], "serial number")->kind, Difference::Kind::own);
    EXPECT_EQ(find(groups[0], "alias")->kind, Difference::Kind::own);
    EXPECT_TRUE(
        contains(ReadPage(out.page.html).verdicts("look at it").at(0), "differ in revision, firmware or EEPROM"));
}

TEST_F(ReportAlike, WithoutDictionariesThePageSaysSo) {
    folder.write("two.toml", "[[slave]]\ndevice = \"drive\"\ncount = 2\n");
    const auto out = made("two.toml", {}, {.dictionaries = false});
    EXPECT_TRUE(ReadPage(out.page.html).has("The dictionaries were not read (--no-dictionary)."));
    const auto alone = made("drive");
    EXPECT_TRUE(ReadPage(alone.page.html).has("No two slaves are of the same product."));
}

}  // namespace
}  // namespace margay::segment_report
