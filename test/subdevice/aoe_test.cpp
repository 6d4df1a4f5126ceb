// The AoE server: octets by hand from ETG.1020 and the ADS commands. The messages are decoded by tshark, too
// (tshark_test.cpp).
#include "subdevice/aoe_server.hpp"

#include "bench_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;
using Octets = std::vector<std::byte>;

Octets octets_from(std::initializer_list<unsigned> values) {
    Octets out;
    for (const unsigned v : values) out.push_back(static_cast<std::byte>(v));
    return out;
}

class Cell final : public AoeDevice {
  public:
    AoeError read(AoeIndex index, MutableBytes into, std::size_t& bytes, Time) override {
        if (index.group != 5) return AoeError::invalid_group;
        bytes = std::min(into.size(), value.size());
        std::copy_n(value.begin(), bytes, into.begin());
        return AoeError::none;
    }
    AoeError write(AoeIndex index, Bytes data, Time) override {
        if (index.group != 5) return AoeError::invalid_group;
        value.assign(data.begin(), data.end());
        return AoeError::none;
    }
    Octets value = octets_from({1, 2, 3, 4});
};

constexpr std::uint16_t kMailbox = 100;

class AoeServerTest : public ::testing::Test {
  protected:
    AoeServerTest() {
        bench.mailbox.emplace(bench.esc, MutableBytes(receive_), MutableBytes(send_), protocols_);
        bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox);
        bench.device->start(bench.esc.time);
        bench.configure(kMailbox);
        (void)bench.request(2);
    }
    // A request from 9.9.9.9.9.9:7 to `net_id`, port 20 or 21.
    static Octets request(unsigned command, const Octets& data, unsigned net_id = 0, unsigned port = 20,
                          unsigned flags = 4) {
        Octets all = octets_from({net_id, net_id, net_id,  net_id, net_id, net_id, port,
                                  0,      9,      9,       9,      9,      9,      9,
                                  7,      0,      command, 0,      flags,  0,      static_cast<unsigned>(data.size()),
                                  0,      0,      0,       0,      0,      0,      0,
                                  0xDD,   0xCC,   0xBB,    0xAA});
        all.insert(all.end(), data.begin(), data.end());
        return all;
    }
    // Returns the data of the response. Its header must be the answer to the request.
    Octets exchange(const Octets& message, unsigned error = 0) {
        EXPECT_TRUE(bench.send(wire::MailboxType::aoe, message));
        (void)bench.step();
        const auto reply = bench.receive(wire::MailboxType::aoe);
        if (reply.size() < 32) {
            ADD_FAILURE() << "a response of " << reply.size() << " octets";
            return {};
        }
        EXPECT_TRUE(std::equal(reply.begin(), reply.begin() + 8, message.begin() + 8));
        EXPECT_TRUE(std::equal(reply.begin() + 8, reply.begin() + 16, message.begin()));
        EXPECT_EQ(reply[16], message[16]);
        EXPECT_EQ(reply[18], std::byte{5});
        EXPECT_EQ(load_le<std::uint32_t>(reply, 20), reply.size() - 32);
        EXPECT_EQ(load_le<std::uint32_t>(reply, 24), error);
        EXPECT_EQ(load_le<std::uint32_t>(reply, 28), 0xAABBCCDDU);
        return {reply.begin() + 32, reply.end()};
    }
    Bench bench{kMailbox};
    Cell own;
    Cell behind;
    std::array<AoeRoute, 2> routes{{{&own, 20}, {&behind, 21, true, {{8, 8, 8, 8, 8, 8}}}}};
    std::array<AoeWatch, 2> watches{};
    AoeServer server{routes, watches};

  private:
    std::array<MailboxProtocol, 2> protocols_{
        {{wire::MailboxType::coe, &bench.coe}, {wire::MailboxType::aoe, &server}}};
    std::array<std::byte, 256> receive_{};
    std::array<std::byte, 256 * 4> send_{};
};

const Octets kAt = octets_from({5, 0, 0, 0, 0, 0, 0, 0});
Octets at(std::initializer_list<unsigned> rest) {
    Octets all = kAt;
    const Octets more = octets_from(rest);
    all.insert(all.end(), more.begin(), more.end());
    return all;
}
const Octets kDone = octets_from({0, 0, 0, 0});

TEST_F(AoeServerTest, AnswersEveryCommand) {
    EXPECT_EQ(exchange(request(2, at({4, 0, 0, 0}))), octets_from({0, 0, 0, 0, 4, 0, 0, 0, 1, 2, 3, 4}));
    EXPECT_EQ(exchange(request(2, at({2, 0, 0, 0}))), octets_from({0, 0, 0, 0, 2, 0, 0, 0, 1, 2}));
    EXPECT_EQ(exchange(request(3, at({2, 0, 0, 0, 8, 9}))), kDone);
    EXPECT_EQ(own.value, octets_from({8, 9}));
    EXPECT_EQ(exchange(request(4, {})), octets_from({0, 0, 0, 0, 5, 0, 0, 0}));
    const auto info = exchange(request(1, {}));
    EXPECT_EQ(info.size(), 24U);
    EXPECT_EQ(exchange(request(5, octets_from({6, 0, 0, 0, 0, 0, 0, 0}))), octets_from({0x01, 0x07, 0, 0}));
    EXPECT_EQ(exchange(request(9, at({4, 0, 0, 0, 0, 0, 0, 0}))), octets_from({0x01, 0x07, 0, 0, 0, 0, 0, 0}));
    // An error has no data.
    EXPECT_EQ(exchange(request(2, octets_from({6, 0, 0, 0, 0, 0, 0, 0, 4, 0, 0, 0}))),
              octets_from({0x02, 0x07, 0, 0, 0, 0, 0, 0}));
}

TEST_F(AoeServerTest, FindsDevicesByNetIdAndPort) {
    behind.value = octets_from({7});
    EXPECT_EQ(exchange(request(2, at({1, 0, 0, 0}), 8, 21)), octets_from({0, 0, 0, 0, 1, 0, 0, 0, 7}));
    EXPECT_EQ(exchange(request(2, at({1, 0, 0, 0}), 8, 20), 6), Octets{});
    EXPECT_EQ(exchange(request(2, at({1, 0, 0, 0}), 1, 20), 7), Octets{});
    // The master gives the slave its NetID.
    const Octets set = octets_from({1, 0, 0, 0, 3, 0, 0, 0, 6, 0, 0, 0, 5, 5, 5, 5, 5, 5});
    EXPECT_EQ(exchange(request(3, set, 5, 0)), kDone);
    EXPECT_EQ(server.net_id(), (AoeNetId{{5, 5, 5, 5, 5, 5}}));
    EXPECT_EQ(exchange(request(2, at({1, 0, 0, 0}), 5, 20)), octets_from({0, 0, 0, 0, 1, 0, 0, 0, 1}));
    EXPECT_EQ(exchange(request(2, at({1, 0, 0, 0}), 0, 20), 7), Octets{}) << "the NetID before";
    // The same write to a device behind the slave does not change the NetID of the slave.
    EXPECT_EQ(exchange(request(3, set, 8, 21)), octets_from({0x02, 0x07, 0, 0}));
    EXPECT_EQ(server.net_id(), (AoeNetId{{5, 5, 5, 5, 5, 5}}));
    // A NetID of five octets is invalid.
    EXPECT_EQ(exchange(request(3, octets_from({1, 0, 0, 0, 3, 0, 0, 0, 5, 0, 0, 0, 4, 4, 4, 4, 4}), 5, 20)),
              octets_from({0x02, 0x07, 0, 0}));
}

TEST_F(AoeServerTest, HostileRequestsGetAnErrorOfTheHeader) {
    EXPECT_EQ(exchange(request(0, {}), 8), Octets{});
    EXPECT_EQ(exchange(request(8, Octets(20)), 8), Octets{}) << "a notification is no request";
    EXPECT_EQ(exchange(request(77, {}), 8), Octets{});
    for (const unsigned command : {2U, 3U, 5U, 6U, 7U, 9U})
        EXPECT_EQ(exchange(request(command, octets_from({1, 2, 3})), 0x0E), Octets{});
    EXPECT_EQ(exchange(request(3, at({3, 0, 0, 0, 8, 9})), 0x0E), Octets{}) << "an octet is missing";
    EXPECT_EQ(exchange(request(3, at({0xFF, 0xFF, 0xFF, 0xFF, 8})), 0x0E), Octets{});
    EXPECT_EQ(exchange(request(9, at({0, 0, 0, 0, 1, 0, 0, 0})), 0x0E), Octets{});
    EXPECT_EQ(exchange(request(5, octets_from({6, 0, 0, 0, 1, 0, 0, 0})), 0x0E), Octets{});
    Octets length = request(4, {});
    length[20] = std::byte{1};
    EXPECT_EQ(exchange(length, 0x0E), Octets{});
    // The request is for more octets than a mailbox can carry.
    EXPECT_EQ(exchange(request(2, at({0xFF, 0xFF, 0xFF, 0xFF}))), octets_from({0x05, 0x07, 0, 0}));
    EXPECT_EQ(exchange(request(2, at({55, 0, 0, 0}))), octets_from({0x05, 0x07, 0, 0}));
    EXPECT_EQ(exchange(request(2, at({54, 0, 0, 0}))).size(), 12U);
    // A part of a header, and a response.
    for (const std::size_t bytes : {1U, 31U}) {
        ASSERT_TRUE(bench.send(wire::MailboxType::aoe, Octets(bytes)));
        (void)bench.step();
        EXPECT_EQ(bench.receive(wire::MailboxType::error), octets_from({1, 0, 6, 0}));
    }
    ASSERT_TRUE(bench.send(wire::MailboxType::aoe, request(4, {}, 0, 20, 5)));
    (void)bench.step();
    EXPECT_EQ(bench.receive(wire::MailboxType::error), octets_from({1, 0, 5, 0}));
    // The master wants no response.
    ASSERT_TRUE(bench.send(wire::MailboxType::aoe, request(3, at({1, 0, 0, 0, 42}), 0, 20, 6)));
    (void)bench.step();
    EXPECT_TRUE(bench.fetch().empty());
    EXPECT_EQ(own.value, octets_from({42}));
}

TEST_F(AoeServerTest, NotifiesInTheFormOfTheStandard) {
    const auto add = [](unsigned length, unsigned mode, unsigned cycle_100_us) {
        Octets data = octets_from({5, 0, 0, 0, 0, 0, 0, 0, length, 0, 0, 0, mode, 0, 0, 0, 0, 0, 0, 0});
        data.resize(40);
        store_le<std::uint32_t>(data, 20, cycle_100_us * 1000);
        return request(6, data);
    };
    EXPECT_EQ(exchange(add(2, 9, 10)), octets_from({0x13, 0x07, 0, 0}));
    EXPECT_EQ(exchange(add(0, 4, 10)), octets_from({0x05, 0x07, 0, 0}));
    EXPECT_EQ(exchange(add(17, 4, 10)), octets_from({0x05, 0x07, 0, 0}));
    bench.esc.time = Time{} + 1'700'000'000s + 123'456'799ns;
    EXPECT_EQ(exchange(add(2, 4, 20)), octets_from({0, 0, 0, 0, 1, 0, 0, 0}));
    bench.settle();
    const auto first = bench.receive(wire::MailboxType::aoe);
    ASSERT_EQ(first.size(), 32U + 30U);
    EXPECT_EQ(Octets(first.begin(), first.begin() + 8), octets_from({9, 9, 9, 9, 9, 9, 7, 0})) << "to who asked";
    EXPECT_EQ(Octets(first.begin() + 16, first.begin() + 24), octets_from({8, 0, 4, 0, 30, 0, 0, 0}));
    EXPECT_EQ(Octets(first.begin() + 32, first.begin() + 40), octets_from({26, 0, 0, 0, 1, 0, 0, 0}));
    EXPECT_EQ(load_le<std::uint64_t>(first, 40), 17'000'000'001'234'567u) << "in units of 100 ns";
    EXPECT_EQ(Octets(first.begin() + 48, first.end()), octets_from({1, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 1, 2}));
    // There is no notification while the value does not change, and one after a change.
    for (int n = 0; n < 10; ++n) {
        bench.esc.time += std::chrono::milliseconds(2);
        (void)bench.step();
        EXPECT_TRUE(bench.fetch().empty());
    }
    own.value = octets_from({6, 6});
    bench.esc.time += std::chrono::milliseconds(2);
    (void)bench.step();
    EXPECT_EQ(bench.receive(wire::MailboxType::aoe)[60], std::byte{6});
    // A second notification is added. There is no place for a third. The end of the first notification frees a place.
    EXPECT_EQ(exchange(add(2, 4, 10)), octets_from({0, 0, 0, 0, 2, 0, 0, 0}));
    (void)bench.step();
    (void)bench.fetch();
    EXPECT_EQ(exchange(add(2, 3, 10)), octets_from({0x16, 0x07, 0, 0}));
    EXPECT_EQ(exchange(request(7, octets_from({3, 0, 0, 0}))), octets_from({0x14, 0x07, 0, 0}));
    EXPECT_EQ(exchange(request(7, octets_from({1, 0, 0, 0}))), kDone);
    EXPECT_EQ(exchange(request(7, octets_from({1, 0, 0, 0}))), octets_from({0x14, 0x07, 0, 0}));
    // INIT ends all notifications.
    (void)bench.request(1);
    bench.configure(kMailbox);
    (void)bench.request(2);
    own.value = octets_from({7, 7});
    bench.esc.time += std::chrono::milliseconds(5);
    bench.settle();
    EXPECT_TRUE(bench.fetch().empty());
}

}  // namespace
}  // namespace margay::subdevice
