// Mail to a slave that is lost or goes to INIT ends at once, with an error text. No mail reaches another device at the
// same station address.
#include "mailbox/foe_bus.hpp"

#include <margay/coe_stream.hpp>
#include <margay/eoe.hpp>
#include <margay/run.hpp>

namespace margay {
namespace {

constexpr MailboxType kPrivate{9};  // a protocol that the library does not know

class MailEnds : public testing::TestWithParam<bool> {
  protected:
    MailboxBus bus;
    ScriptedSlave& slave = (bus.add_scripted(64), bus.add_scripted(64));
    ScriptedSlave* other = nullptr;  // a device of another product, with the station address of slave 2
    std::uint32_t place = 0;         // number of the other device in the segment
    std::array<std::byte, 32> answer{};
    Mail message = mail_bytes({1, 2, 3});
    SuperviseRequest supervision;

    void SetUp() override {
        bus.start(Limits{.slaves = 3});
        auto device = std::make_unique<ScriptedSlave>(64);
        other = device.get();
        auto sii = device->sii();
        store_le<std::uint32_t>(sii, 0x14, 99);
        auto esc = std::make_unique<sim::Esc>(ScriptedSlave::chip(), sii);
        esc->set_firmware(std::move(device));
        place = bus.segment.add(std::move(esc));
        bus.segment.set_power(place, true, bus.osal.now());
        bus.idle(20ms);
        if (!GetParam()) return;
        ASSERT_TRUE(set_target(*bus.ctx, 0, AlState::preop).ok());
        ASSERT_TRUE(submit(*bus.ctx, supervision).ok());
        bus.idle(50ms);
    }
    void set_register(std::uint16_t address, std::uint16_t value) {
        const std::array octets{static_cast<std::byte>(value & 0xFF), static_cast<std::byte>(value >> 8)};
        (void)bus.segment.slave(place).ecat_write(address, octets, bus.osal.now());
        sim::FrameEnd end{};
        end.at = bus.osal.now();
        bus.segment.slave(place).frame_end(end);
    }
    // Gives the other device the registers that this master could have written in an earlier run.
    void prepare_other() {
        const std::array sms{std::byte{0x00}, std::byte{0x10}, std::byte{64}, std::byte{0},
                             std::byte{0x26}, std::byte{0},    std::byte{1},  std::byte{0},
                             std::byte{0},    std::byte{0x18}, std::byte{64}, std::byte{0},
                             std::byte{0x22}, std::byte{0},    std::byte{1},  std::byte{0}};
        set_register(0x0010, 0x1002);
        (void)bus.segment.slave(place).ecat_write(0x0800, sms, bus.osal.now());
        set_register(0x0120, 2);
    }
    void take_out() { bus.segment.disconnect({1, 0}); }
    void notice() {
        if (!GetParam()) (void)readstate(*bus.ctx);
        const Time end = bus.osal.now() + 500ms;
        while (bus.ctx->slave(2).al.state != AlState::none && bus.osal.now() < end) bus.step();
        ASSERT_EQ(bus.ctx->slave(2).al.state, AlState::none);
        bus.step();
    }
    RawMail& waiting(RawMail& request) {
        request.slave = 2;
        request.type = kPrivate;
        request.message = message;
        request.answer = answer;
        EXPECT_TRUE(submit(*bus.ctx, request).ok());
        return request;
    }
};

TEST_P(MailEnds, WhenTheSlaveIsLostAndNothingReachesAnotherDevice) {
    slave.takes = false;  // the first message fills the mailbox of the slave, the others wait
    std::array<VoeSend, 3> sends;
    for (VoeSend& send : sends) {
        send.slave = 2;
        send.data = message;
        send.timeout = 10s;
        ASSERT_TRUE(submit(*bus.ctx, send).ok());
    }
    RawMail raw;
    raw.timeout = 10s;
    waiting(raw);
    RawMail unasked;
    unasked.slave = 2;
    unasked.type = MailboxType::foe;
    unasked.answer = answer;
    unasked.timeout = 10s;
    ASSERT_TRUE(submit(*bus.ctx, unasked).ok());
    SdoUpload upload;
    upload.slave = 2;
    upload.index = 0x1000;
    upload.data = answer;
    upload.timeout = 10s;
    ASSERT_TRUE(submit(*bus.ctx, upload).ok());
    static EoePortMemory<4, 4> memory;
    EoePort port(memory);
    port.slave = 2;
    ASSERT_TRUE(submit(*bus.ctx, port).ok());
    std::array<std::byte, 60> frame{};
    bus.idle(5ms);
    ASSERT_TRUE(port.send(frame));
    bus.idle(5ms);
    EXPECT_EQ(sends[0].state(), RequestState::success);
    ASSERT_TRUE(sends[1].busy() && raw.busy() && unasked.busy() && upload.busy());
    take_out();
    notice();
    for (const Request* request : {static_cast<Request*>(&sends[1]), static_cast<Request*>(&sends[2]),
                                   static_cast<Request*>(&raw), static_cast<Request*>(&upload)}) {
        EXPECT_FALSE(request->busy());
        EXPECT_EQ(request->error().code, Errc::missing_slave) << bus.words(request->error());
    }
    bus.run(unasked, 5ms);
    EXPECT_EQ(unasked.error().code, Errc::missing_slave) << bus.words(unasked.error());
    prepare_other();
    ASSERT_TRUE(bus.segment.connect({0, 1}, {place, 0}));
    (void)port.send(frame);
    VoeSend more;
    more.slave = 2;
    more.data = message;
    (void)submit(*bus.ctx, more);
    for (int n = 0; n < 40; ++n) {
        bus.idle(100ms);
        if (!GetParam() && n % 10 == 0) (void)readstate(*bus.ctx);
    }
    EXPECT_TRUE(other->received.empty()) << other->received.size();
    EXPECT_NE(more.error().code, Errc::none);
    // Slave 2 itself is back in its earlier state. Its mail continues, and mail from the time before is not sent.
    bus.segment.disconnect({place, 0});
    slave.takes = true;
    ASSERT_TRUE(bus.segment.connect({0, 1}, {1, 0}));
    bus.idle(100ms);
    slave.received.clear();
    if (!GetParam()) {
        const auto back = recover_slave(*bus.ctx, 2);
        EXPECT_TRUE(back.ok()) << bus.words(back.error());
    }
    bus.idle(1s);
    ASSERT_GE(bus.ctx->slave(2).al.state, AlState::preop);
    EXPECT_TRUE(slave.received.empty());
    const auto sent = VOEsend(*bus.ctx, 2, {}, message);
    EXPECT_TRUE(sent.ok()) << bus.words(sent.error());
    bus.idle(5ms);
    EXPECT_EQ(slave.received.size(), 1U);
    ASSERT_TRUE(port.send(frame));
    bus.idle(50ms);
    EXPECT_GT(slave.received.size(), 1U) << "the port goes on";
    port.cancel();
}

// No message is in flight between two packets.
TEST_P(MailEnds, AFileEndsWhenTheSlaveIsLost) {
    slave.on_mail = [&](const Mail&) { slave.reply(foe_message(foe::Opcode::acknowledge, 0), MailboxType::foe); };
    struct Never final : ByteSource {
        Piece pull(MutableBytes) override { return {}; }
    } source;
    FoeWrite write;
    write.slave = 2;
    write.name = "x";
    write.source = &source;
    ASSERT_TRUE(submit(*bus.ctx, write).ok());
    bus.idle(20ms);
    ASSERT_TRUE(write.busy());
    take_out();
    notice();
    bus.run(write, 5ms);
    EXPECT_EQ(bus.words(write.error()), "slave 2: FoE write: the slave is missing");
}

INSTANTIATE_TEST_SUITE_P(Unsupervised, MailEnds, testing::Values(false));
INSTANTIATE_TEST_SUITE_P(Supervised, MailEnds, testing::Values(true));

class MailInInit : public testing::Test {
  protected:
    MailboxBus bus;
    ScriptedSlave& slave = bus.add_scripted(64);
    std::array<std::byte, 32> answer{};
    Mail message = mail_bytes({1, 2, 3});
    void SetUp() override {
        bus.start();
        bus.idle(5ms);
    }
    void expect_refused() {
        const Time before = bus.osal.now();
        EXPECT_EQ(raw_mail(*bus.ctx, 1, kPrivate, message, answer).error().code, Errc::wrong_state);
        EXPECT_EQ(SDOread<std::uint32_t>(*bus.ctx, 1, 0x1000, 0).error().code, Errc::wrong_state);
        EXPECT_EQ(VOEsend(*bus.ctx, 1, {}, message).error().code, Errc::wrong_state);
        EXPECT_EQ(FOEread(*bus.ctx, 1, "x", 0, answer).error().code, Errc::wrong_state);
        EXPECT_EQ(bus.osal.now(), before) << "refused at once";
        EXPECT_TRUE(slave.received.empty());
    }
    void expect_open() {
        slave.received.clear();
        EXPECT_TRUE(VOEsend(*bus.ctx, 1, {}, message).ok());
        bus.idle(2ms);
        EXPECT_EQ(slave.received.size(), 1U);
        slave.received.clear();
    }
};

TEST_F(MailInInit, IsRefusedAtOnceWhateverHasBroughtTheSlaveThere) {
    expect_open();
    ASSERT_EQ(bring(bus, AlState::init).code, Errc::none);
    expect_refused();
    ASSERT_EQ(bring(bus, AlState::preop).code, Errc::none);
    expect_open();
    ASSERT_TRUE(writestate(*bus.ctx, 1, AlState::init).ok());
    ASSERT_EQ(statecheck(*bus.ctx, 1, AlState::init, 1s)->state, AlState::init);
    expect_refused();
    ASSERT_TRUE(writestate(*bus.ctx, 1, AlState::preop).ok());
    ASSERT_EQ(statecheck(*bus.ctx, 1, AlState::preop, 1s)->state, AlState::preop);
    expect_open();
    // Without a request, for example after a reset of its program.
    const std::array<std::byte, 2> init{std::byte{1}};
    ASSERT_TRUE(write_register(*bus.ctx, 1, 0x0120, init).ok());
    bus.idle(5ms);
    (void)readstate(*bus.ctx);
    expect_refused();
    EXPECT_TRUE(reconfigure_slave(*bus.ctx, 1).ok());
    expect_open();
}

TEST_F(MailInInit, EndsWhatWaitsForAnAnswer) {
    RawMail raw;
    raw.slave = 1;
    raw.type = kPrivate;
    raw.message = message;
    raw.answer = answer;
    ASSERT_TRUE(submit(*bus.ctx, raw).ok());
    bus.idle(5ms);
    const Time before = bus.osal.now();
    ASSERT_EQ(bring(bus, AlState::init).code, Errc::none);
    EXPECT_EQ(bus.words(raw.error()),
              "slave 1: receiving from the mailbox: the mailbox was closed while the message waited, because the slave "
              "has gone to INIT, is started or is found anew");
    EXPECT_LT(bus.osal.now() - before, 100ms);
}

// A slave was lost and is found again, and it still answers an earlier message. This answer is not the answer to the
// next request for the same object, which the slave refuses.
struct LateAnswers : testing::TestWithParam<int> {
    MailboxBus bus;
    ScriptedSlave& slave = (bus.add_scripted(64), bus.add_scripted(64));
    SuperviseRequest supervision;
};
TEST_P(LateAnswers, OfASlaveThatWasLostBelongToNoLaterRequest) {
    bus.start();
    ASSERT_TRUE(set_target(*bus.ctx, 0, AlState::preop).ok());
    ASSERT_TRUE(submit(*bus.ctx, supervision).ok());
    bus.idle(50ms);
    int received = 0;
    slave.on_mail = [&](const Mail&) {
        const bool first = ++received == 1;
        slave.delay = first ? std::chrono::milliseconds(GetParam()) : 400ms;
        if (first)
            slave.reply({0x00, 0x30, 0x60, 0x00, 0x20, 0, 0, 0, 0, 0});
        else
            slave.reply({0x00, 0x20, 0x80, 0x00, 0x20, 0, 0x30, 0x00, 0x09, 0x06});
    };
    const std::array values{std::byte{1}, std::byte{2}};
    SdoDownload first;
    SdoDownload second;
    first.slave = second.slave = 2;
    first.index = second.index = 0x2000;
    first.data = Bytes(values).first(1);
    second.data = Bytes(values).last(1);
    ASSERT_TRUE(submit(*bus.ctx, first).ok());
    bus.idle(10ms);
    bus.segment.disconnect({0, 1});
    for (int n = 0; n < 100 && first.busy(); ++n) bus.idle(1ms);
    ASSERT_EQ(first.error().code, Errc::missing_slave);
    ASSERT_TRUE(bus.segment.connect({0, 1}, {1, 0}));
    bus.segment.reconsider();
    for (int n = 0; n < 1000 && !submit(*bus.ctx, second).ok(); ++n) bus.idle(1ms);
    bus.run(second, 5s);
    EXPECT_EQ(second.error().code, Errc::sdo_abort) << bus.words(second.error());
    EXPECT_EQ(second.error().detail, 0x06090030U);
}
INSTANTIATE_TEST_SUITE_P(Milliseconds, LateAnswers, testing::Values(30, 60, 120));

}  // namespace
}  // namespace margay
