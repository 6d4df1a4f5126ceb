// MailboxGateway with many, slow, flooding, malformed and vanishing clients. They do not disturb the cycle, and the
// other clients get their replies.
#include "gateway/gateway_bench.hpp"
#include "gateway/sockets.hpp"

#include <poll.h>

#include <random>

namespace margay {
namespace {

class GatewayClients : public GatewayTest {
  protected:
    static bool good(GatewayClient& client) { return upload(client, kOdd, 0x1018, 1).size() == 4; }
    // Waits until there is a place for a new client, and the client gets an answer.
    bool served() {
        for (;;) {
            GatewayClient client(gateway->port(), Over::tcp);
            if (good(client)) return true;
            std::this_thread::yield();
        }
    }
};

TEST_F(GatewayClients, EightClientsHammerAndNoCycleIsLost) {
    std::atomic<int> answers{0};
    const auto hammer = [&](Over over, std::uint16_t address) {
        return [&, over, address] {
            GatewayClient client(gateway->port(), over);
            for (int n = 0; n < 60; ++n) answers += upload(client, address, 0x1018, 2).size() == 4 ? 1 : 0;
        };
    };
    EXPECT_EQ(
        run({hammer(Over::udp, kOdd), hammer(Over::udp, kDrive), hammer(Over::udp, kOdd), hammer(Over::udp, kVoice),
             hammer(Over::tcp, kOdd), hammer(Over::tcp, kDrive), hammer(Over::tcp, kOdd), hammer(Over::tcp, 0)}),
        0)
        << "of " << cycles;
    EXPECT_EQ(answers, 8 * 60);
    EXPECT_EQ(gateway->counts().errors, 0U);
    EXPECT_EQ(gateway->counts().messages, 480U);
    EXPECT_EQ(gateway->counts().clients, 8U);
}

// Two clients read large objects of one slave: the segments of one transfer never come between the segments of the
// other.
TEST_F(GatewayClients, SegmentedTransfersOfSeveralClientsAreKeptApart) {
    serve({.reply_timeout = 1min, .pause_in_transfer = 1min});  // long, because the machine may be loaded
    std::atomic<int> right{0};
    const auto reader = [&](Over over, unsigned block) {
        return [&, over, block] {
            Octets wanted;
            for (unsigned n = 0; n < 1024; ++n) append(wanted, block + 1024 * block + n, 1);
            GatewayClient client(gateway->port(), over);
            for (int n = 0; n < 10; ++n) right += upload(client, kOdd, 0x2000 + block, 0) == wanted ? 1 : 0;
        };
    };
    EXPECT_EQ(run({reader(Over::udp, 4), reader(Over::tcp, 5), reader(Over::tcp, 6)}), 0);
    EXPECT_EQ(right, 30);
}

// A client that keeps one slave busy does not prevent other clients from using this slave.
TEST_F(GatewayClients, EachClientHasItsTurn) {
    serve({.waiting = 64});
    std::atomic<bool> done{false};
    int late = 0;
    EXPECT_EQ(run({[&] {
                       GatewayClient greedy(gateway->port(), Over::tcp);
                       std::size_t open = 0;
                       while (!done) {
                           for (; open < 60; ++open) greedy.send(kOdd, kCoe, sdo(0x40, 0x1018, 1));
                           if (greedy.receive()) --open;
                       }
                   },
                   [&] {
                       GatewayClient modest(gateway->port(), Over::udp);
                       for (int n = 0; n < 20; ++n) {
                           const auto before = gateway->counts().replies;
                           EXPECT_TRUE(good(modest));
                           // The message of this client waits for one message of the other client, not for sixty. A
                           // busy system may delay this thread before and after the message.
                           late += gateway->counts().replies - before >= 50 ? 1 : 0;
                       }
                       done = true;
                   }}),
              0);
    EXPECT_LT(late, 10);
}

TEST_F(GatewayClients, WhatIsMalformedEndsItsOwnConnectionOnly) {
    EXPECT_EQ(run({[&] {
                  GatewayClient steady(gateway->port(), Over::tcp);
                  ASSERT_TRUE(good(steady));
                  const std::string text = "GET / HTTP/1.1\r\n\r\n";
                  GatewayClient http(gateway->port(), Over::tcp);
                  EXPECT_TRUE(http.send_octets(std::as_bytes(std::span(text))));
                  EXPECT_TRUE(http.ended());
                  GatewayClient datagrams(gateway->port(), Over::tcp);  // a frame of type 1
                  EXPECT_TRUE(datagrams.send_octets(octets({0x0E, 0x10, 0, 0})));
                  EXPECT_TRUE(datagrams.ended());
                  GatewayClient tiny(gateway->port(), Over::tcp);  // a frame without room for a mailbox header
                  EXPECT_TRUE(tiny.send_octets(octets({0x05, 0x50, 0, 0, 0, 0, 0})));
                  EXPECT_TRUE(tiny.ended());
                  EXPECT_EQ(gateway->counts().malformed, 3U);
                  GatewayClient udp(gateway->port(), Over::udp);
                  EXPECT_TRUE(udp.send_octets(std::as_bytes(std::span(text))));
                  EXPECT_TRUE(udp.send_octets(octets({0x05})));
                  EXPECT_TRUE(udp.send_octets({}));
                  EXPECT_TRUE(good(udp)) << "the next datagram counts";
                  EXPECT_TRUE(good(steady));
                  EXPECT_EQ(gateway->counts().malformed, 6U);
              }}),
              0);
}

TEST_F(GatewayClients, FramesInPiecesOverTcp) {
    EXPECT_EQ(run({[&] {
                  GatewayClient slow(gateway->port(), Over::tcp);
                  GatewayClient steady(gateway->port(), Over::udp);
                  const auto message = frame(kOdd, kCoe, 4, sdo(0x40, 0x1018, 1));
                  for (const auto octet : message) {
                      ASSERT_TRUE(slow.send_octets(std::span(&octet, 1)));
                      EXPECT_TRUE(good(steady));
                  }
                  EXPECT_EQ(slow.receive().value_or(Message{}).counter, 4U);
                  // The client sends a part of a frame and disconnects.
                  ASSERT_TRUE(slow.send_octets(std::span(message).first(9)));
                  slow.close();
                  EXPECT_TRUE(good(steady));
              }}),
              0);
}

TEST_F(GatewayClients, RandomOctetsHaveNoEffect) {
    serve({.read_only = true});  // a valid random message must not write
    EXPECT_EQ(run({[&] {
                  std::minstd_rand numbers(7);
                  for (int n = 0; n < 150; ++n) {
                      GatewayClient client(gateway->port(), n % 2 == 0 ? Over::udp : Over::tcp);
                      Octets noise(numbers() % 300);
                      for (auto& octet : noise) octet = static_cast<std::byte>(numbers());
                      if (n % 3 == 0 || noise.size() < 8) {
                          (void)client.send_octets(noise);
                          continue;
                      }
                      // A valid frame with random data, to a slave that is present.
                      auto message =
                          frame(static_cast<std::uint16_t>(0x1000 + numbers() % 8), numbers() % 16, 1, noise);
                      (void)client.send_octets(message);
                  }
                  EXPECT_TRUE(served());
              }}),
              0);
}

TEST_F(GatewayClients, AClientThatFloodsAndDoesNotReadWaitsForItself) {
    EXPECT_EQ(run({[&] {
                  GatewayClient flood(gateway->port(), Over::tcp);
                  // Small buffers of the system are full soon.
                  const int small = 4096;
                  (void)::setsockopt(flood.fd(), SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
                  (void)::setsockopt(flood.fd(), SOL_SOCKET, SO_SNDBUF, &small, sizeof small);
                  const auto message = frame(kOdd, kCoe, 1, sdo(0x40, 0x1008, 0));
                  int sent = 0;
                  while (sent < 2'000'000 && flood.send_octets(message, MSG_DONTWAIT)) ++sent;
                  EXPECT_LT(sent, 2'000'000) << "the gateway reads on without answering";
                  GatewayClient steady(gateway->port(), Over::tcp);
                  for (int n = 0; n < 20; ++n) EXPECT_TRUE(good(steady));
              }}),
              0);
}

TEST_F(GatewayClients, AFloodOfDatagramsIsAnsweredByErrors) {
    EXPECT_EQ(run({[&] {
                  GatewayClient flood(gateway->port(), Over::udp);
                  GatewayClient steady(gateway->port(), Over::tcp);
                  const auto message = frame(kOdd, kCoe, 1, sdo(0x40, 0x2100, 0));  // the slave needs 500 ms for it
                  for (int n = 0; n < 2000; ++n) (void)flood.send_octets(message, MSG_DONTWAIT);
                  EXPECT_EQ(flood.receive().value_or(Message{}).error(), 7U);
                  for (int n = 0; n < 3; ++n) EXPECT_EQ(upload(steady, kDrive, 0x1018, 1).size(), 4U);
              }}),
              0);
}

TEST_F(GatewayClients, AClientThatGoesAwayInTheMiddleLeavesNothing) {
    EXPECT_EQ(run({[&] {
                  for (int n = 0; n < 16; ++n) {
                      GatewayClient gone(gateway->port(), n % 2 == 0 ? Over::tcp : Over::udp);
                      gone.send(kOdd, kCoe, sdo(0x40, n % 3 == 0 ? 0x2100 : 0x2004, 0));
                      if (n % 4 == 0) (void)gone.receive();  // in a segmented transfer
                  }
                  EXPECT_TRUE(served());
              }}),
              0);
}

TEST_F(GatewayClients, MoreConnectionsThanPlacesAreClosed) {
    serve({.clients = 2});
    EXPECT_EQ(run({[&] {
                  GatewayClient first(gateway->port(), Over::tcp);
                  GatewayClient second(gateway->port(), Over::tcp);
                  ASSERT_TRUE(good(first));
                  ASSERT_TRUE(good(second));
                  GatewayClient third(gateway->port(), Over::tcp);
                  EXPECT_TRUE(third.ended());
                  GatewayClient sender(gateway->port(), Over::udp);
                  EXPECT_EQ(sender.ask(kOdd, kCoe, sdo(0x40, 0x1018, 1)).error(), 7U);
                  EXPECT_TRUE(good(first));
                  EXPECT_EQ(gateway->counts().refused, 2U);
              }}),
              0);
}

// A client is stalled when its frame does not arrive completely within 10 s, or when it reads no reply for 10 s. The
// test sets the time.
TEST(GatewayConnections, AFrameThatNeverEndsAndRepliesThatNobodyReadsAreStalled) {
    std::array<int, 2> ends{};
    ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends.data()), 0);
    gateway::Moment now{1h};
    gateway::TcpClient client(ends[1], now);
    const auto trickle = [&](const Octets& some) {
        ASSERT_EQ(::send(ends[0], some.data(), some.size(), 0), static_cast<ssize_t>(some.size()));
        EXPECT_EQ(client.receive(now), gateway::TcpClient::Came::octets);
    };
    now += 1h;
    EXPECT_FALSE(client.is_stalled(now, true)) << "an idle client";
    trickle(octets({0x10}));
    for (int n = 0; n < 5; ++n) {
        now += 2s;
        EXPECT_FALSE(client.is_stalled(now, true));
        trickle(octets({0x50}));
    }
    now += 1ms;
    EXPECT_TRUE(client.is_stalled(now, true));
    EXPECT_FALSE(client.is_stalled(now, false)) << "the frames wait for the gateway";
    client.drop(client.received().size());
    EXPECT_FALSE(client.is_stalled(now, true));
    // The next frame begins after the frame that was removed.
    trickle(octets({1, 2, 3}));
    now += 9s;
    client.drop(1);
    EXPECT_FALSE(client.is_stalled(now, true));
    client.drop(2);
    EXPECT_TRUE(client.send(octets({1, 2, 3}), now));
    now += 10s;
    EXPECT_FALSE(client.is_stalled(now, true));
    now += 1ms;
    EXPECT_TRUE(client.is_stalled(now, true));
    EXPECT_TRUE(client.flush(now));
    EXPECT_FALSE(client.is_stalled(now, true));
    ::close(ends[0]);
}

// A client that sends many requests and reads few octets is stalled. A client that reads all replies is not stalled.
TEST(GatewayConnections, ASlowReaderIsStalled) {
    for (const bool slow : {true, false}) {
        std::array<int, 2> ends{};
        ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends.data()), 0);
        for (const int end : ends) {
            const int least = 1;  // the system raises it to a few kilobytes
            ASSERT_EQ(::setsockopt(end, SOL_SOCKET, SO_SNDBUF, &least, sizeof least), 0);
        }
        gateway::Moment now{1h};
        gateway::TcpClient client(ends[1], now);
        while (client.takes_replies()) ASSERT_TRUE(client.send(Octets(1000), now) && client.flush(now));
        Octets into(1000);
        bool stalled = false;
        for (int seconds = 0; seconds < 60 && !stalled; ++seconds) {
            now += 1s;
            do {
                EXPECT_GT(::recv(ends[0], into.data(), into.size(), 0), 0);
                ASSERT_TRUE(client.flush(now));
            } while (!slow && client.has_output());
            stalled = client.is_stalled(now, true);
            EXPECT_FALSE(stalled && seconds < 9);
            if (!client.takes_replies()) continue;
            ASSERT_TRUE(client.send(Octets(1000), now));
        }
        EXPECT_EQ(stalled, slow);
        ::close(ends[0]);
    }
}

// ------------------------------------------------------------------ settings, and the owner

TEST_F(GatewayClients, AGatewayBeforeInitIsAnError) {
    HostContext none({.slaves = 4});
    const MailboxGateway early(none, {.port = 0});
    EXPECT_EQ(early.error(), "mailbox gateway: there is no master yet: create it after init()");
    EXPECT_EQ(early.port(), 0);
}

TEST_F(GatewayClients, WhatCannotBeServedSaysWhy) {
    const auto error = [&](MailboxGatewaySettings settings) {
        return MailboxGateway(ctx, std::move(settings)).error();
    };
    EXPECT_EQ(error({.address = "localhost"}), "localhost: is no IP address in digits");
    EXPECT_EQ(error({.address = ""}), ": is no IP address in digits");
    EXPECT_NE(error({.port = gateway->port()}).find(" (TCP): cannot be bound: "), std::string::npos);
    EXPECT_NE(error({.address = "192.0.2.1"}).find("192.0.2.1:34980 (TCP): cannot be bound: "), std::string::npos);
    EXPECT_EQ(error({.clients = 17}), "mailbox gateway: 17 clients are wanted, and 1 to 16 are possible");
    EXPECT_EQ(error({.waiting = 0}), "mailbox gateway: 0 messages may wait, and 1 to 256 are possible");
    EXPECT_EQ(error({.reply_timeout = 5ms}),
              "mailbox gateway: the reply timeout is 5 ms, and 10 ms to 1 min are possible");
    EXPECT_EQ(error({.pause_in_transfer = 0ms}),
              "mailbox gateway: a pause in a transfer is 0 ms, and 1 ms to 1 min are possible");
    EXPECT_EQ(error({.udp = false, .tcp = false}), "mailbox gateway: neither UDP nor TCP is wanted");
}

TEST_F(GatewayClients, OneTransport) {
    serve({.tcp = false});
    EXPECT_EQ(run({[&] {
                  GatewayClient udp(gateway->port(), Over::udp);
                  EXPECT_TRUE(good(udp));
                  EXPECT_FALSE(GatewayClient(gateway->port(), Over::tcp).connected());
              }}),
              0);
}

TEST_F(GatewayClients, ClientsSpeakByIpVersion6) {
    gateway.reset();
    gateway = std::make_unique<MailboxGateway>(ctx, MailboxGatewaySettings{.address = "::1", .port = 0});
    if (gateway->error().find("Cannot assign requested address") != std::string::npos ||
        gateway->error().find("Address family not supported") != std::string::npos)
        GTEST_SKIP() << "no IPv6 here: " << gateway->error();
    ASSERT_EQ(gateway->error(), "");
    EXPECT_EQ(run({[&] {
                  for (const auto over : {Over::udp, Over::tcp}) {
                      GatewayClient client(gateway->port(), over, false, Ip::v6);
                      ASSERT_TRUE(client.connected());
                      EXPECT_TRUE(good(client));
                  }
                  EXPECT_FALSE(GatewayClient(gateway->port(), Over::tcp).connected()) << "by version 4";
              }}),
              0);
}

TEST_F(GatewayClients, AnOwnerThatDoesNotPollIsToldAndTheGatewayEnds) {
    std::thread first([&] {
        GatewayClient client(gateway->port(), Over::tcp);
        EXPECT_EQ(client.ask(kOdd, kCoe, sdo(0x40, 0x1018, 1)).error(), 7U);
    });
    first.join();
    GatewayClient other(gateway->port(), Over::tcp);
    other.send(kOdd, kCoe, sdo(0x40, 0x1018, 1));
    while (gateway->counts().messages < 2) std::this_thread::yield();
    gateway.reset();  // with a request in the queue
    EXPECT_TRUE(other.ended());
}

}  // namespace
}  // namespace margay
