// ESI files as the programs use them: images for eepromtool, and simulated slaves.
#include "common/xml_files.hpp"
#include "common/segment_file.hpp"

#include "files/examples.hpp"
#include "wire/sii.hpp"

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

}  // namespace
}  // namespace margay::samples
