// Messages of any protocol: octets are unchanged in both directions, and the answer is selected by type and by a
// function.
#include "mailbox/mailbox_bus.hpp"

namespace margay {
namespace {

class RawMailTest : public testing::Test {
  protected:
    MailboxBus bus;
    ScriptedSlave& slave = bus.add_scripted(32, 0);  // a slave with a mailbox and without a protocol in its SII
    std::array<std::byte, 16> answer{};
    void SetUp() override {
        bus.start();
        bus.idle(5ms);
    }
    void answer_with(std::initializer_list<Mail> replies, MailboxType type) {
        const std::vector<Mail> all(replies);
        slave.on_mail = [this, all, type](const Mail&) {
            for (const Mail& one : all) slave.reply(one, type);
        };
    }
    Result<std::size_t> ask(MailboxType type, const Mail& message, Duration timeout = 300ms) {
        return raw_mail(*bus.ctx, 1, type, message, answer, timeout);
    }
};

constexpr MailboxType kOwn{9};  // a protocol that the library does not know

TEST_F(RawMailTest, SendsAnyTypeAndReceivesWhatAnswers) {
    answer_with({mail_bytes({4, 5})}, kOwn);
    const auto got = ask(kOwn, mail_bytes({1, 2, 3}));
    ASSERT_TRUE(got.ok()) << bus.words(got.error());
    EXPECT_EQ(*got, 2U);
    EXPECT_EQ(answer[1], std::byte{5});
    ASSERT_EQ(slave.received.size(), 1U);
    EXPECT_EQ(slave.received[0], mail_bytes({3, 0, 0, 0, 0, 0x19, 1, 2, 3}));
    // Checks priority and address of the mailbox header.
    RawMail gateway;
    gateway.slave = 1;
    gateway.type = kOwn;
    gateway.priority = 2;
    gateway.address = 0x2001;
    const Mail message = mail_bytes({7});
    gateway.message = message;
    ASSERT_TRUE(submit(*bus.ctx, gateway).ok());  // without a buffer for an answer the request ends when it was sent
    bus.run(gateway);
    EXPECT_EQ(gateway.state(), RequestState::success) << bus.words(gateway.error());
    bus.idle(2ms);
    EXPECT_EQ(slave.received.at(1), mail_bytes({1, 0, 0x01, 0x20, 0x80, 0x29, 7}));
}

// The frame with a message is lost. Mail that the slave sends meanwhile is not an answer to a message without an
// answer.
TEST_F(RawMailTest, ALostMessageWithoutAnAnswerTakesNoMail) {
    std::array<std::byte, 256> memory{};
    VoeInbox inbox(memory);
    inbox.only_slave = 1;
    inbox.look_every = 1ms;
    ASSERT_TRUE(listen(*bus.ctx, inbox).ok());
    bus.idle(5ms);
    const Mail message = mail_bytes({1, 0, 0, 0, 1, 0, 9});
    for (const bool malformed : {false, true}) {
        SCOPED_TRACE(malformed);
        slave.received.clear();
        RawMail request;
        request.slave = 1;
        request.type = MailboxType::voe;
        request.message = message;
        const auto resent = mailbox_statistics(*bus.ctx, 1)->resent;
        bus.nic->lose_out.insert(bus.nic->sent);
        ASSERT_TRUE(submit(*bus.ctx, request).ok());
        bus.step();
        slave.reply(malformed ? Mail{} : mail_bytes({1, 0, 0, 0, 1, 0, 7}), MailboxType::voe);
        bus.run(request);
        EXPECT_EQ(request.error().code, Errc::none) << bus.words(request.error());
        bus.idle(5ms);
        EXPECT_EQ(slave.received.size(), 1U);
        EXPECT_EQ(mailbox_statistics(*bus.ctx, 1)->resent, resent + 1);
        EXPECT_EQ(inbox.count(), 1U);
    }
}

TEST_F(RawMailTest, OtherTypesAndOtherMailAreNoAnswer) {
    slave.on_mail = [&](const Mail&) {
        slave.reply(mail_bytes({1}), MailboxType::foe);
        slave.reply(mail_bytes({2, 9}), kOwn);
        slave.reply(mail_bytes({3, 8}), kOwn);
    };
    struct ByOctet : RawMail {
        std::byte first{3};
    } request;
    request.is_answer = [](const RawMail& self, std::span<const std::byte> mail) {
        return mail[0] == static_cast<const ByOctet&>(self).first;
    };
    const Mail message = mail_bytes({0});
    request.slave = 1;
    request.type = kOwn;
    request.message = message;
    request.answer = answer;
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    bus.run(request);
    EXPECT_EQ(request.state(), RequestState::success) << bus.words(request.error());
    EXPECT_EQ(answer[1], std::byte{8});
    EXPECT_EQ(mailbox_statistics(*bus.ctx, 1)->unexpected, 2U);
    // Only other mail arrives until the timeout.
    slave.on_mail = [&](const Mail&) { slave.reply(mail_bytes({1}), MailboxType::foe); };
    EXPECT_EQ(bus.words(ask(kOwn, mail_bytes({1})).error()), "slave 1: receiving from the mailbox: timed out");
}

TEST_F(RawMailTest, WaitsForMailWithoutAMessage) {
    RawMail wait;
    wait.slave = 1;
    wait.type = kOwn;
    wait.answer = answer;
    wait.timeout = 1s;
    ASSERT_TRUE(submit(*bus.ctx, wait).ok());
    bus.idle(100ms);
    EXPECT_TRUE(wait.busy());
    slave.reply(mail_bytes({1, 2}), MailboxType::foe);
    slave.reply(mail_bytes({6, 7, 8}), kOwn);
    slave.reply(mail_bytes({9}), kOwn);
    bus.run(wait, 20ms);
    EXPECT_EQ(wait.state(), RequestState::success) << bus.words(wait.error());
    EXPECT_EQ(wait.bytes, 3U);
    EXPECT_EQ(answer[2], std::byte{8});
    EXPECT_TRUE(slave.received.empty());
    // The timeout has passed. A scan closes the mailbox.
    bus.idle(5ms);
    EXPECT_EQ(ask(kOwn, {}, 20ms).error().code, Errc::timeout);
    ASSERT_TRUE(submit(*bus.ctx, wait).ok());
    bus.idle(5ms);
    ScanRequest scan;
    ASSERT_TRUE(submit(*bus.ctx, scan).ok());
    bus.run(wait, 2s);
    EXPECT_EQ(wait.state(), RequestState::error);
    bus.run(scan);
}

// A slave answers to the address of the message.
TEST_F(RawMailTest, TheAnswerToAnAddressIsTaken) {
    std::uint16_t to = 0;
    slave.on_mail = [&](const Mail& mail) {
        slave.reply(mail_bytes({8}), kOwn, 0x3333);  // to another address
        slave.reply(mail_bytes({1, 2}), kOwn, to != 0 ? to : wire::load_mailbox_header(mail).address);
    };
    const Mail message = mail_bytes({7});
    for (const std::uint16_t address :
         {std::uint16_t{0x2001}, std::uint16_t{0x7777}, std::uint16_t{0x1001}, std::uint16_t{1}}) {
        RawMail gateway;
        gateway.slave = 1;
        gateway.type = kOwn;
        gateway.address = address;
        gateway.message = message;
        gateway.answer = answer;
        ASSERT_TRUE(submit(*bus.ctx, gateway).ok());
        bus.run(gateway);
        EXPECT_EQ(gateway.state(), RequestState::success) << bus.words(gateway.error());
        EXPECT_EQ(gateway.bytes, 2U);
        EXPECT_EQ(answer[1], std::byte{2});
    }
    EXPECT_EQ(mailbox_statistics(*bus.ctx, 1)->unexpected, 4U) << "the mail for somebody else";
    // Mail to another address than the address of the message is not an answer.
    to = 0x2002;
    RawMail gateway;
    gateway.slave = 1;
    gateway.type = kOwn;
    gateway.address = 0x2001;
    gateway.message = message;
    gateway.answer = answer;
    gateway.timeout = 50ms;
    ASSERT_TRUE(submit(*bus.ctx, gateway).ok());
    bus.run(gateway);
    EXPECT_EQ(gateway.error().code, Errc::timeout);
}

// Fragments: each mail announces that more mail follows, without a message in between.
TEST_F(RawMailTest, AnAnswerOfSeveralMails) {
    answer_with({mail_bytes({2, 10}), mail_bytes({1, 11}), mail_bytes({0, 12})}, kOwn);
    struct Parts : RawMail {
        mutable std::vector<std::byte> kept{};
    } request;
    request.more_follows = [](const RawMail& self, std::span<const std::byte> mail) {
        if (mail[0] != std::byte{0}) static_cast<const Parts&>(self).kept.push_back(mail[1]);
        return mail[0] != std::byte{0};
    };
    const Mail message = mail_bytes({7});
    request.slave = 1;
    request.type = kOwn;
    request.message = message;
    request.answer = answer;
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    bus.run(request);
    EXPECT_EQ(request.state(), RequestState::success) << bus.words(request.error());
    EXPECT_EQ(request.kept, mail_bytes({10, 11}));
    EXPECT_EQ(request.bytes, 2U);
    EXPECT_EQ(answer[1], std::byte{12});
    // The last mail does not come.
    answer_with({mail_bytes({1, 10})}, kOwn);
    request.timeout = 50ms;
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    bus.run(request);
    EXPECT_EQ(request.error().code, Errc::timeout);
    // A request without a message.
    request.message = {};
    request.kept.clear();
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    slave.reply(mail_bytes({1, 20}), kOwn);
    slave.reply(mail_bytes({0, 21}), kOwn);
    bus.run(request);
    EXPECT_EQ(request.state(), RequestState::success) << bus.words(request.error());
    EXPECT_EQ(request.kept, mail_bytes({20}));
    EXPECT_EQ(answer[1], std::byte{21});
}

TEST_F(RawMailTest, ASlaveWithAnotherStationAddressGetsNothing) {
    answer_with({mail_bytes({4})}, kOwn);
    const Mail message = mail_bytes({7});
    RawMail request;
    request.slave = 1;
    request.type = kOwn;
    request.message = message;
    request.answer = answer;
    request.station = StationAddress{0x1001};
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    bus.run(request);
    EXPECT_EQ(request.state(), RequestState::success) << bus.words(request.error());
    request.station = StationAddress{0x1002};
    EXPECT_EQ(
        bus.words(submit(*bus.ctx, request).error()),
        "slave 1: sending to the mailbox: there is no such slave (station address 0x1002 is wanted, and the slave "
        "has 0x1001)");
    EXPECT_EQ(slave.received.size(), 1U);
}

TEST_F(RawMailTest, AWaitGetsOnlyWhatNoListenerTakesAlsoOfLaterListeners) {
    struct Later final : MailListener {
        Later() : MailListener(kOwn) {}
        unsigned taken = 0;
        bool takes = true;
        bool take(const UnaskedMail&) override { return takes && ++taken != 0; }
    } later;
    RawMail wait;
    wait.slave = 1;
    wait.type = kOwn;
    wait.answer = answer;
    wait.timeout = 1s;
    ASSERT_TRUE(submit(*bus.ctx, wait).ok());
    bus.idle(5ms);
    ASSERT_TRUE(listen(*bus.ctx, later).ok());
    slave.reply(mail_bytes({1}), kOwn);
    bus.idle(20ms);
    EXPECT_EQ(later.taken, 1U);
    EXPECT_TRUE(wait.busy());
    later.takes = false;
    slave.reply(mail_bytes({2}), kOwn);
    bus.run(wait, 50ms);
    EXPECT_EQ(wait.state(), RequestState::success);
    EXPECT_EQ(answer[0], std::byte{2});
    EXPECT_EQ(later.taken, 1U);
}

TEST_F(RawMailTest, WrongArgumentsAreRefusedInWords) {
    EXPECT_EQ(bus.words(ask(kOwn, Mail(27)).error()),
              "slave 1: sending to the mailbox: argument out of range: the mailbox message is 27 octets, at most "
              "26 are possible");
    answer_with({mail_bytes({1})}, kOwn);
    EXPECT_TRUE(ask(kOwn, Mail(26)).ok());
    EXPECT_EQ(bus.words(ask(MailboxType::error, Mail(4)).error()),
              "slave 1: sending to the mailbox: argument out of range: the mailbox "
              "protocol must be 1 to 15 (of a listener 0 to 15)");
    EXPECT_EQ(ask(MailboxType{16}, Mail(4)).error().code, Errc::invalid_argument);
    RawMail nothing;
    nothing.slave = 1;
    EXPECT_EQ(bus.words(submit(*bus.ctx, nothing).error()),
              "slave 1: sending to the mailbox: argument out of range: the mailbox message is empty");
    nothing.slave = 2;
    EXPECT_EQ(submit(*bus.ctx, nothing).error().code, Errc::unknown_slave);
    // A slave without a mailbox.
    MailboxBus plain;
    plain.add_device(sim::make_device("digital_in_8").value());
    plain.segment.power_up(plain.osal.now());
    plain.cable = std::make_unique<SimulatedNic>(plain.segment, plain.osal);
    plain.nic = std::make_unique<LossyNic>(*plain.cable);
    plain.ctx = std::make_unique<HostContext>(Limits{.slaves = 1});
    ASSERT_TRUE(init(*plain.ctx, *plain.nic, plain.osal).ok());
    ASSERT_TRUE(config_init(*plain.ctx).ok());
    EXPECT_EQ(raw_mail(*plain.ctx, 1, kOwn, Mail(4), answer).error().code, Errc::unsupported);
}

TEST_F(RawMailTest, HostileAnswers) {
    answer_with({Mail(17, std::byte{1})}, kOwn);
    EXPECT_EQ(bus.words(ask(kOwn, Mail(4)).error()),
              "slave 1: receiving from the mailbox: not enough memory: the buffer of the call (needed "
              "17, there is room for 16)");
    answer_with({mail_bytes({0x01, 0x00, 0x02, 0x00})}, MailboxType::error);
    EXPECT_EQ(bus.words(ask(kOwn, Mail(4)).error()),
              "slave 1: receiving from the mailbox: mailbox error reply (detail 0x0002: the mailbox "
              "protocol is not supported)");
    answer_with({Mail{}}, kOwn);
    EXPECT_EQ(ask(kOwn, Mail(4)).error().code, Errc::protocol);
    slave.on_mail = [&](const Mail&) {
        Mail longer(6);
        wire::store_mailbox_header(longer, {.length = 27, .type = kOwn, .counter = 3});
        slave.put(longer);
    };
    EXPECT_EQ(ask(kOwn, Mail(4)).error().code, Errc::protocol);
    answer_with({mail_bytes({1})}, kOwn);
    EXPECT_TRUE(ask(kOwn, Mail(4)).ok());
}

// Two requests of one type are executed one after the other, because their answers could not be distinguished.
TEST_F(RawMailTest, OneAtATimeForEachProtocol) {
    slave.delay = 5ms;
    slave.on_mail = [&](const Mail& mail) { slave.reply({mail.begin() + 6, mail.end()}, kOwn); };
    std::array<RawMail, 4> requests;
    std::array<std::array<std::byte, 4>, 4> into{};
    std::array<Mail, 4> messages;
    for (std::size_t n = 0; n < 4; ++n) {
        messages[n] = mail_bytes({static_cast<unsigned>(n)});
        requests[n].slave = 1;
        requests[n].type = kOwn;
        requests[n].message = messages[n];
        requests[n].answer = into[n];
        ASSERT_TRUE(submit(*bus.ctx, requests[n]).ok());
    }
    for (std::size_t n = 0; n < 4; ++n) {
        bus.run(requests[n]);
        EXPECT_EQ(requests[n].state(), RequestState::success) << bus.words(requests[n].error());
        EXPECT_EQ(into[n][0], static_cast<std::byte>(n));
    }
}

}  // namespace
}  // namespace margay
