// A master and a device with two SyncManagers in each direction: the SII, the mapping, the exchange, other PDOs, and
// what the device refuses.
#include "segment/field_notes.hpp"

#include "sim/sii_model.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

class SplitIo : public FieldNotes {
  protected:
    sim::Esc* chip = nullptr;
    void SetUp() override {
        chip = &plug(sim::make_device("split_io").value());
        start();
    }
    MutableBytes out() { return ctx.slave(1).image.outputs.bytes; }
    Bytes in() { return ctx.slave(1).image.inputs.bytes; }
    MutableBytes terminals() { return chip->process_data()->inputs(); }
    std::uint32_t level(std::uint8_t subindex) {
        return static_cast<std::uint16_t>(beside_the_cycle(1, 0x9000, subindex));
    }
    // Deactivates a SyncManager as another master would.
    void deactivate(unsigned n) {
        const auto address = static_cast<std::uint16_t>(wire::reg::sync_manager(n).address + 6);
        ASSERT_TRUE(write_register<std::uint8_t>(ctx, 1, address, 0));
    }
};

TEST_F(SplitIo, TheSiiHasASyncManagerAndAnFmmuForEachArea) {
    const auto& slave = ctx.slave(1);
    ASSERT_GE(slave.sync_managers.size(), 6U);
    EXPECT_EQ(slave.sync_managers[4].type, SmType::outputs);
    EXPECT_EQ(slave.sync_managers[4].start, 0x1400);
    EXPECT_EQ(slave.sync_managers[4].length_bytes, 4);
    EXPECT_EQ(slave.sync_managers[4].control, 0x64);
    EXPECT_EQ(slave.sync_managers[5].type, SmType::inputs);
    EXPECT_EQ(slave.sync_managers[5].length_bytes, 4);
    for (std::uint8_t n = 1; n <= 6; ++n)
        EXPECT_EQ(*SDOread<std::uint8_t>(ctx, 1, 0x1C00, n, 1s), (std::array{1, 2, 3, 4, 3, 4}[n - 1U]));
}

// ETG.1020: each SyncManager of process data has its synchronization parameters at 0x1C30 + its number.
TEST_F(SplitIo, EachSyncManagerHasItsSynchronizationParameters) {
    constexpr std::array<std::uint16_t, 4> kIndices{0x1C32, 0x1C33, 0x1C34, 0x1C35};
    for (const std::uint16_t index : kIndices) {
        const auto cycle = static_cast<std::uint32_t>(1'000'000 + index);
        EXPECT_TRUE(SDOwrite(ctx, 1, index, 2, cycle, 1s)) << index;
        const bool outputs = index == 0x1C32 || index == 0x1C34;
        EXPECT_EQ(*SDOread<std::uint16_t>(ctx, 1, index, 1, 1s), outputs ? 1U : 0x22U) << index;
    }
    for (const std::uint16_t index : kIndices)
        EXPECT_EQ(*SDOread<std::uint32_t>(ctx, 1, index, 2, 1s), 1'000'000U + index);
    EXPECT_EQ(*SDOread<std::uint8_t>(ctx, 1, 0x1C34, 0, 1s), 0x20U);
    EXPECT_EQ(*SDOread<std::uint8_t>(ctx, 1, 0x1C35, 0, 1s), 0x20U);
    EXPECT_EQ(SDOwrite(ctx, 1, 0x1C34, 0x0B, std::uint16_t{0}, 1s).error().detail, 0x06010002U) << "read only";
}

TEST_F(SplitIo, EachSyncManagerCarriesItsPart) {
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    ASSERT_EQ(out().size(), 6U);
    ASSERT_EQ(in().size(), 6U);
    store_le<std::uint16_t>(out(), 0, 0xA55A);
    store_le<std::int16_t>(out(), 2, -2);
    store_le<std::int16_t>(out(), 4, 0x1234);
    store_le<std::uint16_t>(terminals(), 0, 0xBEEF);
    store_le<std::int16_t>(terminals(), 2, 77);
    store_le<std::int16_t>(terminals(), 4, -3000);
    cycles(3);
    EXPECT_EQ(load_le<std::uint16_t>(in(), 0), 0xBEEF);
    EXPECT_EQ(load_le<std::int16_t>(in(), 2), 77);
    EXPECT_EQ(load_le<std::int16_t>(in(), 4), -3000);
    EXPECT_EQ(level(1), 0xA55AU);
    EXPECT_EQ(level(2), 0xFFFEU);
    EXPECT_EQ(level(3), 0x1234U);
    EXPECT_EQ(to(AlState::safeop), (AlStatus{AlState::safeop, false, 0}));
    EXPECT_EQ(level(1), 0U) << "safe outputs of both";
    EXPECT_EQ(level(3), 0U);
}

TEST_F(SplitIo, ACycleIsOneUpdate) {
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x1C15, 0, std::uint8_t{0}, 1s));
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x1C15, 1, std::uint16_t{0x1A02}, 1s));
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x1C15, 0, std::uint8_t{1}, 1s));
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    ASSERT_EQ(in().size(), 8U) << "the updates come with the analogue inputs";
    cycles(2);
    const auto before = load_le<std::uint16_t>(in(), 6);
    cycles(100);
    const auto updates = static_cast<std::uint16_t>(load_le<std::uint16_t>(in(), 6) - before);
    EXPECT_GE(updates, 100U);
    EXPECT_LE(updates, 101U);
}

TEST_F(SplitIo, TheAssignmentOfASyncManagerHasItsOwnRules) {
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x1C14, 0, std::uint8_t{0}, 1s));
    EXPECT_EQ(SDOwrite(ctx, 1, 0x1C14, 1, std::uint16_t{0x1A01}, 1s).error().detail, 0x06090030U) << "inputs";
    EXPECT_TRUE(SDOwrite(ctx, 1, 0x1C14, 1, std::uint16_t{0x1602}, 1s));
    EXPECT_TRUE(SDOwrite(ctx, 1, 0x1C14, 0, std::uint8_t{1}, 1s));
    EXPECT_EQ(SDOwrite(ctx, 1, 0x1C14, 1, std::uint16_t{0x1601}, 1s).error().code, Errc::sdo_abort) << "it is in use";
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    EXPECT_EQ(out().size(), 4U);
    store_le<std::int16_t>(out(), 2, 99);
    cycles(3);
    EXPECT_EQ(level(2), 99U);
    EXPECT_EQ(level(3), 0U);
}

// Without a PDO in SM4, SM2 alone drives the device.
TEST_F(SplitIo, AnAreaWithoutPdosIsLeftOut) {
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x1C14, 0, std::uint8_t{0}, 1s));
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x1C15, 0, std::uint8_t{0}, 1s));
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    EXPECT_EQ(out().size(), 2U);
    EXPECT_EQ(in().size(), 2U);
    store_le<std::uint16_t>(out(), 0, 0x0F0F);
    cycles(3);
    EXPECT_EQ(level(1), 0x0F0FU);
}

TEST_F(SplitIo, LosingAnySyncManagerEndsTheExchange) {
    for (const unsigned n : {2U, 3U, 4U, 5U}) {
        ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << n << told(1);
        deactivate(n);
        cycles(3);
        const auto now = *readstate(ctx);
        EXPECT_EQ(now.state, AlState::preop) << n;
        EXPECT_EQ(now.code, n % 2 == 0 ? 0x001D : 0x001E) << n;
        ASSERT_TRUE(reconfigure_slave(ctx, 1)) << n;
    }
}

TEST_F(SplitIo, TheWatchdogCountsEveryArea) {
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    osal.advance(500ms);
    EXPECT_EQ(*readstate(ctx), (AlStatus{AlState::safeop, true, 0x001B}));
}

}  // namespace
}  // namespace margay
