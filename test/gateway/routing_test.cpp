// MailboxGateway: messages of each protocol to the slaves and their replies, beside a cycle whose inputs are checked.
// The clients compose every octet by hand.
#include "gateway/gateway_bench.hpp"

#include <margay/voe.hpp>

namespace margay {
namespace {

class Routing : public GatewayTest, public testing::WithParamInterface<Over> {
  protected:
    // Executes a client in a thread of its own. No cycle may be wrong meanwhile.
    void with_client(const std::function<void(GatewayClient&)>& work) {
        EXPECT_EQ(run({[&] {
                      GatewayClient client(gateway->port(), GetParam());
                      ASSERT_TRUE(client.connected());
                      work(client);
                  }}),
                  0)
            << "of " << cycles;
    }
};
INSTANTIATE_TEST_SUITE_P(Both, Routing, testing::Values(Over::udp, Over::tcp),
                         [](const auto& param) { return param.param == Over::udp ? "Udp" : "Tcp"; });

TEST_P(Routing, AReplyHasTheAddressCounterAndPriorityOfItsMessage) {
    with_client([&](GatewayClient& client) {
        for (unsigned counter = 0; counter <= 7; ++counter) {
            client.send(kDrive, kCoe, sdo(0x40, 0x1018, 2), counter, counter % 4);
            const auto reply = client.receive();
            ASSERT_TRUE(reply);
            EXPECT_EQ(reply->address, kDrive);
            EXPECT_EQ(reply->type, unsigned{kCoe});
            EXPECT_EQ(reply->counter, counter);
            EXPECT_EQ(reply->priority, counter % 4);
            Octets wanted = octets({0x00, 0x30, 0x43, 0x18, 0x10, 0x02});
            append(wanted, ctx.slave(3).identity.product, 4);
            EXPECT_EQ(reply->data, wanted);
        }
    });
}

TEST_P(Routing, UploadsAndDownloadsOfAnySize) {
    with_client([&](GatewayClient& client) {
        // An object of 1024 octets, with mailboxes of 128 octets.
        Octets block;
        for (unsigned n = 0; n < 1024; ++n) append(block, 2 + 2048 + n, 1);
        EXPECT_EQ(upload(client, kOdd, 0x2002, 0), block);
        std::ranges::reverse(block);
        EXPECT_TRUE(download(client, kOdd, 0x2002, 0, block, kRoom));
        EXPECT_EQ(upload(client, kOdd, 0x2002, 0), block);
        // The client gets the abort of the slave unchanged.
        const auto missing = client.ask(kOdd, kCoe, sdo(0x40, 0x5FFF, 0));
        EXPECT_EQ(abort_of(missing), 0x06020000U);
        // The client aborts a transfer before its end: the abort gets no reply, and the next transfer works.
        (void)client.ask(kOdd, kCoe, sdo(0x40, 0x2003, 0));
        client.send(kOdd, kCoe, sdo(0x80, 0x2003, 0, 0x08000000));
        EXPECT_EQ(upload(client, kOdd, 0x2002, 0), block);
    });
}

TEST_P(Routing, EveryFragmentOfAListComesWithTheCounterOfTheMessage) {
    with_client([&](GatewayClient& client) {
        client.send(kOdd, kCoe, octets({0x00, 0x80, 0x01, 0, 0, 0, 1, 0}), 5);
        std::size_t indices = 0;
        unsigned left = 1;
        for (unsigned n = 0; left != 0; ++n) {
            const auto reply = client.receive();
            ASSERT_TRUE(reply);
            ASSERT_EQ(reply->counter, 5U);
            ASSERT_GE(reply->data.size(), 6U);
            left = number(reply->data, 4, 2);
            EXPECT_EQ(at(reply->data, 2), left != 0 ? 0x82U : 0x02U);
            indices += (reply->data.size() - (n == 0 ? 8 : 6)) / 2;
        }
        const auto lengths = client.ask(kOdd, kCoe, octets({0x00, 0x80, 0x01, 0, 0, 0, 0, 0}), 6);
        EXPECT_EQ(indices, number(lengths.data, 8, 2));
        EXPECT_GT(indices, 64U);
        const auto object = client.ask(kOdd, kCoe, octets({0x00, 0x80, 0x03, 0, 0, 0, 0x00, 0x10}), 7);
        EXPECT_EQ(at(object.data, 2), 0x04U);
        const auto none = client.ask(kOdd, kCoe, octets({0x00, 0x80, 0x03, 0, 0, 0, 0xFF, 0x5F}), 1);
        EXPECT_EQ(at(none.data, 2), 0x07U);
    });
}

TEST_P(Routing, ParametersOfDrives) {
    with_client([&](GatewayClient& client) {
        // S-0-0001 of drive 1: the value (element bit 6), then the name (bit 1).
        const auto value = client.ask(kAxes, kSoe, octets({0x21, 0x40, 0x01, 0x00}), 4);
        ASSERT_EQ(value.type, unsigned{kSoe});
        EXPECT_EQ(value.counter, 4U);
        EXPECT_EQ(number(value.data, 0, 4), 0x00014022U);
        EXPECT_EQ(value.data.size(), 6U);
        const auto name = client.ask(kAxes, kSoe, octets({0x01, 0x02, 0x01, 0x00}), 5);
        EXPECT_NE(std::string(reinterpret_cast<const char*>(name.data.data()), name.data.size()).find("cycle time"),
                  std::string::npos);
        // The drive has no such IDN. The client gets the error reply of the drive.
        const auto missing = client.ask(kAxes, kSoe, octets({0x01, 0x40, 0xFF, 0x6F}), 6);
        EXPECT_EQ(at(missing.data, 0) & 0x10U, 0x10U);
        EXPECT_EQ(number(missing.data, 4, 2), 0x1001U);
    });
}

TEST_P(Routing, IpParametersOfEoeButNoFrames) {
    with_client([&](GatewayClient& client) {
        const auto parameters = client.ask(kPort, kEoe, octets({0x06, 0x00, 0x00, 0x00}), 2);
        ASSERT_EQ(parameters.type, unsigned{kEoe});
        EXPECT_EQ(at(parameters.data, 0) & 0xFU, 7U);
        Octets fragment = octets({0x00, 0x01, 0x40, 0x00});
        fragment.resize(64);
        EXPECT_EQ(client.ask(kPort, kEoe, fragment).error(), 4U);
    });
}

TEST_P(Routing, EveryMailThatAnswersAVendorMessage) {
    with_client([&](GatewayClient& client) {
        // Vendor 0x4D47, type 1: an echo.
        const auto echo = octets({0x47, 0x4D, 0, 0, 1, 0, 0xAA, 0xBB});
        client.send(kVoice, kVoe, echo, 6);
        auto reply = client.receive();
        ASSERT_TRUE(reply);
        EXPECT_EQ(reply->data, echo);
        EXPECT_EQ(reply->counter, 6U);
        // Type 2 asks the device for five messages.
        client.send(kVoice, kVoe, octets({0x47, 0x4D, 0, 0, 2, 0, 2, 0, 5, 0, 8, 0}), 7);
        for (unsigned n = 0; n < 5; ++n) {
            reply = client.receive();
            ASSERT_TRUE(reply) << n;
            EXPECT_EQ(number(reply->data, 4, 2), 3U);
            EXPECT_EQ(number(reply->data, 6, 4), n);
            EXPECT_EQ(reply->counter, 7U);
        }
    });
}

TEST_P(Routing, VendorMessagesThatTheApplicationListensToStayItsOwn) {
    std::vector<std::byte> memory(4096);
    VoeInbox inbox{memory};
    inbox.only_slave = 4;
    inbox.look_every = 1ms;
    ASSERT_TRUE(listen(ctx, inbox));
    with_client([&](GatewayClient& client) {
        client.send(kVoice, kVoe, octets({0x47, 0x4D, 0, 0, 1, 0, 0xAA, 0xBB}));
        std::array<std::byte, 64> data{};
        VoeReceive got;
        got.inbox = &inbox;
        got.data = data;
        got.timeout = 24h;
        EXPECT_TRUE(submit(ctx, got));
        while (got.busy()) std::this_thread::yield();
        EXPECT_EQ(got.state(), RequestState::success) << words(got.error());
        client.wait_at_most(50);
        EXPECT_FALSE(client.receive());
    });
}

// ------------------------------------------------------------------ what cannot be routed

TEST_P(Routing, ErrorRepliesSayWhy) {
    with_client([&](GatewayClient& client) {
        const auto upload_type = sdo(0x40, 0x1000, 0);
        const auto unknown = client.ask(0x1FFF, kCoe, upload_type, 5);
        EXPECT_EQ(unknown.error(), 1U) << "no slave has the address";
        EXPECT_EQ(unknown.address, 0x1FFF);
        EXPECT_EQ(unknown.counter, 5U);
        EXPECT_EQ(client.ask(kPlain, kCoe, upload_type).error(), 2U) << "a slave without mailbox";
        EXPECT_EQ(client.ask(kOdd, 9, upload_type).error(), 2U) << "no protocol";
        EXPECT_EQ(client.ask(kOdd, kSoe, octets({0x01, 0x40, 0x01, 0x00})).error(), 2U) << "the slave says so";
        EXPECT_EQ(client.ask(kOdd, kCoe, octets({0x00, 0x30, 0x43, 0, 0, 0})).error(), 4U) << "a response";
        EXPECT_EQ(client.ask(kOdd, kCoe, octets({0x00, 0xF0, 0x43})).error(), 5U) << "no service";
        EXPECT_EQ(client.ask(kOdd, kCoe, octets({0x00})).error(), 6U) << "shorter than its header";
        EXPECT_EQ(client.ask(kOdd, kCoe, {}).error(), 6U) << "no data";
        Octets large = upload_type;
        large.resize(kRoom + 1);
        EXPECT_EQ(client.ask(kOdd, kCoe, large).error(), 8U) << "longer than the mailbox";
        auto lies = frame(kOdd, kCoe, 1, upload_type);
        lies[2] = std::byte{0xFF};  // the length in the mailbox header
        ASSERT_TRUE(client.send_octets(lies));
        EXPECT_EQ(client.receive().value_or(Message{}).error(), 8U) << "more announced than sent";
        // An error message of a client gets no reply. The next message gets a reply.
        client.send(kOdd, kErr, octets({1, 0, 1, 0}));
        EXPECT_EQ(client.ask(kOdd, kCoe, upload_type).type, unsigned{kCoe});
    });
}

TEST_P(Routing, SeveralMessagesInOneFrameAndSeveralFrames) {
    with_client([&](GatewayClient& client) {
        const auto one = frame(kOdd, kCoe, 1, sdo(0x40, 0x1018, 1));
        const auto two = frame(kDrive, kCoe, 2, sdo(0x40, 0x1018, 2));
        Octets both;
        append(both, static_cast<std::uint32_t>((one.size() + two.size() - 4) | 0x5000U), 2);
        both.insert(both.end(), one.begin() + 2, one.end());
        both.insert(both.end(), two.begin() + 2, two.end());
        both.insert(both.end(), one.begin(), one.end());  // another frame
        ASSERT_TRUE(client.send_octets(both));
        std::multiset<std::uint16_t> from;
        for (int n = 0; n < 3; ++n) from.insert(client.receive().value_or(Message{}).address);
        EXPECT_EQ(from, (std::multiset<std::uint16_t>{kOdd, kOdd, kDrive}));
    });
}

TEST_P(Routing, ASlaveBelowPreopIsRefused) {
    ASSERT_TRUE(writestate(ctx, 3, AlState::init));
    ASSERT_TRUE(statecheck(ctx, 3, AlState::init, 1s));
    (void)run({[&] {
        GatewayClient client(gateway->port(), GetParam());
        EXPECT_EQ(client.ask(kDrive, kCoe, sdo(0x40, 0x1000, 0)).error(), 4U);
        EXPECT_EQ(client.ask(kOdd, kCoe, sdo(0x40, 0x1000, 0)).type, unsigned{kCoe});
    }});
}

// A slave that was away may be another device: nothing is written to it before the library has identified it.
TEST_P(Routing, ADeviceThatMayHaveBeenExchangedGetsNoMessage) {
    segment.set_power(2, false, osal.now());
    osal.advance(10ms);
    (void)readstate(ctx);
    segment.set_power(2, true, osal.now());
    osal.advance(100ms);
    // The device that is there now gets the station address of the lost slave.
    (void)segment.slave(2).ecat_write(0x0010, octets({0x03, 0x10}), osal.now());
    sim::FrameEnd end{};
    end.at = osal.now();
    segment.slave(2).frame_end(end);
    segment.slave(2).sii().fail_next(1'000'000);
    EXPECT_FALSE(readstate(ctx).ok()) << "its identity cannot be read";
    const auto refused = SDOwrite(ctx, 3, 0x6060, 0, false, octets({8}), 1s);
    ASSERT_EQ(refused.error().code, Errc::identity_unread) << words(refused.error());
    (void)run({[&] {
        GatewayClient client(gateway->port(), GetParam());
        EXPECT_EQ(client.ask(kDrive, kCoe, sdo(0x2F, 0x6060, 0, 8)).error(), 4U);
    }});
}

TEST_P(Routing, ReadOnlyRefusesWhatMayChangeASlave) {
    serve({.read_only = true});
    with_client([&](GatewayClient& client) {
        const auto refused = client.ask(kOdd, kCoe, sdo(0x2F, 0x7000, 1, 1), 3);
        EXPECT_EQ(abort_of(refused), 0x08000021U);
        EXPECT_EQ(number(refused.data, 3, 3), 0x017000U);
        EXPECT_EQ(client.ask(kAxes, kSoe, octets({0x03, 0x40, 0x01, 0x00, 1, 0})).error(), 4U);
        EXPECT_EQ(client.ask(kVoice, kVoe, octets({0x47, 0x4D, 0, 0, 1, 0})).error(), 4U);
        EXPECT_EQ(client.ask(kOdd, kFoe, octets({2, 0, 0, 0, 0, 0, 'a'})).error(), 4U);
        EXPECT_EQ(client.ask(kPort, kEoe, octets({0x02, 0, 0, 0, 0, 0, 0, 0})).error(), 4U);
        EXPECT_FALSE(upload(client, kOdd, 0x2002, 0).empty());
        EXPECT_EQ(client.ask(kAxes, kSoe, octets({0x01, 0x40, 0x01, 0x00})).type, unsigned{kSoe});
    });
}

// After a client has changed the PDO assignment, the process data is not exchanged with the old mapping.
TEST_P(Routing, AChangedPdoAssignmentNeedsANewMapping) {
    ASSERT_TRUE(reach(ctx, AlState::preop, 5s));
    (void)run({[&] {
        GatewayClient client(gateway->port(), GetParam());
        const auto refused = client.ask(kOdd, kCoe, sdo(0x2B, 0x1C12, 1, 0x1601));
        EXPECT_NE(abort_of(refused), 0U) << "subindex 0 is not 0";
        EXPECT_EQ(at(client.ask(kOdd, kCoe, sdo(0x2F, 0x1C12, 0, 0)).data, 2), 0x60U);
    }});
    const auto refused = reach(ctx, AlState::safeop, 2s);
    EXPECT_EQ(refused.error().code, Errc::remapping_needed) << words(refused.error());
    EXPECT_EQ(refused.error().slave, 1);
}

}  // namespace
}  // namespace margay
