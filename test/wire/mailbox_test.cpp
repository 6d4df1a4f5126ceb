// Mailbox header and texts compared with ETG.1000.4 "Mailbox" and the tables of ETG.1000.6.
#include "wire/mailbox.hpp"

#include "wire/al_status_code.hpp"

#include <gtest/gtest.h>

#include <array>
#include <set>
#include <string_view>

namespace margay::wire {
namespace {

TEST(MailboxHeaderTest, BitsLieWhereTheStandardPutsThem) {
    std::array<std::byte, kMailboxHeaderBytes> bytes{};
    store_mailbox_header(
        bytes,
        {.length = 0x0102, .address = 0x1001, .channel = 0x21, .priority = 2, .type = MailboxType::coe, .counter = 5});
    const std::array<int, 6> expected{0x02, 0x01, 0x01, 0x10, 0xA1, 0x53};
    for (std::size_t i = 0; i < bytes.size(); ++i) EXPECT_EQ(std::to_integer<int>(bytes[i]), expected[i]) << i;
}

TEST(MailboxHeaderTest, EveryHeaderComesBackAsItWasStored) {
    std::array<std::byte, kMailboxHeaderBytes> bytes{};
    for (unsigned channel = 0; channel < 64; ++channel)
        for (unsigned priority = 0; priority < 4; ++priority)
            for (unsigned type = 0; type < 16; ++type)
                for (unsigned counter = 0; counter < 8; ++counter) {
                    const MailboxHeader h{
                        7, 9, std::uint8_t(channel), std::uint8_t(priority), MailboxType(type), std::uint8_t(counter)};
                    store_mailbox_header(bytes, h);
                    ASSERT_EQ(load_mailbox_header(bytes), h);
                }
}

TEST(MailboxHeaderTest, CountersGoOneToSeven) {
    std::uint8_t counter = 0;
    for (const int expected : {1, 2, 3, 4, 5, 6, 7, 1, 2}) EXPECT_EQ(counter = next_mailbox_counter(counter), expected);
}

TEST(MailboxMessageTest, NothingIsReadPastTheEnd) {
    std::array<std::byte, 10> bytes{};
    store_mailbox_header(bytes, {.length = 4, .type = MailboxType::error});
    for (std::size_t size = 0; size < bytes.size(); ++size)
        EXPECT_FALSE(load_mailbox_message(Bytes(bytes).first(size))) << size;
    const auto whole = load_mailbox_message(bytes);
    ASSERT_TRUE(whole);
    EXPECT_EQ(whole->data.size(), 4u);
    store_mailbox_header(bytes, {.length = 0xFFFF});
    EXPECT_FALSE(load_mailbox_message(bytes));
}

TEST(AlStatusCodeTest, EveryCodeOfTheTableHasATextOfItsOwn) {
    std::set<std::string_view> texts;
    int named = 0;
    for (unsigned code = 0; code < kVendorAlStatusCodes; ++code) {
        const auto text = al_status_text(static_cast<std::uint16_t>(code));
        ASSERT_FALSE(text.empty());
        if (text == "reserved code") continue;
        ++named;
        EXPECT_TRUE(texts.insert(text).second) << text;
    }
    EXPECT_EQ(named, 63);
    EXPECT_EQ(al_status_text(0x001B), "sync manager watchdog");
    EXPECT_EQ(al_status_text(0x8000), "vendor specific");
    EXPECT_EQ(al_status_text(0xFFFF), "vendor specific");
}

}  // namespace
}  // namespace margay::wire
