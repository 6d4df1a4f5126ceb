// ESI files as the programs use them: images for eepromtool, and simulated slaves.
#include "common/xml_files.hpp"
#include "common/segment_file.hpp"
#include "common/source.hpp"

#include "files/examples.hpp"
#include "wire/sii.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace margay::samples {
namespace {

class XmlFiles : public ::testing::Test {
  protected:
    XmlFiles() {
        std::filesystem::create_directories(folder_);
        std::ofstream(folder_ / "drive.xml") << files::kExampleEsi;
        std::ofstream(folder_ / "wrong.xml") << "<EtherCATInfo>";
    }
    ~XmlFiles() override { std::filesystem::remove_all(folder_); }
    [[nodiscard]] std::string path(const std::string& name) const { return (folder_ / name).string(); }

    std::filesystem::path folder_ = std::filesystem::temp_directory_path() /
                                    ("margay_xml_" + std::to_string(::testing::UnitTest::GetInstance()->random_seed()) +
                                     "_" + std::to_string(reinterpret_cast<std::uintptr_t>(this)));
};

TEST_F(XmlFiles, ADeviceIsChosenByItsType) {
    EXPECT_TRUE(names_esi("a.xml"));
    EXPECT_TRUE(names_esi("a.xml#EX100"));
    EXPECT_FALSE(names_esi("a.bin"));
    const auto image = esi_image(path("drive.xml"));
    EXPECT_EQ(image.error, "");
    EXPECT_EQ(image.type, "EX100");
    EXPECT_EQ(image.octets.size(), 2048U);
    EXPECT_EQ(esi_image(path("drive.xml#EX100")).octets, image.octets);
    EXPECT_NE(esi_image(path("drive.xml#EX200")).error.find("describes no device 'EX200'"), std::string::npos);
    EXPECT_NE(esi_image(path("wrong.xml")).error.find("wrong.xml: line 1"), std::string::npos);
}

TEST_F(XmlFiles, OneOfSeveralRevisionsIsChosen) {
    const std::string good(files::kExampleEsi);
    auto older = good.substr(good.find("<Device "));
    older.resize(older.find("</Device>") + 9);
    const auto at = older.find("RevisionNo=\"");
    ASSERT_NE(at, std::string::npos);
    older.replace(at, older.find('"', at + 12) + 1 - at, "RevisionNo=\"#x0001\"");
    auto both = good;
    both.insert(both.find("<Device "), older);
    std::ofstream(folder_ / "both.xml") << both;
    const auto revision = [](const EsiImage& image) {
        return image.octets.size() < 28 ? 0U : load_le<std::uint32_t>(image.octets, 24);  // word 0x000C of the SII
    };
    const auto greatest = esi_image(path("both.xml#EX100"));
    const auto chosen = esi_image(path("both.xml#EX100/0x1"));
    EXPECT_EQ(revision(greatest), revision(esi_image(path("drive.xml"))));
    EXPECT_EQ(revision(chosen), 1U) << chosen.error;
    ASSERT_FALSE(greatest.remarks.empty());
    EXPECT_NE(greatest.remarks.back().find("of 2 revisions of EX100 the greatest is taken"), std::string::npos);
    EXPECT_NE(esi_image(path("both.xml")).error.find("#TYPE/REVISION"), std::string::npos);
    for (const char* wrong : {"both.xml#EX100/0x7", "both.xml#EX100/", "both.xml#EX100/1x", "both.xml#EX200/0x1"})
        EXPECT_NE(esi_image(path(wrong)).error.find("describes no device 'EX"), std::string::npos) << wrong;
}

TEST_F(XmlFiles, ADeviceThatWasLeftOutIsNamedWithItsFault) {
    const std::string good(files::kExampleEsi);
    std::string faulty = good;
    faulty.insert(faulty.find("StartAddress=\"") + 14, "nowhere");
    // A file that continues in other files, and a file with another device.
    auto further = faulty;
    further.insert(further.find("<Vendor"), "<InfoReference>modules.xml</InfoReference>");
    std::ofstream(folder_ / "further.xml") << further;
    auto other = good.substr(good.find("<Device "));
    other.resize(other.find("</Device>") + 9);
    other.replace(other.find("EX100"), 5, "EX200");
    auto several = faulty;
    several.insert(several.find("<Device "), other);
    std::ofstream(folder_ / "several.xml") << several;
    EXPECT_EQ(esi_image(path("several.xml")).type, "EX200");
    for (const char* wanted : {"further.xml", "further.xml#EX100", "several.xml#EX100"}) {
        const auto error = esi_image(path(wanted)).error;
        EXPECT_NE(error.find("Device 'EX100' is left out: line "), std::string::npos) << error;
        EXPECT_NE(error.find("StartAddress of Sm is 'nowhere"), std::string::npos) << error;
    }
}

TEST_F(XmlFiles, ASegmentOfEsiFiles) {
    const auto segment = load_segment(path("drive.xml") + "," + path("drive.xml#EX100"));
    ASSERT_TRUE(segment) << segment.error();
    const auto refused = load_segment(path("wrong.xml"));
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().find("line 1"), std::string::npos) << refused.error();
}

TEST_F(XmlFiles, AnEniThatIsNoneIsNamed) {
    EXPECT_NE(load_eni(path("drive.xml")).error.find("the root element is EtherCATInfo"), std::string::npos);
    EXPECT_EQ(load_eni(path("nothing.xml")).error, path("nothing.xml") + ": cannot be read: No such file or directory");
}

// Differences from the slaves are known after the scan. They are warnings, like the remarks of the reader.
TEST_F(XmlFiles, AnEniThatDiffersFromTheSlavesIsAWarning) {
    const auto scan = [&](const files::EniConfiguration* eni, std::string* text) {
        auto source = open_source("sim:coupler,drive").take();
        HostContext ctx(with_room(source->limits({.slaves = 8}), eni));
        std::vector<std::byte> image(4096);
        EXPECT_TRUE(source->begin(ctx).ok());
        EXPECT_TRUE(scan_by(ctx, eni).ok());
        EXPECT_TRUE(map_groups(ctx, eni, image).ok());
        if (text != nullptr) *text = files::write_eni(ctx).text;
    };
    std::string text;
    scan(nullptr, &text);
    const auto warnings_with = [&](const std::string& what, const std::string& by) {
        std::string changed = text;
        const auto at = changed.find(what);
        EXPECT_NE(at, std::string::npos) << what;
        std::ofstream(folder_ / "machine.xml") << changed.replace(at, what.size(), by);
        testing::internal::CaptureStderr();
        const auto eni = load_eni(path("machine.xml"));
        EXPECT_EQ(eni.error, "");
        scan(&*eni.configuration, nullptr);
        return testing::internal::GetCapturedStderr();
    };
    const auto port = text.find("<Port>");
    ASSERT_NE(port, std::string::npos);
    const std::string own = text.substr(port, 7);
    EXPECT_EQ(warnings_with(own, own), "");
    const auto shown = warnings_with(own, "<Port>A");
    EXPECT_NE(shown.find("warning: ENI file: line "), std::string::npos) << shown;
    EXPECT_NE(shown.find(std::string("slave 2 is at port A of slave 1 in the file, and here at port ") + own[6] +
                         " of slave 1"),
              std::string::npos)
        << shown;
}

}  // namespace
}  // namespace margay::samples
