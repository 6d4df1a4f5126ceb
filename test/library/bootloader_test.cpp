// Firmware by FoE in BOOT, tested by datagrams: states, files, busy, errors, the restart with the new version.
#include "hand.hpp"

#include "sim/library/bootloader.hpp"
#include "wire/foe.hpp"

#include <algorithm>

namespace margay::sim::test {
namespace {

namespace foe = wire::foe;
using foe::Layout;
using foe::Opcode;

class BootloaderTest : public testing::Test {
  protected:
    Hand hand{"bootloader"};
    unsigned busy_replies = 0;
    std::string error_text;
    foe::ErrorCode error{};

    std::string version() {
        std::string text;
        for (const auto octet : hand.upload(0x100A)) text.push_back(static_cast<char>(octet));
        return text;
    }
    std::vector<std::byte> message(Opcode opcode, std::uint32_t word, Bytes body = {}) {
        std::vector<std::byte> data(foe::kHeaderBytes);
        Layout::opcode::store(data, opcode);
        store_le<std::uint32_t>(data, 2, word);
        data.insert(data.end(), body.begin(), body.end());
        return data;
    }
    static std::vector<std::byte> name(std::string_view text) {
        std::vector<std::byte> octets;
        for (const char c : text) octets.push_back(static_cast<std::byte>(c));
        return octets;
    }
    Opcode send(const std::vector<std::byte>& data, std::vector<std::byte>& reply) {
        reply = hand.exchange(wire::MailboxType::foe, data);
        const auto opcode = Layout::opcode::load(reply);
        if (opcode == Opcode::error) {
            error = Layout::error_code::load(reply);
            error_text.clear();
            for (auto at = reply.begin() + foe::kHeaderBytes; at != reply.end(); ++at)
                error_text.push_back(static_cast<char>(*at));
        }
        return opcode;
    }
    // Returns true if the slave acknowledged the whole file.
    bool write(const std::vector<std::byte>& file, std::uint32_t password = Bootloader::kPassword,
               std::string_view file_name = "firmware", std::size_t stop_after = SIZE_MAX) {
        std::vector<std::byte> reply;
        if (send(message(Opcode::write, password, name(file_name)), reply) != Opcode::acknowledge) return false;
        const std::size_t room = hand.mailbox_bytes - wire::kMailboxHeaderBytes - foe::kHeaderBytes;
        std::uint32_t packet = 0;
        for (std::size_t at = 0;; at += room) {
            const auto bytes = std::min(room, file.size() - at);
            const auto data = message(Opcode::data, ++packet, Bytes(file).subspan(at, bytes));
            auto answer = send(data, reply);
            for (; answer == Opcode::busy; answer = send(data, reply)) {
                ++busy_replies;
                EXPECT_LE(Layout::done::load(reply), Layout::entire::load(reply));
                hand.wait(1ms);
            }
            if (answer != Opcode::acknowledge) return false;
            if (bytes < room) return true;
            if (at + bytes >= stop_after) return false;
        }
    }
    std::uint32_t sii_revision() { return load_le<std::uint32_t>(Bytes(hand.esc().sii().image()), 2 * 0x0C); }
    bool leave_boot() {
        const auto status = hand.ask(AlState::init);
        hand.wait(500ms);
        return status.state == AlState::init;
    }
};

TEST_F(BootloaderTest, NewFirmwareRunsAfterBoot) {
    ASSERT_EQ(hand.to(AlState::preop).state, AlState::preop);
    EXPECT_EQ(version(), "1.0");
    ASSERT_EQ(hand.ask(AlState::init).state, AlState::init);
    ASSERT_EQ(hand.to(AlState::boot), (AlStatus{AlState::boot, false, 0}));
    ASSERT_TRUE(write(Bootloader::make_image(2, 17, 40'000))) << error_text;
    EXPECT_GT(busy_replies, 10u);
    ASSERT_TRUE(leave_boot());
    ASSERT_EQ(hand.to(AlState::preop), (AlStatus{AlState::preop, false, 0}));
    EXPECT_EQ(version(), "2.17");
}

// The test offers the EEPROM to the PDI, as a master does before PREOP.
TEST_F(BootloaderTest, TheRevisionOfTheNewFirmwareIsInTheSiiAndInTheDictionary) {
    (void)hand.rig.write(0, wire::reg::kSiiConfig.address, {std::byte{1}});
    ASSERT_EQ(hand.to(AlState::boot).state, AlState::boot);
    EXPECT_EQ(sii_revision(), 0x0001'0000U);
    ASSERT_TRUE(write(Bootloader::make_image(2, 17, 3000))) << error_text;
    EXPECT_EQ(sii_revision(), 0x0001'0000U);
    ASSERT_TRUE(leave_boot());
    EXPECT_EQ(sii_revision(), 0x0002'0011U);
    ASSERT_EQ(hand.to(AlState::preop).state, AlState::preop);
    EXPECT_EQ(hand.number(0x1018, 3), 0x0002'0011);
}

TEST(OpenBootloader, HasNoPasswordAndTheUsualMailboxes) {
    Hand hand("bootloader_open");
    const auto& boxes = hand.model.fixed.mailboxes;
    EXPECT_EQ(boxes.boot.out_start, boxes.standard.out_start);
    EXPECT_EQ(boxes.boot.in_bytes, boxes.standard.in_bytes);
    ASSERT_EQ(hand.to(AlState::boot).state, AlState::boot);
    std::vector<std::byte> request(foe::kHeaderBytes);
    Layout::opcode::store(request, Opcode::write);
    for (const char c : std::string_view("firmware")) request.push_back(static_cast<std::byte>(c));
    const auto reply = hand.exchange(wire::MailboxType::foe, request);
    EXPECT_EQ(Layout::opcode::load(reply), Opcode::acknowledge);
}

TEST_F(BootloaderTest, AFileOfWholePacketsEndsWithAnEmptyOne) {
    ASSERT_EQ(hand.to(AlState::boot).state, AlState::boot);
    const std::size_t room = hand.mailbox_bytes - wire::kMailboxHeaderBytes - foe::kHeaderBytes;
    ASSERT_TRUE(write(Bootloader::make_image(3, 0, 10 * room - Bootloader::ImageLayout::bytes))) << error_text;
    ASSERT_TRUE(leave_boot());
    ASSERT_EQ(hand.to(AlState::preop).state, AlState::preop);
    EXPECT_EQ(version(), "3.0");
}

TEST_F(BootloaderTest, TheDeviceIsGoneWhileItStarts) {
    ASSERT_EQ(hand.to(AlState::boot).state, AlState::boot);
    ASSERT_TRUE(write(Bootloader::make_image(2, 0, 100)));
    ASSERT_EQ(hand.ask(AlState::init).state, AlState::init);
    hand.configure_mailboxes();
    EXPECT_EQ(hand.ask(AlState::preop, 100ms).state, AlState::init) << "nobody there to answer";
    EXPECT_EQ(hand.ask(AlState::preop, 500ms).state, AlState::preop);
}

TEST_F(BootloaderTest, ABrokenImageIsRefusedAndNothingRunsUntilAGoodOneComes) {
    ASSERT_EQ(hand.to(AlState::boot).state, AlState::boot);
    auto broken = Bootloader::make_image(2, 0, 5000);
    broken[1000] ^= std::byte{1};
    EXPECT_FALSE(write(broken));
    EXPECT_EQ(error_text, "the checksum of the image is wrong");
    ASSERT_TRUE(leave_boot());
    hand.configure_mailboxes();
    EXPECT_EQ(hand.ask(AlState::preop), (AlStatus{AlState::init, true, 0x0014}));  // no valid firmware
    (void)hand.ask(AlState::init, 10ms, wire::al::kErrorAcknowledge);
    ASSERT_EQ(hand.to(AlState::boot).state, AlState::boot);
    ASSERT_TRUE(write(Bootloader::make_image(2, 1, 5000))) << error_text;
    ASSERT_TRUE(leave_boot());
    ASSERT_EQ(hand.to(AlState::preop).state, AlState::preop);
    EXPECT_EQ(version(), "2.1");
}

TEST_F(BootloaderTest, AnInterruptedDownloadLeavesNoFirmware) {
    ASSERT_EQ(hand.to(AlState::boot).state, AlState::boot);
    EXPECT_FALSE(write(Bootloader::make_image(2, 0, 20'000), Bootloader::kPassword, "firmware", 4000));
    ASSERT_TRUE(leave_boot());
    hand.configure_mailboxes();
    EXPECT_EQ(hand.ask(AlState::preop), (AlStatus{AlState::init, true, 0x0014}));
}

TEST_F(BootloaderTest, WrongNamePasswordProductAndState) {
    ASSERT_EQ(hand.to(AlState::boot).state, AlState::boot);
    EXPECT_FALSE(write({}, Bootloader::kPassword, "parameters"));
    EXPECT_EQ(error, foe::ErrorCode::not_found);
    EXPECT_FALSE(write({}, 1));
    EXPECT_EQ(error_text, "wrong password");
    std::vector<std::byte> other = Bootloader::make_image(1, 1, 10);
    other.resize(3);
    EXPECT_FALSE(write(other));
    EXPECT_EQ(error_text, "this is no firmware image");
    EXPECT_FALSE(write(Bootloader::make_image(1, 1, Bootloader::kFlashBytes)));
    EXPECT_EQ(error, foe::ErrorCode::disk_full);
    ASSERT_TRUE(write(Bootloader::make_image(1, 2, 10)));
    ASSERT_TRUE(leave_boot());
    ASSERT_EQ(hand.to(AlState::preop).state, AlState::preop);
    EXPECT_FALSE(write({}));
    EXPECT_EQ(error, foe::ErrorCode::bootstrap_only);
}

TEST_F(BootloaderTest, TheImageReadsBackAsItWasWritten) {
    ASSERT_EQ(hand.to(AlState::boot).state, AlState::boot);
    const auto image = Bootloader::make_image(4, 5, 3000);
    ASSERT_TRUE(write(image));
    std::vector<std::byte> reply;
    std::vector<std::byte> file;
    const std::size_t room = hand.mailbox_bytes - wire::kMailboxHeaderBytes - foe::kHeaderBytes;
    auto opcode = send(message(Opcode::read, Bootloader::kPassword, name("firmware")), reply);
    for (std::uint32_t packet = 1; opcode == Opcode::data; ++packet) {
        ASSERT_EQ(Layout::packet_number::load(reply), packet);
        file.insert(file.end(), reply.begin() + foe::kHeaderBytes, reply.end());
        if (reply.size() - foe::kHeaderBytes < room) break;
        opcode = send(message(Opcode::acknowledge, packet), reply);
    }
    EXPECT_EQ(file, image);
}

}  // namespace
}  // namespace margay::sim::test
