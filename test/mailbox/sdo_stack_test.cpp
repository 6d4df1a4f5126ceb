// SDO transfers between our client and our slave stack, over a simulated segment.
#include "mailbox/mailbox_bus.hpp"

namespace margay {
namespace {

TEST(SdoStack, ReadsTypedValuesTextsAndLongOnes) {
    MailboxBus bus;
    auto& slave = bus.add_stack(128);
    bus.start();
    auto& ctx = *bus.ctx;
    const auto type = SDOread<std::uint32_t>(ctx, 1, 0x1000, 0);
    ASSERT_TRUE(type.ok()) << bus.words(type.error());
    EXPECT_EQ(*type, 0x191U);
    EXPECT_EQ(*SDOread<std::int16_t>(ctx, 1, 0x2000, 0), 100);
    EXPECT_EQ(*SDOread<std::uint64_t>(ctx, 1, 0x2001, 0), 0x1122334455667788U);
    std::array<char, 40> text{};
    const auto name = SDOread_text(ctx, 1, 0x1008, 0, text);
    ASSERT_TRUE(name.ok());
    EXPECT_EQ(*name, "Bench device of many words");
    std::vector<std::byte> vast(70'000);
    const auto bytes = SDOread(ctx, 1, 0x2008, 0, false, vast);
    ASSERT_TRUE(bytes.ok()) << bus.words(bytes.error());
    EXPECT_EQ(*bytes, 70'000U);
    EXPECT_EQ(vast, slave.application.vast);
}

TEST(SdoStack, WritesTypedValuesTextsAndLongOnes) {
    MailboxBus bus;
    auto& slave = bus.add_stack(128);
    bus.start();
    auto& ctx = *bus.ctx;
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x2000, 0, std::int16_t{-321}).ok());
    EXPECT_EQ(*SDOread<std::int16_t>(ctx, 1, 0x2000, 0), -321);
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x2001, 0, std::uint64_t{42}).ok());
    EXPECT_EQ(*SDOread<std::uint64_t>(ctx, 1, 0x2001, 0), 42U);
    ASSERT_TRUE(SDOwrite_text(ctx, 1, 0x2002, 0, "margay").ok());
    std::array<char, 40> text{};
    EXPECT_EQ(*SDOread_text(ctx, 1, 0x2002, 0, text), "margay");
    const auto vast = pattern(66'000);
    const auto written = SDOwrite(ctx, 1, 0x2008, 0, false, vast);
    ASSERT_TRUE(written.ok()) << bus.words(written.error());
    EXPECT_EQ(slave.application.vast_bytes, 66'000U);
    EXPECT_TRUE(std::equal(vast.begin(), vast.end(), slave.application.vast.begin()));
}

TEST(SdoStack, AbortsAreErrorsInWords) {
    MailboxBus bus;
    bus.add_stack(128);
    bus.start();
    const auto none = SDOread<std::uint8_t>(*bus.ctx, 1, 0x3000, 1);
    ASSERT_FALSE(none.ok());
    EXPECT_EQ(none.error().code, Errc::sdo_abort);
    EXPECT_EQ(none.error().detail, 0x06020000U);
    EXPECT_EQ(bus.words(none.error()),
              "slave 1: SDO upload of 0x3000:1: the slave aborted the transfer (abort code 0x06020000: object does not "
              "exist)");
    EXPECT_EQ(sdo_abort_text(0x06090011), "subindex does not exist");
    const auto wide = SDOread<std::uint32_t>(*bus.ctx, 1, 0x2000, 0);
    EXPECT_EQ(wide.error().code, Errc::wrong_size);
    EXPECT_EQ(bus.words(wide.error()),
              "slave 1: SDO upload of 0x2000:0: the size of the value differs from the requested size (expected 4 "
              "octets, got 2)");
    const auto narrow = SDOread<std::uint8_t>(*bus.ctx, 1, 0x2000, 0);
    EXPECT_EQ(narrow.error().code, Errc::capacity);
    EXPECT_EQ(SDOread<std::uint8_t>(*bus.ctx, 2, 0x2000, 0).error().code, Errc::unknown_slave);
    EXPECT_TRUE(SDOread<std::int16_t>(*bus.ctx, 1, 0x2000, 0).ok());
}

}  // namespace
}  // namespace margay
