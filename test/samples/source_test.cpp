// SOURCE strings: the sources that they open, and the errors.
#include "common/source.hpp"
#include "wire/datagram.hpp"

#include <margay/cycle_stamps.hpp>
#include <margay/host_context.hpp>

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace margay::samples {
namespace {

using namespace std::chrono_literals;

struct SourceTest : testing::Test {
    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("margay-source-" + std::to_string(::getpid()));
    SourceTest() { std::filesystem::create_directories(folder); }
    ~SourceTest() override { std::filesystem::remove_all(folder); }

    static std::string error_of(const std::string& text, const SourceOptions& options = {}) {
        auto source = open_source(text, options);
        EXPECT_FALSE(source) << text;
        return source.error();
    }

    // The recording of one BRD and its reply, made by the recorder.
    std::string recording() {
        struct Loop final : Nic {
            SendStatus send(std::span<const std::byte>) noexcept override { return SendStatus::sent; }
            std::size_t receive(std::span<std::byte> into) noexcept override {
                std::copy(reply.begin(), reply.end(), into.begin());
                return reply.size();
            }
            std::vector<std::byte> reply;
        } nic;
        VirtualOsal osal;
        PcapRecorder recorder(nic, osal);
        const auto path = folder / "one.pcap";
        EXPECT_TRUE(recorder.open(path).ok());
        const auto request = brd();
        EXPECT_EQ(recorder.send(request), SendStatus::sent);
        osal.advance(50us);
        nic.reply = request;
        nic.reply[6] |= wire::kPassedEscBit;
        nic.reply.back() = std::byte{0};
        nic.reply[nic.reply.size() - 2] = std::byte{3};
        std::array<std::byte, 1518> into;
        EXPECT_EQ(recorder.receive(into), request.size());
        EXPECT_TRUE(recorder.close().ok());
        return path;
    }
    static std::vector<std::byte> brd() {
        std::vector<std::byte> buffer(100);
        wire::FrameBuilder builder(buffer, {});
        (void)builder.append(wire::Command::BRD, 0, wire::DatagramAddress(0), 1);
        buffer.resize(builder.finish().size());
        return buffer;
    }
};

TEST_F(SourceTest, AnInterfaceThatIsNotThereIsNamed) {
    EXPECT_NE(error_of("no-such-if").find("there is no interface \"no-such-if\""), std::string::npos);
    EXPECT_NE(error_of("").find("there is no interface \"\""), std::string::npos);
    EXPECT_NE(error_of("ftp:eth0").find("there is no interface \"ftp:eth0\""), std::string::npos);
}

TEST_F(SourceTest, TwoInterfaces) {
    EXPECT_NE(error_of("eth0+").find("the name of an interface is missing"), std::string::npos);
    EXPECT_NE(error_of("+eth0").find("the name of an interface is missing"), std::string::npos);
    EXPECT_NE(error_of("eth0+eth0").find("both interfaces are the same"), std::string::npos);
    EXPECT_NE(error_of("eth0+eth1+eth2").find("more than two interfaces"), std::string::npos);
    EXPECT_NE(error_of("no-such-if+eth0").find("there is no interface \"no-such-if\""), std::string::npos);
}

TEST_F(SourceTest, ARingOfASegmentFileHasTwoNics) {
    const auto file = folder / "ring.toml";
    std::ofstream(file) << "ring = { slave = \"last\", port = 1 }\n[[slave]]\ndevice = \"junction\"\ncount = 3\n"
                        << "[[slave]]\nname = \"last\"\ndevice = \"junction\"\n";
    const std::string record = folder / "two.pcapng";
    // The second round replays the recording of the first round.
    for (const auto& [text, kept] :
         {std::pair{"sim:" + file.string(), record}, std::pair{"pcap:" + record, std::string()}}) {
        SCOPED_TRACE(text);
        auto source = open_source(text, {.record = kept});
        ASSERT_TRUE(source) << source.error();
        ASSERT_NE(source->second(), nullptr);
        HostContext ctx(source->limits({.slaves = 8}));
        ASSERT_TRUE(source->begin(ctx).ok());
        const auto found = config_init(ctx);
        ASSERT_TRUE(found.ok());
        EXPECT_EQ(*found, 4U);
        EXPECT_EQ(redundancy(ctx).ring, RingState::whole);
        EXPECT_EQ(source->finish(), "");
    }
    EXPECT_NE(error_of("pcap:a.pcap+pcap:b.pcap").find("mergecap -I none -w ring.pcapng a.pcap b.pcap"),
              std::string::npos)
        << error_of("pcap:a.pcap+pcap:b.pcap");
    EXPECT_EQ(open_source("sim:demo")->second(), nullptr);
}

// The NICs provide the requested times, and no other times. A NIC that cannot provide them reports this.
TEST_F(SourceTest, TimesOfFrames) {
    const WantedTimes both{.stamps = WantedTimes::Stamps::hardware, .send_at = true};
    EXPECT_EQ(open_source("sim:demo")->timing().sent, nullptr);
    EXPECT_EQ(open_source("sim:demo")->timing().send_at, nullptr);
    for (const bool with_slaves_that_come_late : {false, true}) {
        const auto source = open_source(with_slaves_that_come_late ? "sim:coupler,digital_in_8@1s" : "sim:demo",
                                        {.record = folder / "times.pcap", .trace = true, .times = both})
                                .take();
        EXPECT_NE(source->timing().sent, nullptr);
        EXPECT_NE(source->timing().received, nullptr);
        EXPECT_NE(source->timing().send_at, nullptr);
    }
    const auto stamps = open_source("sim:demo", {.times = {.stamps = WantedTimes::Stamps::software}}).take();
    EXPECT_NE(stamps->timing().sent, nullptr);
    EXPECT_EQ(stamps->timing().send_at, nullptr);
    EXPECT_EQ(error_of("pcap:" + recording(), {.times = both}),
              "pcap:" + (folder / "one.pcap").string() + ": a recording has no times of frames");
    EXPECT_NE(error_of("xdp:eth0", {.times = both}).find("AF_XDP has no times of frames"), std::string::npos);
    EXPECT_NE(error_of("try-xdp:no-such-if", {.times = both}).find("and with AF_PACKET: there is no interface"),
              std::string::npos);
}

// In a whole ring, the copy that the first NIC has sent comes back at the second NIC.
TEST_F(SourceTest, StampsOfFramesInARing) {
    const auto file = folder / "ring.toml";
    std::ofstream(file) << "ring = { slave = \"last\", port = 1 }\n[[slave]]\ndevice = \"digital_io_16\"\n"
                        << "[[slave]]\nname = \"last\"\ndevice = \"digital_io_16\"\n";
    const WantedTimes stamps{.stamps = WantedTimes::Stamps::hardware};
    const auto source = open_source("sim:" + file.string(), {.times = stamps}).take();
    HostContext ctx(source->limits({.slaves = 8}));
    std::array<std::byte, 64> image{};
    ASSERT_TRUE(source->begin(ctx).ok());
    ASSERT_TRUE(config_init(ctx).ok());
    ASSERT_TRUE(config_map(ctx, image).ok());
    for (unsigned cycles = 0; cycles < 300; ++cycles) {
        ASSERT_TRUE(send_processdata(ctx).ok());
        (void)receive_processdata(ctx, 500us);
        const auto trip = cycle_stamps(ctx, source->timing()).round_trip();
        ASSERT_TRUE(trip) << cycles;
        EXPECT_GT(*trip, 100ns);
        EXPECT_LT(*trip, 500us);
        source->osal().wait(source->osal().now() + 500us, source->wait_handles());
    }
}

// Frames leave by both NICs of a ring at the same time.
TEST_F(SourceTest, TimesOfFramesInARing) {
    const auto file = folder / "ring.toml";
    std::ofstream(file) << "ring = { slave = \"last\", port = 1 }\n[[slave]]\ndevice = \"junction\"\n"
                        << "[[slave]]\nname = \"last\"\ndevice = \"junction\"\n";
    const auto source = open_source("sim:" + file.string(), {.times = {.send_at = true}}).take();
    HostContext ctx(source->limits({.slaves = 8}));
    ASSERT_TRUE(source->begin(ctx).ok());
    ASSERT_TRUE(config_init(ctx).ok());
    TimedSend* const timed = source->timing().send_at;
    ASSERT_NE(timed, nullptr);
    const auto frame = brd();
    timed->set_send_time(source->osal().now() + 5ms);
    for (Nic* nic : {&source->nic(), source->second()}) {
        EXPECT_EQ(nic->send(frame), SendStatus::sent);
        EXPECT_LE(nic->next_arrival(), source->osal().now() + 5ms);
        EXPECT_GT(nic->next_arrival(), source->osal().now() + 4ms) << "at once";
    }
    EXPECT_EQ(timed->missed(), 0U);
    timed->set_send_time(source->osal().now() - 1ms);
    for (Nic* nic : {&source->nic(), source->second()}) EXPECT_EQ(nic->send(frame), SendStatus::sent);
    EXPECT_EQ(timed->missed(), 2U);
}

TEST_F(SourceTest, ARecordingThatIsNoneIsNamed) {
    EXPECT_NE(error_of("pcap:/no/such/file").find("/no/such/file"), std::string::npos);
    EXPECT_NE(error_of("pcap:").find("the name of the recording is missing"), std::string::npos) << error_of("pcap:");
    std::ofstream(folder / "text") << "this is a text file and no recording";
    EXPECT_NE(error_of("pcap:" + (folder / "text").string()).find("neither pcap nor pcapng"), std::string::npos);
}

TEST_F(SourceTest, AnImageThatIsNoneIsNamed) {
    const auto path = (folder / "notes.txt").string();
    std::ofstream(path) << std::string(50, 'a') << '\n' << std::string(150, 'b');
    EXPECT_EQ(error_of("sim:" + path),
              "'" + path + "' is text, not an SII image (the name of a segment description ends in .toml)");
    EXPECT_EQ(error_of("sim:/no/such.bin"), "cannot read the SII image '/no/such.bin'");
    EXPECT_EQ(error_of("sim:" + folder.string()), "'" + folder.string() + "' is a folder, not an SII image");
}

TEST_F(SourceTest, ARecordingAnswersInVirtualTime) {
    auto source = open_source("pcap:" + recording());
    ASSERT_TRUE(source) << source.error();
    EXPECT_TRUE(source->virtual_time());
    ASSERT_EQ(source->nic().send(brd()), SendStatus::sent);
    const auto before = source->osal().now();
    source->osal().wait(source->nic().next_arrival(), source->nic().wait_handle());
    EXPECT_EQ(source->osal().now() - before, 50us);
    std::array<std::byte, 1518> into;
    ASSERT_EQ(source->nic().receive(into), brd().size());
    EXPECT_EQ(into[brd().size() - 2], std::byte{3});
    EXPECT_EQ(source->finish(), "");
}

TEST_F(SourceTest, ARequestThatWasNotRecordedIsToldAtTheEnd) {
    auto source = open_source("pcap:" + recording());
    ASSERT_TRUE(source) << source.error();
    auto other = brd();
    other[wire::kFramePrefixBytes] = std::byte{4};  // FPRD
    ASSERT_EQ(source->nic().send(other), SendStatus::sent);
    const auto said = source->finish();
    EXPECT_NE(said.find("the recording has no FPRD"), std::string::npos) << said;
    EXPECT_NE(said.find("answers only what the recorded master asked"), std::string::npos) << said;
    EXPECT_FALSE(source->recording_lost());
}

TEST_F(SourceTest, RecordingARecordingGivesTheSameFile) {
    const auto first = recording();
    const auto second = (folder / "two.pcap").string();
    {
        auto source = open_source("pcap:" + first, {.record = second});
        ASSERT_TRUE(source) << source.error();
        ASSERT_EQ(source->nic().send(brd()), SendStatus::sent);
        source->osal().wait(source->nic().next_arrival(), -1);
        std::array<std::byte, 1518> into;
        ASSERT_NE(source->nic().receive(into), 0u);
        EXPECT_EQ(source->finish(), "");
    }
    const auto content = [](const std::string& path) {
        std::ifstream in(path, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(in), {});
    };
    EXPECT_FALSE(content(first).empty());
    EXPECT_EQ(content(first), content(second));
}

TEST_F(SourceTest, ARecordingIsNotWrittenOverItself) {
    const auto file = recording();
    const auto size = std::filesystem::file_size(file);
    EXPECT_NE(error_of("pcap:" + file, {.record = file}).find("at the same time"), std::string::npos);
    EXPECT_NE(error_of("pcap:" + file, {.record = (folder / "." / "one.pcap").string()}).find("at the same time"),
              std::string::npos);
    EXPECT_EQ(std::filesystem::file_size(file), size);
}

TEST_F(SourceTest, ARecordingThatCannotBeMadeIsNamed) {
    EXPECT_NE(error_of("pcap:" + recording(), {.record = "/no/such/folder/x.pcap"}).find("/no/such/folder/x.pcap"),
              std::string::npos);
}

TEST_F(SourceTest, AnIncompleteRecordingIsToldAtTheEnd) {
    if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
    auto source = open_source("pcap:" + recording(), {.record = "/dev/full"});
    ASSERT_TRUE(source) << source.error();
    for (int i = 0; i < 500; ++i) (void)source->nic().send(brd());
    EXPECT_NE(source->finish().find("not complete"), std::string::npos);
    EXPECT_TRUE(source->recording_lost());
}

TEST_F(SourceTest, TraceGoesToStandardError) {
    auto source = open_source("pcap:" + recording(), {.trace = true});
    ASSERT_TRUE(source) << source.error();
    testing::internal::CaptureStderr();
    ASSERT_EQ(source->nic().send(brd()), SendStatus::sent);
    const auto shown = testing::internal::GetCapturedStderr();
    EXPECT_NE(shown.find("tx 1 0x00 BRD"), std::string::npos) << shown;
    EXPECT_EQ(shown.back(), '\n');
}

}  // namespace
}  // namespace margay::samples
