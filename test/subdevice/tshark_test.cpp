// What the slave stack sends in all tests of this program, read by tshark: every message must be a mailbox message to it, with
// no malformed field and no expert warning. The program runs itself once more, with a file to write them to.
#include "bench_device.hpp"

#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>

namespace margay::subdevice::testing {
namespace {

constexpr const char* kRecordTo = "MARGAY_MAILBOX_RECORD";

std::string number(std::uint64_t value, int bytes) {
    std::string out;
    for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i));
    return out;
}

// The message as a master fetches it, in a frame on its way back.
std::string frame_of(const std::vector<std::byte>& message) {
    std::string frame(6, '\xFF');
    frame += std::string("\x02\x01\x01\x01\x01\x01\x88\xA4", 8);
    frame += number(0x1000 | (message.size() + 12), 2);
    frame += number(4, 1) + number(0, 1) + number(0x1001, 2) + number(0x1100, 2) + number(message.size(), 2) + number(0, 2);
    frame.append(reinterpret_cast<const char*>(message.data()), message.size());
    return frame + number(1, 2);
}

// What tshark cannot read though it is as the standard has it (ETG.1000.6 "SDO information"): it takes the second fragment of a
// description for a description, and default, minimum and maximum of an entry for its name. Lists it does read.
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
    return fragment || (kind == coe::InfoOpcode::entry_response && data.size() > coe::InfoLayout::entry_value_info::offset &&
                        coe::InfoLayout::entry_value_info::load(data) != 0);
}

class Recorder final : public ::testing::Environment {
  public:
    void TearDown() override {
        const char* const path = std::getenv(kRecordTo);
        if (path == nullptr) return;
        std::ofstream file(path, std::ios::binary);
        file << number(0xA1B2C3D4, 4) << number(2, 2) << number(4, 2) << number(0, 8) << number(65535, 4) << number(1, 4);
        // The same message over and over says nothing more.
        std::set<std::vector<std::byte>> written;
        bool more_to_come = false;
        for (auto& [from_slave, octets] : recording()) {
            if (!from_slave || octets.size() < wire::kMailboxHeaderBytes) continue;
            if (beyond_tshark(octets, more_to_come)) continue;
            auto header = wire::load_mailbox_header(octets);
            header.counter = 1;
            wire::store_mailbox_header(octets, header);
            if (!written.insert(octets).second) continue;
            const auto frame = frame_of(octets);
            file << number(written.size(), 4) << number(0, 4) << number(frame.size(), 4) << number(frame.size(), 4) << frame;
        }
    }
};
[[maybe_unused]] const auto* const kRecorder = ::testing::AddGlobalTestEnvironment(new Recorder);

std::vector<std::string> lines_of(const std::string& command) {
    std::vector<std::string> lines;
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(::popen(command.c_str(), "r"), ::pclose);
    if (!pipe) return lines;
    char* line = nullptr;
    std::size_t room = 0;
    for (ssize_t length = 0; (length = ::getline(&line, &room, pipe.get())) > 0;)
        lines.emplace_back(line, static_cast<std::size_t>(length - 1));
    std::free(line);
    return lines;
}

TEST(TsharkMailbox, DecodesEveryMessageOfAllTests) {
    if (std::system("command -v tshark >/dev/null 2>&1") != 0) GTEST_SKIP() << "tshark is not installed";
    const auto file =
        std::filesystem::temp_directory_path() / ("margay-mailbox-" + std::to_string(::getpid()) + ".pcap");
    const std::string self = std::filesystem::read_symlink("/proc/self/exe");
    const auto run = std::string(kRecordTo) + "='" + file.string() + "' '" + self +
                     "' --gtest_filter='-TsharkMailbox*' --gtest_brief=1 >/dev/null 2>&1";
    ASSERT_EQ(std::system(run.c_str()), 0) << "other tests fail: see them first";
    const auto fields = lines_of("tshark -n -r '" + file.string() +
                                 "' -T fields -E separator=/t -e frame.number -e _ws.malformed -e _ws.expert"
                                 " -e ecat_mailbox.length -e ecat_mailbox.coe.type -e ecat_mailbox.foe_opmode 2>/dev/null");
    std::size_t coe = 0;
    std::size_t foe = 0;
    std::size_t errors = 0;
    for (const auto& line : fields) {
        std::vector<std::string> columns(1);
        for (const char c : line) c == '\t' ? (void)columns.emplace_back() : columns.back().push_back(c);
        ASSERT_EQ(columns.size(), 6u) << line;
        EXPECT_EQ(columns[1], "") << "malformed: packet " << line;
        EXPECT_EQ(columns[2], "") << "expert information: packet " << line;
        coe += columns[4].empty() ? 0 : 1;
        foe += columns[5].empty() ? 0 : 1;
        errors += columns[4].empty() && columns[5].empty() ? 1 : 0;
    }
    // All kinds have been there: hundreds of SDO and file messages, and mailbox errors, which tshark knows no more of.
    EXPECT_GT(coe, 500u);
    EXPECT_GT(foe, 100u);
    EXPECT_GE(errors, 6u);
    EXPECT_LT(errors, 100u);
    std::error_code ignored;
    if (!HasFailure()) std::filesystem::remove(file, ignored);
}

}  // namespace
}  // namespace margay::subdevice::testing
