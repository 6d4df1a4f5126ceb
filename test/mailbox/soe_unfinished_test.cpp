// SoE writes of several mails that end before their last mail. The slave receives a message that ends the write, and
// the next write is complete.
#include "mailbox/mailbox_bus.hpp"
#include "sim/library/library.hpp"
#include "wire/soe.hpp"

#include <margay/soe.hpp>
#include <margay/supervision.hpp>

namespace margay {
namespace {

constexpr Idn kMode = Idn::standard(32);
constexpr Idn kList = Idn::standard(16);

struct Write : SoeWrite {
    Write(Bytes value, Duration limit, std::uint8_t axis = 1) {
        slave = 1;
        drive = axis;
        idn = kList;
        data = Borrowed<std::byte>(value.data(), value.size());
        timeout = limit;
    }
};

// The drive of the library, whose mailbox has room for 118 octets of a value. The write is cancelled at each step of
// the transfer.
TEST(UnfinishedSoeWrite, ThatIsCancelledDoesNotSpoilTheNextOne) {
    MailboxBus bus;
    bus.add_device(sim::make_device("soe_drive").value());
    bus.start();
    Context& ctx = *bus.ctx;
    const auto value = pattern(3 * 118);
    unsigned cut = 0;  // writes that were cancelled while the slave waited for more mail
    for (int steps = 0; steps < 40; ++steps) {
        SCOPED_TRACE(steps);
        const auto before = mailbox_statistics(ctx, 1)->sent;
        Write write(value, 10s);
        ASSERT_TRUE(submit(ctx, write).ok());
        for (int n = 0; n < steps && write.busy(); ++n) bus.step();
        const auto mails = mailbox_statistics(ctx, 1)->sent - before;
        cut += write.busy() && (mails == 1 || mails == 2) ? 1 : 0;
        write.cancel();
        const auto next = SoEwrite(ctx, 1, 1, kMode, static_cast<std::uint16_t>(steps % 3 + 1));
        ASSERT_TRUE(next.ok()) << bus.words(next.error());
        const auto mode = SoEread<std::uint16_t>(ctx, 1, 1, kMode);
        ASSERT_TRUE(mode.ok()) << bus.words(mode.error());
        EXPECT_EQ(*mode, steps % 3 + 1);
    }
    EXPECT_GE(cut, 2U);
}

class UnfinishedSoeMails : public testing::Test {
  protected:
    MailboxBus bus;
    ScriptedSlave& slave = bus.add_scripted(24);  // 14 octets of a value in each mail
    void SetUp() override { bus.start(); }

    [[nodiscard]] std::vector<Mail> got() const {
        std::vector<Mail> all;
        for (const Mail& mail : slave.received) all.emplace_back(mail.begin() + wire::kMailboxHeaderBytes, mail.end());
        return all;
    }
    // Answers the last mail of each write. S-0-0000 is refused.
    void answer_writes() {
        slave.on_mail = [&](const Mail& mail) {
            const auto header = wire::soe::load_header(Bytes(mail).subspan(wire::kMailboxHeaderBytes));
            if (header.incomplete) return;
            const unsigned head = unsigned{header.drive} << 5 | 4U;
            if (header.number == 0)
                slave.reply(mail_bytes({head | 0x10, 0x40, 0, 0, 0x01, 0x10}), MailboxType::soe);
            else
                slave.reply(mail_bytes({head, 0x40, header.number & 0xFFU, unsigned{header.number} >> 8}),
                            MailboxType::soe);
        };
    }
    const Mail kEnd = mail_bytes({0x63, 0x40, 0x00, 0x00});  // write, drive 3, the value, S-0-0000
};

TEST_F(UnfinishedSoeMails, ThatTimeOutAreEndedBeforeTheNextRequest) {
    const auto value = pattern(40);
    slave.on_mail = [&](const Mail&) { slave.takes = false; };  // the slave does not read the second mail
    Write write(value, 50ms, 3);
    ASSERT_TRUE(submit(*bus.ctx, write).ok());
    bus.run(write);
    EXPECT_EQ(write.error().code, Errc::mailbox_full) << bus.words(write.error());
    ASSERT_EQ(slave.received.size(), 1U);
    answer_writes();
    slave.takes = true;
    // The answer to the message that ends the write names S-0-0000. It is not the answer to this write of several
    // mails.
    const auto next = SoEwrite(*bus.ctx, 1, 3, kList, soe_element::kValue, Bytes(value).first(20));
    EXPECT_TRUE(next.ok()) << bus.words(next.error());
    const auto mails = got();
    ASSERT_EQ(mails.size(), 5U);
    EXPECT_EQ(mails[1][0], std::byte{0x6B}) << "the second mail, which the slave had not read";
    EXPECT_EQ(mails[2], kEnd);
    EXPECT_EQ(mails[3][0], std::byte{0x6B});
    EXPECT_EQ(mails[4][0], std::byte{0x63});
}

TEST_F(UnfinishedSoeMails, NothingIsSentBehindAWriteThatHasAnAnswer) {
    answer_writes();
    const auto value = pattern(40);
    EXPECT_TRUE(SoEwrite(*bus.ctx, 1, 3, kList, soe_element::kValue, value).ok());
    EXPECT_EQ(SoEwrite(*bus.ctx, 1, 3, Idn{0}, soe_element::kValue, value).error().code, Errc::soe_error);
    // A write of one mail leaves no unfinished operation in the slave.
    slave.on_mail = nullptr;
    EXPECT_EQ(SoEwrite(*bus.ctx, 1, 3, kList, std::uint16_t{1}, 20ms).error().code, Errc::timeout);
    bus.idle(200ms);
    EXPECT_EQ(slave.received.size(), 7U);
}

// The slave keeps the unfinished write while it is lost.
TEST(UnfinishedSoeWrite, IsEndedWhenALostSlaveIsThereAgain) {
    for (unsigned mails = 1; mails <= 3; ++mails) {
        SCOPED_TRACE(mails);
        MailboxBus bus;
        (void)bus.add_scripted(64);
        bus.add_device(sim::make_device("soe_drive").value());
        bus.start();
        Context& ctx = *bus.ctx;
        const auto value = pattern(4 * 118);
        Write write(value, 60s);
        write.slave = 2;
        const auto before = mailbox_statistics(ctx, 2)->sent;
        ASSERT_TRUE(submit(ctx, write).ok());
        while (write.busy() && mailbox_statistics(ctx, 2)->sent < before + mails) bus.step();
        ASSERT_TRUE(write.busy());
        bus.segment.disconnect({1, 0});
        (void)readstate(ctx);
        const Time end = bus.osal.now() + 2s;
        while (ctx.slave(2).al.state != AlState::none && bus.osal.now() < end) bus.step();
        bus.run(write, 100ms);
        ASSERT_EQ(write.error().code, Errc::missing_slave) << bus.words(write.error());
        ASSERT_TRUE(bus.segment.connect({0, 1}, {1, 0}));
        bus.idle(50ms);
        const auto back = recover_slave(ctx, 2);
        ASSERT_TRUE(back.ok()) << bus.words(back.error());
        const auto next = SoEwrite(ctx, 2, 1, kMode, std::uint16_t{2});
        EXPECT_TRUE(next.ok()) << bus.words(next.error());
        EXPECT_EQ(*SoEread<std::uint16_t>(ctx, 2, 1, kMode), 2);
    }
}

}  // namespace
}  // namespace margay
