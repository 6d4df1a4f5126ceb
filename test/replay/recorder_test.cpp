// The file of the recorder, read octet by octet and by the library.
#include "oshw/pcap/recorder.hpp"
#include "files.hpp"
#include "osal/virtual/virtual_osal.hpp"
#include "wire/datagram.hpp"

#include <gtest/gtest.h>

#include <deque>

namespace margay {
namespace {

using namespace std::chrono_literals;

class Wire final : public Nic {
  public:
    SendStatus send(std::span<const std::byte>) noexcept override { return status; }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        if (arriving.empty()) return 0;
        const auto frame = arriving.front();
        arriving.pop_front();
        std::copy(frame.begin(), frame.end(), into.begin());
        return frame.size();
    }
    SendStatus status = SendStatus::sent;
    std::deque<Frame> arriving;
};

struct RecorderTest : testing::Test {
    TemporaryFolder folder;
    VirtualOsal clock{Time(7s + 123ns)};
    Wire wire;
    PcapRecorder recorder{wire, clock};
    Frame buffer = Frame(1518);
};

TEST_F(RecorderTest, TheFileIsAsTheFormatSaysOctetByOctet) {
    const Frame request(29, std::byte{0x11});
    const Frame reply(60, std::byte{0x22});
    const auto path = folder.file("a.pcap");
    ASSERT_TRUE(recorder.open(path, 1'000'000s).ok()) << recorder.problem();
    ASSERT_EQ(recorder.send(request), SendStatus::sent);
    clock.advance(1s);
    wire.arriving.push_back(reply);
    ASSERT_EQ(recorder.receive(buffer), 60u);
    ASSERT_EQ(recorder.receive(buffer), 0u);
    ASSERT_TRUE(recorder.close().ok()) << recorder.problem();
    EXPECT_EQ(read_file(path),
              pcap_header(kNanoseconds) + pcap_packet(1'000'007, 123, request) + pcap_packet(1'000'008, 123, reply));
}

TEST_F(RecorderTest, AFrameThatWasNotTakenIsNotRecorded) {
    const auto path = folder.file("b.pcap");
    ASSERT_TRUE(recorder.open(path).ok());
    wire.status = SendStatus::busy;
    EXPECT_EQ(recorder.send(Frame(60)), SendStatus::busy);
    wire.status = SendStatus::failed;
    EXPECT_EQ(recorder.send(Frame(60)), SendStatus::failed);
    ASSERT_TRUE(recorder.close().ok());
    EXPECT_EQ(read_file(path), pcap_header(kNanoseconds));
}

TEST_F(RecorderTest, PassesFramesOnWithoutAFile) {
    EXPECT_EQ(recorder.send(Frame(60)), SendStatus::sent);
    wire.arriving.push_back(Frame(60));
    EXPECT_EQ(recorder.receive(buffer), 60u);
    EXPECT_TRUE(recorder.close().ok());
}

TEST_F(RecorderTest, SaysWhyAFileCannotBeMade) {
    EXPECT_FALSE(recorder.open(folder.file("no/such/folder.pcap")).ok());
    EXPECT_NE(recorder.problem().find("folder.pcap: No such file"), std::string::npos) << recorder.problem();
    EXPECT_EQ(recorder.send(Frame(60)), SendStatus::sent);
}

TEST_F(RecorderTest, AFullDiskIsNoSuccess) {
    if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
    ASSERT_TRUE(recorder.open("/dev/full").ok());
    for (int i = 0; i < 100; ++i) EXPECT_EQ(recorder.send(Frame(1000)), SendStatus::sent);
    EXPECT_FALSE(recorder.close().ok());
    EXPECT_NE(recorder.problem().find("not complete"), std::string::npos) << recorder.problem();
    EXPECT_TRUE(recorder.close().ok());
}

TEST_F(RecorderTest, TsharkReadsWhatItWrites) {
    if (std::system("command -v tshark >/dev/null 2>&1") != 0) GTEST_SKIP() << "tshark is not installed";
    Frame frame(100);
    wire::FrameBuilder builder(frame, {});
    (void)builder.append(wire::Command::FPRD, 0x2A, {StationAddress{0x1001}, 0x0130}, 2);
    frame.resize(builder.finish().size());
    const auto path = folder.file("c.pcap");
    ASSERT_TRUE(recorder.open(path).ok());
    ASSERT_EQ(recorder.send(frame), SendStatus::sent);
    ASSERT_TRUE(recorder.close().ok());
    const auto printed = folder.file("printed");
    const auto command = "tshark -n -r '" + path +
                         "' -T fields -e frame.time_epoch -e ecat.cmd -e ecat.adp -e ecat.ado >'" + printed +
                         "' 2>/dev/null";
    ASSERT_EQ(std::system(command.c_str()), 0);
    EXPECT_EQ(read_file(printed), "7.000000123\t0x04\t0x1001\t0x0130\n");
}

}  // namespace
}  // namespace margay
