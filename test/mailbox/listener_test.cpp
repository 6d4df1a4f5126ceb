// Listeners for mail that no request waits for, and the regular looks for this mail.
#include "mailbox/mailbox_bus.hpp"

namespace margay {
namespace {

// Takes mail whose first octet is in `wanted`, or any mail, and stores it.
class Keeper final : public MailListener {
  public:
    explicit Keeper(MailboxType type = MailboxType::voe) : MailListener(type) {}
    std::vector<std::pair<std::uint16_t, Mail>> all;
    std::optional<unsigned> wanted;
    std::function<void()> before;  // called in take()

  private:
    bool take(const UnaskedMail& mail) override {
        if (before) before();
        if (wanted && std::to_integer<unsigned>(mail.data[0]) != *wanted) return false;
        all.emplace_back(mail.slave, Mail(mail.data.begin(), mail.data.end()));
        return true;
    }
};

class ListenerTest : public testing::Test {
  protected:
    MailboxBus bus;
    std::vector<ScriptedSlave*> slaves;
    void start(int count) {
        for (int n = 0; n < count; ++n) slaves.push_back(&bus.add_scripted(32));
        bus.start();
        bus.idle(5ms);
    }
    void send(std::size_t slave, std::initializer_list<unsigned> data, MailboxType type = MailboxType::voe) {
        slaves[slave - 1]->reply(mail_bytes(data), type);
    }
    [[nodiscard]] std::uint32_t unexpected(std::uint16_t slave) {
        return mailbox_statistics(*bus.ctx, slave)->unexpected;
    }
};

TEST_F(ListenerTest, HearsItsSlaveAndItsProtocolInTheOrderOfListening) {
    start(2);
    Keeper first;
    Keeper second;
    Keeper all;
    Keeper other(MailboxType::foe);
    first.only_slave = 1;
    first.wanted = 7;
    second.only_slave = 1;
    for (MailListener* one : {static_cast<MailListener*>(&first), static_cast<MailListener*>(&second),
                              static_cast<MailListener*>(&all), static_cast<MailListener*>(&other)})
        ASSERT_TRUE(listen(*bus.ctx, *one).ok());
    EXPECT_TRUE(first.listening());
    (void)watch_mailboxes(*bus.ctx, 1ms);
    send(1, {7, 1});
    send(1, {8, 2});
    send(2, {9, 3});
    send(2, {1}, MailboxType::foe);
    send(2, {0x00, 0x10, 0x30, 0x81, 0x05, 1, 2, 3, 4, 5}, MailboxType::coe);  // an emergency
    bus.idle(30ms);
    using Heard = std::vector<std::pair<std::uint16_t, Mail>>;
    EXPECT_EQ(first.all, (Heard{{1, mail_bytes({7, 1})}}));
    EXPECT_EQ(second.all, (Heard{{1, mail_bytes({8, 2})}}));
    EXPECT_EQ(all.all, (Heard{{2, mail_bytes({9, 3})}}));
    EXPECT_EQ(other.all, (Heard{{2, mail_bytes({1})}}));
    EXPECT_EQ(emergencies(*bus.ctx, 2).count(), 1U);
    EXPECT_EQ(unexpected(1) + unexpected(2), 0U);
    // A listener for CoE gets all CoE mail except emergencies.
    Keeper coe(MailboxType::coe);
    ASSERT_TRUE(listen(*bus.ctx, coe).ok());
    send(2, {0x00, 0x10, 0x30, 0x81, 0x05, 1, 2, 3, 4, 5}, MailboxType::coe);
    send(2, {0x05, 0x40, 1}, MailboxType::coe);
    bus.idle(30ms);
    EXPECT_EQ(coe.all, (Heard{{2, mail_bytes({0x05, 0x40, 1})}}));
    EXPECT_EQ(emergencies(*bus.ctx, 2).count(), 2U);
}

TEST_F(ListenerTest, IsRefusedInWords) {
    Keeper keeper;
    MailboxBus none;
    HostContext early(Limits{});
    EXPECT_EQ(listen(early, keeper).error().code, Errc::wrong_state);
    start(1);
    ASSERT_TRUE(listen(*bus.ctx, keeper).ok());
    EXPECT_EQ(listen(*bus.ctx, keeper).error().code, Errc::busy);
    ASSERT_TRUE(unlisten(*bus.ctx, keeper).ok());
    ASSERT_TRUE(unlisten(*bus.ctx, keeper).ok());
    keeper.only_slave = 5;
    EXPECT_EQ(bus.words(listen(*bus.ctx, keeper).error()),
              "slave 5: receiving from the mailbox: there is no such slave (there are 1)");
    keeper.only_slave = 1;
    keeper.look_every = -1ms;
    EXPECT_EQ(listen(*bus.ctx, keeper).error().code, Errc::invalid_argument);
    Keeper unknown(static_cast<MailboxType>(16));
    EXPECT_EQ(bus.words(listen(*bus.ctx, unknown).error()),
              "receiving from the mailbox: argument out of range: the mailbox "
              "protocol must be 1 to 15 (of a listener 0 to 15)");
}

// Another context may own the listener.
TEST_F(ListenerTest, OfAnotherContextGoesOnListening) {
    start(1);
    Keeper keeper;
    ASSERT_TRUE(listen(*bus.ctx, keeper).ok());
    MailboxBus other;
    (void)other.add_scripted(32);
    other.start();
    EXPECT_TRUE(unlisten(*other.ctx, keeper).ok());
    EXPECT_TRUE(keeper.listening());
}

// A mailbox error that answers a message without a reply goes to the listener. A mailbox error that ends a request
// belongs to the request.
TEST_F(ListenerTest, HearsErrorsThatEndNoRequest) {
    start(1);
    (void)watch_mailboxes(*bus.ctx, 1ms);
    Keeper errors(MailboxType::error);
    ASSERT_TRUE(listen(*bus.ctx, errors).ok());
    const Mail refusal = mail_bytes({1, 0, 2, 0});
    slaves[0]->on_mail = [&](const Mail&) { slaves[0]->reply(refusal, MailboxType::error); };
    const Mail message = mail_bytes({1, 2, 3, 4});
    RawMail sent;
    sent.slave = 1;
    sent.message = message;
    ASSERT_TRUE(submit(*bus.ctx, sent).ok());
    bus.idle(30ms);
    EXPECT_EQ(sent.state(), RequestState::success);
    using Heard = std::vector<std::pair<std::uint16_t, Mail>>;
    EXPECT_EQ(errors.all, (Heard{{1, refusal}}));
    EXPECT_EQ(unexpected(1), 0U);
    // Waits until an error most likely does not belong to that message any more.
    bus.idle(5s);
    std::array<std::byte, 32> answer{};
    RawMail asked;
    asked.slave = 1;
    asked.message = message;
    asked.answer = answer;
    ASSERT_TRUE(submit(*bus.ctx, asked).ok());
    bus.idle(30ms);
    EXPECT_EQ(asked.error().code, Errc::mailbox_error);
    EXPECT_EQ(errors.all.size(), 1U);
}

// While the library calls a listener, listeners may be removed, destroyed and added.
TEST_F(ListenerTest, MayChangeTheListenersWhileItIsAsked) {
    start(1);
    (void)watch_mailboxes(*bus.ctx, 1ms);
    auto first = std::make_unique<Keeper>();
    auto second = std::make_unique<Keeper>();
    Keeper third;
    first->wanted = 99;  // takes nothing
    first->before = [&] { second.reset(); };
    ASSERT_TRUE(listen(*bus.ctx, *first).ok());
    ASSERT_TRUE(listen(*bus.ctx, *second).ok());
    ASSERT_TRUE(listen(*bus.ctx, third).ok());
    send(1, {1});
    bus.idle(10ms);
    EXPECT_EQ(third.all.size(), 1U);
    first->before = [&] { (void)unlisten(*bus.ctx, third); };
    send(1, {2});
    bus.idle(10ms);
    EXPECT_EQ(third.all.size(), 1U);
    EXPECT_EQ(unexpected(1), 1U);
    first->before = [&] { (void)listen(*bus.ctx, third); };
    send(1, {3});
    bus.idle(10ms);
    EXPECT_EQ(third.all.size(), 1U) << "a listener that was added gets later mail";
    // A listener that moves to the end of the list is called once for each mail.
    unsigned asked = 0;
    const auto move = [&](Keeper& one) {
        ++asked;
        (void)unlisten(*bus.ctx, one);
        (void)listen(*bus.ctx, one);
    };
    third.wanted = 99;
    first->before = [&] { move(*first); };
    third.before = [&] { move(third); };
    send(1, {4});
    bus.idle(10ms);
    EXPECT_EQ(asked, 2U);
    first->before = third.before = nullptr;
    third.wanted.reset();
    send(1, {5});
    bus.idle(10ms);
    EXPECT_EQ(third.all.size(), 2U);
    third.before = [&] { first.reset(); };
    send(1, {4});
    bus.idle(10ms);
    EXPECT_EQ(third.all.size(), 3U);
    third.before = nullptr;
    // The context may be destroyed before its listeners.
    bus.ctx.reset();
    EXPECT_FALSE(third.listening());
}

TEST_F(ListenerTest, StaysAfterAScan) {
    start(1);
    Keeper keeper;
    keeper.only_slave = 1;
    keeper.look_every = 2ms;
    ASSERT_TRUE(listen(*bus.ctx, keeper).ok());
    ASSERT_TRUE(config_init(*bus.ctx).ok());
    send(1, {5});
    bus.idle(20ms);
    EXPECT_EQ(keeper.all.size(), 1U);
}

// The looks have the period of the listener. A slave that does not answer gets only one look at a time.
TEST_F(ListenerTest, LooksRegularlyAndNoMoreThanThat) {
    start(2);
    Keeper keeper;
    keeper.only_slave = 2;
    keeper.look_every = 10ms;
    const auto datagrams = [&](Duration time) {
        const auto before = bus.ctx->statistics().datagrams_sent;
        bus.idle(time);
        return bus.ctx->statistics().datagrams_sent - before;
    };
    EXPECT_EQ(datagrams(100ms), 0U);
    ASSERT_TRUE(listen(*bus.ctx, keeper).ok());
    const auto regular = datagrams(1s);
    EXPECT_GE(regular, 95U);
    EXPECT_LE(regular, 105U);
    send(2, {1});
    send(2, {2});
    send(2, {3});
    bus.idle(15ms);
    EXPECT_EQ(keeper.all.size(), 3U);  // one look finds all these messages
    // The library uses the shortest period of all listeners.
    Keeper faster;
    faster.look_every = 2ms;
    ASSERT_TRUE(listen(*bus.ctx, faster).ok());
    const auto both = datagrams(1s);
    EXPECT_GE(both, 900U);
    EXPECT_LE(both, 1110U);  // two slaves each 2 ms, and one of these slaves also each 10 ms
    ASSERT_TRUE(unlisten(*bus.ctx, faster).ok());
    bus.segment.set_power(1, false, bus.osal.now());
    const auto silent = datagrams(1s);
    EXPECT_GE(silent, 95U);
    EXPECT_LE(silent, 310U);  // each look is sent up to three times
    ASSERT_TRUE(unlisten(*bus.ctx, keeper).ok());
    bus.idle(50ms);
    EXPECT_EQ(datagrams(100ms), 0U);
}

// A slave that always has mail receives its messages, and other slaves are served, too.
TEST_F(ListenerTest, AFloodOfMailKeepsNobodyFromSending) {
    start(2);
    Keeper keeper;
    keeper.only_slave = 1;
    keeper.look_every = 1ms;
    ASSERT_TRUE(listen(*bus.ctx, keeper).ok());
    for (unsigned n = 0; n < 2000; ++n) send(1, {n & 0xFFU});
    bus.idle(2ms);
    for (ScriptedSlave* slave : slaves)
        slave->on_mail = [slave](const Mail&) { slave->reply({0x00, 0x30, 0x4F, 0x00, 0x10, 0x00, 42, 0, 0, 0}); };
    const auto other = SDOread<std::uint8_t>(*bus.ctx, 2, 0x1000, 0, 50ms);
    ASSERT_TRUE(other.ok()) << bus.words(other.error());
    // The reply comes after 2000 messages.
    SdoUpload same;
    std::array<std::byte, 4> value{};
    same.slave = 1;
    same.index = 0x1000;
    same.data = value;
    same.timeout = 10s;
    ASSERT_TRUE(submit(*bus.ctx, same).ok());
    bus.idle(20ms);
    EXPECT_EQ(slaves[0]->received.size(), 1U);
    EXPECT_LT(keeper.all.size(), 2000U);
    bus.run(same);
    EXPECT_EQ(same.state(), RequestState::success) << bus.words(same.error());
    EXPECT_EQ(keeper.all.size(), 2000U);
}

// The same right after the scan: the library first fetches earlier mail, but not without a limit.
TEST_F(ListenerTest, MailFromBeforeKeepsNobodyFromSending) {
    slaves.push_back(&bus.add_scripted(32));
    for (unsigned n = 0; n < 5000; ++n) send(1, {n & 0xFFU});
    bus.start();
    for (unsigned n = 0; n < 5000; ++n) send(1, {n & 0xFFU});
    VoeSend message;
    message.slave = 1;
    message.timeout = 20ms;
    ASSERT_TRUE(submit(*bus.ctx, message).ok());
    bus.run(message);
    EXPECT_EQ(message.state(), RequestState::success) << bus.words(message.error());
    EXPECT_EQ(slaves[0]->received.size(), 1U);
}

// Beside a cycle: there is no look while the mapped bit reports no mail. Process data and its frames do not change.
TEST(ListenerInTheCycle, UsesTheMappedBitAndTheBudgetOfTheCycle) {
    MailboxBus bus;
    auto& slave = bus.add_stack(128);
    bus.add_device(sim::make_device("voe_device").value());
    bus.start();
    std::vector<std::byte> image(256);
    for (const Slave& one : bus.ctx->slaves()) one.config.mailbox_status = true;
    const auto mapped = config_map(*bus.ctx, image);
    ASSERT_TRUE(mapped.ok()) << bus.words(mapped.error());
    std::uint64_t most_frames = 0;
    const auto cycle = [&] {
        bus.osal.advance(1ms);
        bus.segment.advance(bus.osal.now());
        const auto frames = bus.ctx->statistics().frames_sent;
        ASSERT_TRUE(send_processdata(*bus.ctx).ok());
        const auto wkc = receive_processdata(*bus.ctx, 500us);
        ASSERT_TRUE(wkc.ok()) << bus.words(wkc.error());
        (void)poll(*bus.ctx, bus.osal.now());
        most_frames = std::max(most_frames, bus.ctx->statistics().frames_sent - frames);
    };
    for (int n = 0; n < 50; ++n) ASSERT_NO_FATAL_FAILURE(cycle());
    (void)slave;
    std::vector<std::byte> memory(64 * 1024);
    VoeInbox inbox(memory);
    inbox.only_slave = 2;
    inbox.look_every = 1ms;
    ASSERT_TRUE(listen(*bus.ctx, inbox).ok());
    for (int n = 0; n < 30; ++n) ASSERT_NO_FATAL_FAILURE(cycle());
    const auto in_a_cycle = bus.ctx->group(0).datagrams.size();
    const auto quiet = bus.ctx->statistics().datagrams_sent;
    for (int n = 0; n < 200; ++n) ASSERT_NO_FATAL_FAILURE(cycle());
    // One look each 20 ms checks that the bit is right.
    EXPECT_LE(bus.ctx->statistics().datagrams_sent - quiet, 200 * in_a_cycle + 12);
    // 500 messages, one per millisecond.
    std::array<std::byte, 6> wish{};
    store_le<std::uint16_t>(wish, 0, 1);
    store_le<std::uint16_t>(wish, 2, 500);
    store_le<std::uint16_t>(wish, 4, 60);
    VoeSend begin;
    begin.slave = 2;
    begin.header = {.vendor_id = sim::kVendorId, .vendor_type = 2};
    begin.data = wish;
    ASSERT_TRUE(submit(*bus.ctx, begin).ok());
    most_frames = 0;
    for (int n = 0; n < 2000 && inbox.count() < 500; ++n) ASSERT_NO_FATAL_FAILURE(cycle());
    EXPECT_EQ(begin.state(), RequestState::success) << bus.words(begin.error());
    EXPECT_EQ(most_frames, bus.ctx->group(0).frames);
    std::array<std::byte, 100> data{};
    std::uint32_t next = 0;
    while (const auto message = inbox.take(data)) {
        ASSERT_EQ(message->bytes, 60U);
        const auto number = load_le<std::uint32_t>(data);
        EXPECT_GE(number, next);  // the memory of the device is limited, so it may lose some messages
        next = number + 1;
    }
    EXPECT_EQ(inbox.lost(), 0U);
    EXPECT_GE(next, 490U);
}

TEST_F(ListenerTest, WhatIsRefusedIsSaidInWords) {
    slaves.push_back(&bus.add_scripted(32));
    slaves.push_back(&bus.add_scripted(32));
    bus.start({.slaves = 10});
    Keeper keeper;
    keeper.only_slave = 99;
    EXPECT_EQ(bus.words(listen(*bus.ctx, keeper).error()),
              "slave 99: receiving from the mailbox: there is no such slave (there are 2)");
    keeper.only_slave = 7;  // a later scan may find it
    EXPECT_TRUE(listen(*bus.ctx, keeper).ok());
    ASSERT_TRUE(unlisten(*bus.ctx, keeper).ok());
    keeper.look_every = -1ms;
    constexpr auto kNegative =
        "argument out of range: the interval of looks for mail must not be negative (zero: no looks)";
    EXPECT_EQ(bus.words(listen(*bus.ctx, keeper).error()),
              std::string("slave 7: receiving from the mailbox: ") + kNegative);
    EXPECT_EQ(bus.words(watch_mailboxes(*bus.ctx, -1ms).error()),
              std::string("receiving from the mailbox: ") + kNegative);
    HostContext fresh(Limits{.slaves = 10});
    ASSERT_TRUE(init(fresh, *bus.nic, bus.osal).ok());
    keeper.only_slave = 11;
    EXPECT_EQ(bus.words(listen(fresh, keeper).error()),
              "slave 11: receiving from the mailbox: there is no such slave (Limits::slaves is 10)");
}

}  // namespace
}  // namespace margay
