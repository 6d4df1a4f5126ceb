// Mailboxes that the SII does not describe: the mailboxes of BOOT, and other mailboxes for PREOP.
#include "mailbox/foe_bus.hpp"
#include "wire/sync_manager.hpp"

#include <margay/mailbox_places.hpp>

namespace margay {
namespace {

TEST(BootPlaces, AreThoseOfTheApplicationUntilTheNextScan) {
    MailboxBus bus;
    auto device = sim::make_device("bootloader").value();
    constexpr std::size_t kBootMailboxes = 0x28;  // octets 0x28 to 0x2F
    std::fill_n(device.sii.begin() + kBootMailboxes, 8, std::byte{0});
    bus.add_device(std::move(device));
    bus.start();
    EXPECT_EQ(bring(bus, AlState::boot).code, Errc::unsupported);
    const MailboxInfo places{.out_start = 0x1000, .out_bytes = 512, .in_start = 0x1400, .in_bytes = 512};
    HostContext early(Limits{});
    EXPECT_EQ(place_mailboxes(early, 1, AlState::boot, places).error().code, Errc::wrong_state);
    EXPECT_EQ(place_mailboxes(*bus.ctx, 2, AlState::boot, places).error().code, Errc::unknown_slave);
    EXPECT_EQ(place_mailboxes(*bus.ctx, 1, AlState::op, places).error().code, Errc::invalid_argument);
    for (const MailboxInfo& wrong :
         {MailboxInfo{}, MailboxInfo{.out_start = 0x1000, .out_bytes = 128},
          MailboxInfo{.out_start = 0x1000, .out_bytes = 128, .in_start = 0x1040, .in_bytes = 128},
          MailboxInfo{.out_start = 0x1000, .out_bytes = 1500, .in_start = 0x1800, .in_bytes = 128}})
        EXPECT_EQ(place_mailboxes(*bus.ctx, 1, AlState::boot, wrong).error().code, Errc::sii_format);
    ASSERT_TRUE(place_mailboxes(*bus.ctx, 1, AlState::boot, places).ok());
    EXPECT_EQ(bring(bus, AlState::boot).code, Errc::none);
    const auto firmware = sim::Bootloader::make_image(2, 3, 5000);
    EXPECT_TRUE(FOEwrite(*bus.ctx, 1, "firmware", sim::Bootloader::kPassword, firmware).ok());
    // PREOP still uses the mailboxes of the SII. Other mailboxes are used from the next INIT on.
    bus.idle(500ms);
    ASSERT_EQ(bring(bus, AlState::preop).code, Errc::none);
    const auto has_mailbox = [&bus] {
        std::array<char, 32> text{};
        return SDOread_text(*bus.ctx, 1, 0x100A, 0, text).ok();
    };
    EXPECT_TRUE(has_mailbox());
    const MailboxInfo known = bus.ctx->slave(1).mailbox;
    MailboxInfo smaller = known;
    smaller.out_bytes = 64;
    ASSERT_TRUE(place_mailboxes(*bus.ctx, 1, AlState::preop, smaller).ok());
    EXPECT_TRUE(has_mailbox());
    constexpr auto kLength = static_cast<std::uint16_t>(wire::reg::kSyncManagerBase + 2);
    EXPECT_EQ(*read_register<std::uint16_t>(*bus.ctx, 1, kLength), known.out_bytes);
    ASSERT_EQ(bring(bus, AlState::init).code, Errc::none);
    ASSERT_EQ(bring(bus, AlState::preop).code, Errc::none);
    EXPECT_EQ(*read_register<std::uint16_t>(*bus.ctx, 1, kLength), 64U);
    EXPECT_TRUE(has_mailbox());
    EXPECT_EQ(config_init(*bus.ctx).error().code, Errc::none);
    EXPECT_EQ(bring(bus, AlState::boot).code, Errc::unsupported) << "the scan has read the SII again";
}

}  // namespace
}  // namespace margay
