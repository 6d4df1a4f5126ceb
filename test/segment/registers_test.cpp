// Registers by the public API: values, access during cycles, and refused accesses.
#include "segment/bench.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

class Registers : public SegmentTest {
  protected:
    void SetUp() override {
        plug_line({"coupler", "digital_in_8", "digital_out_8"});
        switch_on();
        ASSERT_TRUE(bring_up());
    }
};

TEST_F(Registers, AreReadAndWrittenOfTheSlaveThatIsNamed) {
    EXPECT_EQ(*read_register<std::uint16_t>(ctx, 2, 0x0010), 0x1002);  // its station address
    EXPECT_EQ(*read_register<std::uint16_t>(ctx, 3, 0x0010), 0x1003);
    ASSERT_TRUE(write_register<std::uint16_t>(ctx, 3, 0x0420, 0x1234));
    EXPECT_EQ(*read_register<std::uint16_t>(ctx, 3, 0x0420), 0x1234);
    EXPECT_NE(*read_register<std::uint16_t>(ctx, 2, 0x0420), 0x1234);
    // Many octets at once: the SyncManagers of the output terminal.
    std::array<std::byte, 32> all{};
    ASSERT_TRUE(read_register(ctx, 3, 0x0800, all));
    EXPECT_EQ(all[2], static_cast<std::byte>(*read_register<std::uint8_t>(ctx, 3, 0x0802)));
}

TEST_F(Registers, RideInTheFramesOfACycle) {
    std::array<std::byte, 64> image{};
    ASSERT_TRUE(config_map(ctx, image).ok());
    std::array<std::byte, 2> octets{};
    RegisterReadRequest request;
    request.slave = 2;
    request.address = 0x0010;
    request.data = octets;
    for (int n = 0; n < 4; ++n) {
        osal.advance(1ms);
        if (n == 2) {
            ASSERT_TRUE(submit(ctx, request));
            EXPECT_EQ(submit(ctx, request).error().code, Errc::busy);
        }
        (void)poll(ctx, osal.now());
        const auto frames = ctx.statistics().frames_sent;
        ASSERT_TRUE(send_processdata(ctx));
        EXPECT_EQ(*receive_processdata(ctx, 500us), ctx.group(0).expected_wkc);
        EXPECT_EQ(ctx.statistics().frames_sent - frames, 1U) << "none of its own";
    }
    (void)poll(ctx, osal.now());
    EXPECT_EQ(request.state(), RequestState::success);
    EXPECT_EQ(octets, (std::array{std::byte{0x02}, std::byte{0x10}}));
}

TEST_F(Registers, WhatIsWrongIsNamed) {
    EXPECT_EQ(words(read_register<std::uint8_t>(ctx, 4, 0x0000).error()),
              "slave 4: reading at register 0x0000: there is no such slave (there are 3)");
    std::array<std::byte, 1500> many{};
    const auto refused = [&](std::uint16_t address, std::size_t octets) {
        return read_register(ctx, 1, address, std::span(many).first(octets)).error().code;
    };
    EXPECT_EQ(words(read_register(ctx, 1, 0xFFFF, std::span(many).first(2)).error()),
              "slave 1: reading at register 0xffff: argument out of range: 1 to 1486 octets, and none beyond register "
              "0xffff");
    EXPECT_EQ(refused(0x1000, 0), Errc::invalid_argument);
    EXPECT_EQ(refused(0x1000, 1487), Errc::invalid_argument);
    EXPECT_EQ(refused(0xFFFF, 2), Errc::invalid_argument);
    EXPECT_EQ(write_register(ctx, 1, 0xFFFF, std::span(many).first(2)).error().code, Errc::invalid_argument);
    segment.set_power(2, false, osal.now());
    EXPECT_EQ(write_register<std::uint16_t>(ctx, 3, 0x0420, 1).error().code, Errc::working_counter);
    EXPECT_EQ(*read_register<std::uint16_t>(ctx, 2, 0x0010), 0x1002) << "and the others answer";
}

TEST(RegistersBeforeInit, AreRefused) {
    HostContext ctx{Limits{.slaves = 1}};
    EXPECT_EQ(read_register<std::uint8_t>(ctx, 1, 0x0000).error().code, Errc::wrong_state);
    EXPECT_EQ(write_register<std::uint8_t>(ctx, 1, 0x0000, 1).error().code, Errc::wrong_state);
}

// The words of the SII, by the public API.
class SiiWords : public Registers {
  protected:
    std::array<std::byte, 8> octets{};
    std::uint32_t end = 0;

    void SetUp() override {
        Registers::SetUp();
        end = ctx.slave(2).sii_bytes / 2;
        ASSERT_GT(end, 0x40U);
        octets.fill(std::byte{0x55});
    }
    Result<> read(std::uint32_t word, std::size_t count) {
        return read_sii(ctx, 2, word, std::span(octets).first(count));
    }
};

TEST_F(SiiWords, BeyondTheEndAreRefusedAndTheFirstOfThemIsNamed) {
    EXPECT_TRUE(read(end - 1, 2));
    octets.fill(std::byte{0x55});
    for (const std::uint32_t word : {end, 0x10000U, 0xFF'FFFFU, 0xFFFF'FFFFU}) {
        const auto refused = read(word, 2);
        EXPECT_EQ(refused.error().code, Errc::invalid_argument) << word;
        EXPECT_EQ(refused.error().word(), word);
        const auto unwritten = write_sii(ctx, 2, word, std::span(octets).first(2));
        EXPECT_EQ(unwritten.error().code, Errc::invalid_argument) << word;
        EXPECT_EQ(unwritten.error().word(), word);
    }
    const auto partly = read(end - 2, 8);
    EXPECT_EQ(partly.error().code, Errc::invalid_argument);
    EXPECT_EQ(partly.error().word(), end) << "the first word that does not exist";
    EXPECT_EQ(octets[0], std::byte{0x55}) << "nothing was read";
    EXPECT_EQ(words(write_sii(ctx, 2, 0x10000, std::span(octets).first(2)).error()),
              "slave 2: writing the SII at word 0x10000: argument out of range: beyond the end of the EEPROM, which "
              "has " +
                  std::to_string(end) + " words");
    EXPECT_EQ(words(read(0, 3).error()),
              "slave 2: reading the SII at word 0x0000: argument out of range: the SII is read and written in words, "
              "the data must have an even number of octets, at least 2");
}

TEST_F(SiiWords, BeyondTheDeclaredEndAreReadOnRequest) {
    SiiReadRequest request;
    request.slave = 2;
    request.word = end;
    request.data = std::span(octets).first(2);
    request.beyond_end = true;
    ASSERT_TRUE(submit(ctx, request));
    EXPECT_TRUE(wait(ctx, request));
    EXPECT_EQ(octets[0], std::byte{0xFF});
    request.word = 0xFFFF'FFFF;  // not even an address
    EXPECT_EQ(submit(ctx, request).error().word(), 0xFFFF'FFFFU);
    request.word = 0xFFFF'FFFE;
    octets.fill(std::byte{0x55});
    ASSERT_TRUE(submit(ctx, request));
    EXPECT_TRUE(wait(ctx, request));
    EXPECT_EQ(octets[0], std::byte{0xFF});
}

TEST_F(SegmentTest, WordsOfAnEepromOfUnknownSizeAreRead) {
    const auto blank =
        segment.add(std::make_unique<sim::Esc>(sim::et1100(), std::vector<std::byte>(2048, std::byte{0xFF})));
    ASSERT_TRUE(segment.connect_master({blank, 0}));
    switch_on();
    EXPECT_FALSE(bring_up()) << "a blank EEPROM";
    EXPECT_EQ(ctx.slave(1).sii_bytes, 0U);
    std::array<std::byte, 2> octets{};
    EXPECT_TRUE(read_sii(ctx, 1, 0x1'0000, octets));
    EXPECT_EQ(octets[0], std::byte{0xFF});
    EXPECT_EQ(read_sii(ctx, 1, 0xFFFF'FFFF, octets).error().code, Errc::invalid_argument) << "no address at all";
}

TEST_F(SiiWords, OfASlaveThatDoesNotAnswerAreNamedInFull) {
    segment.set_power(1, false, osal.now());
    SiiReadRequest request;
    request.slave = 2;
    request.word = 0x12'3456;
    request.data = std::span(octets).first(2);
    request.beyond_end = true;
    ASSERT_TRUE(submit(ctx, request));
    const auto silent = wait(ctx, request);
    EXPECT_EQ(silent.error().word(), 0x12'3456U);
    EXPECT_EQ(words(silent.error()),
              "slave 2: reading the SII at word 0x123456: wrong working counter (expected 1, got 0): the slave does "
              "not answer");
}

}  // namespace
}  // namespace margay
