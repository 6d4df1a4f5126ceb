// A mailbox error does not name the message that it answers. The slaves process several protocols at a time, drop
// messages, or refuse late. No request ends by the reply to an earlier request.
#include "mailbox/slow_slave.hpp"

namespace margay {
namespace {

class MailboxErrors : public testing::Test {
  protected:
    MailboxBus bus;
    ScriptedSlave& slave{bus.add_scripted(64)};
    std::function<void(MailboxType, Bytes)> answers;
    std::array<std::byte, 64> octets{};

    void SetUp() override {
        slave.on_mail = [this](const Mail& mail) {
            const auto header = wire::load_mailbox_header(mail);
            if (header.counter != 0 && header.counter == counter_) return;  // the same message again
            counter_ = header.counter;
            answers(header.type, Bytes(mail).subspan(wire::kMailboxHeaderBytes));
        };
        // The start of the master sends no messages that these tests check.
        answers = [](MailboxType, Bytes) {};
        bus.start();
        idle(200ms);
    }
    static unsigned octet(Bytes data, std::size_t at) { return std::to_integer<unsigned>(data[at]); }
    static bool is_sdo(MailboxType type, Bytes data) { return type == MailboxType::coe && octet(data, 2) != 0x80; }
    void reply(Duration after, const Mail& mail, MailboxType type) {
        replies_.push_back({bus.osal.now() + after, mail, type});
    }
    void refuse_message(Duration after) { reply(after, mail_bytes({1, 0, 2, 0}), MailboxType::error); }
    // The slave answers in order, one message after the other. Objects of 0x20xx accept values below 10, other objects
    // are read.
    void reply_in_order(Duration time, const Mail& mail, MailboxType type) {
        const Time now = bus.osal.now();
        free_ = std::max(free_, now) + time;
        reply(free_ - now, mail, type);
    }
    void answer_sdo(Bytes data, Duration time) { reply_in_order(time, sdo_answer(data), MailboxType::coe); }
    void refuse_in_order(Duration time) { reply_in_order(time, mail_bytes({1, 0, 2, 0}), MailboxType::error); }
    static bool is_good_write(Bytes data) { return octet(data, 4) == 0x20 && octet(data, 6) < 10; }
    void step() {
        for (std::size_t n = 0; n < replies_.size();) {
            if (bus.osal.now() < replies_[n].due) {
                ++n;
                continue;
            }
            slave.reply(replies_[n].mail, replies_[n].type);
            replies_.erase(replies_.begin() + static_cast<std::ptrdiff_t>(n));
        }
        bus.step();
    }
    void idle(Duration time) {
        for (const Time end = bus.osal.now() + time; bus.osal.now() < end;) step();
    }
    Error run(const Request& request) {
        for (const Time end = bus.osal.now() + 60s; request.busy() && bus.osal.now() < end;) step();
        EXPECT_FALSE(request.busy());
        return request.error();
    }
    void begin(Request& request) {
        const auto done = submit(*bus.ctx, request);
        ASSERT_TRUE(done.ok()) << bus.words(done.error());
    }
    Error finish(Request& request) {
        begin(request);
        return run(request);
    }
    void expect_refused(std::uint16_t object) {
        Write write(99, object, 0ms);
        const Error error = finish(write);
        EXPECT_EQ(error.code, Errc::sdo_abort) << bus.words(error);
    }

    struct Read : FoeRead {
        Read(MutableBytes memory, Duration most) {
            slave = 1;
            name = "b";
            data = memory;
            answer_timeout = most;
        }
    };

  private:
    struct Reply {
        Time due;
        Mail mail;
        MailboxType type;
    };
    static Mail sdo_answer(Bytes data) {
        const unsigned low = octet(data, 3);
        const unsigned high = octet(data, 4);
        if (high != 0x20) return mail_bytes({0, 0x30, 0x43, low, high, octet(data, 5), 1, 2, 3, 4});
        if (octet(data, 2) >> 5 == 2) return mail_bytes({0, 0x30, 0x43, low, high, 0, 1, 2, 3, 4});
        if (octet(data, 6) < 10) return mail_bytes({0, 0x30, 0x60, low, high, 0, 0, 0, 0, 0});
        return mail_bytes({0, 0x20, 0x80, low, high, 0, 0x30, 0, 9, 6});  // out of range
    }
    std::vector<Reply> replies_;
    std::uint8_t counter_ = 0;
    Time free_{};
};

// The slave still processes the write when the error of the file ends it.
TEST_F(MailboxErrors, OfAFileWhileAWriteIsAtWork) {
    answers = [this](MailboxType type, Bytes data) {
        if (type == MailboxType::foe && octet(data, 0) == 1) refuse_message(1ms);
        if (is_sdo(type, data)) answer_sdo(data, is_good_write(data) ? 500ms : 1ms);
    };
    Write write(1, 0x2000, 0ms);
    begin(write);
    idle(5ms);
    Read read(octets, 1s);
    begin(read);
    EXPECT_EQ(run(write).code, Errc::mailbox_error);
    expect_refused(0x2000);
    (void)run(read);
}

// The error comes while the library waits for the answer to a question.
TEST_F(MailboxErrors, OfAFileWhileAQuestionWaits) {
    answers = [this](MailboxType type, Bytes data) {
        if (type == MailboxType::foe && octet(data, 0) == 1) refuse_message(1ms);
        if (is_sdo(type, data)) answer_sdo(data, is_good_write(data) ? 500ms : 1ms);
    };
    Write write(1, 0x2000, 100ms);
    EXPECT_EQ(finish(write).code, Errc::timeout);
    Write second(99, 0x2000, 0ms);
    begin(second);
    idle(150ms);
    Read read(octets, 1s);
    begin(read);
    const Error error = run(second);
    EXPECT_EQ(error.code, Errc::sdo_abort) << bus.words(error);
    (void)run(read);
}

// A late mailbox error refuses an object whose request was given up. Meanwhile another object is written.
TEST_F(MailboxErrors, OfAnObjectThatWasGivenUp) {
    answers = [this](MailboxType type, Bytes data) {
        if (!is_sdo(type, data)) return;
        if (octet(data, 4) == 0x20 && octet(data, 3) == 0) return refuse_message(300ms);
        answer_sdo(data, 310ms);
    };
    Write write(1, 0x2000, 50ms);
    EXPECT_EQ(finish(write).code, Errc::timeout);
    idle(150ms);
    Write other(1, 0x2001, 0ms);
    (void)finish(other);
    expect_refused(0x2001);
}

// Each request has its own error, at once.
TEST_F(MailboxErrors, OfSeveralProtocolsAtOnce) {
    answers = [this](MailboxType, Bytes) { refuse_message(1ms); };
    const Mail question = mail_bytes({1, 0, 0, 0, 1, 0, 1});
    std::array<std::byte, 16> answer{};
    std::array<std::byte, 4> value{};
    RawMail mail;
    mail.slave = 1;
    mail.type = MailboxType::voe;
    mail.message = Bytes(question);
    mail.answer = answer;
    SoeRead soe;
    soe.slave = 1;
    soe.idn = Idn{100};
    soe.data = value;
    SdoUpload sdo;
    sdo.slave = 1;
    sdo.index = 0x2000;
    sdo.data = octets;
    const Time start = bus.osal.now();
    for (Request* request : {static_cast<Request*>(&mail), static_cast<Request*>(&soe), static_cast<Request*>(&sdo)})
        begin(*request);
    for (Request* request : {static_cast<Request*>(&mail), static_cast<Request*>(&soe), static_cast<Request*>(&sdo)})
        EXPECT_EQ(run(*request).code, Errc::mailbox_error) << bus.words(request->error());
    EXPECT_LT(bus.osal.now() - start, 20ms);
}

// The slave queues messages. The errors of messages that were given up come before the confirmation of a write that was
// also given up.
TEST_F(MailboxErrors, OfAQueueAreNoAnswersToQuestions) {
    for (const unsigned errors : {2U, 3U, 7U}) {
        SCOPED_TRACE(errors);
        unsigned refused = 0;
        answers = [&](MailboxType type, Bytes data) {
            if (type == MailboxType::voe) refuse_in_order(refused++ == 0 ? 2s : 20ms);
            if (is_sdo(type, data)) answer_sdo(data, is_good_write(data) ? 300ms : 1ms);
        };
        const Mail question = mail_bytes({1, 0, 0, 0, 1, 0, 1});
        while (refused < errors) {
            RawMail mail;
            mail.slave = 1;
            mail.type = MailboxType::voe;
            mail.message = Bytes(question);
            mail.answer = octets;
            mail.timeout = 20ms;
            EXPECT_EQ(finish(mail).code, Errc::timeout);
            idle(120ms);
        }
        Write write(1, 0x2000, 50ms);
        EXPECT_EQ(finish(write).code, Errc::timeout);
        idle(200ms);
        Error error{.code = Errc::mailbox_error};
        for (unsigned n = 0; n < 3 && error.code == Errc::mailbox_error; ++n) {
            Write second(99, 0x2000, 0ms);
            error = finish(second);
        }
        EXPECT_EQ(error.code, Errc::sdo_abort) << bus.words(error);
        idle(2s);
    }
}

// Requests of protocols that have no message to end a request. The slave refuses them while it processes another
// request.
TEST_F(MailboxErrors, OfRequestsThatWereGivenUpLongAgo) {
    std::array<std::byte, 4> value{};
    SoeRead soe;
    soe.idn = Idn{100};
    soe.data = value;
    AoeRead aoe;
    aoe.target = {{{10, 0, 0, 1, 2, 1}}, 1001};
    aoe.data = value;
    for (MailRequest* first : {static_cast<MailRequest*>(&soe), static_cast<MailRequest*>(&aoe)}) {
        answers = [&](MailboxType type, Bytes data) {
            if (type != MailboxType::coe) refuse_in_order(1s);
            if (is_sdo(type, data)) answer_sdo(data, is_good_write(data) ? 300ms : 1ms);
        };
        first->slave = 1;
        first->timeout = 50ms;
        EXPECT_EQ(finish(*first).code, Errc::timeout);
        idle(500ms);
        Write write(1, 0x2000, 0ms);
        EXPECT_EQ(finish(write).code, Errc::mailbox_error);
        expect_refused(0x2000);
        // The mailbox is opened again, so the library knows nothing of earlier messages.
        ASSERT_TRUE(set_target(*bus.ctx, 1, AlState::init).ok());
        ASSERT_TRUE(set_target(*bus.ctx, 1, AlState::preop).ok());
        idle(2s);
    }
}

// A slave drops all messages for 2 s. Each time another object is read.
TEST_F(MailboxErrors, ASlaveThatDropsMessagesIsUsedAgainAtOnce) {
    Time until{};
    answers = [&](MailboxType type, Bytes data) {
        if (!is_sdo(type, data)) return;
        if (until == Time{}) until = bus.osal.now() + 2s;
        if (bus.osal.now() >= until) answer_sdo(data, 1ms);
    };
    const Time start = bus.osal.now();
    for (bool done = false; !done && bus.osal.now() < start + 20s;) {
        Write write(1, 0x2000, 100ms);
        done = finish(write).code == Errc::none;
    }
    EXPECT_LT(bus.osal.now() - start, 2200ms);
}

TEST_F(MailboxErrors, RawCoeDoesNotGetTheAnswerOfAQuestion) {
    answers = [this](MailboxType type, Bytes data) {
        if (is_sdo(type, data)) answer_sdo(data, 120ms);
    };
    for (int n = 0; n < 2; ++n) {
        Write write(1, 0x2000, 50ms);
        EXPECT_EQ(finish(write).code, Errc::timeout);
    }
    idle(60ms);
    const Mail question = mail_bytes({0, 0x20, 0x40, 1, 0x20, 0, 0, 0, 0, 0});
    RawMail mail;
    mail.slave = 1;
    mail.type = MailboxType::coe;
    mail.message = Bytes(question);
    mail.answer = octets;
    const Error error = finish(mail);
    EXPECT_EQ(error.code, Errc::none) << bus.words(error);
    EXPECT_EQ(load_le<std::uint16_t>(Bytes(octets), 3), 0x2001);
}

// A boot loader needs 5 s for the first message, and is busy once.
TEST_F(MailboxErrors, AFileDoesNotWaitForTheSlowestAnswerOfTheFileBefore) {
    unsigned packets = 0;
    answers = [&](MailboxType type, Bytes data) {
        if (type != MailboxType::foe) return;
        if (octet(data, 0) == 2) reply(5s, foe_message(foe::Opcode::acknowledge, 0), type);
        if (octet(data, 0) == 3)
            reply(1ms, packets++ == 0 ? foe_busy(0, 100) : foe_message(foe::Opcode::acknowledge, 1), type);
        if (octet(data, 0) == 1) reply(1ms, foe_message(foe::Opcode::data, 1, Bytes(octets).first(8)), type);
    };
    const auto content = pattern(20);
    FoeWrite write;
    write.slave = 1;
    write.name = "fw";
    write.data = Bytes(content);
    EXPECT_EQ(finish(write).code, Errc::none) << bus.words(write.error());
    const Time start = bus.osal.now();
    std::array<std::byte, 64> memory{};
    Read read(memory, 3s);
    EXPECT_EQ(finish(read).code, Errc::none) << bus.words(read.error());
    EXPECT_LT(bus.osal.now() - start, 200ms);
}

}  // namespace
}  // namespace margay
