// SDO transfers of several messages: `timeout` limits the whole request, and `answer_timeout` each answer.
#include "mailbox/slow_slave.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

// Object 0x2000 is written in five messages, and the slave answers each of them after 100 ms.
class AnswerTimeout : public testing::Test {
  protected:
    MailboxBus bus;
    SlowSlave slave{bus};

    void SetUp() override {
        slave.answers = [](MailboxType, const Mail& mail) { return answer(Bytes(mail).subspan(6)); };
        bus.start();
    }
    static SlowSlave::Answer answer(Bytes data) {
        const unsigned command = std::to_integer<unsigned>(data[2]);
        Mail mail = mail_bytes({0, 3U << 4, 0, 0, 0, 0, 0, 0, 0, 0});
        if (command == 0x80) return {};
        if (command >> 5 == 0) {
            mail[2] = static_cast<std::byte>(0x20 | (command & 0x10));
        } else if (command >> 5 == 1) {
            mail[2] = std::byte{0x60};
            std::ranges::copy(data.subspan(3, 3), mail.begin() + 3);
        } else {
            mail[2] = std::byte{0x43};  // the question after a transfer that was given up
            std::ranges::copy(data.subspan(3, 3), mail.begin() + 3);
        }
        return {100ms, {mail}};
    }
    Error write(Duration timeout, Duration answer_timeout) {
        std::array<std::byte, 240> octets{};
        SdoDownload request;
        request.slave = 1;
        request.index = 0x2000;
        request.data = octets;
        request.timeout = timeout;
        request.answer_timeout = answer_timeout;
        EXPECT_TRUE(submit(*bus.ctx, request).ok());
        slave.run(request);
        return request.error();
    }
};

TEST_F(AnswerTimeout, EachAnswerHasItsOwnTime) {
    EXPECT_EQ(write(Duration{0}, 150ms).code, Errc::none);
    EXPECT_EQ(write(2s, 150ms).code, Errc::none);
    EXPECT_EQ(write(2s, Duration{0}).code, Errc::none);
    EXPECT_EQ(write(Duration{0}, -1s).code, Errc::none) << "as 0: 3 s for each answer";
}

TEST_F(AnswerTimeout, TheRequestEndsWithEitherTime) {
    EXPECT_EQ(write(250ms, 150ms).code, Errc::timeout) << "five answers need 500 ms";
    EXPECT_EQ(write(Duration{0}, 50ms).code, Errc::timeout);
}

}  // namespace
}  // namespace margay
