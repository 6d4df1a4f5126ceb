// The SoE client with a slave for which the test writes every reply. The octets are composed by hand from ETG.1000.6.
#include "wire/soe.hpp"
#include "facts.hpp"
#include "mailbox/mailbox_bus.hpp"

namespace margay {
namespace {

constexpr Idn kPosition = Idn::standard(51);
constexpr auto kSoe = wire::MailboxType::soe;

class SoeTest : public testing::Test {
  protected:
    MailboxBus bus;
    ScriptedSlave& slave = bus.add_scripted(24);
    void SetUp() override { bus.start(); }
    std::array<std::byte, 64> memory{};

    // The message with number n that the slave received, without the mailbox header.
    [[nodiscard]] Mail got(std::size_t n) const {
        return {slave.received.at(n).begin() + wire::kMailboxHeaderBytes, slave.received.at(n).end()};
    }
    void reply(std::initializer_list<unsigned> data) { slave.reply(mail_bytes(data), kSoe); }
    void answer(std::function<void(const Mail& data)> how) {
        slave.on_mail = [how](const Mail& mail) { how({mail.begin() + wire::kMailboxHeaderBytes, mail.end()}); };
    }
    Result<std::size_t> read(std::size_t room = 64, Duration timeout = 300ms) {
        return SoEread(*bus.ctx, 1, 3, kPosition, soe_element::kValue, std::span(memory).first(room), timeout);
    }
};

TEST_F(SoeTest, ReadsAValue) {
    answer([&](const Mail&) { reply({0x62, 0x40, 0x33, 0x00, 0x78, 0x56, 0x34, 0x12}); });
    const auto value = SoEread<std::int32_t>(*bus.ctx, 1, 3, kPosition);
    ASSERT_TRUE(value.ok()) << bus.words(value.error());
    EXPECT_EQ(*value, 0x12345678);
    ASSERT_EQ(slave.received.size(), 1U);
    EXPECT_EQ(got(0), mail_bytes({0x61, 0x40, 0x33, 0x00}));
    EXPECT_EQ(wire::load_mailbox_header(slave.received[0]).type, kSoe);
    EXPECT_EQ(SoEread<std::int16_t>(*bus.ctx, 1, 3, kPosition).error().code, Errc::capacity);
    const auto longer = SoEread<std::int64_t>(*bus.ctx, 1, 3, kPosition);
    EXPECT_EQ(longer.error().code, Errc::wrong_size);
    EXPECT_EQ(bus.words(longer.error()),
              "slave 1: SoE read of S-0-0051, drive 3: the size of the value differs from the requested size (expected "
              "8 octets, got 4)");
}

TEST_F(SoeTest, ReadsInFragmentsWhileOtherMailComes) {
    struct Seen final : SoeListener {
        unsigned notifications = 0;
        SoeNotification last;
        std::uint16_t state = 0;
        void notified(std::uint16_t from, const SoeNotification& told) override {
            EXPECT_EQ(from, 1);
            ++notifications;
            last = told;
            state = told.data.size() == 2 ? load_le<std::uint16_t>(told.data) : std::uint16_t{0};
        }
    } seen;
    seen.only_slave = 1;
    ASSERT_TRUE(listen(*bus.ctx, seen).ok());
    answer([&](const Mail&) {
        reply({0x62, 0x40, 0x34, 0x00, 9, 9});                                   // late reply to a read of S-0-0052
        reply({0x42, 0x40, 0x33, 0x00, 9, 9});                                   // reply of another drive
        reply({0x6A, 0x40, 0x02, 0x00, 1, 2, 3, 4, 5});                          // two more fragments
        reply({0x65, 0x01, 0x94, 0x00, 0x03, 0x00});                             // S-0-0148 has been executed
        reply({0x6A, 0x40, 0x01, 0x00, 6, 7, 8, 9, 10});                         // one more fragment
        slave.reply(mail_bytes({0x00, 0x10, 0x10, 0x42, 0x01, 0, 0, 0, 0, 0}));  // a CoE emergency
        reply({0x64, 0x40, 0x33, 0x00});                                         // reply to a write
        reply({0x62, 0x40, 0x33, 0x00, 11, 12});
    });
    const auto done = read();
    ASSERT_TRUE(done.ok()) << bus.words(done.error());
    ASSERT_EQ(*done, 12U);
    for (unsigned n = 0; n < 12; ++n) EXPECT_EQ(std::to_integer<unsigned>(memory[n]), n + 1);
    EXPECT_EQ(seen.notifications, 1U);
    EXPECT_FALSE(seen.last.emergency);
    EXPECT_EQ(seen.last.drive, 3);
    EXPECT_EQ(seen.last.idn, Idn::standard(148));
    EXPECT_EQ(seen.state, 3);
    EXPECT_EQ(emergencies(*bus.ctx, 1).count(), 1U);
    EXPECT_EQ(mailbox_statistics(*bus.ctx, 1)->unexpected, 3U);

    // The buffer is one octet too small. The error gives the required size, and no octet is written behind the buffer.
    memory.fill(std::byte{0xEE});
    const auto less = read(11);
    EXPECT_EQ(less.error().code, Errc::capacity);
    EXPECT_EQ(less.error().expected, 12U);
    EXPECT_EQ(less.error().actual, 11U);
    EXPECT_EQ(memory[11], std::byte{0xEE});
    EXPECT_EQ(seen.notifications, 2U);
}

TEST_F(SoeTest, AnEmergencyOfADriveReachesTheListener) {
    struct Emergencies final : SoeListener {
        unsigned octets = 0;
        void notified(std::uint16_t, const SoeNotification& told) override {
            EXPECT_TRUE(told.emergency);
            EXPECT_EQ(told.drive, 2);
            octets = static_cast<unsigned>(told.data.size());
        }
    } emergencies;
    ASSERT_TRUE(listen(*bus.ctx, emergencies).ok());
    reply({0x46, 0x00, 0x00, 0x00, 1, 2, 3});
    (void)watch_mailboxes(*bus.ctx, 1ms);
    bus.idle(20ms);
    EXPECT_EQ(emergencies.octets, 3U);
    // Without a listener the notification counts as unexpected mail.
    ASSERT_TRUE(unlisten(*bus.ctx, emergencies).ok());
    reply({0x46, 0x00, 0x00, 0x00, 1, 2, 3});
    bus.idle(20ms);
    EXPECT_EQ(mailbox_statistics(*bus.ctx, 1)->unexpected, 1U);
}

TEST_F(SoeTest, ErrorsAreToldInWords) {
    answer([&](const Mail&) { reply({0x72, 0x40, 0x33, 0x00, 0x05, 0x70}); });
    const auto refused = read();
    EXPECT_EQ(bus.words(refused.error()),
              "slave 1: SoE read of S-0-0051, drive 3: the drive refused (error code 0x7005: the value is "
              "write-protected in this state)");
    EXPECT_EQ(soe_error_text(0x1001), "no such IDN");
    // A reply to another read is ignored. A reply that is too short is a protocol error. A reply without element flags
    // comes from a slave that does not report them.
    answer([&](const Mail&) { reply({0x72, 0x40, 0x34, 0x00, 0x05, 0x70}); });
    EXPECT_EQ(read().error().code, Errc::timeout);
    answer([&](const Mail&) { reply({0x72, 0x40, 0x33, 0x00, 0x05}); });
    EXPECT_EQ(read().error().code, Errc::protocol);
    answer([&](const Mail&) { reply({0x62, 0x00, 0x33, 0x00, 0x05}); });
    EXPECT_EQ(*read(), 1U);
    answer([&](const Mail&) { reply({0x62, 0x04, 0x33, 0x00, 0x05}); });  // another element
    EXPECT_EQ(read().error().code, Errc::timeout);
    answer([&](const Mail&) { slave.reply(mail_bytes({0x01, 0x00, 0x02, 0x00}), wire::MailboxType::error); });
    EXPECT_EQ(read().error().code, Errc::mailbox_error);
}

TEST_F(SoeTest, FragmentsCountDownOrTheTransferEnds) {
    const std::vector<std::vector<Mail>> wrong{
        // the number of fragments left does not decrease
        {mail_bytes({0x6A, 0x40, 2, 0, 1}), mail_bytes({0x6A, 0x40, 2, 0, 1})},
        {mail_bytes({0x6A, 0x40, 3, 0, 1}), mail_bytes({0x6A, 0x40, 1, 0, 1})},     // a fragment is missing
        {mail_bytes({0x6A, 0x40, 2, 0, 1}), mail_bytes({0x62, 0x40, 0x33, 0, 1})},  // ends early
        {mail_bytes({0x6A, 0x40, 1, 0, 1}), mail_bytes({0x62, 0x40, 0x34, 0, 1})},  // ends with another IDN
        {mail_bytes({0x6A, 0x40, 0, 0, 1})},                                        // none left, but another fragment
        {mail_bytes({0x6A, 0x40, 2, 0})},                                           // empty
    };
    for (const auto& replies : wrong) {
        answer([&](const Mail&) {
            for (const Mail& one : replies) slave.reply(one, kSoe);
        });
        EXPECT_EQ(read().error().code, Errc::protocol);
        bus.idle(5ms);
    }
    answer([&](const Mail&) {
        reply({0x6A, 0x40, 2, 0, 1});
        reply({0x7A, 0x40, 1, 0, 0x01, 0x70});  // aborted between fragments
    });
    const auto broken_off = read();
    EXPECT_EQ(broken_off.error().code, Errc::soe_error);
    EXPECT_EQ(broken_off.error().detail, 0x7001U);
    answer([&](const Mail&) { reply({0x6A, 0x40, 2, 0, 1}); });  // the next fragment does not come
    EXPECT_EQ(read().error().code, Errc::timeout);
    answer([&](const Mail&) { reply({0x62, 0x40, 0x33, 0x00, 7}); });
    EXPECT_EQ(*read(), 1U);  // the next read succeeds
}

TEST_F(SoeTest, WritesInFragmentsOfWhichTheLastIsAnswered) {
    answer([&](const Mail& data) {
        if ((std::to_integer<unsigned>(data[0]) & 8) == 0) reply({0x64, 0x40, 0x33, 0x00});
    });
    ASSERT_TRUE(SoEwrite(*bus.ctx, 1, 3, kPosition, std::uint16_t{0x0201}).ok());
    EXPECT_EQ(got(0), mail_bytes({0x63, 0x40, 0x33, 0x00, 0x01, 0x02}));
    slave.received.clear();
    const auto value = pattern(30);  // a mailbox of 24 octets has room for 14 of these octets
    const auto written = SoEwrite(*bus.ctx, 1, 3, kPosition, soe_element::kValue, value);
    ASSERT_TRUE(written.ok()) << bus.words(written.error());
    ASSERT_EQ(slave.received.size(), 3U);
    const std::array<Mail, 3> heads{mail_bytes({0x6B, 0x40, 0x02, 0x00}), mail_bytes({0x6B, 0x40, 0x01, 0x00}),
                                    mail_bytes({0x63, 0x40, 0x33, 0x00})};
    Mail joined;
    for (std::size_t n = 0; n < 3; ++n) {
        const Mail data = got(n);
        EXPECT_TRUE(std::equal(heads[n].begin(), heads[n].end(), data.begin())) << n;
        joined.insert(joined.end(), data.begin() + 4, data.end());
    }
    EXPECT_EQ(joined, value);
    EXPECT_EQ(got(0).size(), 18U);
    // A value that fits exactly needs one message; one octet more needs two.
    for (const std::size_t size : {0U, 14U, 15U, 28U, 29U}) {
        slave.received.clear();
        ASSERT_TRUE(SoEwrite(*bus.ctx, 1, 3, kPosition, soe_element::kValue, Bytes(value).first(size)).ok());
        EXPECT_EQ(slave.received.size(), size == 0 ? 1U : (size + 13) / 14) << size;
    }
}

TEST_F(SoeTest, ARefusedWriteIsOverWhicheverFragmentWasRefused) {
    const auto value = pattern(30);
    answer([&](const Mail& data) {
        if ((std::to_integer<unsigned>(data[0]) & 8) == 0) reply({0x74, 0x40, 0x33, 0x00, 0x03, 0x70});
    });
    EXPECT_EQ(SoEwrite(*bus.ctx, 1, 3, kPosition, soe_element::kValue, value).error().detail, 0x7003U);
    unsigned count = 0;
    answer([&](const Mail&) {
        if (++count == 3) reply({0x74, 0x40, 0x01, 0x00, 0x04, 0x70});  // the reply names the fragment
    });
    EXPECT_EQ(SoEwrite(*bus.ctx, 1, 3, kPosition, soe_element::kValue, value).error().detail, 0x7004U);
    answer([](const Mail&) {});
    EXPECT_EQ(SoEwrite(*bus.ctx, 1, 3, kPosition, std::uint16_t{1}, 50ms).error().code, Errc::timeout);
}

TEST_F(SoeTest, TextsHaveAHead) {
    answer([&](const Mail&) { reply({0x62, 0x08, 0x33, 0x00, 0x03, 0x00, 0x03, 0x00, 'r', 'p', 'm'}); });
    std::array<char, 16> text{};
    EXPECT_EQ(*SoEread_text(*bus.ctx, 1, 3, kPosition, soe_element::kUnit, text), "rpm");
    answer([&](const Mail&) {
        reply({0x62, 0x08, 0x33, 0x00, 0x09, 0x00, 0x03, 0x00, 'r', 'p', 0});
    });  // reports a wrong length
    EXPECT_EQ(*SoEread_text(*bus.ctx, 1, 3, kPosition, soe_element::kUnit, text), "rp");
    answer([&](const Mail&) { reply({0x62, 0x08, 0x33, 0x00, 0x00, 0x00}); });
    EXPECT_EQ(*SoEread_text(*bus.ctx, 1, 3, kPosition, soe_element::kUnit, text), "");
    answer([&](const Mail&) { reply({0x62, 0x04, 0x33, 0x00, 0x01, 0x00, 0x22, 0x44}); });
    EXPECT_EQ(*SoEattribute(*bus.ctx, 1, 3, kPosition), soe_attribute(0x44220001));
    answer([&](const Mail&) { reply({0x62, 0x04, 0x33, 0x00, 0x01, 0x00}); });
    EXPECT_EQ(SoEattribute(*bus.ctx, 1, 3, kPosition).error().code, Errc::wrong_size);
}

TEST_F(SoeTest, WhatIsWrongWithARequestIsItsError) {
    const auto code = [&](std::uint16_t position, std::uint8_t drive) {
        return SoEread(*bus.ctx, position, drive, kPosition, soe_element::kValue, memory).error().code;
    };
    EXPECT_EQ(code(2, 0), Errc::unknown_slave);
    EXPECT_EQ(code(1, 8), Errc::invalid_argument);
    facts(bus.ctx->slave(1)).mailbox.protocols = mailbox_protocol::kCoE;
    EXPECT_EQ(code(1, 0), Errc::unsupported);
    EXPECT_TRUE(slave.received.empty());
}

// ------------------------------------------------------------------ procedure commands

class SoeCommandTest : public SoeTest {
  protected:
    std::uint16_t state = 0x0000;
    unsigned looks = 0;
    std::function<void()> on_look = [] {};
    std::vector<unsigned> written;
    void SetUp() override {
        SoeTest::SetUp();
        answer([&](const Mail& data) {
            const auto head = std::to_integer<unsigned>(data[0]);
            ASSERT_EQ(std::to_integer<unsigned>(data[2]), 148U);
            if (head == 0x03) {
                written.push_back(load_le<std::uint16_t>(data, 4));
                reply({0x04, 0x40, 148, 0});
            } else {
                ASSERT_EQ(head, 0x01U);
                ASSERT_EQ(std::to_integer<unsigned>(data[1]), soe_element::kDataState);
                ++looks;
                on_look();
                reply({0x02, 0x01, 148, 0, state & 0xFFU, unsigned{state} >> 8});
            }
        });
    }
    Result<> execute(Duration timeout = Duration{0}) { return SoEcommand(*bus.ctx, 1, 0, Idn::standard(148), timeout); }
};

TEST_F(SoeCommandTest, IsSetLookedAtAndTakenBack) {
    on_look = [&] { state = looks < 2 ? 0x0000 : looks < 10 ? 0x0007 : 0x0003; };
    const auto done = execute();
    ASSERT_TRUE(done.ok()) << bus.words(done.error());
    EXPECT_EQ(looks, 10U);
    EXPECT_EQ(written, (std::vector<unsigned>{3, 0}));
}

TEST_F(SoeCommandTest, ThatFailsIsTakenBackToo) {
    on_look = [&] { state = looks < 3 ? 0x0007 : 0x000F; };
    const auto done = execute();
    EXPECT_EQ(bus.words(done.error()),
              "slave 1: SoE command of S-0-0148, drive 0: the command could not be executed (data state 0x000f)");
    EXPECT_EQ(written, (std::vector<unsigned>{3, 0}));
}

// The command has not ended until the drive has reported this.
TEST_F(SoeCommandTest, WithoutAWholeDataStateHasNotSucceeded) {
    for (const unsigned octets : {0U, 1U}) {
        written.clear();
        answer([&](const Mail& data) {
            if (data[0] == std::byte{0x03}) {
                written.push_back(load_le<std::uint16_t>(data, 4));
                reply({0x04, 0x40, 148, 0});
            } else if (octets == 0) {
                reply({0x02, 0x01, 148, 0});
            } else {
                reply({0x02, 0x01, 148, 0, 0x03});
            }
        });
        EXPECT_EQ(bus.words(execute().error()),
                  "slave 1: SoE command of S-0-0148, drive 0: the size of the value differs from the requested size "
                  "(expected 2 octets, got " +
                      std::to_string(octets) + ")");
        bus.idle(10ms);
        EXPECT_EQ(written, (std::vector<unsigned>{3, 0}));
    }
}

TEST_F(SoeCommandTest, ThatIsGivenUpIsTakenBackToo) {
    state = 0x0007;
    EXPECT_EQ(execute(80ms).error().code, Errc::timeout);
    bus.idle(10ms);
    EXPECT_EQ(written, (std::vector<unsigned>{3, 0}));
    written.clear();
    {
        SoeCommand request;
        request.slave = 1;
        request.idn = Idn::standard(148);
        ASSERT_TRUE(submit(*bus.ctx, request).ok());
        while (looks < 12) bus.step();
    }
    bus.idle(10ms);
    EXPECT_EQ(written, (std::vector<unsigned>{3, 0}));
}

TEST_F(SoeCommandTest, ThatIsRefusedIsNotSet) {
    answer([&](const Mail& data) {
        written.push_back(std::to_integer<unsigned>(data[0]));
        reply({0x14, 0x40, 148, 0, 0x12, 0x70});
    });
    EXPECT_EQ(execute().error().detail, 0x7012U);
    bus.idle(10ms);
    EXPECT_EQ(written, (std::vector<unsigned>{3}));
}

TEST_F(SoeCommandTest, LeavesRoomForOtherRequests) {
    state = 0x0007;
    SoeCommand command;
    command.slave = 1;
    command.idn = Idn::standard(148);
    ASSERT_TRUE(submit(*bus.ctx, command).ok());
    while (looks < 3) bus.step();
    answer([&](const Mail& data) {
        if (std::to_integer<unsigned>(data[2]) == 51) return reply({0x62, 0x40, 0x33, 0x00, 5});
        if (std::to_integer<unsigned>(data[0]) == 3) return reply({0x04, 0x40, 148, 0});
        reply({0x02, 0x01, 148, 0, state & 0xFFU, 0});
    });
    EXPECT_EQ(*read(), 1U);
    EXPECT_TRUE(command.busy());
    state = 3;
    bus.run(command);
    EXPECT_EQ(command.state(), RequestState::success);
}

}  // namespace
}  // namespace margay
