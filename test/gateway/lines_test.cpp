// MailboxGateway on lines that lose frames, with slaves that do not answer, and with files in BOOT. The segment has
// virtual time. The tests read the messages that a slave gets.
#include "gateway/gateway_client.hpp"
#include "mailbox/mailbox_bus.hpp"

#include <margay/gateway/mailbox_gateway.hpp>

#include <atomic>
#include <thread>

namespace margay {
namespace {

using namespace testing_gateway;

class GatewayLines : public testing::Test {
  protected:
    MailboxBus bus;
    std::unique_ptr<MailboxGateway> gateway;

    void TearDown() override { gateway.reset(); }
    void serve(MailboxGatewaySettings settings = {}) {
        settings.port = 0;
        // The gateway uses real time. A long timeout, because the machine may be loaded.
        if (settings.reply_timeout == MailboxGatewaySettings{}.reply_timeout) settings.reply_timeout = 1min;
        gateway = std::make_unique<MailboxGateway>(*bus.ctx, std::move(settings));
        ASSERT_EQ(gateway->error(), "");
    }
    void with_client(const std::function<void(GatewayClient&)>& work, Over over = Over::tcp) {
        std::atomic<bool> done{false};
        std::thread thread([&] {
            GatewayClient client(gateway->port(), over);
            work(client);
            done = true;
        });
        while (!done) bus.step();
        thread.join();
    }
};

TEST_F(GatewayLines, FramesThatAreLostOnTheSegmentAreRepeatedByTheLibrary) {
    bus.add_device(sim::make_device("odd_device").value());
    bus.start();
    for (std::uint64_t n = bus.nic->sent; n < 100'000; n += 7) bus.nic->lose_out.insert(n);
    for (std::uint64_t n = bus.nic->sent + 3; n < 100'000; n += 11) bus.nic->lose_in.insert(n);
    serve();
    Octets block(1024, std::byte{0x5A});
    with_client([&](GatewayClient& client) {
        EXPECT_TRUE(download(client, 0x1001, 0x2007, 0, block, 122));
        EXPECT_EQ(upload(client, 0x1001, 0x2007, 0), block);
    });
    EXPECT_EQ(gateway->counts().errors, 0U);
}

TEST_F(GatewayLines, ASlaveThatDoesNotAnswerIsAnErrorAfterTheTimeout) {
    ScriptedSlave& silent = bus.add_scripted(64);
    ScriptedSlave& full = bus.add_scripted(64);
    bus.start();
    full.takes = false;
    serve({.reply_timeout = 5s});
    with_client([&](GatewayClient& client) {
        EXPECT_EQ(client.ask(0x1001, kCoe, sdo(0x40, 0x1000, 0), 5).error(), 9U);
        EXPECT_EQ(silent.received.size(), 1U) << "the message was repeated";
        (void)client.ask(0x1002, kCoe, sdo(0x40, 0x1000, 0));  // stays in the mailbox of the slave
        EXPECT_EQ(client.ask(0x1002, kCoe, sdo(0x40, 0x1000, 0)).error(), 9U);
    });
    // The slave gets the message of the client, with the address 0 and a counter of the master.
    ASSERT_FALSE(silent.received.empty());
    EXPECT_EQ(silent.received[0], mail_bytes({10, 0, 0, 0, 0, 0x13, 0x00, 0x20, 0x40, 0x00, 0x10, 0, 0, 0, 0, 0}));
}

// The first slave answers after the second slave has got its message.
TEST_F(GatewayLines, TheMessagesOfOneClientWorkOnSeveralSlavesAtOnce) {
    ScriptedSlave& first = bus.add_scripted(64);
    ScriptedSlave& second = bus.add_scripted(64);
    second.on_mail = [&](const Mail&) {
        second.reply({0, 0x30, 0x43, 0x00, 0x10, 0, 2, 2, 2, 2});
        first.reply({0, 0x30, 0x43, 0x00, 0x10, 0, 1, 1, 1, 1});
    };
    bus.start();
    serve();
    with_client([&](GatewayClient& client) {
        auto both = frame(0x1001, kCoe, 1, sdo(0x40, 0x1000, 0));
        const auto other = frame(0x1002, kCoe, 2, sdo(0x40, 0x1000, 0));
        both.insert(both.end(), other.begin(), other.end());
        ASSERT_TRUE(client.send_octets(both));
        for (int n = 0; n < 2; ++n) {
            const auto reply = client.receive();
            ASSERT_TRUE(reply);
            ASSERT_EQ(reply->type, unsigned{kCoe}) << reply->error();
            EXPECT_EQ(number(reply->data, 6, 4), reply->counter * 0x01010101U);
        }
    });
}

// Other messages of the slave are no answer: an emergency, the answer to an older message, an answer of another kind.
TEST_F(GatewayLines, OnlyTheAnswerIsTheAnswer) {
    ScriptedSlave& slave = bus.add_scripted(64);
    slave.on_mail = [&](const Mail&) {
        slave.reply({0, 0x10, 0x00, 0x80, 1, 0, 0, 0, 0, 0});     // emergency
        slave.reply({0, 0x30, 0x43, 0x34, 0x12, 0, 9, 9, 9, 9});  // another object
        slave.reply({0, 0x30, 0x60, 0x00, 0x10, 0, 0, 0, 0, 0});  // the answer to a download
        slave.reply({0, 0x30, 0x43, 0x00, 0x10, 0, 0x92, 1, 2, 0});
    };
    bus.start();
    serve();
    with_client([&](GatewayClient& client) {
        EXPECT_EQ(client.ask(0x1001, kCoe, sdo(0x40, 0x1000, 0)).data,
                  octets({0, 0x30, 0x43, 0x00, 0x10, 0, 0x92, 1, 2, 0}));
        client.wait_at_most(50);
        EXPECT_FALSE(client.receive());
    });
    EXPECT_NE(emergencies(*bus.ctx, 1).take(), std::nullopt) << "the application gets it";
}

// A mailbox error of the slave is sent with its code to the client that sent the request.
TEST_F(GatewayLines, AnErrorReplyOfTheSlaveIsPassedOn) {
    ScriptedSlave& slave = bus.add_scripted(64);
    slave.on_mail = [&](const Mail&) { slave.reply(mail_bytes({1, 0, 3, 0}), MailboxType::error); };
    bus.start();
    serve();
    with_client([&](GatewayClient& client) {
        const auto reply = client.ask(0x1001, kCoe, sdo(0x40, 0x1000, 0), 6);
        EXPECT_EQ(reply.error(), 3U);
        EXPECT_EQ(reply.counter, 6U);
    });
}

// One client stops in the middle of a segmented transfer. Another client waits for a bounded time.
TEST_F(GatewayLines, AConversationThatStopsDoesNotKeepOthersAway) {
    bus.add_device(sim::make_device("odd_device").value());
    bus.start();
    serve();
    with_client([&](GatewayClient& client) {
        (void)client.ask(0x1001, kCoe, sdo(0x40, 0x2002, 0));
        GatewayClient other(gateway->port(), Over::udp);
        EXPECT_EQ(upload(other, 0x1001, 0x1018, 1).size(), 4U);
    });
    EXPECT_EQ(gateway->counts().errors, 0U);
    serve({.reply_timeout = 2s, .pause_in_transfer = 1min});
    with_client([&](GatewayClient& client) {
        (void)client.ask(0x1001, kCoe, sdo(0x40, 0x2002, 0));
        GatewayClient other(gateway->port(), Over::udp);
        EXPECT_EQ(other.ask(0x1001, kCoe, sdo(0x40, 0x1018, 1)).error(), 9U) << "it waits no longer than its timeout";
    });
}

// ------------------------------------------------------------------ files

Octets packet(unsigned opcode, std::uint32_t value, const Octets& data = {}) {
    Octets out = octets({opcode, 0});
    append(out, value, 4);
    out.insert(out.end(), data.begin(), data.end());
    return out;
}
Octets text(std::string_view from) {
    Octets out;
    for (const char c : from) append(out, static_cast<unsigned char>(c), 1);
    return out;
}

TEST_F(GatewayLines, FilesPacketByPacket) {
    ScriptedSlave& slave = bus.add_scripted(64);  // packets of 52 octets
    const Octets full(52, std::byte{0x11});
    unsigned written = 0;
    slave.on_mail = [&](const Mail& mail) {
        const unsigned opcode = at(mail, 6);
        if (opcode == 1) slave.reply(packet(3, 1, full), MailboxType::foe);
        if (opcode == 4 && number(mail, 8, 4) == 1) slave.reply(packet(6, 0), MailboxType::foe);  // busy
        if (opcode == 4 && number(mail, 8, 4) == 7) slave.reply(packet(3, 2, octets({1, 2, 3})), MailboxType::foe);
        if (opcode == 2) slave.reply(packet(4, 0), MailboxType::foe);
        if (opcode == 3) slave.reply(packet(4, ++written), MailboxType::foe);
    };
    bus.start();
    serve();
    with_client([&](GatewayClient& client) {
        auto reply = client.ask(0x1001, kFoe, packet(1, 0, text("file")), 1);
        EXPECT_EQ(reply.data, packet(3, 1, full));
        reply = client.ask(0x1001, kFoe, packet(4, 1), 2);
        EXPECT_EQ(at(reply.data, 0), 6U) << "busy";
        reply = client.ask(0x1001, kFoe, packet(4, 7), 3);
        EXPECT_EQ(reply.data.size(), 9U) << "the last packet";
        // The acknowledgement of the last packet gets no reply and no error.
        client.send(0x1001, kFoe, packet(4, 2), 4);
        reply = client.ask(0x1001, kFoe, packet(2, 0, text("file")), 5);
        EXPECT_EQ(reply.counter, 5U);
        EXPECT_EQ(reply.data, packet(4, 0));
        EXPECT_EQ(client.ask(0x1001, kFoe, packet(3, 1, full), 6).data, packet(4, 1));
        EXPECT_EQ(client.ask(0x1001, kFoe, packet(3, 2, octets({9})), 7).data, packet(4, 2));
    });
    EXPECT_EQ(gateway->counts().errors, 0U);
    EXPECT_EQ(slave.received.size(), 7U);
}

TEST_F(GatewayLines, FirmwareInBoot) {
    bus.add_device(sim::make_device("bootloader_open").value());
    bus.start();

    StateRequest boot;
    boot.slave = 1;
    boot.wanted = AlState::boot;
    ASSERT_TRUE(submit(*bus.ctx, boot));
    bus.run(boot);
    ASSERT_EQ(boot.state(), RequestState::success) << bus.words(boot.error());
    serve();
    with_client([&](GatewayClient& client) {
        auto reply = client.ask(0x1001, kFoe, packet(1, 0, text("firmware")));
        ASSERT_EQ(reply.type, unsigned{kFoe}) << reply.error();
        unsigned n = 1;
        for (; at(reply.data, 0) == 3 && number(reply.data, 2, 4) == n; ++n) {
            if (reply.data.size() < 1024 - 6) break;
            reply = client.ask(0x1001, kFoe, packet(4, n));
        }
        EXPECT_EQ(at(reply.data, 0), 3U) << "the last packet";
        client.send(0x1001, kFoe, packet(4, n));
        const auto missing = client.ask(0x1001, kFoe, packet(1, 0, text("no such file")));
        EXPECT_EQ(at(missing.data, 0), 5U);
        EXPECT_EQ(number(missing.data, 2, 4), 0x8001U);
    });
    EXPECT_EQ(gateway->counts().errors, 0U);
}

TEST_F(GatewayLines, CommandsToDevicesBehindAGateway) {
    bus.add_device(sim::make_device("aoe_gateway").value());
    bus.start();
    const AoeNetId net_id{{10, 0, 0, 9, 1, 1}};
    AoeSetNetId set;
    set.slave = 1;
    set.net_id = net_id;
    ASSERT_TRUE(submit(*bus.ctx, set));
    bus.run(set);
    ASSERT_EQ(set.state(), RequestState::success) << bus.words(set.error());
    serve();
    with_client([&](GatewayClient& client) {
        // Read 4 octets of index group 0x100, offset 0, of port 1; invoke ID 0x77.
        Octets read = octets({10, 0, 0, 9, 1, 1, 1, 0, 1, 2, 3, 4, 5, 6, 0x99, 0x80, 2, 0, 4, 0});
        for (const std::uint32_t word : {12U, 0U, 0x77U, 0x100U, 0U, 4U}) append(read, word, 4);
        const auto reply = client.ask(0x1001, kAoe, read);
        ASSERT_EQ(reply.type, unsigned{kAoe});
        ASSERT_GE(reply.data.size(), 44U);
        EXPECT_EQ(number(reply.data, 18, 2), 5U) << "a response";
        EXPECT_EQ(number(reply.data, 28, 4), 0x77U);
        EXPECT_EQ(number(reply.data, 36, 4), 4U);
    });
}

}  // namespace
}  // namespace margay
