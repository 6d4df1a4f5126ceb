// The object dictionary of the master at address 0 (ETG.1510).
#include "gateway/gateway_bench.hpp"

namespace margay {
namespace {

class MasterObjectDictionary : public GatewayTest {
  protected:
    void with_client(const std::function<void(GatewayClient&)>& work) {
        EXPECT_EQ(run({[&] {
                      GatewayClient client(gateway->port(), Over::tcp);
                      work(client);
                  }}),
                  0);
    }
    static std::uint32_t value(GatewayClient& client, unsigned index, unsigned subindex) {
        const auto octets = upload(client, 0, index, subindex);
        return octets.empty() ? 0xDEAD'0000 : number(octets, 0, octets.size());
    }
};

TEST_F(MasterObjectDictionary, NamesTheMaster) {
    serve({.name = "Line 1", .identity = {.vendor = 0x11, .product = 0x22, .revision = 0x33, .serial = 0x44}});
    with_client([&](GatewayClient& client) {
        EXPECT_EQ(value(client, 0x1000, 0) & 0xFFFFU, 5001U);
        const auto name = upload(client, 0, 0x1008, 0);
        EXPECT_EQ(std::string(reinterpret_cast<const char*>(name.data()), name.size()), "Line 1");
        EXPECT_FALSE(upload(client, 0, 0x100A, 0).empty());
        EXPECT_EQ(value(client, 0x1018, 0), 4U);
        for (unsigned n = 1; n <= 4; ++n) EXPECT_EQ(value(client, 0x1018, n), 0x11U * n);
        EXPECT_EQ(value(client, 0xF000, 1), 1U);
        EXPECT_EQ(value(client, 0xF000, 2), 4080U);
    });
}

TEST_F(MasterObjectDictionary, ListsTheSlavesAndTheirIdentities) {
    with_client([&](GatewayClient& client) {
        for (const unsigned list : {0xF020U, 0xF040U}) {
            ASSERT_EQ(value(client, list, 0), 6U);
            for (unsigned n = 1; n <= 6; ++n) EXPECT_EQ(value(client, list, n), 0x1000U + n);
        }
        for (const unsigned first : {0x8000U, 0x9000U})
            for (unsigned n = 0; n < 6; ++n) {
                const Identity identity = ctx.slave(static_cast<std::uint16_t>(n + 1)).identity;
                EXPECT_EQ(value(client, first + n, 1), 0x1001U + n);
                EXPECT_EQ(value(client, first + n, 5), identity.vendor);
                EXPECT_EQ(value(client, first + n, 6), identity.product);
                EXPECT_EQ(value(client, first + n, 7), identity.revision);
                EXPECT_EQ(value(client, first + n, 8), identity.serial);
            }
        // Complete access: subindex 0 in 16 bits, then the addresses.
        Message last;
        const auto all = upload(client, 0, 0xF020, 0, &last);
        (void)all;
        const auto complete = client.ask(0, kCoe, sdo(0x50, 0xF020, 0));
        ASSERT_EQ(complete.data.size(), 10U + 14U);
        EXPECT_EQ(number(complete.data, 10, 4), 0x10010006U);
    });
}

TEST_F(MasterObjectDictionary, ALostSlaveIsConfiguredAndNotDetected) {
    segment.set_power(5, false, osal.now());
    osal.advance(10ms);
    (void)readstate(ctx);
    (void)run({[&] {
        GatewayClient client(gateway->port(), Over::udp);
        EXPECT_EQ(value(client, 0xF020, 0), 6U);
        EXPECT_EQ(value(client, 0xF040, 0), 5U);
        EXPECT_EQ(abort_of(client.ask(0, kCoe, sdo(0x40, 0x9005, 1))), 0x06020000U);
        EXPECT_EQ(value(client, 0x8005, 6), ctx.slave(6).identity.product);
        EXPECT_EQ(client.ask(kPort, kCoe, sdo(0x40, 0x1000, 0)).error(), 4U);
    }});
}

TEST_F(MasterObjectDictionary, AbortsByTheRightCode) {
    with_client([&](GatewayClient& client) {
        EXPECT_EQ(abort_of(client.ask(0, kCoe, sdo(0x40, 0x2000, 0))), 0x06020000U);
        EXPECT_EQ(abort_of(client.ask(0, kCoe, sdo(0x40, 0x8006, 1))), 0x06020000U) << "there are six slaves";
        EXPECT_EQ(abort_of(client.ask(0, kCoe, sdo(0x40, 0xF020, 7))), 0x06090011U);
        EXPECT_EQ(abort_of(client.ask(0, kCoe, sdo(0x40, 0x8000, 2))), 0x06090011U) << "not known for sure";
        EXPECT_EQ(abort_of(client.ask(0, kCoe, sdo(0x2B, 0xF020, 1, 7))), 0x06010002U);
        EXPECT_EQ(abort_of(client.ask(0, kCoe, sdo(0x2B, 0xF002, 1, 1))), 0x06010002U);
        EXPECT_EQ(client.ask(0, kFoe, octets({1, 0, 0, 0, 0, 0, 'a'})).error(), 2U);
        EXPECT_EQ(client.ask(0, kCoe, octets({0, 0x10, 0, 0, 0, 0, 0, 0, 0, 0})).error(), 4U);
    });
}

TEST_F(MasterObjectDictionary, IsListedBySdoInformation) {
    with_client([&](GatewayClient& client) {
        const auto list = client.ask(0, kCoe, octets({0x00, 0x80, 0x01, 0, 0, 0, 1, 0}));
        ASSERT_EQ(at(list.data, 2), 0x02U);
        // The list: 1000 1008 100A 1018, 6 × 8nnn, 6 × 9nnn, F000 F002 F020 F040.
        EXPECT_EQ((list.data.size() - 8) / 2, 20U);
        const auto object = client.ask(0, kCoe, octets({0x00, 0x80, 0x03, 0, 0, 0, 0x20, 0xF0}));
        EXPECT_EQ(at(object.data, 10), 6U);
        EXPECT_EQ(at(object.data, 11), 8U) << "an array";
        const auto entry = client.ask(0, kCoe, octets({0x00, 0x80, 0x05, 0, 0, 0, 0x05, 0x80, 0x05, 0}));
        EXPECT_EQ(number(entry.data, 10, 2), 7U) << "UNSIGNED32";
        EXPECT_EQ(number(entry.data, 14, 2), 7U) << "read only, in all states";
    });
}

}  // namespace
}  // namespace margay
