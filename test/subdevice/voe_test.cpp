// The VoE server: octets by hand from ETG.1000.6 "Vendor specific protocol".
#include "subdevice/voe_server.hpp"

#include "bench_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;
using Octets = std::vector<std::byte>;

Octets octets_of(std::initializer_list<unsigned> values) {
    Octets out;
    for (const unsigned v : values) out.push_back(static_cast<std::byte>(v));
    return out;
}

class Author final : public VoeApplication {
  public:
    bool received(VoeServer& server, const VoeHeader& header, Bytes data, Time) override {
        ++messages;
        if (header.vendor_id != 0x11223344) return false;
        last.assign(data.begin(), data.end());
        for (unsigned n = 0; n < answers; ++n) sent += server.send(header, data) ? 1U : 0U;
        return true;
    }
    unsigned messages = 0;
    unsigned answers = 1;
    unsigned sent = 0;
    Octets last;
};

class VoeServerTest : public ::testing::Test {
  protected:
    VoeServerTest() {
        bench.mailbox.emplace(bench.esc, MutableBytes(receive_), MutableBytes(send_), protocols_);
        bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox);
        bench.device->start(bench.esc.time);
        bench.configure(32);
        (void)bench.request(2);
    }
    Bench bench{32};
    Author author;
    std::array<std::byte, 64> memory{};
    VoeServer server{author, memory};

  private:
    std::array<MailboxProtocol, 2> protocols_{
        {{wire::MailboxType::coe, &bench.coe}, {wire::MailboxType::voe, &server}}};
    std::array<std::byte, 256> receive_{};
    std::array<std::byte, 256 * 4> send_{};
};

const Octets kMessage = octets_of({0x44, 0x33, 0x22, 0x11, 0x66, 0x55, 1, 2, 3});

TEST_F(VoeServerTest, PassesMessagesOnAndSendsAnswers) {
    ASSERT_TRUE(bench.send(wire::MailboxType::voe, kMessage));
    (void)bench.step();
    EXPECT_EQ(author.last, octets_of({1, 2, 3}));
    EXPECT_EQ(bench.receive(wire::MailboxType::voe), kMessage);
    // A header alone is a message without data.
    ASSERT_TRUE(bench.send(wire::MailboxType::voe, octets_of({0x44, 0x33, 0x22, 0x11, 9, 0})));
    (void)bench.step();
    EXPECT_TRUE(author.last.empty());
    EXPECT_EQ(bench.receive(wire::MailboxType::voe).size(), 6U);
}

TEST_F(VoeServerTest, AnswersUnknownVendorsAndShortMessagesWithAMailboxError) {
    ASSERT_TRUE(bench.send(wire::MailboxType::voe, octets_of({1, 0, 0, 0, 1, 0, 5})));
    (void)bench.step();
    EXPECT_EQ(bench.receive(wire::MailboxType::error), octets_of({1, 0, 4, 0}));
    ASSERT_TRUE(bench.send(wire::MailboxType::voe, octets_of({0x44, 0x33, 0x22, 0x11, 1})));
    (void)bench.step();
    EXPECT_EQ(bench.receive(wire::MailboxType::error), octets_of({1, 0, 6, 0}));
    EXPECT_EQ(author.messages, 1U);
}

TEST_F(VoeServerTest, SendsOnItsOwnInOrderAndCountsWhatItLoses) {
    const VoeHeader header{0x11223344, 0x5566};
    // Five messages of 11 octets (with length and header) fit into 64 octets.
    for (unsigned n = 0; n < 7; ++n) EXPECT_EQ(server.send(header, octets_of({n, 0, 0})), n < 5) << n;
    EXPECT_EQ(server.lost(), 2U);
    (void)bench.step();
    for (unsigned n = 0; n < 5; ++n) EXPECT_EQ(bench.receive(wire::MailboxType::voe)[6], static_cast<std::byte>(n));
    EXPECT_TRUE(bench.fetch().empty());
    // The largest message has 26 octets.
    EXPECT_TRUE(server.send(header, Octets(20)));
    EXPECT_FALSE(server.send(header, Octets(21)));
    (void)bench.step();
    EXPECT_EQ(bench.receive(wire::MailboxType::voe).size(), 26U);
}

// A master that reads no replies: the server accepts only as many messages as it can answer, and other protocols
// continue.
TEST_F(VoeServerTest, WaitsWhenTheMasterFetchesNothing) {
    Octets long_message = kMessage;
    long_message.resize(26);
    for (int n = 0; n < 10; ++n) {
        (void)bench.send(wire::MailboxType::voe, long_message);
        (void)bench.step();
    }
    EXPECT_EQ(author.sent, author.messages);
    EXPECT_LT(author.messages, 10U);
    unsigned came = 0;
    for (int n = 0; n < 20; ++n) {
        if (!bench.fetch().empty()) ++came;
        (void)bench.step();
    }
    EXPECT_EQ(came, author.messages);
    EXPECT_EQ(server.lost(), 0U);
}

TEST_F(VoeServerTest, ForgetsItsMessagesInInit) {
    EXPECT_TRUE(server.send({1, 2}, octets_of({1})));
    (void)bench.request(1);
    EXPECT_FALSE(server.send({1, 2}, octets_of({1}))) << "the mailbox does not work in INIT";
    bench.configure(32);
    (void)bench.request(2);
    (void)bench.step();
    EXPECT_TRUE(bench.fetch().empty());
}

}  // namespace
}  // namespace margay::subdevice
