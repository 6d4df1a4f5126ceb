// Replies that come late or twice. The library never accepts a reply to a request that was given up as the reply to the
// next request of the same kind, however long the slave works and whatever else was given up.
#include "mailbox/slow_slave.hpp"

namespace margay {
namespace {

class LateReply : public testing::Test {
  protected:
    MailboxBus bus;
    SlowSlave slave{bus};
    Duration slow = 30ms;
    std::string open;  // the file that is read
    std::size_t packet = 0;

    void SetUp() override {
        slave.answers = [this](MailboxType type, const Mail& mail) { return answer(type, mail); };
        bus.start();
    }
    // 0x2000 accepts the value 1 after `slow`, and refuses any other value at once. A file contains the first octet of
    // its name 20 times, or 100 times for a capital letter. The files 'a' and 'A' come after `slow`.
    SlowSlave::Answer answer(MailboxType type, const Mail& mail) {
        if (type == MailboxType::foe) return foe_answer(mail);
        const Bytes data = Bytes(mail).subspan(wire::kMailboxHeaderBytes);
        if (type == MailboxType::eoe) {
            if (data[0] != std::byte{6}) return {0ms, {mail_bytes({9, 1, 1, 0})}};  // the slave has no filter
            ++eoe_asked;
            return {eoe_asked == 1 ? slow : 1ms, {mail_bytes({7, 1, 0, 0, 2, 0, 0, 0, eoe_asked, 0, 0, 10})}};
        }
        if (type == MailboxType::voe) return {1ms, {mail_bytes({1, 0, 2, 0})}, MailboxType::error};
        if (type != MailboxType::coe || data[2] == std::byte{0x80}) return {};
        const auto index = load_le<std::uint16_t>(data, 3);
        const auto low = std::to_integer<unsigned>(data[3]);
        const auto high = std::to_integer<unsigned>(data[4]);
        if (index != 0x2000) return {0ms, {mail_bytes({0, 0x30, 0x43, low, high, 0, 1, 2, 3, 4})}};
        if (load_le<std::uint16_t>(data, 6) == 1) return {slow, {mail_bytes({0, 0x30, 0x60, 0, 0x20, 0, 0, 0, 0, 0})}};
        return {0ms, {mail_bytes({0, 0x20, 0x80, 0, 0x20, 0, 0x30, 0, 9, 6})}};  // the value is out of range
    }
    SlowSlave::Answer foe_answer(const Mail& mail) {
        const FoeAsked asked(mail);
        if (asked.opcode == foe::Opcode::read) {
            const char first = text_of(asked.body)[0];
            open = std::string(first < 'a' ? 100 : 20, first);
            packet = 1;
            return {first == 'a' || first == 'A' ? slow : 0ms, {part()}};
        }
        const bool next =
            asked.opcode == foe::Opcode::acknowledge && asked.word == packet && packet * 52 <= open.size();
        if (!next) return {};
        ++packet;
        return {0ms, {part()}};
    }
    Mail part() const {
        const std::string octets = open.substr((packet - 1) * 52, 52);
        return foe_message(foe::Opcode::data, static_cast<std::uint32_t>(packet), std::as_bytes(std::span(octets)));
    }
    unsigned eoe_asked = 0;

    struct Read : FoeRead {
        explicit Read(std::string_view file) {
            slave = 1;
            name = file;
            data = memory;
        }
        [[nodiscard]] std::string content() const { return text_of(Bytes(memory).first(bytes())); }
        std::array<std::byte, 400> memory{};
    };
    void begin(Request& request) {
        const auto done = submit(*bus.ctx, request);
        ASSERT_TRUE(done.ok()) << bus.words(done.error());
    }
    void refused() {
        Write second(2);
        begin(second);
        slave.run(second);
        EXPECT_EQ(second.error().code, Errc::sdo_abort) << bus.words(second.error());
        EXPECT_EQ(second.error().detail, 0x06090030U);
    }
    void reads(const char* name) {
        Read second(name);
        begin(second);
        slave.run(second);
        EXPECT_EQ(second.error().code, Errc::none) << bus.words(second.error());
        EXPECT_EQ(second.content(), std::string(name[0] < 'a' ? 100 : 20, name[0]));
    }
};

TEST_F(LateReply, IsNotTakenWhenAnotherProtocolIsGivenUpToo) {
    for (const bool queues : {false, true}) {
        slave.queues = queues;
        for (const bool file : {false, true}) {
            SCOPED_TRACE(testing::Message() << queues << file);
            Write write(1);
            Read read("a");
            std::array<std::byte, 4> memory{};
            AoeRead aoe;
            aoe.slave = 1;
            aoe.data = memory;
            aoe.target = {{{1, 2, 3, 4, 5, 6}}, 10};
            Request& first = file ? static_cast<Request&>(read) : write;
            begin(first);
            slave.idle(2ms);
            begin(aoe);
            slave.idle(3ms);
            first.cancel();
            aoe.cancel();
            if (file)
                reads("b");
            else
                refused();
            slave.idle(200ms);
        }
    }
}

// A write and a file are cancelled. The library remembers both late replies.
TEST_F(LateReply, IsNotTakenWhenSeveralAreGivenUp) {
    slave.queues = true;
    slow = 150ms;
    Write write(1);
    Read read("a");
    begin(write);
    begin(read);
    slave.idle(5ms);
    write.cancel();
    read.cancel();
    refused();
    reads("b");
}

TEST_F(LateReply, IsNotTakenBehindMailOfAnotherProtocol) {
    for (const bool file : {false, true}) {
        SCOPED_TRACE(file);
        slave.queues = true;
        Write write(1);
        Read read("a");
        Request& first = file ? static_cast<Request&>(read) : write;
        begin(first);
        slave.idle(3ms);
        first.cancel();
        slave.idle(1ms);
        slave.say(mail_bytes({1, 0, 0, 0, 1, 0, 7}), MailboxType::voe);
        slave.idle(2ms);
        if (file)
            reads("b");
        else
            refused();
        slave.idle(100ms);
    }
}

// The slave refuses a protocol that it does not have. Its error does not name the message.
TEST_F(LateReply, TheErrorOfAMessageThatWasGivenUpDoesNotEndTheNextRequest) {
    const auto message = mail_bytes({1, 2, 3, 4, 5, 6});
    for (const bool wants_answer : {false, true})
        for (unsigned steps = 0; steps < 12; ++steps) {
            SCOPED_TRACE(testing::Message() << wants_answer << " given up after " << steps << " steps");
            std::array<std::byte, 32> memory{};
            RawMail other;
            other.slave = 1;
            other.type = MailboxType::voe;
            other.message = message;
            if (wants_answer) other.answer = memory;
            begin(other);
            for (unsigned n = 0; n < steps; ++n) slave.step();
            other.cancel();
            slave.run(other);

            std::array<std::byte, 4> octets{};
            SdoUpload read;
            read.slave = 1;
            read.index = static_cast<std::uint16_t>(0x3000 + steps);
            read.data = octets;
            begin(read);
            slave.run(read);
            EXPECT_EQ(read.state(), RequestState::success) << bus.words(read.error());
            slave.idle(200ms);
        }
}

// A slave processes a write and a file at the same time, and refuses the file. This error ends the write, which is
// older, because the error does not name the message that it answers.
TEST_F(LateReply, OfAWriteThatTheErrorOfAnotherProtocolEnded) {
    slave.queues = true;
    Write write(1);
    Read read("a");
    begin(write);
    slave.idle(3ms);
    begin(read);
    slave.idle(3ms);
    slave.say(mail_bytes({1, 0, 2, 0}), MailboxType::error);
    slave.run(write);
    EXPECT_EQ(write.error().code, Errc::mailbox_error) << bus.words(write.error());
    refused();
    read.cancel();
}

// A fragment of a frame is not an answer to a request for the IP parameters.
TEST_F(LateReply, OfEoeIsNotTakenBehindAFrame) {
    slave.queues = true;
    EoeGetIp first;
    first.slave = 1;
    begin(first);
    slave.idle(3ms);
    first.cancel();
    slave.say(mail_bytes({0, 1, 0, 0, 1, 2, 3, 4}), MailboxType::eoe);
    slave.idle(2ms);
    EoeGetIp second;
    second.slave = 1;
    begin(second);
    slave.run(second);
    EXPECT_EQ(second.error().code, Errc::none) << bus.words(second.error());
    EXPECT_EQ(second.ip.address, (Ipv4Address{10, 0, 0, 2}));
}

// The slave may need any time, also longer than the timeout.
TEST_F(LateReply, OfASlowObjectIsNotTaken) {
    for (const bool queues : {false, true})
        for (const Duration takes : {Duration(150ms), Duration(1500ms)})
            for (const bool cancels : {false, true}) {
                SCOPED_TRACE(testing::Message() << queues << cancels << " " << takes.count());
                slave.queues = queues;
                slow = takes;
                Write first(1);
                if (!cancels) first.timeout = 100ms;
                begin(first);
                if (cancels) slave.idle(100ms);
                if (cancels) first.cancel();
                slave.run(first);
                refused();
                slave.idle(100ms);
            }
}

TEST_F(LateReply, OfAnObjectThatTakesLongerThanTheDefaultTimeout) {
    for (const bool queues : {false, true}) {
        SCOPED_TRACE(queues);
        slave.queues = queues;
        slow = 3100ms;
        Write first(1);
        begin(first);
        slave.run(first);
        EXPECT_EQ(first.error().code, Errc::timeout);
        refused();
        slow = 5s;  // also longer than the timeout of the second request
        Write again(1);
        begin(again);
        slave.run(again);
        EXPECT_EQ(again.error().code, Errc::timeout);
        Write early(2);
        early.timeout = 1s;
        begin(early);
        slave.run(early);
        EXPECT_EQ(early.error().code, Errc::timeout) << bus.words(early.error());
        refused();
    }
}

// Checks the abort of the first message octet by octet. A slave that has dropped the request does not delay other
// requests for long.
TEST_F(LateReply, TheFirstMessageIsAbortedAndARetryIsQuick) {
    slave.answers = [&](MailboxType type, const Mail& mail) -> SlowSlave::Answer {
        if (slave.received().size() == 1) return {};
        return answer(type, mail);
    };
    Write first(1);
    first.timeout = 50ms;
    begin(first);
    slave.run(first);
    EXPECT_EQ(first.error().code, Errc::timeout);
    const Time start = bus.osal.now();
    refused();
    EXPECT_LT(bus.osal.now() - start, 20ms);
    ASSERT_EQ(slave.received().size(), 4U);  // the abort, a question, the second write
    const Mail& abort = slave.received()[1];
    EXPECT_EQ(Mail(abort.begin() + 6, abort.end()), mail_bytes({0, 0x20, 0x80, 0, 0x20, 0, 0, 0, 0x04, 0x05}));
    refused();
    EXPECT_EQ(slave.received().size(), 5U) << "nothing is owed any more";
}

TEST_F(LateReply, OfASlowFileIsNotTaken) {
    for (const Duration takes : {Duration(250ms), Duration(900ms)})
        for (const bool cancels : {false, true})
            for (const bool queues : {false, true})
                for (const auto* name : {"b", "B"}) {
                    if (queues && !cancels) continue;  // only the time limit remains, see the next test
                    SCOPED_TRACE(testing::Message() << queues << cancels << name << takes.count());
                    slave.queues = queues;
                    slow = takes;
                    Read first("a");
                    if (!cancels) first.answer_timeout = 100ms;
                    begin(first);
                    if (cancels) slave.idle(100ms);
                    if (cancels) first.cancel();
                    slave.run(first);
                    reads(name);
                    slave.idle(100ms);
                }
}

// A slave with a queue answers long after the timeout. A file of one packet is read again.
TEST_F(LateReply, OfAFileOfOnePacketIsNotTaken) {
    slave.queues = true;
    for (const Duration takes : {Duration(250ms), Duration(700ms), Duration(12s)})
        for (const unsigned given_up : {1U, 2U}) {
            SCOPED_TRACE(testing::Message() << takes.count() << " " << given_up);
            slow = takes;
            for (unsigned n = 0; n < given_up; ++n) {
                Read first("a");
                first.answer_timeout = 100ms;
                begin(first);
                slave.run(first);
                EXPECT_EQ(first.error().code, Errc::timeout);
            }
            reads("b");
            reads("c");
            slave.idle(15s);
            reads("d");
        }
}

// After a late packet the read of a file of several packets is not successful. The next attempt succeeds.
TEST_F(LateReply, OfAFileOfOnePacketBeforeALongerFile) {
    slave.queues = true;
    slow = 700ms;
    Read first("a");
    first.answer_timeout = 100ms;
    begin(first);
    slave.run(first);
    slave.idle(200ms);
    Read second("B");
    begin(second);
    slave.run(second);
    EXPECT_EQ(second.error().code, Errc::protocol) << bus.words(second.error());
    slave.idle(200ms);
    reads("B");
}

// A slave has dropped the request. A file of one packet is read twice, until a file of several packets shows that no
// reply is late. Without an earlier timeout the file is read once.
TEST_F(LateReply, IsNotExpectedForEver) {
    reads("b");
    const auto mails = slave.received().size();
    slave.answers = [&](MailboxType type, const Mail& mail) -> SlowSlave::Answer {
        auto usual = answer(type, mail);
        return open[0] == 'a' ? SlowSlave::Answer{} : usual;
    };
    Read first("a");
    first.answer_timeout = 100ms;
    begin(first);
    slave.run(first);
    const auto of = [&](const char* name) {
        const auto before = slave.received().size();
        reads(name);
        return slave.received().size() - before;
    };
    slave.idle(200ms);
    EXPECT_EQ(of("b"), 2 * mails);
    (void)of("B");
    EXPECT_EQ(of("b"), mails);
}

// A slave with a queue answers long after the timeout. The read of a file whose first packet comes twice is not
// successful.
TEST_F(LateReply, OfAFileIsFoundWhenTheFirstPacketComesTwice) {
    slave.queues = true;
    slow = 700ms;
    Read first("A");
    first.answer_timeout = 100ms;
    begin(first);
    slave.run(first);
    slave.idle(200ms);
    Read second("B");
    begin(second);
    slave.run(second);
    EXPECT_EQ(second.error().code, Errc::protocol) << bus.words(second.error());
    slave.idle(200ms);
    reads("B");
}

// A slave that was busy answers twice. The second answer comes after the file.
TEST_F(LateReply, TheSecondAnswerBehindABusyFile) {
    for (const bool fails : {false, true}) {
        SCOPED_TRACE(fails);
        unsigned asked = 0;
        slave.answers = [&](MailboxType type, const Mail& mail) -> SlowSlave::Answer {
            auto usual = answer(type, mail);
            if (type != MailboxType::foe || FoeAsked(mail).opcode != foe::Opcode::read || open[0] != 'c') return usual;
            if (++asked == 1) return {0ms, {foe_busy(0, 0, "loading")}};
            if (fails) usual.mails[0] = foe_error(0x8001);
            usual.mails.push_back(usual.mails[0]);
            return usual;
        };
        Read first("c");
        begin(first);
        slave.run(first);
        EXPECT_EQ(first.error().code, fails ? Errc::foe_error : Errc::none) << bus.words(first.error());
        reads("B");
        reads("b");
    }
}

// The same with a slave that was not busy.
TEST_F(LateReply, AnErrorThatComesTwiceDoesNotEndTheNextFile) {
    slave.answers = [&](MailboxType type, const Mail& mail) -> SlowSlave::Answer {
        auto usual = answer(type, mail);
        if (open[0] == 'c' && !usual.mails.empty()) usual.mails = {foe_error(0x8001), foe_error(0x8001)};
        return usual;
    };
    Read first("c");
    begin(first);
    slave.run(first);
    EXPECT_EQ(first.error().code, Errc::foe_error);
    const Time start = bus.osal.now();
    reads("b");
    EXPECT_LT(bus.osal.now() - start, 20ms);
}

}  // namespace
}  // namespace margay
