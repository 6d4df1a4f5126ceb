// The program slaveinfo: over a cable to a second process with a simulated segment, compared with the same segment
// without the cable and with its recording; and without any segment.
#include <places.hpp>
#include "netns.hpp"
#include "osal/linux/linux_osal.hpp"
#include "oshw/linux/packet_nic.hpp"
#include "wire/datagram.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

namespace margay::process {
namespace {

using namespace std::chrono_literals;

const std::string kSlaveinfo = std::string(MARGAY_BIN_DIR) + "/slaveinfo";
const std::string kVirtualSegment = std::string(MARGAY_BIN_DIR) + "/virtual_segment";
constexpr auto kLimit = 60s;

struct SlaveinfoTest : testing::Test {
    Cable cable;
    std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("margay-slaveinfo-" + std::to_string(::getpid()));

    void SetUp() override {
        if (!cable.missing().empty()) GTEST_SKIP() << cable.missing();
        std::filesystem::create_directories(folder);
    }
    ~SlaveinfoTest() override {
        std::error_code ignored;
        std::filesystem::remove_all(folder, ignored);
    }

    struct Result {
        int code;
        std::string output;
        std::string errors;
    };
    Result slaveinfo(std::vector<std::string> arguments) {
        arguments.insert(arguments.begin(), kSlaveinfo);
        Child child(cable.master_namespace(), arguments);
        const int code = child.wait(kLimit);
        return {code, child.output(), child.errors()};
    }
    std::string output_of(const std::vector<std::string>& arguments) {
        const auto result = slaveinfo(arguments);
        EXPECT_EQ(result.code, 0) << result.errors;
        EXPECT_EQ(result.errors, "");
        EXPECT_GT(result.output.size(), 100u);
        return result.output;
    }
    // Checks with a PacketNic whether the far end answers, so that the test does not depend on the output of a
    // program.
    bool answered_within(std::chrono::seconds limit) {
        PacketNic nic;
        Cable::inside(cable.master_namespace(), [&] { EXPECT_TRUE(nic.open(Cable::kMaster).ok()) << nic.problem(); });
        LinuxOsal osal;
        std::array<std::byte, 1518> buffer{};
        const auto until = osal.now() + limit;
        while (osal.now() < until) {
            wire::FrameBuilder builder(buffer, nic.source_mac());
            (void)builder.append(wire::Command::BRD, 0, wire::DatagramAddress(0), 1);
            if (nic.send(builder.finish()) != SendStatus::sent) return false;
            osal.wait(osal.now() + 10ms, nic.wait_handle());
            if (nic.receive(buffer) != 0) return true;
        }
        return false;
    }
};

TEST_F(SlaveinfoTest, ShowsTheSameFromTheCableTheSimulationAndTheRecording) {
    if (!std::filesystem::exists(kVirtualSegment)) GTEST_SKIP() << kVirtualSegment << " is not built";
    const auto recording = (folder / "cable.pcap").string();
    const auto simulated = output_of({"sim:demo"});
    {
        Child segment(cable.segment_namespace(), {kVirtualSegment, Cable::kSegment, "demo"});
        ASSERT_TRUE(answered_within(20s)) << segment.output() << segment.errors();
        EXPECT_EQ(output_of({Cable::kMaster}), simulated);
        EXPECT_EQ(output_of({Cable::kMaster, "--record", recording}), simulated)
            << "a second run, over what the first has left";
        segment.terminate();
        EXPECT_EQ(segment.wait(10s), 0) << segment.errors();
    }
    EXPECT_FALSE(answered_within(1s)) << "the segment is gone";
    EXPECT_EQ(output_of({"pcap:" + recording}), simulated);
}

TEST_F(SlaveinfoTest, ShowsTheSameToPrograms) {
    if (!std::filesystem::exists(kVirtualSegment)) GTEST_SKIP() << kVirtualSegment << " is not built";
    const auto recording = (folder / "json.pcap").string();
    const auto simulated = output_of({"sim:demo", "--json"});
    Child segment(cable.segment_namespace(), {kVirtualSegment, Cable::kSegment, "demo"});
    ASSERT_TRUE(answered_within(20s)) << segment.output() << segment.errors();
    EXPECT_EQ(output_of({Cable::kMaster, "--json", "--record", recording}), simulated);
    EXPECT_EQ(output_of({"pcap:" + recording, "--json"}), simulated);
}

TEST_F(SlaveinfoTest, AnUnpluggedCableIsNamed) {
    ASSERT_TRUE(cable.ip(cable.segment_namespace(), std::string("link set ") + Cable::kSegment + " down"));
    const auto result = slaveinfo({Cable::kMaster});
    EXPECT_NE(result.code, 0);
    EXPECT_NE(result.code, -1) << "it hung";
    EXPECT_NE(result.errors.find("link"), std::string::npos) << result.errors;
    EXPECT_EQ(result.output, "");
}

TEST_F(SlaveinfoTest, ACableWithNobodyAtItsEndIsNamed) {
    const auto result = slaveinfo({Cable::kMaster});
    EXPECT_NE(result.code, 0);
    EXPECT_NE(result.code, -1) << "it hung";
    EXPECT_FALSE(result.errors.empty());
    EXPECT_EQ(result.output, "");
}

TEST_F(SlaveinfoTest, AnInterfaceThatDoesNotExistIsNamed) {
    const auto result = slaveinfo({"no-such-if"});
    EXPECT_GT(result.code, 0);
    EXPECT_NE(result.errors.find("there is no interface \"no-such-if\""), std::string::npos) << result.errors;
}

TEST_F(SlaveinfoTest, MissingPermissionIsNamedWithItsRemedy) {
    if (!std::filesystem::exists("/usr/bin/setpriv")) GTEST_SKIP() << "setpriv is not installed";
    Child child(cable.master_namespace(), {"/usr/bin/setpriv", "--bounding-set", "-net_raw", "--inh-caps", "-net_raw",
                                           kSlaveinfo, Cable::kMaster});
    EXPECT_GT(child.wait(kLimit), 0);
    EXPECT_NE(child.errors().find("CAP_NET_RAW is missing"), std::string::npos) << child.errors();
    EXPECT_NE(child.errors().find("sudo setcap cap_net_raw+ep " + std::filesystem::canonical(kSlaveinfo).string()),
              std::string::npos)
        << child.errors();
}

}  // namespace
}  // namespace margay::process
