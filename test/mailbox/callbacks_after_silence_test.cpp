// The first mail after a silence calls a callback of the application. There is no supervision, and the library has not
// noticed the silence. The callback submits a request to the same slave. The request is refused, and the mailbox
// continues.
#include "mailbox/foe_bus.hpp"

namespace margay {
namespace {

struct CallbackAfterASilence : testing::Test {
    MailboxBus bus;
    ScriptedSlave* slave = nullptr;
    SdoUpload upload;
    std::array<std::byte, 4> value{};
    int calls = 0;
    Error answer;

    void SetUp() override {
        (void)bus.add_scripted();
        slave = &bus.add_scripted();
        bus.start();
        upload.slave = 2;
        upload.index = 0x1001;
        upload.data = value;
    }
    // The scripted slave answers SDO uploads with 42.
    void answer_uploads() {
        slave->on_mail = [this](const Mail&) { slave->reply({0x00, 0x30, 0x4F, 0x01, 0x10, 0x00, 42, 0, 0, 0}); };
    }
    void submit_upload() {
        ++calls;
        answer = submit(*bus.ctx, upload).error();
    }
    void lose_frames(std::uint64_t count) {
        for (std::uint64_t n = 0; n < count; ++n) bus.nic->lose_out.insert(bus.nic->sent + n);
    }
    // A silence in which the regular looks for mail are lost.
    void silence() {
        (void)watch_mailboxes(*bus.ctx, 1ms);
        bus.idle(50ms);
        const std::uint64_t before = bus.nic->sent;
        lose_frames(15);
        bus.idle(1s);
        ASSERT_GT(bus.nic->sent, before + 15);
    }
    void expect_refused() {
        EXPECT_EQ(calls, 1);
        EXPECT_FALSE(upload.busy());
        EXPECT_EQ(answer.code, Errc::identity_unread) << bus.words(answer);
        EXPECT_EQ(answer.slave, 2);
    }
    void expect_mailbox_works() {
        answer_uploads();
        const auto read = readstate(*bus.ctx);
        EXPECT_TRUE(read.ok()) << bus.words(read.error());
        ASSERT_TRUE(submit(*bus.ctx, upload).ok());
        bus.run(upload);
        EXPECT_EQ(upload.state(), RequestState::success) << bus.words(upload.error());
        EXPECT_EQ(value[0], std::byte{42});
    }
};

constexpr std::initializer_list<unsigned> kEmergency{0x00, 0x10, 0x30, 0x81, 0x05, 1, 2, 3, 4, 5};

TEST_F(CallbackAfterASilence, OfTheEventOfAnEmergency) {
    bus.ctx->events().user = this;
    bus.ctx->events().callback = [](const Event& event, void* user) {
        if (event.kind == EventKind::emergency) static_cast<CallbackAfterASilence*>(user)->submit_upload();
    };
    silence();
    slave->reply(kEmergency);
    bus.idle(100ms);
    expect_refused();
    EXPECT_EQ(emergencies(*bus.ctx, 2).count(), 1U);
    bus.ctx->events().callback = nullptr;
    slave->reply(kEmergency);
    expect_mailbox_works();
    bus.idle(100ms);
    EXPECT_EQ(emergencies(*bus.ctx, 2).count(), 2U);
}

TEST_F(CallbackAfterASilence, OfAListener) {
    struct Asks final : MailListener {
        explicit Asks(CallbackAfterASilence& of) : MailListener(MailboxType::voe), test(of) {}
        CallbackAfterASilence& test;
        int taken = 0;
        bool take(const UnaskedMail& mail) override {
            EXPECT_EQ(mail.slave, 2);
            test.submit_upload();
            ++taken;
            return true;
        }
    } listener(*this);
    ASSERT_TRUE(listen(*bus.ctx, listener).ok());
    silence();
    slave->reply(mail_bytes({1, 2, 3, 4}), MailboxType::voe);
    bus.idle(100ms);
    expect_refused();
    EXPECT_EQ(listener.taken, 1);
    ASSERT_TRUE(unlisten(*bus.ctx, listener).ok());
    expect_mailbox_works();
    ASSERT_TRUE(listen(*bus.ctx, listener).ok());
    slave->reply(mail_bytes({5}), MailboxType::voe);
    bus.idle(100ms);
    EXPECT_EQ(listener.taken, 2);
    EXPECT_EQ(upload.state(), RequestState::success) << bus.words(upload.error());
}

// A transfer of a file to a slave that is not in BOOT. The slave answers packet 2 only after the silence.
struct TransferInASilence : CallbackAfterASilence {
    FoeWrite write;
    std::vector<std::byte> content = pattern(500);
    std::function<void()> in_callback;

    void transfer_through_a_silence() {
        bool waits = false;
        slave->on_mail = [this, &waits](const Mail& mail) {
            const FoeAsked asked(mail);
            const std::uint32_t number = asked.opcode == foe::Opcode::write ? 0 : asked.word;
            waits |= number == 2;
            if (number != 2) slave->reply(foe_message(foe::Opcode::acknowledge, number), MailboxType::foe);
        };
        write.slave = 2;
        write.name = "file";
        write.data = content;
        write.timeout = 20s;
        write.user = this;
        write.progressed = [](const FoeProgress&, void* user) {
            auto& test = *static_cast<TransferInASilence*>(user);
            if (const auto call = std::exchange(test.in_callback, nullptr)) call();
        };
        auto call = std::exchange(in_callback, nullptr);
        ASSERT_TRUE(submit(*bus.ctx, write).ok());
        for (int n = 0; n < 1000 && !waits; ++n) bus.step();
        ASSERT_TRUE(waits);
        const std::uint64_t before = bus.nic->sent;
        lose_frames(15);
        bus.idle(1s);
        ASSERT_GT(bus.nic->sent, before + 15);
        ASSERT_TRUE(write.busy()) << bus.words(write.error());
        in_callback = std::move(call);
        slave->reply(foe_message(foe::Opcode::acknowledge, 2), MailboxType::foe);
        bus.idle(100ms);
        EXPECT_EQ(in_callback, nullptr) << "not called";
        EXPECT_FALSE(write.busy());
    }
};
// foe.hpp does not allow this call. The call is refused, too, and the transfer ends with an error, because another
// device may be present.
TEST_F(TransferInASilence, SubmitsARequestInItsCallback) {
    in_callback = [this] { submit_upload(); };
    transfer_through_a_silence();
    expect_refused();
    EXPECT_EQ(write.state(), RequestState::error);
    EXPECT_EQ(
        bus.words(write.error()),
        "slave 2: FoE write: the slave was away, and its identity was not compared since: readstate() or a supervision "
        "does it");
    expect_mailbox_works();
}
TEST_F(TransferInASilence, IsCanceledInItsCallback) {
    in_callback = [this] { write.cancel(); };
    transfer_through_a_silence();
    EXPECT_EQ(write.error().code, Errc::canceled) << bus.words(write.error());
    expect_mailbox_works();
}

}  // namespace
}  // namespace margay
