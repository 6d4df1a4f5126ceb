// Late replies after lost frames, after silences of the slave, and after times in which the slave is slow. Each request
// has its own answer, whatever came before it.
#include "mailbox/slow_slave.hpp"

namespace margay {
namespace {

// SDO: 0x2000 and 0x2001 accept values below 10 after `slow`, and refuse other values. An upload of 0x2000 returns the
// number of its uploads. All other objects answer with four octets. A file contains the first letter of its name 20
// times; file "a" is slow.
class LateOrder : public testing::Test {
  protected:
    MailboxBus bus;
    SlowSlave slave{bus, 80};
    Duration slow = 300ms;
    Duration usual{0};
    unsigned asked = 0;
    std::array<std::byte, 100> file{};
    std::array<std::byte, 16> octets{};

    void SetUp() override {
        slave.answers = [this](MailboxType type, const Mail& mail) { return answer(type, mail); };
        bus.start();
    }
    SlowSlave::Answer answer(MailboxType type, const Mail& mail) {
        const Bytes data = Bytes(mail).subspan(wire::kMailboxHeaderBytes);
        const auto octet = [&](std::size_t n) { return std::to_integer<unsigned>(data[n]); };
        if (type == MailboxType::foe) {
            const FoeAsked file_asked(mail);
            if (file_asked.opcode != foe::Opcode::read) return {};
            const std::string content(20, text_of(file_asked.body)[0]);
            return {content[0] == 'a' ? slow : usual,
                    {foe_message(foe::Opcode::data, 1, std::as_bytes(std::span(content)))}};
        }
        if (type == MailboxType::soe && octet(2) != 100)  // the slave has no other parameter
            return {usual, {mail_bytes({0x12, octet(1), octet(2), octet(3), 1, 0x10})}};
        if (type == MailboxType::soe) return {slow, {mail_bytes({2, 0x40, 100, 0, ++asked, 0, 0, 0})}};
        if (type == MailboxType::eoe && octet(0) == 6)
            return {usual, {mail_bytes({7, 1, 0, 0, 2, 0, 0, 0, 1, 0, 0, 10})}};
        // The last octet of the address comes first.
        if (type == MailboxType::eoe)
            return {slow, {mail_bytes({3, 1, octet(8) == 99 ? 1U : 0U, octet(8) == 99 ? 2U : 0U})}};
        if (type == MailboxType::voe) return {slow, {mail_bytes({1, 0, 0, 0, 1, 0, ++asked})}};
        if (type != MailboxType::coe || octet(2) == 0x80) return {};
        if (octet(4) != 0x20) return {usual, {mail_bytes({0, 0x30, 0x43, octet(3), octet(4), octet(5), 1, 2, 3, 4})}};
        if (octet(2) >> 5 == 2) return {slow, {mail_bytes({0, 0x30, 0x4B, octet(3), 0x20, 0, ++asked, 0, 0, 0})}};
        if (octet(6) < 10) return {slow, {mail_bytes({0, 0x30, 0x60, octet(3), 0x20, 0, 0, 0, 0, 0})}};
        return {usual, {mail_bytes({0, 0x20, 0x80, octet(3), 0x20, 0, 0x30, 0, 9, 6})}};  // out of range
    }

    struct Read : FoeRead {
        Read(std::string_view file, MutableBytes memory) {
            slave = 1;
            name = file;
            data = memory;
        }
    };
    void begin(Request& request) {
        const auto done = submit(*bus.ctx, request);
        ASSERT_TRUE(done.ok()) << bus.words(done.error());
    }
    Error finish(Request& request) {
        begin(request);
        slave.run(request);
        return request.error();
    }
    // Checks that the slave refuses a write. This shows that the slave answers requests again.
    void refused(std::uint16_t object = 0x2000) {
        Write write(99, object);
        const Error error = finish(write);
        EXPECT_EQ(error.code, Errc::sdo_abort) << bus.words(error);
        EXPECT_EQ(error.detail, 0x06090030U);
    }
    void reads_b() {
        Read read("b", file);
        const Error error = finish(read);
        EXPECT_EQ(error.code, Errc::none) << bus.words(error);
        EXPECT_EQ(text_of(Bytes(file).first(read.bytes())), std::string(20, 'b'));
    }
    // Loses the frame with a mail that the slave sends on its own.
    void lose_other_mail() {
        slave.idle(5ms);
        bus.nic->lose_mail_from = 1;
        slave.say(mail_bytes({1, 0, 0, 0, 1, 0, 7}), MailboxType::voe);
        slave.idle(3ms);
        bus.nic->lose_mail_from = 0;
    }
};

// The slave needs longer than the library waits before it treats a reply as lost. So the slave gets the request twice.
TEST_F(LateOrder, BehindALostFrameWithOtherMail) {
    for (const bool repeats : {false, true})
        for (const bool queues : {false, true})
            for (const Duration time : {Duration(150ms), Duration(1s)}) {
                SCOPED_TRACE(testing::Message() << repeats << queues << time.count());
                slave.script().repeats = slave.script().forgets = repeats;
                slave.queues = queues;
                slow = time;
                Write write(1);
                begin(write);
                lose_other_mail();
                slave.run(write);
                EXPECT_EQ(write.error().code, Errc::none) << bus.words(write.error());
                refused();
                Read read("a", file);
                begin(read);
                lose_other_mail();
                slave.run(read);
                reads_b();
                slave.idle(5s);
            }
}

// The frame with the reply is lost, and the slave has put new mail into the mailbox. So it cannot repeat the reply.
TEST_F(LateOrder, AReplyIsLostBeforeOtherMail) {
    slow = 5ms;
    SdoUpload first;
    first.slave = 1;
    first.index = 0x2000;
    first.data = octets;
    EXPECT_EQ(finish(first).code, Errc::none);
    SdoUpload read;
    read.slave = 1;
    read.index = 0x2000;
    read.data = octets;
    bus.nic->keeps_mail = true;
    bus.nic->lose_mail_from = 1;
    const Time start = bus.osal.now();
    begin(read);
    while (bus.nic->mail.size() < 2) slave.step();
    slave.say(mail_bytes({1, 0, 0, 0, 1, 0, 7}), MailboxType::voe);
    bus.nic->lose_mail_from = 0;
    slave.run(read);
    EXPECT_EQ(read.error().code, Errc::none) << bus.words(read.error());
    EXPECT_EQ(std::to_integer<unsigned>(octets[0]), asked);
    EXPECT_LT(bus.osal.now() - start, 500ms);
}

// There is no supervision, and the slave keeps its state during the silence. The slave still answers the earlier
// request.
TEST_F(LateOrder, BehindASilence) {
    for (const bool of_file : {false, true})
        for (const bool queues : {false, true})
            for (const Duration time : {Duration(600ms), Duration(2s)}) {
                SCOPED_TRACE(testing::Message() << of_file << queues << time.count());
                slave.queues = queues;
                slow = time;
                slave.idle(100ms);
                Write write(1);
                Read read("a", file);
                Request& first = of_file ? static_cast<Request&>(read) : write;
                begin(first);
                slave.idle(10ms);
                bus.segment.set_cable({0, 0}, false);
                slave.idle(200ms);
                bus.segment.set_cable({0, 0}, true);
                while (first.busy()) {
                    slave.idle(50ms);
                    ReadStateRequest states;
                    (void)finish(states);
                }
                EXPECT_EQ(first.error().code, Errc::identity_unread) << bus.words(first.error());
                if (of_file)
                    reads_b();
                else
                    refused();
                slave.idle(5s);
            }
}

// For a while the slave is slower than the timeout. Later requests have their own answers.
TEST_F(LateOrder, AfterASlowSpell) {
    slave.queues = true;
    for (const Duration timeout : {Duration(60ms), Duration(80ms), Duration(100ms)})
        for (const Duration spell : {Duration(70ms), Duration(110ms), Duration(200ms)})
            for (const Duration pause : {Duration(100ms), Duration(1s)}) {
                SCOPED_TRACE(testing::Message() << timeout.count() << " " << spell.count() << " " << pause.count());
                for (unsigned n = 0; n < 24; ++n) {
                    usual = slow = n >= 4 && n < 7 ? spell : Duration(20ms);
                    const bool good = n % 2 == 0;
                    Write write(good ? 1 : 99, 0x2000, timeout);
                    const Error error = finish(write);
                    const Errc right = good ? Errc::none : Errc::sdo_abort;
                    EXPECT_TRUE(error.code == right || (error.code == Errc::timeout && n <= 16))
                        << n << ": " << bus.words(error);
                    slave.idle(pause);
                }
            }
}

// The request that was given up reads an object that the library also reads for itself.
TEST_F(LateOrder, BehindAReadOfTheDeviceType) {
    slave.queues = true;
    for (const Duration give_up : {Duration(20ms), Duration(50ms)}) {
        SCOPED_TRACE(give_up.count());
        slow = usual = 500ms;
        SdoUpload type;
        type.slave = 1;
        type.index = 0x1000;
        type.data = octets;
        type.timeout = give_up;
        EXPECT_EQ(finish(type).code, Errc::timeout);
        Write write(1, 0x2000, give_up);
        EXPECT_EQ(finish(write).code, Errc::timeout);
        refused();
        slave.idle(5s);
    }
}

TEST_F(LateOrder, BehindTwoObjectsThatWereGivenUp) {
    slave.queues = true;
    slow = 200ms;
    Write a(1, 0x2000, 50ms);
    EXPECT_EQ(finish(a).code, Errc::timeout);
    Write b(1, 0x2001, 50ms);
    EXPECT_EQ(finish(b).code, Errc::timeout);
    Write again(1, 0x2000, 150ms);
    (void)finish(again);
    refused(0x2001);
    refused();
}

// The late reply is in the mailbox when the next request begins, a minute later.
TEST_F(LateOrder, AMinuteLater) {
    slow = 700ms;
    for (const bool raw : {false, true}) {
        asked = 0;
        for (unsigned n = 1; n <= 3; ++n) {
            SCOPED_TRACE(testing::Message() << raw << n);
            const Mail question = mail_bytes({1, 0, 0, 0, 1, 0, 1});
            RawMail mail;
            mail.type = MailboxType::voe;
            mail.message = Bytes(question);
            mail.answer = octets;
            SoeRead soe;
            soe.idn = Idn{100};
            soe.data = octets;
            auto& request = raw ? static_cast<MailRequest&>(mail) : soe;
            request.slave = 1;
            if (n == 1) request.timeout = 500ms;
            const Error error = finish(request);
            EXPECT_EQ(error.code, n == 1 ? Errc::timeout : Errc::none) << bus.words(error);
            if (n != 1) {
                EXPECT_EQ(std::to_integer<unsigned>(octets[raw ? 6 : 0]), asked);
            }
            slave.idle(60s);
        }
    }
}

// Replies of CoE do not name the raw message that they answer.
TEST_F(LateOrder, OfRawCoe) {
    slow = 700ms;
    for (const bool queues : {false, true}) {
        slave.queues = queues;
        const Mail question = mail_bytes({0, 0x20, 0x40, 0, 0x20, 0, 0, 0, 0, 0});
        for (const bool first : {true, false}) {
            RawMail mail;
            mail.slave = 1;
            mail.type = MailboxType::coe;
            mail.message = Bytes(question);
            mail.answer = octets;
            if (first) mail.timeout = 100ms;
            const Error error = finish(mail);
            EXPECT_EQ(error.code, first ? Errc::timeout : Errc::none) << bus.words(error);
        }
        EXPECT_EQ(std::to_integer<unsigned>(octets[6]), asked);
        slave.idle(5s);
    }
}

struct ReadState : SoeRead {
    explicit ReadState(MutableBytes into) {
        slave = 1;
        idn = Idn::standard(100);
        data = into;
    }
};
struct SetIp : EoeSetIp {
    explicit SetIp(std::uint8_t last) {
        slave = 1;
        packed = true;
        ip.address = Ipv4Address{10, 0, 0, last};
    }
};

// The slave needs longer than the library waits before it treats a reply as lost. The slave answers both messages.
TEST_F(LateOrder, TheSecondAnswerToARequestThatWasRepeated) {
    slow = 300ms;
    slave.script().repeats = false;
    const auto repeated = [&](Request& request) {
        begin(request);
        slave.idle(50ms);
        lose_other_mail();
        slave.run(request);
        EXPECT_EQ(request.error().code, Errc::none) << bus.words(request.error());
        slave.idle(120ms);
    };
    ReadState first(octets);
    repeated(first);
    ReadState second(octets);
    EXPECT_EQ(finish(second).code, Errc::none);
    EXPECT_EQ(std::to_integer<unsigned>(octets[0]), asked);
    SetIp accepted(1);
    repeated(accepted);
    SetIp refused(99);
    EXPECT_EQ(finish(refused).code, Errc::eoe_error);
}

// Mail without data ends the waiting request. The answer to this request comes later.
TEST_F(LateOrder, TheAnswerBehindAMalformedMail) {
    const auto disturbed = [&](Request&& request, MailboxType type, Duration behind) {
        slow = 5ms + behind;
        begin(request);
        slave.idle(5ms);
        slave.say({}, type);
        slave.run(request);
        EXPECT_EQ(request.error().code, Errc::protocol) << bus.words(request.error());
    };
    for (const bool queues : {false, true})
        for (const Duration behind : {1ms, 30ms, 80ms}) {
            SCOPED_TRACE(testing::Message() << queues << behind.count());
            slave.queues = queues;
            disturbed(Write(1), MailboxType::coe, behind);
            refused();
            asked = 0;
            disturbed(ReadState(octets), MailboxType::soe, behind);
            ReadState second(octets);
            EXPECT_EQ(finish(second).code, Errc::none);
            EXPECT_EQ(octets[0], std::byte{2});
            disturbed(SetIp(1), MailboxType::eoe, behind);
            SetIp refused_ip(99);
            EXPECT_EQ(finish(refused_ip).code, Errc::eoe_error);
            disturbed(Read("a", file), MailboxType::foe, behind);
            reads_b();
        }
}

}  // namespace
}  // namespace margay
