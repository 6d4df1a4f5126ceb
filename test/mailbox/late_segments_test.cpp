// Segmented SDO transfers that are given up. A late reply to a segment is not the answer to a later request.
#include "mailbox/slow_slave.hpp"

#include <utility>

namespace margay {
namespace {

// Object 0x2000: a text, which must not begin with 'b'. The slave checks it when it has received the whole text.
class LateSegments : public testing::TestWithParam<std::pair<bool, bool>> {
  protected:
    static constexpr std::size_t kInSegments = 100;
    static constexpr std::size_t kInOneMail = 40;
    MailboxBus bus;
    SlowSlave slave{bus};
    std::string checked;  // the first letters
    std::size_t size = 0;
    std::vector<std::byte> coming;

    void SetUp() override {
        slave.queues = GetParam().first;
        slave.answers = [this](MailboxType, const Mail& mail) { return answer(Bytes(mail).subspan(6)); };
        bus.start();
    }
    static Mail reply(unsigned service, unsigned command, unsigned index, unsigned subindex, std::uint32_t value) {
        Mail mail = mail_bytes({0, service << 4, command, index & 0xFF, index >> 8, subindex, 0, 0, 0, 0});
        store_le(MutableBytes(mail), 6, value);
        return mail;
    }
    SlowSlave::Answer answer(Bytes data) {
        const unsigned command = std::to_integer<unsigned>(data[2]);
        const auto index = load_le<std::uint16_t>(data, 3);
        if (command == 0x80) return {};
        if (command >> 5 == 0) {
            const std::size_t octets = data.size() > 10 ? data.size() - 3 : 7 - (command >> 1 & 7);
            return add(data.subspan(3, octets), reply(3, 0x20 | (command & 0x10), 0, 0, 0), (command & 1) != 0);
        }
        if (command >> 5 == 2 || index != 0x2000)
            return {300us, {reply(3, 0x43, index, std::to_integer<unsigned>(data[5]), 7)}};
        size = load_le<std::uint32_t>(data, 6);
        coming.clear();
        return add(data.subspan(10, std::min(size, data.size() - 10)), reply(3, 0x60, 0x2000, 0, 0),
                   data.size() - 10 >= size);
    }
    SlowSlave::Answer add(Bytes part, Mail good, bool last) {
        coming.insert(coming.end(), part.begin(), part.end());
        if (!last) return {300us, {std::move(good)}};
        const char first = static_cast<char>(coming[0]);
        checked += first;
        return {60ms, {first == 'b' ? reply(2, 0x80, 0x2000, 0, 0x06090030) : std::move(good)}};
    }

    struct Text : SdoDownload {
        Text(char letter, std::size_t length) : octets(length, static_cast<std::byte>(letter)) {
            slave = 1;
            index = 0x2000;
            data = octets;
        }
        std::vector<std::byte> octets;
    };
    Error finish(Request& request) {
        const auto begun = submit(*bus.ctx, request);
        EXPECT_TRUE(begun.ok()) << bus.words(begun.error());
        slave.run(request);
        return request.error();
    }
    // The slave checks the text when the request ends.
    void give_up() {
        Text text('b', kInSegments);
        const bool cancels = GetParam().second;
        if (!cancels) text.timeout = 30ms;
        ASSERT_TRUE(submit(*bus.ctx, text).ok());
        if (cancels) {
            slave.idle(30ms);
            text.cancel();
        }
        slave.run(text);
        EXPECT_EQ(text.error().code, cancels ? Errc::canceled : Errc::timeout) << bus.words(text.error());
    }
};

TEST_P(LateSegments, TheNextRequestsHaveTheirOwnAnswers) {
    give_up();
    for (const std::size_t length : {kInOneMail, kInSegments}) {
        Text good('c', length);
        EXPECT_EQ(finish(good).code, Errc::none) << bus.words(good.error());
        Text bad('b', length);
        EXPECT_EQ(finish(bad).code, Errc::sdo_abort) << bus.words(bad.error());
    }
    EXPECT_EQ(checked, "bcbcb");
}

TEST_P(LateSegments, RawMailHasItsOwnAnswer) {
    give_up();
    const Mail question = mail_bytes({0, 0x20, 0x40, 0x18, 0x10, 1, 0, 0, 0, 0});
    std::array<std::byte, 64> octets{};
    RawMail mail;
    mail.slave = 1;
    mail.type = MailboxType::coe;
    mail.message = question;
    mail.answer = octets;
    EXPECT_EQ(finish(mail).code, Errc::none) << bus.words(mail.error());
    EXPECT_EQ(Mail(octets.begin(), octets.begin() + static_cast<std::ptrdiff_t>(mail.bytes)),
              reply(3, 0x43, 0x1018, 1, 7));
}

INSTANTIATE_TEST_SUITE_P(QueuesAndCancels, LateSegments,
                         testing::Values(std::pair{false, false}, std::pair{false, true}, std::pair{true, false},
                                         std::pair{true, true}));

}  // namespace
}  // namespace margay
