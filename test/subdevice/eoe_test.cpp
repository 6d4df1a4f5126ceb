// The EoE server: octets by hand from ETG.1000.6 "Ethernet over EtherCAT".
#include "subdevice/eoe_server.hpp"

#include "bench_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;
using EoeOctets = std::vector<std::byte>;

EoeOctets eoe_octets(std::initializer_list<unsigned> values) {
    EoeOctets out;
    for (const unsigned v : values) out.push_back(static_cast<std::byte>(v));
    return out;
}

// A frame of the experimental type 0x88B5.
EoeOctets eoe_frame(std::size_t bytes) {
    EoeOctets out(bytes);
    for (std::size_t n = 0; n < bytes; ++n) out[n] = static_cast<std::byte>(n * 3);
    const EoeOctets head = eoe_octets({2, 3, 6, 9, 12, 15, 2, 21, 24, 27, 30, 33, 0x88, 0xB5});
    std::copy_n(head.begin(), std::min(bytes, head.size()), out.begin());
    return out;
}

class EoeAuthor final : public EoeApplication {
  public:
    void received(EoeServer& server, Bytes frame, Time) override {
        last.assign(frame.begin(), frame.end());
        ++frames;
        if (answers) sent += server.send(frame, 1) ? 1U : 0U;
    }
    EoeResult set_ip(const EoeIp& wanted) override {
        if (refuses) return EoeApplication::set_ip(wanted);
        ip = wanted;
        return EoeResult::success;
    }
    EoeResult get_ip(EoeIp& wanted) override {
        wanted = ip;
        return refuses ? EoeApplication::get_ip(wanted) : EoeResult::success;
    }
    EoeResult set_filter(const EoeFilter& wanted) override {
        if (refuses) return EoeApplication::set_filter(wanted);
        filter = wanted;
        return EoeResult::success;
    }
    EoeResult get_filter(EoeFilter& wanted) override {
        wanted = filter;
        return refuses ? EoeApplication::get_filter(wanted) : EoeResult::success;
    }
    void stopped() override { ++stops; }
    std::uint32_t time_stamp(Time) override { return 0x01020304; }

    unsigned frames = 0;
    unsigned sent = 0;
    unsigned stops = 0;
    bool answers = false;
    bool refuses = false;
    EoeOctets last;
    EoeIp ip;
    EoeFilter filter;
};

class EoeServerTest : public ::testing::Test {
  protected:
    EoeServerTest() {
        bench.mailbox.emplace(bench.esc, MutableBytes(receive_), MutableBytes(send_), protocols_);
        bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox);
        bench.device->start(bench.esc.time);
        bench.configure(140);
        (void)bench.request(2);
    }
    void tell(const EoeOctets& data) {
        ASSERT_TRUE(bench.send(wire::MailboxType::eoe, data));
        (void)bench.step();
    }
    // Sends the octets behind a header of two words.
    void fragment(unsigned flags, unsigned number, const EoeOctets& data) {
        EoeOctets message = eoe_octets({flags & 0xFF, flags >> 8, number & 0xFF, number >> 8});
        message.insert(message.end(), data.begin(), data.end());
        tell(message);
    }
    EoeOctets heard() { return bench.receive(wire::MailboxType::eoe); }

    Bench bench{140};
    EoeAuthor author;
    std::array<std::byte, 512> assembly{};
    std::array<std::byte, 400> queue{};
    EoeServer server{author, assembly, queue};

  private:
    std::array<MailboxProtocol, 2> protocols_{
        {{wire::MailboxType::coe, &bench.coe}, {wire::MailboxType::eoe, &server}}};
    std::array<std::byte, 256> receive_{};
    std::array<std::byte, 256 * 4> send_{};
};

TEST_F(EoeServerTest, FramesArriveInFragmentsAndLeaveInFragments) {
    const auto frame = eoe_frame(200);
    fragment(0, 7 << 6 | 5 << 12, {frame.begin(), frame.begin() + 128});
    EXPECT_EQ(author.frames, 0U);
    author.answers = true;
    fragment(0x100, 1 | 4 << 6 | 5 << 12, {frame.begin() + 128, frame.end()});
    EXPECT_EQ(author.last, frame);
    // 134 octets of data: 128 fit. The first frame of the slave has the number 0, and the port of send().
    EoeOctets expected = eoe_octets({0x10, 0, 0xC0, 0x01});
    expected.insert(expected.end(), frame.begin(), frame.begin() + 128);
    EXPECT_EQ(heard(), expected);
    expected = eoe_octets({0x10, 0x01, 0x01, 0x01});
    expected.insert(expected.end(), frame.begin() + 128, frame.end());
    EXPECT_EQ(heard(), expected);
    EXPECT_EQ(server.counters().received, 1U);
    EXPECT_EQ(server.counters().sent, 1U);
}

TEST_F(EoeServerTest, TimeStampsAreAppendedAndAnswered) {
    EoeOctets set(4 + 58);
    set[0] = std::byte{2};
    set[1] = std::byte{1};
    set[6] = std::byte{1};
    tell(set);
    EXPECT_EQ(heard(), eoe_octets({3, 1, 0, 0}));
    ASSERT_TRUE(server.send(eoe_frame(60)));
    (void)bench.step();
    auto expected = eoe_octets({0, 0x03, 0x80, 0});
    const auto frame = eoe_frame(60);
    expected.insert(expected.end(), frame.begin(), frame.end());
    for (const unsigned octet : {4U, 3U, 2U, 1U}) expected.push_back(static_cast<std::byte>(octet));
    EXPECT_EQ(heard(), expected);
    // The master asks for the time at which its frame is sent.
    fragment(0x500, 2 << 6 | 9 << 12, frame);
    EXPECT_EQ(heard(), eoe_octets({1, 1, 0, 0x90, 4, 3, 2, 1}));
}

TEST_F(EoeServerTest, ParametersAndFiltersAreSetAndRead) {
    EoeOctets set = eoe_octets({2, 1, 0, 0, 3, 0, 0, 0, 1, 2, 3, 4, 5, 6, 2, 5, 168, 192});
    tell(set);  // packed
    EXPECT_EQ(heard(), eoe_octets({3, 1, 0, 0}));
    EXPECT_EQ(author.ip, (EoeIp{.mac = MacAddress{1, 2, 3, 4, 5, 6}, .address = Ipv4Address{192, 168, 5, 2}}));
    tell(eoe_octets({6, 1, 0, 0}));
    EoeOctets expected = eoe_octets({7, 1, 0, 0, 3, 0, 0, 0, 1, 2, 3, 4, 5, 6, 2, 5, 168, 192});
    expected.resize(62);
    EXPECT_EQ(heard(), expected);
    EoeOctets filter(126);
    filter[0] = std::byte{4};
    filter[1] = std::byte{1};
    filter[4] = std::byte{0x81};
    filter[6] = std::byte{0x0A};
    tell(filter);
    EXPECT_EQ(heard(), eoe_octets({5, 1, 0, 0}));
    EXPECT_EQ(author.filter.address_count, 1);
    EXPECT_TRUE(author.filter.no_broadcasts);
    tell(eoe_octets({8, 1, 0, 0}));
    filter[0] = std::byte{9};
    EXPECT_EQ(heard(), filter);
    author.refuses = true;
    for (const unsigned type : {2U, 4U, 6U, 8U}) {
        EoeOctets request(126);
        request[0] = static_cast<std::byte>(type);
        request[1] = std::byte{1};
        tell(request);
        EXPECT_EQ(heard(), eoe_octets({type + 1, 1, 1, type % 4 == 2 ? 2U : 4U}));
    }
}

TEST_F(EoeServerTest, MessagesThatAreWrongGetAnError) {
    tell(eoe_octets({2, 1, 0}));
    EXPECT_EQ(bench.receive(wire::MailboxType::error), eoe_octets({1, 0, 6, 0}));
    for (const unsigned type : {1U, 3U, 10U, 15U}) {
        tell(eoe_octets({type, 1, 0, 0}));
        EXPECT_EQ(bench.receive(wire::MailboxType::error), eoe_octets({1, 0, 4, 0})) << type;
    }
    tell(eoe_octets({2, 1, 0, 0, 1, 0, 0, 0, 1}));  // the address is cut
    EXPECT_EQ(heard(), eoe_octets({3, 1, 1, 0}));
    tell(eoe_octets({4, 1, 0, 0, 1}));
    EXPECT_EQ(heard(), eoe_octets({5, 1, 1, 0}));
}

TEST_F(EoeServerTest, FramesWithWrongFragmentsAreDroppedAndCounted) {
    const auto frame = eoe_frame(128);
    const EoeOctets half(frame.begin(), frame.begin() + 64);
    fragment(0, 4 << 6, half);
    fragment(0, 2 | 2 << 6, half);      // number
    fragment(0x100, 1 | 2 << 6, half);  // of the dropped frame
    fragment(0, 4 << 6, half);
    fragment(0x100, 1 | 1 << 6, half);  // offset
    fragment(0x100, 9 << 6, half);      // size
    fragment(0, 17 << 6, half);         // longer than the memory
    fragment(0, 4 << 6, half);          // not continued
    EXPECT_EQ(server.counters().dropped, 4U);
    fragment(0x100, 2 << 6, half);
    EXPECT_EQ(server.counters().dropped, 5U);
    EXPECT_EQ(author.last, half);
    EXPECT_EQ(author.frames, 1U);
    EXPECT_TRUE(bench.fetch().empty());
}

TEST_F(EoeServerTest, AFullQueueCountsWhatItLoses) {
    EXPECT_FALSE(server.send(eoe_frame(13)));
    EXPECT_FALSE(server.send(eoe_frame(2017)));
    EXPECT_TRUE(server.has_room(397));
    EXPECT_FALSE(server.has_room(398));
    EXPECT_TRUE(server.send(eoe_frame(197)));
    EXPECT_TRUE(server.send(eoe_frame(197)));
    EXPECT_FALSE(server.send(eoe_frame(14)));
    EXPECT_EQ(server.counters().lost, 3U);
    (void)bench.request(1);
    EXPECT_EQ(author.stops, 1U);
    EXPECT_FALSE(server.send(eoe_frame(60))) << "the mailbox does not work in INIT";
    bench.configure(140);
    (void)bench.request(2);
    (void)bench.step();
    EXPECT_TRUE(bench.fetch().empty());
}

}  // namespace
}  // namespace margay::subdevice
