// Process data by SoE parameters, with slaves whose parameters the test sets.
#include "facts.hpp"
#include "mailbox/mailbox_bus.hpp"
#include "wire/soe.hpp"

#include <margay/entry.hpp>

#include <map>
#include <tuple>

namespace margay {
namespace {

using Key = std::tuple<unsigned, unsigned, unsigned>;  // drive, number of the IDN, element

class SoePdo : public testing::Test {
  protected:
    MailboxBus bus;
    ScriptedSlave& slave = bus.add_scripted(64, mailbox_protocol::kSoE, 0);
    std::map<Key, Mail> parameters;
    unsigned drives = 1;
    unsigned refusal = 0x800A;  // error code of drives that do not exist
    unsigned asked = 0;
    std::vector<std::byte> image = std::vector<std::byte>(256);

    void SetUp() override {
        slave.on_mail = [this](const Mail& mail) {
            ++asked;
            const auto h = wire::soe::load_header(Bytes(mail).subspan(wire::kMailboxHeaderBytes));
            ASSERT_EQ(h.opcode, wire::soe::Opcode::read_request);
            Mail reply(4);
            auto answer = h;
            answer.opcode = wire::soe::Opcode::read_response;
            const auto found = parameters.find({h.drive, h.idn().number(), h.elements});
            answer.error = found == parameters.end();
            wire::soe::store_header(reply, answer);
            const unsigned code = h.drive >= drives ? refusal : 0x1001;
            const Mail data = answer.error ? mail_bytes({code & 0xFF, code >> 8}) : found->second;
            reply.insert(reply.end(), data.begin(), data.end());
            slave.reply(reply, wire::MailboxType::soe);
        };
        for (unsigned drive = 0; drive < 8; ++drive) {
            for (const unsigned idn : {36U, 40U, 47U, 51U, 53U}) attribute(drive, idn, 4);
            attribute(drive, 80, 2);
            attribute(drive, 84, 2);
            attribute(drive, 134, 2);
            attribute(drive, 135, 2);
        }
        bus.start();
    }
    void attribute(unsigned drive, unsigned idn, std::uint8_t bytes, bool list = false) {
        Mail bits(4);
        store_le(bits, 0, soe_attribute_bits({.bytes = bytes, .list = list}));
        parameters[{drive, idn, soe_element::kAttribute}] = bits;
    }
    void type(unsigned drive, unsigned value) { parameters[{drive, 15, soe_element::kValue}] = mail_bytes({value, 0}); }
    void list(unsigned drive, unsigned idn, std::initializer_list<unsigned> idns) {
        Mail value = mail_bytes({static_cast<unsigned>(2 * idns.size()), 0, 64, 0});
        for (const unsigned one : idns) {
            value.push_back(static_cast<std::byte>(one));
            value.push_back(std::byte{0});
        }
        parameters[{drive, idn, soe_element::kValue}] = value;
    }
    // Maps the slave, and checks the bits of outputs and inputs and the source of the configuration.
    void expect_mapped(std::uint32_t outputs, std::uint32_t inputs,
                       ConfigurationSource source = ConfigurationSource::soe) {
        auto& config = bus.ctx->slave(1).config;
        config = {};
        EXPECT_TRUE(clear_error(*bus.ctx, 1));
        const auto mapped = config_map(*bus.ctx, image);
        ASSERT_TRUE(mapped.ok()) << bus.words(mapped.error());
        EXPECT_EQ(config.source, source);
        ASSERT_EQ(config.sm_count, 2);
        EXPECT_EQ(config.sms[0], (ProcessSm{2, Direction::outputs, 0x64, 0x2000, outputs}));
        EXPECT_EQ(config.sms[1], (ProcessSm{3, Direction::inputs, 0x20, 0x2100, inputs}));
        EXPECT_EQ(bus.ctx->slave(1).al.state, AlState::safeop);
    }
    // A drive with a wrong answer does not count as a slave without process data.
    void expect_unknown() {
        auto& config = bus.ctx->slave(1).config;
        config = {};
        EXPECT_TRUE(clear_error(*bus.ctx, 1));
        (void)config_map(*bus.ctx, image);
        EXPECT_EQ(config.source, ConfigurationSource::none);
        EXPECT_EQ(config.sm_count, 0);
        EXPECT_TRUE(bus.ctx->slave(1).pdos_failed);
        EXPECT_EQ(bus.ctx->slave(1).al.state, AlState::preop);
    }
};

TEST_F(SoePdo, TheConfigurableTelegramIsWhatTheListsSay) {
    type(0, 7);
    list(0, 16, {51, 84});
    list(0, 24, {47});
    expect_mapped(16 + 32, 16 + 32 + 16);
    EXPECT_EQ(bus.ctx->slave(1).error.code, Errc::none);
    EXPECT_EQ(bus.ctx->slave(1).image.outputs.bits, 48U);
    EXPECT_EQ(asked, 3U + 3 + 7);                   // type and lists, attributes, and the drives that do not exist
    EXPECT_LE(bus.ctx->arena_peak_bytes(), 7168U);  // of the 8192 octets per slave
    // Other bits of the telegram type have other meanings.
    type(0, 0xFF);
    list(0, 16, {135, 51});  // the status word is mapped once, listed or not
    list(0, 24, {134});
    expect_mapped(16, 16 + 32);
    list(0, 16, {});
    expect_mapped(16, 16);
    attribute(0, 200, 1, true);  // a list does not have a fixed length
    list(0, 16, {200, 84});
    expect_mapped(16, 32);
}

// IEC 61800-7-204, S-0-0015: bits besides control word and status word.
TEST_F(SoePdo, StandardTelegramsHaveFixedContents) {
    const std::array<std::pair<unsigned, unsigned>, 7> expected{
        {{0, 0}, {16, 0}, {32, 32}, {32, 32}, {32, 32}, {64, 64}, {32, 0}}};
    for (unsigned n = 0; n < expected.size(); ++n) {
        SCOPED_TRACE(n);
        type(0, n);
        expect_mapped(16 + expected[n].first, 16 + expected[n].second);
    }
    attribute(0, 51, 8);  // its own length in the attribute
    type(0, 4);
    expect_mapped(16 + 32, 16 + 64);
}

TEST_F(SoePdo, SeveralDrivesLieOneBehindTheOther) {
    drives = 3;
    type(0, 7);
    list(0, 16, {51, 40});
    list(0, 24, {47});
    type(1, 4);
    type(2, 0);
    expect_mapped(48 + 48 + 16, 80 + 48 + 16);
    // A gap in the drive numbers does not end the search; a drive without this parameter is ignored.
    drives = 8;
    refusal = 0x1001;
    parameters.erase({0, 15, soe_element::kValue});
    parameters.erase({0, 16, soe_element::kValue});
    type(7, 3);
    expect_mapped(48 + 16 + 48, 48 + 16 + 48);
}

TEST_F(SoePdo, ADriveWithoutTelegramTypeHasLists) {
    list(0, 16, {51});
    list(0, 24, {36, 80});
    expect_mapped(16 + 48, 16 + 32);
}

TEST_F(SoePdo, WithoutDrivesTheSiiCounts) {
    drives = 0;
    expect_mapped(0, 0, ConfigurationSource::sii);
    EXPECT_EQ(bus.ctx->slave(1).error.code, Errc::none);
}

TEST_F(SoePdo, WhatIsWrongIsNamed) {
    type(0, 7);
    list(0, 16, {51, 99});  // IDN 99 has no attribute
    list(0, 24, {47});
    expect_mapped(0, 0, ConfigurationSource::sii);
    EXPECT_EQ(bus.words(bus.ctx->slave(1).error),
              "slave 1: SoE read of S-0-0099, drive 0: the drive refused (error code 0x1001: no such IDN)");
    // the length is four octets, and only one of the two IDNs is present
    parameters[{0, 16, soe_element::kValue}] = mail_bytes({8, 0, 8, 0, 51, 0});
    expect_unknown();
    EXPECT_EQ(bus.ctx->slave(1).error.code, Errc::protocol);
    EXPECT_EQ(bus.ctx->slave(1).error.index, 16);
    // The list is longer than the master can store. The error gives its length.
    slave.on_mail = [this](const Mail&) {
        for (unsigned left = 4; left <= 4; --left) {
            Mail reply(54, std::byte{0});
            const Idn idn = Idn::standard(15);
            wire::soe::store_header(reply, {.opcode = wire::soe::Opcode::read_response,
                                            .incomplete = left != 0,
                                            .elements = soe_element::kValue,
                                            .number = left != 0 ? static_cast<std::uint16_t>(left) : idn.value});
            slave.reply(reply, wire::MailboxType::soe);
        }
    };
    expect_unknown();
    EXPECT_EQ(bus.ctx->slave(1).error.code, Errc::capacity);
    EXPECT_EQ(bus.ctx->slave(1).error.expected, 250U);
}

// Finding an entry changes nothing, and a refusal of the drive during the search is not an error of the slave.
TEST_F(SoePdo, ToFindAnEntryNotesNoRefusal) {
    type(0, 7);
    list(0, 16, {51, 99});  // IDN 99 has no attribute
    list(0, 24, {47});
    expect_mapped(0, 0, ConfigurationSource::sii);
    EXPECT_TRUE(clear_error(*bus.ctx, 1));
    while (bus.ctx->errors().take()) {
    }
    const unsigned before = asked;
    EXPECT_EQ(find_entry(*bus.ctx, 1, 0x7000, 1).error().code, Errc::entry_not_mapped);
    EXPECT_GT(asked, before);
    EXPECT_EQ(bus.ctx->slave(1).error.code, Errc::none) << bus.words(bus.ctx->slave(1).error);
    EXPECT_FALSE(bus.ctx->errors().take());
}

// Zeros in place of missing octets would mean other process data.
TEST_F(SoePdo, AnAnswerWithoutItsOctetsIsNoSize) {
    parameters[{0, 15, soe_element::kValue}] = mail_bytes({4});
    expect_unknown();
    EXPECT_EQ(bus.ctx->slave(1).error.code, Errc::wrong_size);
    EXPECT_EQ(bus.ctx->slave(1).error.index, 15);
    type(0, 7);
    list(0, 16, {51, 84});
    list(0, 24, {47});
    parameters[{0, 84, soe_element::kAttribute}] = Mail(3);
    expect_unknown();
    EXPECT_EQ(bus.words(bus.ctx->slave(1).error),
              "slave 1: SoE read of S-0-0084, drive 0: the size of the value differs from the requested size (expected "
              "4 octets, got 3)");
}

// When a slave has both, its dictionary is used.
TEST_F(SoePdo, CoeComesFirst) {
    MailboxBus both;
    both.add_stack(128);
    both.start();
    facts(both.ctx->slave(1)).mailbox.protocols |= mailbox_protocol::kSoE;
    ASSERT_TRUE(config_map(*both.ctx, image).ok());
    EXPECT_EQ(both.ctx->slave(1).config.source, ConfigurationSource::coe);
}

}  // namespace
}  // namespace margay
