// All messages that the slave stack sends in the tests of this program, decoded by tshark: tshark must decode each
// without a malformed field or an expert warning. It shows mailbox errors and VoE messages as plain data. For this the
// program starts itself again, with a file for the messages.
#include "bench_device.hpp"

#include "wire/mailbox_pcap.hpp"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <set>

namespace margay::subdevice::testing {
namespace {

constexpr const char* kRecordTo = "MARGAY_MAILBOX_RECORD";

// Messages that tshark decodes wrongly although they conform to the standard (ETG.1000.6 "SDO information"): it reads
// the second fragment of a description as a description, and the default, minimum and maximum of an entry as its name.
// It reads lists correctly.
bool beyond_tshark(const std::vector<std::byte>& message, bool& more_to_come) {
    namespace coe = wire::coe;
    const auto data = Bytes(message).subspan(wire::kMailboxHeaderBytes);
    if (wire::load_mailbox_header(message).type != wire::MailboxType::coe || data.size() < coe::kInfoHeaderBytes ||
        coe::load_header(data).service != coe::Service::sdo_information)
        return false;
    const auto opcode = coe::InfoLayout::opcode::load(data);
    const auto kind = static_cast<coe::InfoOpcode>(opcode & ~coe::kInfoIncomplete);
    const bool description = kind == coe::InfoOpcode::object_response || kind == coe::InfoOpcode::entry_response;
    const bool fragment = more_to_come || (opcode & coe::kInfoIncomplete) != 0;
    more_to_come = (opcode & coe::kInfoIncomplete) != 0;
    if (!description) return false;
    return fragment ||
           (kind == coe::InfoOpcode::entry_response && data.size() > coe::InfoLayout::entry_value_info::offset &&
            coe::InfoLayout::entry_value_info::load(data) != 0);
}

class Recorder final : public ::testing::Environment {
  public:
    void TearDown() override {
        const char* const path = std::getenv(kRecordTo);
        if (path == nullptr) return;
        testing_tshark::MailboxPcap file(path);
        // Equal messages are written only once.
        std::set<std::vector<std::byte>> written;
        bool more_to_come = false;
        for (auto& [from_slave, octets] : recording()) {
            if (!from_slave || octets.size() < wire::kMailboxHeaderBytes) continue;
            if (beyond_tshark(octets, more_to_come)) continue;
            auto header = wire::load_mailbox_header(octets);
            header.counter = 1;
            wire::store_mailbox_header(octets, header);
            if (written.insert(octets).second) file.add(octets);
        }
    }
};
[[maybe_unused]] const auto* const kRecorder = ::testing::AddGlobalTestEnvironment(new Recorder);

TEST(TsharkMailbox, DecodesEveryMessageOfAllTests) {
    if (!testing_tshark::installed()) GTEST_SKIP() << "tshark is not installed";
    const auto file =
        std::filesystem::temp_directory_path() / ("margay-mailbox-" + std::to_string(::getpid()) + ".pcap");
    const std::string self = std::filesystem::read_symlink("/proc/self/exe");
    // This process may be one of several processes that share the tests. The process that it starts executes all tests.
    const auto run = "env -u GTEST_TOTAL_SHARDS -u GTEST_SHARD_INDEX " + std::string(kRecordTo) + "='" + file.string() +
                     "' '" + self + "' --gtest_filter='-TsharkMailbox*' --gtest_brief=1 >/dev/null 2>&1";
    ASSERT_EQ(std::system(run.c_str()), 0) << "other tests fail: see them first";
    const auto packets = testing_tshark::fields_of(
        file.string(), {"frame.number", "_ws.malformed", "_ws.expert", "ecat_mailbox.length", "ecat_mailbox.coe.type",
                        "ecat_mailbox.foe_opmode", "ecat_mailbox.soe_opcode", "ams.cmdid", "ecat_mailbox.eoe.type"});
    std::size_t coe = 0;
    std::size_t foe = 0;
    std::size_t soe = 0;
    std::size_t aoe = 0;
    std::size_t eoe = 0;
    std::size_t plain = 0;
    for (const auto& columns : packets) {
        ASSERT_EQ(columns.size(), 9u);
        EXPECT_EQ(columns[1], "") << "malformed: packet " << columns[0];
        EXPECT_EQ(columns[2], "") << "expert information: packet " << columns[0];
        coe += columns[4].empty() ? 0 : 1;
        foe += columns[5].empty() ? 0 : 1;
        soe += columns[6].empty() ? 0 : 1;
        aoe += columns[7].empty() ? 0 : 1;
        eoe += columns[8].empty() ? 0 : 1;
        const bool decoded = !(columns[4].empty() && columns[5].empty() && columns[6].empty() && columns[7].empty() &&
                               columns[8].empty());
        plain += decoded ? 0 : 1;
    }
    // All kinds of messages occurred: hundreds of SDO and file messages, at least six mailbox errors and five VoE
    // messages.
    EXPECT_GT(coe, 500u);
    EXPECT_GT(foe, 100u);
    EXPECT_GT(soe, 60u);
    EXPECT_GT(aoe, 30u);
    EXPECT_GT(eoe, 10u);
    EXPECT_GE(plain, 11u);
    EXPECT_LT(plain, 100u);
    std::error_code ignored;
    if (!HasFailure()) std::filesystem::remove(file, ignored);
}

}  // namespace
}  // namespace margay::subdevice::testing
