// FoE requests over a mailbox: with our server, and with slaves for which the test writes each reply.
#include "mailbox/foe_bus.hpp"
#include "sim/library/quirks.hpp"

#include <margay/hooked_slave.hpp>

namespace margay {
namespace {

using foe::Opcode;
using sim::Bootloader;
constexpr std::uint32_t kPassword = Bootloader::kPassword;

class FoeClient : public testing::Test {
  protected:
    MailboxBus bus;

    void start_bootloader() {
        bus.add_device(sim::make_device("bootloader").value());
        bus.start();
        const Error error = bring(bus, AlState::boot);
        ASSERT_EQ(error.code, Errc::none) << bus.words(error);
    }
    ScriptedSlave& start_scripted(std::uint16_t mailbox_bytes = 32) {
        auto& slave = bus.add_scripted(mailbox_bytes);
        bus.start();
        return slave;
    }
};

TEST_F(FoeClient, FirmwareGoesThereAndComesBack) {
    start_bootloader();
    const auto image = Bootloader::make_image(2, 5, 20'000);
    const auto written = FOEwrite(*bus.ctx, 1, "firmware", kPassword, image);
    ASSERT_TRUE(written.ok()) << bus.words(written.error());
    std::vector<std::byte> back(image.size() + 100);
    const auto read = FOEread(*bus.ctx, 1, "firmware", kPassword, back);
    ASSERT_TRUE(read.ok()) << bus.words(read.error());
    back.resize(*read);
    EXPECT_EQ(back, image);
}

// A hook that writes the firmware when the slave has reached BOOT, and reads it back.
struct Flash {
    std::vector<std::byte> image = Bootloader::make_image(2, 5, 5'000);
    std::vector<std::byte> back = std::vector<std::byte>(6'000);
    Error error{.code = Errc::canceled};
    static Task<> hook(HookedSlave slave, Transition which, Moment when, void* user) {
        auto& my = *static_cast<Flash*>(user);
        if (which != Transition::init_to_boot || when != Moment::after) co_return Result<>();
        auto refused = co_await slave.foe_write("firmware", kPassword + 1, my.image);
        if (refused) co_return Error{.code = Errc::check_failed};
        auto written = co_await slave.foe_write("firmware", kPassword, my.image);
        if (!written) co_return written;
        auto read = co_await slave.foe_read("firmware", kPassword, my.back);
        if (!read) co_return read.error();
        my.back.resize(*read);
        my.error = {};
        co_return Result<>();
    }
};

TEST_F(FoeClient, AHookTransfersFiles) {
    bus.add_device(sim::make_device("bootloader").value());
    bus.start();
    Flash flash;
    bus.ctx->slave(1).hooks.user = &flash;
    bus.ctx->slave(1).hooks.transition = Flash::hook;
    const Error error = bring(bus, AlState::boot);
    ASSERT_EQ(error.code, Errc::none) << bus.words(error);
    EXPECT_EQ(flash.error.code, Errc::none);
    EXPECT_EQ(flash.back, flash.image);
}

TEST_F(FoeClient, AFileOfWholePackets) {
    start_bootloader();
    const std::size_t room = 512 - wire::kMailboxHeaderBytes - foe::kHeaderBytes;
    const auto image = Bootloader::make_image(2, 5, 8 * room - Bootloader::ImageLayout::bytes);
    ASSERT_TRUE(FOEwrite(*bus.ctx, 1, "firmware", kPassword, image).ok());
    std::vector<std::byte> back(image.size());
    const auto read = FOEread(*bus.ctx, 1, "firmware", kPassword, back);
    ASSERT_TRUE(read.ok()) << bus.words(read.error());
    EXPECT_EQ(*read, image.size());
    EXPECT_EQ(back, image);
}

TEST_F(FoeClient, RefusalsHaveTheCodeAndTheTextOfTheSlave) {
    start_bootloader();
    FoeWrite request;
    request.slave = 1;
    request.name = "firmware";
    request.password = 1;
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    bus.run(request);
    EXPECT_EQ(request.error().code, Errc::foe_error);
    EXPECT_EQ(request.error().detail, 0x800AU);
    EXPECT_EQ(request.slave_text(), "wrong password");
    request.password = kPassword;
    request.name = "other";
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    bus.run(request);
    EXPECT_EQ(request.slave_text(), "the only file is 'firmware'");
    const auto large = Bootloader::make_image(1, 1, Bootloader::kFlashBytes);
    request.name = "firmware";
    request.data = large;
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    bus.run(request);
    EXPECT_EQ(request.error().detail, 0x8003U);
    EXPECT_EQ(request.slave_text(), "the image is larger than the flash");
    EXPECT_GT(request.bytes(), Bootloader::kFlashBytes - 512U);
    // The next transfer succeeds.
    const auto image = Bootloader::make_image(2, 5, 2000);
    EXPECT_TRUE(FOEwrite(*bus.ctx, 1, "firmware", kPassword, image).ok());
}

TEST_F(FoeClient, ABufferThatIsTooSmall) {
    start_bootloader();
    std::vector<std::byte> back(1000, std::byte{0xA5});
    const auto read = FOEread(*bus.ctx, 1, "firmware", kPassword, MutableBytes(back).first(900));
    EXPECT_EQ(bus.words(read.error()), "slave 1: FoE read: not enough memory: the buffer of the call");
    EXPECT_EQ(read.error().actual, 900U);
    for (std::size_t n = 900; n < 1000; ++n) ASSERT_EQ(back[n], std::byte{0xA5});
    bus.idle(10ms);
    EXPECT_EQ(mailbox_statistics(*bus.ctx, 1)->unexpected, 0U);
    back.resize(5000);
    EXPECT_EQ(*FOEread(*bus.ctx, 1, "firmware", kPassword, back), 4096U + Bootloader::ImageLayout::bytes);
}

TEST_F(FoeClient, StreamsThatAreSlow) {
    start_bootloader();
    const auto image = Bootloader::make_image(2, 5, 3000);
    SlowSource source(image, 100);
    const auto written = FOEwrite(*bus.ctx, 1, "firmware", kPassword, source);
    ASSERT_TRUE(written.ok()) << bus.words(written.error());
    SlowSink sink;
    const auto read = FOEread(*bus.ctx, 1, "firmware", kPassword, sink);
    ASSERT_TRUE(read.ok()) << bus.words(read.error());
    EXPECT_EQ(*read, image.size());
    EXPECT_EQ(sink.content, image);
}

TEST_F(FoeClient, AStreamThatFailsEndsTheTransferInTheSlaveToo) {
    start_bootloader();
    const auto image = Bootloader::make_image(2, 5, 3000);
    SlowSource source(image, 100);
    source.fails_after = 30;
    const auto written = FOEwrite(*bus.ctx, 1, "firmware", kPassword, source);
    EXPECT_EQ(bus.words(written.error()),
              "slave 1: FoE write: the source or sink of the application has failed (number 28)");
    bus.idle(10ms);
    EXPECT_TRUE(FOEwrite(*bus.ctx, 1, "firmware", kPassword, image).ok());
    SlowSink sink;
    sink.fails_above = 700;
    const auto read = FOEread(*bus.ctx, 1, "firmware", kPassword, sink);
    EXPECT_EQ(read.error().code, Errc::stream_failed);
    std::vector<std::byte> back(image.size());
    EXPECT_TRUE(FOEread(*bus.ctx, 1, "firmware", kPassword, back).ok());
    EXPECT_EQ(back, image);
}

// The transfer is cancelled at each packet. The slave receives an error message, and the next transfer succeeds.
TEST_F(FoeClient, CanBeCancelledAtAnyPacket) {
    start_bootloader();
    const auto image = Bootloader::make_image(2, 5, 4000);
    struct Cut {
        FoeWrite request;
        unsigned left = 0;
    };
    for (unsigned at = 1; at <= 9; ++at) {
        Cut cut;
        cut.request.slave = 1;
        cut.request.name = "firmware";
        cut.request.password = kPassword;
        cut.request.data = image;
        cut.left = at;
        cut.request.user = &cut;
        cut.request.progressed = [](const FoeProgress& progress, void* user) {
            auto& c = *static_cast<Cut*>(user);
            if (!progress.busy && --c.left == 0) c.request.cancel();
        };
        ASSERT_TRUE(submit(*bus.ctx, cut.request).ok());
        bus.run(cut.request);
        if (at < 9) {
            EXPECT_EQ(cut.request.error().code, Errc::canceled) << at;
        }
        bus.idle(5ms);
    }
    const auto written = FOEwrite(*bus.ctx, 1, "firmware", kPassword, image);
    EXPECT_TRUE(written.ok()) << bus.words(written.error());
}

TEST_F(FoeClient, TwoTransfersOfASlaveTakeTurns) {
    start_bootloader();
    const auto image = Bootloader::make_image(2, 5, 4000);
    FoeWrite write;
    write.slave = 1;
    write.name = "firmware";
    write.password = kPassword;
    write.data = image;
    std::vector<std::byte> back(image.size());
    FoeRead read;
    read.slave = 1;
    read.name = "firmware";
    read.password = kPassword;
    read.data = back;
    ASSERT_TRUE(submit(*bus.ctx, write).ok());
    ASSERT_TRUE(submit(*bus.ctx, read).ok());
    bus.run(write);
    bus.run(read);
    EXPECT_EQ(write.error().code, Errc::none);
    EXPECT_EQ(read.error().code, Errc::none);
    EXPECT_EQ(back, image);
}

TEST_F(FoeClient, TheNameMayFillTheMailbox) {
    auto& slave = start_scripted(32);
    std::string asked;
    slave.on_mail = [&](const Mail& mail) {
        const FoeAsked message(mail);
        asked = text_of(message.body);
        slave.reply(foe_error(0x8001), wire::MailboxType::foe);
    };
    const std::string longest(20, 'n');
    const auto refused = FOEwrite(*bus.ctx, 1, longest, 0, Bytes());
    EXPECT_EQ(refused.error().code, Errc::foe_error);
    EXPECT_EQ(asked, longest);
    const auto longer = FOEwrite(*bus.ctx, 1, std::string(21, 'n'), 0, Bytes());
    EXPECT_EQ(bus.words(longer.error()),
              "slave 1: FoE write: argument out of range: the name of the file does not fit the mailbox of the slave");
}

// A slave that is always busy, or that sends full packets without an end, does not occupy the client for ever.
TEST_F(FoeClient, ASlaveThatIsBusyForEverIsGivenUp) {
    auto& slave = start_scripted();
    unsigned repeated = 0;
    Opcode last{};
    slave.on_mail = [&](const Mail& mail) {
        last = FoeAsked(mail).opcode;
        if (last == Opcode::write) ++repeated;
        if (last != Opcode::error) slave.reply(foe_busy(1, 100, "wait"), wire::MailboxType::foe);
    };
    FoeWrite request;
    request.slave = 1;
    request.name = "x";
    request.busy_timeout = 500ms;
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    const Time begin = bus.osal.now();
    bus.run(request);
    EXPECT_EQ(request.error().code, Errc::timeout);
    EXPECT_LT(bus.osal.now() - begin, 700ms);
    EXPECT_GT(repeated, 15U);
    EXPECT_LT(repeated, 40U);  // with pauses in between
    bus.idle(10ms);
    EXPECT_EQ(last, Opcode::error);  // the slave has received the error
}

TEST_F(FoeClient, EndlessMailThatIsNoAnswerDoesNotProlongTheWait) {
    auto& slave = start_scripted();
    slave.on_mail = [&](const Mail& mail) {
        if (FoeAsked(mail).opcode != Opcode::write) return;
        for (int n = 0; n < 5000; ++n) slave.reply(foe_message(Opcode::acknowledge, 9), wire::MailboxType::foe);
    };
    FoeWrite request;
    request.slave = 1;
    request.name = "x";
    request.answer_timeout = 50ms;
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    const Time begin = bus.osal.now();
    bus.run(request);
    EXPECT_EQ(request.error().code, Errc::timeout);
    EXPECT_LT(bus.osal.now() - begin, 60ms);
}

TEST_F(FoeClient, TheTimeoutLimitsTheWholeTransfer) {
    auto& slave = start_scripted();
    std::uint32_t sent = 0;
    slave.on_mail = [&](const Mail& mail) {  // full packets without end
        const FoeAsked message(mail);
        if (message.opcode == Opcode::error) return;
        slave.reply(foe_message(Opcode::data, ++sent, pattern(20)), wire::MailboxType::foe);
    };
    struct Nowhere final : ByteSink {
        Taken push(Bytes octets) override { return {.bytes = octets.size()}; }
    } nowhere;
    const Time begin = bus.osal.now();
    const auto read = FOEread(*bus.ctx, 1, "x", 0, nowhere, 200ms);
    EXPECT_EQ(read.error().code, Errc::timeout);
    EXPECT_LT(bus.osal.now() - begin, 210ms);
    EXPECT_GT(sent, 100U);
}

// The slave acknowledges each packet twice and is busy in between. The client repeats each busy packet.
TEST_F(FoeClient, ASlaveThatIsBusyAndAcknowledgesTwice) {
    auto& slave = start_scripted();
    std::vector<std::byte> got;
    std::uint32_t taken = 0;
    unsigned busy = 0;
    slave.on_mail = [&](const Mail& mail) {
        const FoeAsked message(mail);
        const auto acknowledge = [&](std::uint32_t n) {
            slave.reply(foe_message(Opcode::acknowledge, n), wire::MailboxType::foe);
        };
        if (message.opcode == Opcode::write) return acknowledge(0);
        if (message.opcode != Opcode::data) return;
        if (message.word == taken + 1) {
            got.insert(got.end(), message.body.begin(), message.body.end());
            ++taken;
            if (++busy % 3 == 0) return slave.reply(foe_busy(0, 0), wire::MailboxType::foe);
        }
        acknowledge(message.word);
        acknowledge(message.word);
    };
    const auto content = pattern(2000);
    const auto written = FOEwrite(*bus.ctx, 1, "x", 0, content);
    ASSERT_TRUE(written.ok()) << bus.words(written.error());
    EXPECT_EQ(got, content);
}

TEST_F(FoeClient, HostileRepliesEndTheTransferOrAreIgnored) {
    auto& slave = start_scripted();
    // Each reply of a transfer in turn is replaced by a length beyond the mailbox, empty mail, or an error reply of the
    // mailbox. These replies have no counter, so none of them is a copy of another reply.
    const std::vector<std::pair<Mail, Errc>> replies{
        {mail_bytes({0xFF, 0x05, 0, 0, 0, 4, 4, 0, 0, 0, 0, 0}), Errc::protocol},
        {mail_bytes({0, 0, 0, 0, 0, 4}), Errc::protocol},
        {mail_bytes({4, 0, 0, 0, 0, 0, 1, 0, 2, 0}), Errc::mailbox_error},
        {mail_bytes({1, 0, 0, 0, 0, 4, 5}), Errc::timeout},
        {mail_bytes({6, 0, 0, 0, 0, 4, 6, 0, 0xFF, 0xFF, 0, 0}), Errc::timeout},  // busy 65535 of 0
        {mail_bytes({6, 0, 0, 0, 0, 4, 4, 0, 9, 0, 0, 0}), Errc::protocol},
    };
    for (unsigned at = 0; at < 3; ++at) {
        for (const auto& [reply, expected] : replies) {
            std::uint32_t step = 0;
            std::uint32_t wrong_from = at;
            slave.on_mail = [&](const Mail& mail) {
                const FoeAsked message(mail);
                if (message.opcode != Opcode::write && message.opcode != Opcode::data) return;
                if (step++ >= wrong_from) return slave.put(reply);
                const std::uint32_t number = message.opcode == Opcode::write ? 0 : message.word;
                slave.reply(foe_message(Opcode::acknowledge, number), wire::MailboxType::foe);
            };
            FoeWrite request;
            request.slave = 1;
            request.name = "x";
            request.answer_timeout = 50ms;
            request.busy_timeout = 100ms;
            const auto content = pattern(100);
            request.data = content;
            ASSERT_TRUE(submit(*bus.ctx, request).ok());
            bus.run(request, 5s);
            const bool old = at == 0 && reply.size() == 12 && expected == Errc::protocol && reply[0] == std::byte{6};
            EXPECT_EQ(request.error().code, old ? Errc::timeout : expected) << at << " " << bus.words(request.error());
            bus.idle(200ms);
            // After a file of two packets, the answers to this request are not in doubt any more.
            wrong_from = UINT32_MAX;
            ASSERT_TRUE(submit(*bus.ctx, request).ok());
            bus.run(request, 5s);
            EXPECT_EQ(request.error().code, Errc::none) << bus.words(request.error());
        }
    }
}

TEST_F(FoeClient, RefusedWithoutFoeOrBeforePreop) {
    auto& scripted = bus.add_scripted(64, mailbox_protocol::kCoE);
    bus.add_device(sim::make_device("bootloader").value());
    bus.start();
    (void)scripted;
    std::array<std::byte, 4> memory{};
    EXPECT_EQ(bus.words(FOEread(*bus.ctx, 1, "x", 0, memory).error()), "slave 1: FoE read: not supported by the slave");
    EXPECT_EQ(FOEread(*bus.ctx, 3, "x", 0, memory).error().code, Errc::unknown_slave);
    const auto preop = FOEread(*bus.ctx, 2, "firmware", kPassword, memory);
    EXPECT_EQ(bus.words(preop.error()),
              "slave 2: FoE read: the slave ended the file transfer (error code 0x8008: possible in BOOT only)");
    FoeRead request;
    request.slave = 2;
    request.busy_timeout = Duration{0};
    EXPECT_EQ(bus.words(submit(*bus.ctx, request).error()),
              "slave 2: FoE read: argument out of range: answer_timeout and busy_timeout must be above zero");
}

// ------------------------------------------------------------------ lost frames

// Each frame of a write and of a read in turn is lost on the way out, lost on the way back, or sent twice.
TEST(FoeLostFrames, EveryFrameOfATransfer) {
    const auto image = Bootloader::make_image(2, 5, 1200);
    std::uint64_t frames = 1;
    unsigned repeats = 0;
    for (const int fault : {0, 1, 2}) {
        for (std::uint64_t at = 0; at < frames; ++at) {
            MailboxBus bus;
            bus.add_device(sim::make_device("bootloader").value());
            bus.start();
            ASSERT_EQ(bring(bus, AlState::boot).code, Errc::none);
            bus.idle(5ms);
            const std::uint64_t before = bus.nic->sent;
            if (frames > 1) {
                auto& set = fault == 0 ? bus.nic->lose_out : fault == 1 ? bus.nic->lose_in : bus.nic->twice;
                set.insert(before + at);
            }
            SCOPED_TRACE(testing::Message() << "fault " << fault << " at frame " << at << " of " << frames);
            const auto written = FOEwrite(*bus.ctx, 1, "firmware", kPassword, image);
            ASSERT_TRUE(written.ok()) << bus.words(written.error());
            std::vector<std::byte> back(image.size());
            const auto read = FOEread(*bus.ctx, 1, "firmware", kPassword, back);
            ASSERT_TRUE(read.ok()) << bus.words(read.error());
            EXPECT_EQ(back, image);
            if (frames == 1) {
                frames = bus.nic->sent - before;
                at = static_cast<std::uint64_t>(-1);
                ASSERT_LT(frames, 400U);
            }
            repeats += mailbox_statistics(*bus.ctx, 1)->repeats;
        }
    }
    EXPECT_GT(repeats, 10U);
}

// The same when the slave cannot repeat a lost reply. The client sends its request again as a new message.
TEST(FoeLostFrames, WhereNothingIsRepeated) {
    const auto image = Bootloader::make_image(2, 5, 1200);
    std::uint64_t frames = 1;
    for (std::uint64_t at = 0; at < frames; ++at) {
        MailboxBus bus;
        auto device = sim::make_device("bootloader").value();
        ASSERT_TRUE(sim::add_quirk(device, "empty_repeats"));
        bus.add_device(std::move(device));
        bus.start();
        ASSERT_EQ(bring(bus, AlState::boot).code, Errc::none);
        bus.idle(5ms);
        const std::uint64_t before = bus.nic->sent;
        if (at > 0) bus.nic->lose_in.insert(before + at - 1);
        SCOPED_TRACE(testing::Message() << "reply " << at << " of " << frames);
        const auto written = FOEwrite(*bus.ctx, 1, "firmware", kPassword, image);
        ASSERT_TRUE(written.ok()) << bus.words(written.error());
        std::vector<std::byte> back(image.size());
        const auto read = FOEread(*bus.ctx, 1, "firmware", kPassword, back);
        ASSERT_TRUE(read.ok()) << bus.words(read.error());
        EXPECT_EQ(back, image);
        if (at == 0) frames = bus.nic->sent - before;
    }
}

// An error reply does not name the message that it answers. After the last acknowledgement of a file it may be the
// answer to that message, or to the next message.
TEST(FoeInBoot, ARequestBehindAFileGetsTheErrorReplyOfTheSlave) {
    MailboxBus bus;
    bus.add_device(sim::make_device("bootloader_open").value());
    bus.start();
    ASSERT_EQ(bring(bus, AlState::boot).code, Errc::none);
    std::vector<std::byte> back(8192);
    ASSERT_TRUE(FOEread(*bus.ctx, 1, "firmware", 0, back).ok());
    const auto type = SDOread<std::uint32_t>(*bus.ctx, 1, 0x1000, 0);
    EXPECT_EQ(bus.words(type.error()),
              "slave 1: SDO upload of 0x1000:0: mailbox error reply (detail 0x0002: the mailbox "
              "protocol is not supported)");
}

}  // namespace
}  // namespace margay
