// VoE: octets by hand from ETG.1000.6 "Vendor specific protocol", inboxes, and the device "voe_device" of the library.
#include "facts.hpp"
#include "mailbox/spoilt_frames.hpp"

#include <deque>
#include <random>
#include <thread>

namespace margay {
namespace {

constexpr auto kVoe = wire::MailboxType::voe;
constexpr std::uint32_t kOurs = sim::kVendorId;

class VoeTest : public testing::Test {
  protected:
    MailboxBus bus;
    ScriptedSlave& slave = bus.add_scripted(32);
    std::vector<std::byte> memory = std::vector<std::byte>(4096);
    VoeInbox inbox{memory};
    std::array<std::byte, 64> data{};
    void SetUp() override {
        bus.add_device(sim::make_device("voe_device").value());
        bus.start();
        bus.idle(5ms);
    }
    void hear(VoeInbox& one, std::uint16_t from) {
        one.only_slave = from;
        one.look_every = 1ms;
        ASSERT_TRUE(listen(*bus.ctx, one).ok());
    }
    void reply(std::initializer_list<unsigned> octets) { slave.reply(mail_bytes(octets), kVoe); }
    Result<VoeMessage> receive(Duration timeout = 50ms) { return VOEreceive(*bus.ctx, inbox, data, timeout); }
};

TEST_F(VoeTest, AMessageHasVendorTypeAndData) {
    const auto sent = VOEsend(*bus.ctx, 1, {.vendor_id = 0x11223344, .vendor_type = 0x5566}, mail_bytes({7, 8, 9}));
    ASSERT_TRUE(sent.ok()) << bus.words(sent.error());
    bus.idle(2ms);
    ASSERT_EQ(slave.received.size(), 1U);
    EXPECT_EQ(wire::load_mailbox_header(slave.received[0]).type, kVoe);
    EXPECT_EQ(Mail(slave.received[0].begin() + 6, slave.received[0].end()),
              mail_bytes({0x44, 0x33, 0x22, 0x11, 0x66, 0x55, 7, 8, 9}));
    hear(inbox, 1);
    const auto before = bus.osal.now();
    reply({0xDD, 0xCC, 0xBB, 0xAA, 0x02, 0x01, 5, 6});
    const auto got = receive();
    ASSERT_TRUE(got.ok()) << bus.words(got.error());
    EXPECT_EQ(got->slave, 1);
    EXPECT_EQ(got->header, (VoeHeader{.vendor_id = 0xAABBCCDD, .vendor_type = 0x0102}));
    EXPECT_EQ(got->bytes, 2U);
    EXPECT_GT(got->at, before);
    EXPECT_EQ(Mail(data.begin(), data.begin() + 2), mail_bytes({5, 6}));
    // A message without data, in both directions.
    ASSERT_TRUE(VOEsend(*bus.ctx, 1, {.vendor_id = 1, .vendor_type = 2}, {}).ok());
    reply({1, 0, 0, 0, 2, 0});
    const auto empty = receive();
    ASSERT_TRUE(empty.ok());
    EXPECT_EQ(empty->bytes, 0U);
    EXPECT_EQ(slave.received.back().size(), 12U);
}

TEST_F(VoeTest, IsRefusedInWords) {
    const std::vector<std::byte> most(20);
    const std::vector<std::byte> more(21);
    EXPECT_TRUE(VOEsend(*bus.ctx, 1, {}, most).ok());
    EXPECT_EQ(bus.words(VOEsend(*bus.ctx, 1, {}, more).error()),
              "slave 1: VoE send: argument out of range: the mailbox message is 27 octets, at most 26 are "
              "possible");
    EXPECT_EQ(VOEsend(*bus.ctx, 9, {}, most).error().code, Errc::unknown_slave);
    EXPECT_EQ(bus.words(receive().error()),
              "VoE receive: argument out of range: the object does not listen, call listen()");
    VoeReceive none;
    EXPECT_EQ(submit(*bus.ctx, none).error().code, Errc::invalid_argument);
    hear(inbox, 1);
    EXPECT_EQ(bus.words(receive().error()), "slave 1: VoE receive: timed out");
    // A slave without VoE.
    MailboxBus other;
    (void)other.add_scripted(32, 0x04);
    other.start();
    EXPECT_EQ(other.words(VOEsend(*other.ctx, 1, {}, most).error()), "slave 1: VoE send: not supported by the slave");
    // An inbox of another context.
    VoeReceive foreign;
    foreign.inbox = &inbox;
    EXPECT_EQ(submit(*other.ctx, foreign).error().code, Errc::invalid_argument);
}

TEST_F(VoeTest, SeveralInboxesByVendorAndType) {
    VoeInbox ours(memory);
    std::vector<std::byte> second(4096);
    VoeInbox others(second);
    ours.vendor_id = kOurs;
    ours.vendor_type = 1;
    others.vendor_id = 0x1234;
    hear(ours, 2);
    hear(others, 2);
    ASSERT_TRUE(VOEsend(*bus.ctx, 2, {0x1234, 6}, mail_bytes({1, 2, 3})).ok());
    ASSERT_TRUE(VOEsend(*bus.ctx, 2, {kOurs, 1}, mail_bytes({4, 5})).ok());
    ASSERT_TRUE(VOEsend(*bus.ctx, 2, {0x9999, 1}, mail_bytes({4, 5})).ok());  // the device does not know this vendor
    const auto echo = VOEreceive(*bus.ctx, ours, data);
    ASSERT_TRUE(echo.ok()) << bus.words(echo.error());
    EXPECT_EQ(Mail(data.begin(), data.begin() + 2), mail_bytes({4, 5}));
    const auto reversed = VOEreceive(*bus.ctx, others, data);
    ASSERT_TRUE(reversed.ok());
    EXPECT_EQ(reversed->header, (VoeHeader{0x1234, 7}));
    EXPECT_EQ(Mail(data.begin(), data.begin() + 3), mail_bytes({3, 2, 1}));
    bus.idle(5ms);
    EXPECT_EQ(mailbox_statistics(*bus.ctx, 2)->errors, 1U);
    EXPECT_TRUE(ours.empty());
    EXPECT_TRUE(others.empty());
}

// An inbox for all slaves without its own regular looks. The request looks at the slaves with VoE one after the other.
TEST_F(VoeTest, AWaitForAllSlavesLooksAtThemInTurn) {
    ASSERT_EQ(inbox.only_slave, 0);
    ASSERT_EQ(inbox.look_every, 0ms);
    ASSERT_TRUE(listen(*bus.ctx, inbox).ok());
    reply({0xDD, 0xCC, 0xBB, 0xAA, 0x02, 0x01, 5, 6});
    const auto first = receive();
    ASSERT_TRUE(first.ok()) << bus.words(first.error());
    EXPECT_EQ(first->slave, 1);
    ASSERT_TRUE(VOEsend(*bus.ctx, 2, {kOurs, 1}, mail_bytes({4, 5})).ok());
    const auto second = receive();
    ASSERT_TRUE(second.ok()) << bus.words(second.error());
    EXPECT_EQ(second->slave, 2);
    EXPECT_EQ(bus.words(receive().error()), "VoE receive: timed out");
}

TEST_F(VoeTest, AFullInboxCountsWhatItLoses) {
    std::vector<std::byte> small(100);
    VoeInbox few(small);
    hear(few, 2);
    std::array<std::byte, 6> wish{};
    store_le<std::uint16_t>(wish, 0, 2);
    store_le<std::uint16_t>(wish, 2, 10);
    store_le<std::uint16_t>(wish, 4, 10);
    ASSERT_TRUE(VOEsend(*bus.ctx, 2, {kOurs, 2}, wish).ok());
    bus.idle(100ms);
    EXPECT_EQ(few.count(), 10U);
    EXPECT_EQ(few.lost(), 7U);  // three times 30 octets fit
    for (std::uint32_t n = 0; n < 3; ++n) {
        const auto message = few.take(data);
        ASSERT_TRUE(message.has_value());
        EXPECT_EQ(message->header, (VoeHeader{kOurs, 3}));
        EXPECT_EQ(load_le<std::uint32_t>(data), n);  // the inbox keeps the oldest messages
    }
    EXPECT_FALSE(few.take(data).has_value());
    ASSERT_TRUE(VOEsend(*bus.ctx, 2, {kOurs, 1}, mail_bytes({1})).ok());
    EXPECT_TRUE(VOEreceive(*bus.ctx, few, data).ok());
}

TEST_F(VoeTest, AWaitEndsWhenTheInboxStopsOrTheRequestIsCanceled) {
    hear(inbox, 1);
    VoeReceive wait;
    wait.inbox = &inbox;
    wait.data = data;
    ASSERT_TRUE(submit(*bus.ctx, wait).ok());
    bus.idle(10s);
    EXPECT_TRUE(wait.busy());  // without a timeout it has no limit
    ASSERT_TRUE(unlisten(*bus.ctx, inbox).ok());
    bus.run(wait, 100ms);
    EXPECT_EQ(bus.words(wait.error()),
              "slave 1: VoE receive: the inbox does not listen any more: unlisten() was called");
    EXPECT_EQ(wait.error().code, Errc::mailbox_closed);
    hear(inbox, 1);
    ASSERT_TRUE(submit(*bus.ctx, wait).ok());
    bus.idle(10ms);
    wait.cancel();
    EXPECT_EQ(wait.error().code, Errc::canceled);
    // The buffer is too small. The call returns the size, and the message is lost.
    reply({1, 0, 0, 0, 2, 0, 1, 2, 3, 4, 5});
    const auto less = VOEreceive(*bus.ctx, inbox, MutableBytes(data).first(2));
    EXPECT_EQ(bus.words(less.error()),
              "slave 1: VoE receive: not enough memory: the buffer of the call (needed 5, there is "
              "room for 2)");
    EXPECT_TRUE(inbox.empty());
}

TEST_F(VoeTest, MalformedMessagesAreCountedAndHarmNothing) {
    hear(inbox, 1);
    for (unsigned length = 1; length < 6; ++length) {
        Mail shorter(length, std::byte{1});
        slave.reply(shorter, kVoe);
    }
    slave.reply({}, kVoe);
    Mail longer(6);  // the header announces more octets than the mailbox has
    wire::store_mailbox_header(longer, {.length = 27, .type = kVoe, .counter = 7});
    slave.put(longer);
    reply({1, 0, 0, 0, 2, 0, 42});
    const auto good = receive();
    ASSERT_TRUE(good.ok()) << bus.words(good.error());
    EXPECT_EQ(data[0], std::byte{42});
    const auto statistics = *mailbox_statistics(*bus.ctx, 1);
    EXPECT_EQ(statistics.unexpected, 5U);
    EXPECT_EQ(statistics.malformed, 2U);
    EXPECT_EQ(inbox.count(), 1U);
}

// Any sequence of messages and reads, compared with a queue.
TEST_F(VoeTest, AnInboxIsAQueue) {
    std::mt19937 random(7);
    for (const std::size_t bytes : {0U, 19U, 20U, 21U, 61U, 100U, 257U}) {
        std::vector<std::byte> ring(bytes);
        VoeInbox one(ring);
        hear(one, 1);
        std::deque<Mail> model;
        std::size_t used = 0;
        std::uint32_t lost = 0;
        for (int n = 0; n < 400; ++n) {
            if (random() % 2 == 0) {
                Mail text(6 + random() % 20);
                for (auto& octet : text) octet = static_cast<std::byte>(random());
                slave.reply(text, kVoe);
                bus.idle(2ms);
                const std::size_t need = 20 + text.size() - 6;
                if (used + need <= bytes) {
                    model.push_back(text);
                    used += need;
                } else {
                    ++lost;
                }
            } else if (const auto message = one.take(data)) {
                ASSERT_FALSE(model.empty());
                Mail whole(6);
                store_le(whole, 0, message->header.vendor_id);
                store_le(whole, 4, message->header.vendor_type);
                whole.insert(whole.end(), data.begin(), data.begin() + static_cast<std::ptrdiff_t>(message->bytes));
                ASSERT_EQ(whole, model.front());
                used -= 20 + whole.size() - 6;
                model.pop_front();
            } else {
                ASSERT_TRUE(model.empty());
            }
            ASSERT_EQ(one.empty(), model.empty());
        }
        EXPECT_EQ(one.lost(), lost);
    }
}

TEST_F(VoeTest, AnotherThreadReads) {
    hear(inbox, 2);
    std::array<std::byte, 6> wish{};
    store_le<std::uint16_t>(wish, 0, 1);
    store_le<std::uint16_t>(wish, 2, 300);
    store_le<std::uint16_t>(wish, 4, 40);
    std::atomic<bool> end{false};
    std::uint32_t next = 0;
    bool wrong = false;
    std::thread reader([&] {
        std::array<std::byte, 64> into{};
        for (bool last = false; !last;) {
            last = end;
            while (const auto message = inbox.take(into)) {
                wrong = wrong || message->bytes != 40 || load_le<std::uint32_t>(into) < next;
                next = load_le<std::uint32_t>(into) + 1;
                for (std::size_t n = 4; n < 40; ++n) wrong = wrong || into[n] != static_cast<std::byte>(n);
            }
        }
    });
    EXPECT_TRUE(VOEsend(*bus.ctx, 2, {kOurs, 2}, wish).ok());
    bus.idle(500ms);
    end = true;
    reader.join();
    EXPECT_FALSE(wrong);
    EXPECT_EQ(inbox.count(), 300U);
}

// A message and its echo. Each of their frames in turn is lost on the way out, lost on the way back, or sent twice.
TEST(VoeLostFrames, EveryMessageArrivesOnce) {
    with_each_frame_spoilt("voe_device", 400, [](MailboxBus& bus) {
        std::vector<std::byte> memory(1024);
        VoeInbox inbox(memory);
        inbox.only_slave = 1;
        EXPECT_TRUE(listen(*bus.ctx, inbox).ok());
        std::array<std::byte, 16> data{};
        for (unsigned n = 0; n < 3; ++n) {
            const auto sent = VOEsend(*bus.ctx, 1, {kOurs, 1}, mail_bytes({n}));
            EXPECT_TRUE(sent.ok()) << bus.words(sent.error());
            const auto echo = VOEreceive(*bus.ctx, inbox, data);
            EXPECT_TRUE(echo.ok()) << bus.words(echo.error());
            EXPECT_EQ(data[0], static_cast<std::byte>(n));
        }
        bus.idle(200ms);
        EXPECT_TRUE(inbox.empty());
        EXPECT_EQ(inbox.count(), 3U);
    });
}

}  // namespace
}  // namespace margay
