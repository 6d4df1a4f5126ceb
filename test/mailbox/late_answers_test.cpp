// Answers of EoE and SoE that come long after their request was given up. These answers do not name the request. The
// library never accepts one of them as the answer to another request.
#include "mailbox/slow_slave.hpp"

#include <margay/eoe.hpp>
#include <margay/soe.hpp>

#include <random>

namespace margay {
namespace {

constexpr std::uint16_t kNumber = 0x0FFF;  // of an IDN in its set

class LateAnswers : public testing::Test {
  protected:
    MailboxBus bus;
    SlowSlave slave{bus, 200};  // octets of a mailbox
    Duration slow = 1ms;        // for each parameter that is read or written
    bool answers_questions = true;
    bool reads_address = false;  // the library then sends another question
    Duration usual = 1ms;        // for each question
    unsigned lost = 0;           // number of the next answers that are lost
    unsigned asked = 0;          // parameters that were requested, without the questions of the library
    unsigned questions = 0;      // questions of the library
    std::array<std::byte, 8> octets{};

    void SetUp() override {
        slave.answers = [this](MailboxType type, const Mail& mail) {
            SlowSlave::Answer full = answer(type, mail);
            if (lost == 0) return full;
            --lost;
            return SlowSlave::Answer{};
        };
        bus.start();
        slave.queues = true;
    }
    // The value of a parameter is the number of requests so far, in one mail or in two mails. The slave accepts values
    // below 90. It accepts an address below 90, and a read of the address returns the number of requests.
    SlowSlave::Answer answer(MailboxType type, const Mail& mail) {
        const Bytes data = Bytes(mail).subspan(wire::kMailboxHeaderBytes);
        if (type == MailboxType::soe) return answer_drive(data);
        if (type != MailboxType::eoe) return {};
        const auto octet = [&](std::size_t n) { return std::to_integer<unsigned>(data[n]); };
        switch (octet(0) & 0xFU) {
            case 2: ++asked; return {slow, {mail_bytes({3, 1, octet(8) >= 90 ? 1U : 0U, octet(8) >= 90 ? 2U : 0U})}};
            case 6:
                if (reads_address) return {slow, {mail_bytes({7, 1, 0, 0, 2, 0, 0, 0, ++asked, 0, 0, 10})}};
                ++questions;
                if (!answers_questions) return {};
                return {usual, {mail_bytes({7, 1, 0, 0, 2, 0, 0, 0, 1, 0, 0, 10})}};
            case 8:  // a filter, which the slave does not have
                ++questions;
                if (!answers_questions) return {};
                return {usual, {mail_bytes({9, 1, 1, 0})}};
            default: return {};
        }
    }

    SlowSlave::Answer answer_drive(Bytes data) {
        const auto header = wire::soe::load_header(data);
        const auto low = std::to_integer<unsigned>(data[0]);
        const auto number = std::to_integer<unsigned>(data[2]);
        const auto high = std::to_integer<unsigned>(data[3]);
        if ((header.number & kNumber) == 0) {  // no parameter has this number
            ++questions;
            if (!answers_questions) return {};
            return {usual, {mail_bytes({low + 0x11U, 1, number, high, 1, 0x10})}};
        }
        ++asked;
        if (header.opcode == wire::soe::Opcode::read_request) {
            if (header.number != 200) return {slow, {mail_bytes({low + 1U, 0x40, number, high, asked, 0, 0, 0})}};
            return {slow,
                    {mail_bytes({low + 9U, 0x40, 1, 0, asked, 0, 0, 0}),
                     mail_bytes({low + 1U, 0x40, number, high, asked, 0, 0, 0})}};
        }
        const bool accepts = std::to_integer<unsigned>(data[4]) < 90;
        if (accepts) return {slow, {mail_bytes({low + 1U, 0x40, number, high})}};
        return {slow, {mail_bytes({low + 0x11U, 0x40, number, high, 8, 0x70})}};
    }

    Error finish(Request& request) {
        const auto begun = submit(*bus.ctx, request);
        EXPECT_TRUE(begun.ok()) << bus.words(begun.error());
        slave.run(request);
        return request.error();
    }
    // The number of requests that the slave has received, without the questions of the library.
    [[nodiscard]] unsigned sent(MailboxType type) const {
        return static_cast<unsigned>(std::ranges::count_if(slave.received(), [&](const Mail& mail) {
            const Bytes data = Bytes(mail).subspan(wire::kMailboxHeaderBytes);
            if (wire::load_mailbox_header(mail).type != type) return false;
            if (type == MailboxType::soe) return (wire::soe::load_header(data).number & kNumber) != 0;
            return (std::to_integer<unsigned>(data[0]) & 0xFU) == 6;
        }));
    }
    // The library waits half of the time limit for the answer to its question. The slave answers in order, so it
    // answers the question in time when the late answer needs kWithin, and not in time when it needs kBeyond.
    static constexpr Duration kWithin = 2s;
    static constexpr Duration kBeyond = 7s;
    Error finish_late(Request& request) {
        request.timeout = 10s;
        return finish(request);
    }
    // The slave needs `work` for the answer, and the library gives up the request before the answer.
    void times_out(Request&& request, Duration work) {
        slow = work;
        request.timeout = 50ms;
        const Error error = finish(request);
        EXPECT_EQ(error.code, Errc::timeout) << bus.words(error);
        slave.idle(110ms);
        slow = 1ms;
    }
    struct ReadParameter : SoeRead {
        ReadParameter(MutableBytes into, unsigned number, std::uint8_t of = 0) {
            slave = 1;
            drive = of;
            idn = Idn::standard(number);
            data = into;
        }
    };
    struct WriteParameter : SoeWrite {
        explicit WriteParameter(unsigned v) : value{static_cast<std::byte>(v), std::byte{0}} {
            slave = 1;
            idn = Idn::standard(100);
            data = value;
        }
        std::array<std::byte, 2> value;
    };
    struct SetIp : EoeSetIp {
        explicit SetIp(std::uint8_t last) {
            slave = 1;
            packed = true;
            ip.address = Ipv4Address{10, 0, 0, last};
        }
    };
    struct GetIp : EoeGetIp {
        GetIp() { slave = 1; }
    };
};

// One request, or several requests, are given up. The slave answers them later than any time limit of the library.
TEST_F(LateAnswers, OfAParameterThatWasRead) {
    for (const bool question : {false, true})
        for (const unsigned number : {100U, 200U})
            for (unsigned given_up = 1; given_up <= 3; ++given_up) {
                SCOPED_TRACE(testing::Message() << question << ' ' << number << ' ' << given_up);
                answers_questions = question;
                for (unsigned n = 0; n < given_up; ++n)
                    times_out(ReadParameter(octets, number), question ? kWithin : kBeyond);
                const unsigned before = sent(MailboxType::soe);
                ReadParameter second(octets, number);
                const Error error = finish_late(second);
                EXPECT_EQ(error.code, Errc::none) << bus.words(error);
                EXPECT_GT(std::to_integer<unsigned>(octets[0]), before);
                slave.idle(10s);
            }
}

TEST_F(LateAnswers, OfAParameterThatWasWritten) {
    for (const bool question : {false, true})
        for (unsigned given_up = 1; given_up <= 3; ++given_up) {
            SCOPED_TRACE(testing::Message() << question << ' ' << given_up);
            answers_questions = question;
            for (unsigned n = 0; n < given_up; ++n) times_out(WriteParameter(1), question ? kWithin : kBeyond);
            WriteParameter second(99);
            const Error error = finish_late(second);
            EXPECT_EQ(error.code, Errc::soe_error) << bus.words(error);
            slave.idle(10s);
        }
}

// Another drive answers in its own order, so its answers are not in doubt.
TEST_F(LateAnswers, OfAnotherDrive) {
    times_out(ReadParameter(octets, 100), kWithin);
    questions = asked = 0;
    ReadParameter second(octets, 100, 1);
    EXPECT_EQ(finish_late(second).code, Errc::none);
    EXPECT_EQ(asked, 1U);
    EXPECT_EQ(questions, 0U);
}

// The library sends one question. The following request is sent as if nothing were in doubt.
TEST_F(LateAnswers, AreNoDoubtBehindAQuestion) {
    const auto count = [&](Request&& request, unsigned wanted_questions) {
        questions = asked = 0;
        EXPECT_EQ(finish_late(request).code, Errc::none) << bus.words(request.error());
        EXPECT_EQ(asked, 1U);
        EXPECT_EQ(questions, wanted_questions);
    };
    times_out(WriteParameter(1), kWithin);
    count(WriteParameter(2), 1);
    count(WriteParameter(3), 0);
    count(ReadParameter(octets, 100), 0);
    times_out(SetIp(1), kWithin);
    count(SetIp(2), 1);
    count(SetIp(3), 0);
}

// The late answer comes before the next request, and it is the only late answer.
TEST_F(LateAnswers, AreNoDoubtWhenTheyHaveCome) {
    times_out(WriteParameter(1), 200ms);
    times_out(SetIp(1), 200ms);
    slave.idle(1s);
    questions = 0;
    WriteParameter write(2);
    EXPECT_EQ(finish(write).code, Errc::none);
    SetIp set(2);
    EXPECT_EQ(finish(set).code, Errc::none);
    EXPECT_EQ(questions, 0U);
}

TEST_F(LateAnswers, OfAnAddressThatWasSet) {
    for (const bool question : {false, true})
        for (unsigned given_up = 1; given_up <= 3; ++given_up) {
            SCOPED_TRACE(testing::Message() << question << ' ' << given_up);
            answers_questions = question;
            for (unsigned n = 0; n < given_up; ++n) times_out(SetIp(1), question ? kWithin : kBeyond);
            SetIp second(99);
            const Error error = finish_late(second);
            EXPECT_EQ(error.code, Errc::eoe_error) << bus.words(error);
            slave.idle(10s);
        }
}

TEST_F(LateAnswers, OfAnAddressThatWasRead) {
    reads_address = true;
    for (const bool question : {false, true})
        for (unsigned given_up = 1; given_up <= 3; ++given_up) {
            SCOPED_TRACE(testing::Message() << question << ' ' << given_up);
            answers_questions = question;
            for (unsigned n = 0; n < given_up; ++n) times_out(GetIp(), question ? kWithin : kBeyond);
            const unsigned before = sent(MailboxType::eoe);
            GetIp second;
            const Error error = finish_late(second);
            EXPECT_EQ(error.code, Errc::none) << bus.words(error);
            EXPECT_GT(unsigned{second.ip.address.value_or(Ipv4Address{})[3]}, before);
            slave.idle(10s);
        }
}

// A slave that needs more than half of the timeout for each answer. After some requests each request is answered again,
// because the answer to the question of an earlier request also ends the doubt.
TEST_F(LateAnswers, OfASlowSlaveAreOverSomeRequestsLater) {
    constexpr Duration kTimeout = 20ms;
    for (const bool drive : {true, false})
        for (const bool queues : {true, false})
            for (const unsigned losses : {1U, 2U, 5U})
                for (const Duration pause : {1ms, 300ms})
                    for (const Duration work : {6ms, 11ms, 16ms}) {
                        SCOPED_TRACE(testing::Message()
                                     << drive << queues << losses << ' ' << pause.count() << ' ' << work.count());
                        slave.queues = queues;
                        reads_address = true;
                        slow = usual = work;
                        lost = losses;
                        unsigned answered = 0;  // the last requests, without a timeout between them
                        for (unsigned n = 0; n < 40; ++n) {
                            const unsigned before = asked;
                            ReadParameter parameter(octets, 100);
                            GetIp address;
                            Request& request = drive ? static_cast<Request&>(parameter) : address;
                            request.timeout = kTimeout;
                            const Error error = finish(request);
                            answered = error.code == Errc::none ? answered + 1 : 0;
                            if (error.code == Errc::none) {
                                const auto value = drive ? std::to_integer<unsigned>(octets[0])
                                                         : unsigned{address.ip.address.value_or(Ipv4Address{})[3]};
                                EXPECT_EQ(value, asked & 0xFFU);
                                EXPECT_GT(asked, before);
                            }
                            slave.idle(pause);
                        }
                        EXPECT_GE(answered, 10U);
                        slave.idle(2s);
                    }
}

// Any answer may be lost, and any answer may take longer than the timeout.
TEST_F(LateAnswers, AreNeverTakenForOthers) {
    std::mt19937 random(15);
    const auto one_of = [&](unsigned many) { return static_cast<unsigned>(random() % many); };
    unsigned successes = 0;
    slave.answers = [&](MailboxType type, const Mail& mail) {
        slow = usual = one_of(8) == 0 ? Duration(1ms) * one_of(400) : Duration(1ms) * one_of(15);
        SlowSlave::Answer full = answer(type, mail);
        if (one_of(20) == 0) full.mails.clear();
        return full;
    };
    reads_address = true;
    for (unsigned n = 0; n < 3000; ++n) {
        if (n % 100 == 0) slave.queues = !slave.queues;
        const unsigned before = asked & 0xFFU;
        ReadParameter parameter(octets, 100, static_cast<std::uint8_t>(one_of(2)));
        WriteParameter write(one_of(2) == 0 ? 1 : 99);
        GetIp address;
        SetIp set(one_of(2) == 0 ? 1 : 99);
        const unsigned which = one_of(4);
        Request& request = which == 0   ? static_cast<Request&>(parameter)
                           : which == 1 ? static_cast<Request&>(write)
                           : which == 2 ? static_cast<Request&>(address)
                                        : set;
        request.timeout = Duration(1ms) * (5 + one_of(60));
        const Error error = finish(request);
        if (one_of(3) == 0) slave.idle(Duration(1ms) * one_of(300));
        if (error.code == Errc::timeout || error.code == Errc::mailbox_full) continue;
        ++successes;
        SCOPED_TRACE(testing::Message() << n << " request " << which << ' ' << bus.words(error));
        const unsigned value =
            which == 0 ? std::to_integer<unsigned>(octets[0]) : unsigned{address.ip.address.value_or(Ipv4Address{})[3]};
        const Errc refused = which == 1 ? Errc::soe_error : Errc::eoe_error;
        const bool accepts = which == 1 ? write.value[0] == std::byte{1} : set.ip.address->at(3) == 1;
        if (which % 2 == 0) {
            EXPECT_EQ(error.code, Errc::none);
            EXPECT_LE((value - before - 1U) & 0xFFU, 16U);
        } else {
            EXPECT_EQ(error.code, accepts ? Errc::none : refused);
        }
    }
    EXPECT_GT(successes, 1000U);
}

}  // namespace
}  // namespace margay
