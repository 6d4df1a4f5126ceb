// Recordings in both formats, and files that are no recordings.
#include "files.hpp"
#include "wire/datagram.hpp"

#include <gtest/gtest.h>

namespace margay {
namespace {

using namespace std::chrono_literals;

Frame ethercat_frame(std::uint8_t first_source_octet = 0) {
    Frame buffer(100);
    wire::FrameBuilder builder(buffer, {first_source_octet, 2, 3, 4, 5, 6});
    (void)builder.append(wire::Command::BRD, 1, wire::DatagramAddress(0), 1);
    buffer.resize(builder.finish().size());
    return buffer;
}

struct CaptureFileTest : testing::Test {
    TemporaryFolder folder;
    CaptureFile capture;

    // The problem as text; empty when the file was accepted.
    std::string load(const std::string& content) {
        const auto loaded = capture.load(folder.write("x.pcap", content));
        EXPECT_EQ(loaded.ok(), capture.problem().empty());
        if (!loaded.ok()) {
            EXPECT_EQ(loaded.error().step, Step::open_nic);
            EXPECT_TRUE(capture.frames().empty());
            EXPECT_NE(capture.problem().find("x.pcap"), std::string::npos) << "which file?";
        }
        return capture.problem();
    }
};

TEST_F(CaptureFileTest, ReadsPcapOfBothResolutions) {
    const auto request = ethercat_frame(0x00);
    const auto reply = ethercat_frame(0x02);
    const Frame foreign(60, std::byte{0x11});
    for (const auto& [magic, unit] : {std::pair{kMicroseconds, 1000ns}, std::pair{kNanoseconds, 1ns}}) {
        ASSERT_EQ(load(pcap_header(magic) + pcap_packet(100, 5, foreign) + pcap_packet(100, 7, request) +
                       pcap_packet(101, 2, reply)),
                  "");
        ASSERT_EQ(capture.frames().size(), 2u);
        EXPECT_EQ(capture.skipped(), 1u);
        EXPECT_EQ(capture.frames()[0].at, 2 * unit);
        EXPECT_EQ(capture.frames()[1].at, 1s - 3 * unit);
        EXPECT_EQ(capture.frames()[0].number, 2u);
        EXPECT_FALSE(capture.frames()[0].reply);
        EXPECT_TRUE(capture.frames()[1].reply);
        const auto bytes = capture.bytes(capture.frames()[1]);
        EXPECT_EQ(Frame(bytes.begin(), bytes.end()), reply);
    }
}

TEST_F(CaptureFileTest, ReadsPcapngWithItsOwnResolution) {
    const auto frame = ethercat_frame();
    for (const auto& [resolution, unit] : {std::pair{6, 1000ns}, std::pair{9, 1ns}}) {
        ASSERT_EQ(load(pcapng_header(static_cast<std::uint8_t>(resolution)) + pcapng_packet(5'000'000'000u, frame) +
                       pcapng_packet(5'000'000'123u, frame)),
                  "");
        ASSERT_EQ(capture.frames().size(), 2u);
        EXPECT_EQ(capture.frames()[1].at, 123 * unit);
    }
}

TEST_F(CaptureFileTest, SaysWhatIsWrongWithAFile) {
    const auto frame = ethercat_frame();
    const auto says = [&](const std::string& content, const std::string& what) {
        const auto problem = load(content);
        EXPECT_NE(problem.find(what), std::string::npos) << problem;
    };
    says("", "too short for a recording");
    says("MZ this is no recording at all, but it is long enough for a header", "neither pcap nor pcapng");
    says(pcap_header().substr(0, 20), "too short for a recording");
    says(pcap_header(), "holds no EtherCAT frame");
    says(pcap_header() + pcap_packet(0, 0, Frame(60)), "holds no EtherCAT frame");
    says(pcap_header(kNanoseconds, 113) + pcap_packet(0, 0, frame), "link type is Linux cooked");
    says(pcap_header() + pcap_packet(0, 0, frame) + pcap_packet(0, 0, frame).substr(0, 25),
         "breaks off or is damaged behind packet 1");
    says(pcap_header() + pcap_packet(0, 0, frame) + "\x01", "breaks off or is damaged behind packet 1");
    says(pcap_header() + pcap_packet(0, 0, frame) + pcap_packet(0, 0, frame, 1000),
         "packet 2 was recorded cut to 29 of its 1000 octets");
    says(pcap_header() + pcap_packet(1, 0, frame) + pcap_packet(2'000'000'000u, 0, frame), "packet 2 is years away");
    says(pcapng_header(6) + pcapng_packet(1, frame) + pcapng_packet(0x0FFFFFFFFFFFFFF0u, frame),
         "packet 2 is years away");
    auto tagged = frame;
    const std::byte tag[] = {std::byte{0x81}, std::byte{0x00}, std::byte{0x00}, std::byte{0x05}};
    tagged.insert(tagged.begin() + 12, std::begin(tag), std::end(tag));
    says(pcap_header() + pcap_packet(0, 0, tagged), "packet 1 is EtherCAT in a VLAN tag");
    says(pcapng_header(9) + pcapng_packet(0, frame).substr(0, 30), "breaks off or is damaged behind packet 0");
}

TEST_F(CaptureFileTest, SaysSoWhenThereIsNoFile) {
    EXPECT_FALSE(capture.load(folder.file("none.pcap")).ok());
    EXPECT_NE(capture.problem().find("No such file"), std::string::npos) << capture.problem();
    EXPECT_FALSE(capture.load(folder.file("")).ok());  // the path of the folder
    EXPECT_FALSE(capture.problem().empty());
}

TEST_F(CaptureFileTest, EveryCutOfAFileIsRefusedOrShorter) {
    const auto frame = ethercat_frame();
    const auto header = pcap_header();
    const auto whole = header + pcap_packet(0, 0, frame) + pcap_packet(0, 9, frame);
    for (std::size_t cut = 0; cut < whole.size(); ++cut) {
        const auto problem = load(whole.substr(0, cut));
        const bool between = cut == header.size() + 16 + frame.size();
        EXPECT_EQ(problem.empty(), between) << cut;
    }
}

// The file of a recorder that was killed: its complete packets can be read with CutOff::accept.
TEST_F(CaptureFileTest, AFileCutOffAtItsEndGivesItsWholePacketsWhereThatIsAskedFor) {
    const auto frame = ethercat_frame();
    const auto one = pcap_packet(0, 0, frame);
    const auto whole = pcap_header() + one + pcap_packet(0, 9, frame);
    const auto path = folder.write("cut.pcap", whole.substr(0, whole.size() - 7));
    EXPECT_FALSE(capture.load(path).ok());
    ASSERT_TRUE(capture.load(path, CaptureFile::CutOff::accept).ok());
    EXPECT_EQ(capture.frames().size(), 1U);
    EXPECT_NE(capture.remark().find("ends in the middle of a packet; the 1 packets before"), std::string::npos)
        << capture.remark();
    ASSERT_TRUE(capture.load(folder.write("whole.pcap", whole), CaptureFile::CutOff::accept).ok());
    EXPECT_EQ(capture.remark(), "");
    EXPECT_EQ(capture.frames().size(), 2U);
    // The file has no whole packet, so it is refused.
    EXPECT_FALSE(capture.load(folder.write("none.pcap", whole.substr(0, 30)), CaptureFile::CutOff::accept).ok());
}

// Linux "any" beside Ethernet interfaces: the file can be replayed, and a message names the interface that is left out.
TEST_F(CaptureFileTest, NamesInterfacesThatAreLeftOut) {
    const auto frame = ethercat_frame();
    const auto cooked = pcapng_block(1, word16(113) + word16(0) + word32(0));
    EXPECT_EQ(load(pcapng_header(6) + cooked + pcapng_packet(1, frame)), "");
    EXPECT_NE(capture.remark().find(": left out is what is not Ethernet: interface 1 (link type Linux cooked v1"),
              std::string::npos)
        << capture.remark();
    EXPECT_EQ(capture.frames().size(), 1U);
    EXPECT_NE(load(pcapng_header(6) + cooked).find("no EtherCAT frame (recording"), std::string::npos)
        << capture.problem();
}

TEST_F(CaptureFileTest, SurvivesTurnedBits) {
    const auto frame = ethercat_frame();
    for (const auto& whole : {pcap_header() + pcap_packet(0, 0, frame) + pcap_packet(0, 9, frame),
                              pcapng_header(9) + pcapng_packet(1, frame) + pcapng_packet(2, frame)}) {
        for (std::size_t bit = 0; bit < whole.size() * 8; bit += 7) {
            auto content = whole;
            content[bit / 8] = static_cast<char>(content[bit / 8] ^ (1 << (bit % 8)));
            const auto problem = load(content);
            if (!problem.empty()) continue;
            for (const auto& one : capture.frames()) EXPECT_LE(capture.bytes(one).size(), whole.size());
        }
    }
}

}  // namespace
}  // namespace margay
