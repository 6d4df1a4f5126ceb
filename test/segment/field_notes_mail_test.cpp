// Slaves with unusual mailboxes and dictionaries. The master gets the value, or an error that names the fault, and the
// next request works. test/README.md lists the field note of each test.
#include "segment/field_notes.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

class FieldNotesMail : public FieldNotes {
  protected:
    // Returns whether the 1024 octets of 0x2000 are read correctly.
    bool reads_block(std::size_t n) {
        std::vector<std::byte> block(1024);
        const auto read = SDOread(ctx, static_cast<std::uint16_t>(n), 0x2000, 0, false, block, 2s);
        EXPECT_TRUE(read) << words(read.error());
        for (std::size_t i = 0; i < block.size(); ++i)
            if (block[i] != static_cast<std::byte>(i)) return false;
        return read && *read == block.size();
    }
    Error block_error(std::size_t n) {
        std::vector<std::byte> block(1024);
        return SDOread(ctx, static_cast<std::uint16_t>(n), 0x2000, 0, false, block, 500ms).error();
    }
    bool reads_identity_whole(std::size_t n) {
        std::array<std::byte, 32> whole{};
        const auto read = SDOread(ctx, static_cast<std::uint16_t>(n), 0x1018, 0, true, whole, 2s);
        EXPECT_TRUE(read) << words(read.error());
        return read && *read == 18 && load_le<std::uint16_t>(whole) == 4 &&
               load_le<std::uint32_t>(whole, 6) == kProduct;
    }
};

// Deviations without effect: short and long values, complete access, and process data by the dictionary work.
TEST_F(FieldNotesMail, TheValueComesWhateverComesBeforeIt) {
    const std::string_view manners[] = {"old_mail",        "counter_zero",
                                        "replies_twice",   "emergency_first",
                                        "ethernet_first",  "mail_for_others",
                                        "foreign_replies", "mailbox_full",
                                        "slow_replies",    "no_size_indicated",
                                        "never_expedited", "segments_only",
                                        "small_segments",  "refuses_complete_access",
                                        "slow_firmware"};
    for (const auto name : manners) plug_odd({name});
    start();
    for (std::size_t n = 1; n <= std::size(manners); ++n) {
        SCOPED_TRACE(manners[n - 1]);
        for (int round = 0; round < 9; ++round) {  // more rounds than a counter has values
            const auto value = product(n);
            ASSERT_TRUE(value) << words(value.error());
            ASSERT_EQ(*value, kProduct);
        }
        EXPECT_TRUE(reads_identity_whole(n));
        const bool long_ones = manners[n - 1] != "slow_replies" && manners[n - 1] != "replies_twice";
        EXPECT_TRUE(!long_ones || reads_block(n));
        EXPECT_EQ(mailbox_statistics(ctx, static_cast<std::uint16_t>(n))->resent, 0U) << "nothing is written twice";
    }
    EXPECT_GE(emergencies(ctx, 4).count(), 9U);
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0}));
    for (std::size_t n = 1; n <= std::size(manners); ++n) {
        EXPECT_EQ(ctx.slave(n).config.source, ConfigurationSource::coe) << manners[n - 1] << ": " << told(n);
        EXPECT_TRUE(exchanges(n)) << manners[n - 1];
    }
}

TEST_F(FieldNotesMail, WhatIsWrongIsNamedInBoundedTime) {
    struct Case {
        std::string_view manner;
        Errc code;
        std::string_view says;
    };
    const Case cases[] = {
        {"never_replies", Errc::timeout, "0x2000"},       {"error_replies", Errc::mailbox_error, "mailbox error reply"},
        {"overlong_replies", Errc::protocol, "0x2000"},   {"empty_replies", Errc::protocol, "0x2000"},
        {"short_replies", Errc::protocol, "0x2000"},      {"empty_segments", Errc::protocol, "0x2000"},
        {"aborts_midway", Errc::sdo_abort, "abort code"}, {"toggle_stuck", Errc::protocol, "0x2000"},
    };
    for (const auto& c : cases) plug_odd({c.manner});
    plug_odd({});
    start();
    for (std::size_t n = 1; n <= std::size(cases); ++n) {
        const auto& c = cases[n - 1];
        const Time before = osal.now();
        const Error error = block_error(n);
        EXPECT_EQ(error.code, c.code) << c.manner << ": " << words(error);
        EXPECT_EQ(error.slave, n) << c.manner;
        EXPECT_NE(words(error).find(c.says), std::string::npos) << words(error);
        EXPECT_LE(osal.now() - before, 600ms) << c.manner;
    }
    // Devices that fail only at long values return short values.
    for (const std::size_t n : {6U, 7U, 8U}) EXPECT_EQ(*product(n), kProduct) << cases[n - 1].manner;
    EXPECT_TRUE(reads_block(std::size(cases) + 1));
}

TEST_F(FieldNotesMail, TheDictionarysPdosCountAndTheSiisWhereItHasNone) {
    plug_odd({"coe_disagrees"});
    plug_odd({"no_assignment"});
    plug_odd({"unpadded_complete_access"});
    start();
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1) << told(2) << told(3);
    EXPECT_EQ(ctx.slave(1).config.source, ConfigurationSource::coe);
    EXPECT_EQ(ctx.slave(1).image.outputs.bits, 128U) << "0x1601, not the 64 bits of the SII";
    EXPECT_EQ(ctx.slave(2).config.source, ConfigurationSource::sii);
    EXPECT_EQ(ctx.slave(2).image.outputs.bits, 64U);
    EXPECT_EQ(ctx.slave(2).error.code, Errc::none) << told(2);
    EXPECT_TRUE(exchanges(2));
    EXPECT_EQ(ctx.slave(3).config.source, ConfigurationSource::coe);
    EXPECT_TRUE(exchanges(3));
}

// A slave that does not answer is not a slave without process data: the SII does not replace the missing answer. For a
// slave that refuses the read, the SII is used.
TEST_F(FieldNotesMail, ASlaveThatDoesNotAnswerIsNoSlaveWithoutProcessData) {
    plug_odd({"never_replies"});
    plug_odd({"empty_replies"});
    plug_odd({"error_replies"});
    plug_odd({});
    start();
    (void)config_map(ctx, image);
    EXPECT_EQ(ctx.slave(1).error.code, Errc::timeout) << told(1);
    EXPECT_EQ(ctx.slave(2).error.code, Errc::protocol) << told(2);
    for (const std::size_t n : {1U, 2U}) {
        EXPECT_EQ(ctx.slave(n).al.state, AlState::preop) << n;
        EXPECT_TRUE(ctx.slave(n).pdos_failed) << n;
        EXPECT_FALSE(ctx.slave(n).takes_part) << n;
        EXPECT_EQ(ctx.slave(n).config.source, ConfigurationSource::none) << n << ": asked again the next time";
    }
    EXPECT_EQ(ctx.slave(3).config.source, ConfigurationSource::sii) << told(3);
    EXPECT_EQ(ctx.slave(3).al.state, AlState::safeop) << told(3);
    EXPECT_EQ(ctx.slave(4).config.source, ConfigurationSource::coe) << told(4);
    EXPECT_EQ(ctx.slave(4).al.state, AlState::safeop) << told(4);
    // The supervision does not bring it to OP without process data, either.
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx, supervision));
    cycles(500);
    EXPECT_EQ(ctx.slave(1).al.state, AlState::preop) << told(1);
    EXPECT_EQ(ctx.slave(2).al.state, AlState::preop) << told(2);
    EXPECT_EQ(ctx.slave(4).al.state, AlState::op) << told(4);
}

// Ten entries for a PDO of a device that accepts eight: the device refuses the ninth entry, and the error text names
// its index and subindex.
TEST_F(FieldNotesMail, ACapOnMappingEntriesIsNamed) {
    plug_odd({"few_mapping_entries", "refuses_complete_access"});
    start();
    std::array<std::byte, 2 + 10 * 4> mapping{std::byte{10}};
    for (std::size_t n = 0; n < 10; ++n)
        store_le<std::uint32_t>(mapping, 2 + n * 4, static_cast<std::uint32_t>(0x70000110 + (n << 8)));
    const auto refused = SDOwrite(ctx, 1, 0x1600, 0, true, mapping, 1s);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::sdo_abort) << words(refused.error());
    EXPECT_EQ(refused.error().index, 0x1600);
    EXPECT_EQ(refused.error().detail, 0x06040042U) << words(refused.error());
    mapping[0] = std::byte{8};
    const auto taken = SDOwrite(ctx, 1, 0x1600, 0, true, std::span(mapping).first(2 + 8 * 4), 1s);
    EXPECT_TRUE(taken) << words(taken.error());
    EXPECT_EQ(*SDOread<std::uint8_t>(ctx, 1, 0x1600, 0), 8);
    EXPECT_EQ(*SDOread<std::uint32_t>(ctx, 1, 0x1600, 8), 0x70000810U);
}

// In INIT the mailbox is not enabled. A master that knows the state refuses requests at once. If it has not read the
// state, the working counter shows that the mailbox is not enabled.
TEST_F(FieldNotesMail, AMailboxThatIsNotEnabledIsToldSo) {
    plug_odd({});
    start();
    ASSERT_TRUE(writestate(ctx, 1, AlState::init));
    cycles(20);
    const Time before = osal.now();
    const auto refused = SDOread<std::uint32_t>(ctx, 1, 0x1018, 2, 200ms);
    EXPECT_EQ(refused.error().code, Errc::mailbox_full) << words(refused.error());
    EXPECT_NE(words(refused.error()).find("not enabled in this AL state"), std::string::npos) << words(refused.error());
    EXPECT_LE(osal.now() - before, 250ms);
    ASSERT_EQ(statecheck(ctx, 1, AlState::init, 1s)->state, AlState::init);
    const Time known = osal.now();
    EXPECT_EQ(SDOread<std::uint32_t>(ctx, 1, 0x1018, 2, 200ms).error().code, Errc::wrong_state);
    EXPECT_EQ(osal.now(), known);
    ASSERT_TRUE(writestate(ctx, 1, AlState::preop));
    ASSERT_EQ(statecheck(ctx, 1, AlState::preop, 1s)->state, AlState::preop);
    EXPECT_EQ(*product(1), kProduct);
}

// An entry with index 0 is a gap, which occupies bits in the image.
TEST_F(FieldNotesMail, MailToASlaveWithoutPowerSaysThatItDoesNotAnswer) {
    plug_odd({});
    plug_odd({});
    start();
    segment.set_power(1, false, osal.now());
    EXPECT_EQ(words(SDOread<std::uint32_t>(ctx, 2, 0x1018, 1).error()),
              "slave 2: SDO upload of 0x1018:1: wrong working counter (expected 1, got 0): the slave does not answer");
    EXPECT_TRUE(readstate(ctx).ok());
    EXPECT_EQ(words(SDOread<std::uint32_t>(ctx, 2, 0x1018, 1).error()),
              "slave 2: SDO upload of 0x1018:1: the slave is missing");
}

TEST_F(FieldNotesMail, GapsOfAMappingTakeTheirBits) {
    plug_odd({});
    start();
    std::array<std::byte, 2 + 3 * 4> mapping{std::byte{3}};
    store_le<std::uint32_t>(mapping, 2, 0x70000110);
    store_le<std::uint32_t>(mapping, 6, 0x00000008);
    store_le<std::uint32_t>(mapping, 10, 0x70000210);
    ASSERT_TRUE(SDOwrite(ctx, 1, 0x1600, 0, std::uint8_t{0}));
    const auto written = SDOwrite(ctx, 1, 0x1600, 0, true, mapping, 1s);
    ASSERT_TRUE(written) << words(written.error());
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(1);
    EXPECT_EQ(ctx.slave(1).config.sms[0].bits, 40U);
    const auto out = ctx.slave(1).image.outputs.bytes;
    ASSERT_EQ(out.size(), 5U);
    out[0] = std::byte{0x11};
    out[2] = std::byte{0xEE};
    out[3] = std::byte{0x22};
    cycles(5);
    EXPECT_EQ(ctx.slave(1).image.inputs.bytes[0], std::byte{0x11});
    EXPECT_EQ(ctx.slave(1).image.inputs.bytes[2], std::byte{0x22}) << "the second word, behind the gap";
}

// The features of the ESC, or the application, declare that the ESC has no LRW.
TEST_F(FieldNotesMail, AnEscWithoutLrwIsExchangedByLrdAndLwr) {
    plug_odd({});
    plug_odd({"no_lrw"});
    start();
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(2);
    EXPECT_EQ(ctx.group(0).datagrams.size(), 2U);
    EXPECT_EQ(*cycle(), 4U);
    EXPECT_TRUE(exchanges(1));
    EXPECT_TRUE(exchanges(2));
    // An ESC without LRW whose features do not show this: the working counter of LRW is too low. With the flag in the
    // features it is right.
    segment.slave(1).registers().set<std::uint16_t>(wire::reg::kFeatures.address, 0x00FC);
    ASSERT_TRUE(config_init(ctx));
    map();
    cycles(2);
    const auto short_one = cycle();
    ASSERT_FALSE(short_one);
    EXPECT_EQ(short_one.error().expected, 6U);
    ASSERT_TRUE(config_init(ctx));
    ctx.slave(2).config.block_lrw = true;
    ASSERT_EQ(to_op(), (AlStatus{AlState::op, false, 0})) << told(2);
    EXPECT_TRUE(exchanges(2));
}

}  // namespace
}  // namespace margay
