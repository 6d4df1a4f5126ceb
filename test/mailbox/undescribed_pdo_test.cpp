// A slave assigns a PDO that its dictionary does not have.
#include "mailbox/mailbox_bus.hpp"

#include <margay/run.hpp>

#include <algorithm>
#include <array>
#include <chrono>

namespace margay {
namespace {

class UndescribedPdo : public testing::Test {
  protected:
    // Assigns the PDO before the SII is written. At this time the SyncManager has no length in the SII.
    static void assign(StackSlave& slave, std::uint16_t pdo) {
        subdevice::testing::Values::rx_assign::store(slave.image, pdo);
    }
    // Renames PDO 0x1600 to 0x1605 in the SII.
    void rename_in_sii() {
        auto& sii = bus.segment.slave(0).sii().image();
        const std::array<std::byte, 2> first{std::byte{0x00}, std::byte{0x16}};
        const auto found = std::ranges::search(sii, first);
        ASSERT_FALSE(found.empty());
        found.front() = std::byte{0x05};
    }
    std::vector<std::string> errors() {
        std::vector<std::string> all;
        while (const auto error = bus.ctx->errors().take()) all.push_back(bus.words(*error));
        return all;
    }
    MailboxBus bus;
    std::vector<std::byte> image = std::vector<std::byte>(512);
};

TEST_F(UndescribedPdo, WithoutALengthInTheSiiItIsAnError) {
    auto firmware = std::make_unique<StackSlave>(std::uint16_t{128});
    assign(*firmware, 0x1605);
    bus.add(std::move(firmware));
    bus.start();
    EXPECT_FALSE(config_map(*bus.ctx, image).ok());
    EXPECT_EQ(bus.words(bus.ctx->slave(1).error),
              "slave 1: finding the PDOs, PDO 0x1605: neither the list nor the slave says which entries the PDO has");
    EXPECT_EQ(bus.ctx->slave(1).image.outputs.bits, 0U);
}

TEST_F(UndescribedPdo, WithALengthInTheSiiItIsSaidAndUsed) {
    StackSlave& slave = bus.add_stack();
    assign(slave, 0x1605);
    bus.start();
    EXPECT_EQ(bus.words(config_map(*bus.ctx, image).error()),
              "slave 1: requesting a state: the slave refused (wanted SAFEOP, is in PREOP, AL status code 0x0025: "
              "invalid output mapping)")
        << "as its firmware does not know the PDO either";
    const auto told = errors();
    ASSERT_FALSE(told.empty());
    EXPECT_EQ(told.front(),
              "slave 1: finding the PDOs, PDO 0x1605: neither the list nor the slave says which entries the PDO has "
              "(used: 4 octets, as the SII says)");
    EXPECT_EQ(bus.ctx->slave(1).image.outputs.bits, 32U);
}

TEST_F(UndescribedPdo, AGapInTheAssignmentIsNone) {
    StackSlave& slave = bus.add_stack();
    assign(slave, 0);
    bus.start();
    EXPECT_TRUE(config_map(*bus.ctx, image).ok());
    for (const auto& text : errors()) EXPECT_EQ(text.find("neither the list"), std::string::npos) << text;
}

// The application lists the PDO without its entries.
constexpr Pdo kOpen[] = {{0x1605}};
constexpr SmPdos kOpenList[] = {{2, kOpen}};
constexpr SlaveSetup kOpenSetup{.pdos = kOpenList};

TEST_F(UndescribedPdo, InAListWithoutItsEntriesItIsAnError) {
    StackSlave& slave = bus.add_stack();
    assign(slave, 0x1605);
    bus.start();
    bus.ctx->slave(1).config.setup = &kOpenSetup;
    bus.ctx->slave(1).config.fixed_pdos = true;
    EXPECT_EQ(bus.words(config_map(*bus.ctx, image).error()),
              "slave 1: configuring PDOs of 0x1605:0: neither the list nor the slave says which entries the PDO has");
    EXPECT_EQ(bus.ctx->slave(1).image.outputs.bits, 0U) << "the length of the SyncManager in the SII is of other PDOs";
    EXPECT_EQ(bus.ctx->slave(1).al.state, AlState::preop);
}

// The list has another PDO with its entries. The size of the list is still unknown.
constexpr PdoEntry kTwo[] = {{0x7000, 1, 16}};
constexpr Pdo kOneOpen[] = {{0x1600, kTwo}, {0x1605}};
constexpr SmPdos kOneOpenList[] = {{2, kOneOpen}};
constexpr SlaveSetup kOneOpenSetup{.pdos = kOneOpenList};

TEST_F(UndescribedPdo, BesideAListedOneItIsAnErrorToo) {
    StackSlave& slave = bus.add_stack();
    assign(slave, 0x1605);
    bus.start();
    bus.ctx->slave(1).config.setup = &kOneOpenSetup;
    bus.ctx->slave(1).config.fixed_pdos = true;
    const auto mapped = config_map(*bus.ctx, image);
    EXPECT_EQ(bus.words(mapped.error()),
              "slave 1: configuring PDOs of 0x1605:0: neither the list nor the slave says which entries the PDO has");
    EXPECT_EQ(bus.ctx->slave(1).image.outputs.bits, 0U) << "not the 16 bits of the other one alone";
    EXPECT_EQ(bus.ctx->slave(1).al.state, AlState::preop);
    EXPECT_FALSE(reach(*bus.ctx, AlState::op, std::chrono::seconds(1)).ok());
    EXPECT_FALSE(all_right(*bus.ctx));
}

// A list names its PDOs, so the SII may provide their entries.
TEST_F(UndescribedPdo, InAListItIsTakenFromTheSii) {
    StackSlave& slave = bus.add_stack();
    rename_in_sii();
    assign(slave, 0x1605);
    bus.start();
    bus.ctx->slave(1).config.setup = &kOpenSetup;
    bus.ctx->slave(1).config.fixed_pdos = true;
    EXPECT_EQ(bus.words(config_map(*bus.ctx, image).error()),
              "slave 1: requesting a state: the slave refused (wanted SAFEOP, is in PREOP, AL status code 0x0025: "
              "invalid output mapping)")
        << "as its firmware does not know the PDO";
    EXPECT_EQ(bus.ctx->slave(1).image.outputs.bits, 32U);
}

TEST_F(UndescribedPdo, BesideAListedOneItIsTakenFromTheSiiToo) {
    StackSlave& slave = bus.add_stack();
    rename_in_sii();
    assign(slave, 0x1605);
    bus.start();
    bus.ctx->slave(1).config.setup = &kOneOpenSetup;
    bus.ctx->slave(1).config.fixed_pdos = true;
    EXPECT_FALSE(config_map(*bus.ctx, image).ok()) << "its firmware does not know the PDO";
    EXPECT_EQ(bus.ctx->slave(1).image.outputs.bits, 48U) << "16 of the list and 32 of the SII";
}

}  // namespace
}  // namespace margay
