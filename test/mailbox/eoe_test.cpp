// EoE requests: octets by hand from ETG.1000.6 "Ethernet over EtherCAT", hostile answers, and the device "eoe_gateway".
#include "mailbox/eoe_frames.hpp"
#include "mailbox/spoilt_frames.hpp"

namespace margay {
namespace {

class EoeTest : public testing::Test {
  protected:
    MailboxBus bus;
    ScriptedSlave& slave = bus.add_scripted(160);
    void SetUp() override {
        bus.add_device(sim::make_device("eoe_gateway").value());
        bus.start();
        bus.idle(5ms);
    }
    // The slave answers each message with these octets.
    void answer(Mail octets) {
        slave.on_mail = [this, octets](const Mail&) { slave.reply(octets, kEoe); };
    }
    static EoeIp some_ip() {
        EoeIp ip{.mac = MacAddress{2, 0, 0, 0, 0, 5},
                 .address = Ipv4Address{192, 168, 5, 2},
                 .subnet_mask = Ipv4Address{255, 255, 255, 0},
                 .default_gateway = Ipv4Address{192, 168, 5, 1},
                 .dns_server = Ipv4Address{9, 8, 7, 6}};
        EXPECT_TRUE(ip.set_host_name("gateway"));
        return ip;
    }
};

TEST_F(EoeTest, IpParametersAreSetWithTheOctetsOfTheStandard) {
    answer(mail_bytes({0x03, 0x01, 0, 0}));
    EoeSetIp request;
    request.slave = 1;
    request.ip.address = Ipv4Address{192, 168, 5, 2};
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    bus.run(request);
    ASSERT_EQ(request.state(), RequestState::success) << bus.words(request.error());
    Mail expected = mail_bytes({0x02, 0x01, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 5, 168, 192});
    expected.resize(62);
    ASSERT_EQ(slave.received.size(), 1U);
    EXPECT_EQ(wire::load_mailbox_header(slave.received[0]).type, kEoe);
    EXPECT_EQ(Mail(slave.received[0].begin() + 6, slave.received[0].end()), expected);
    request.packed = true;
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    bus.run(request);
    EXPECT_EQ(Mail(slave.received[1].begin() + 6, slave.received[1].end()),
              mail_bytes({0x02, 0x01, 0, 0, 2, 0, 0, 0, 2, 5, 168, 192}));
}

TEST_F(EoeTest, TheDeviceKeepsWhatIsSet) {
    const auto ip = some_ip();
    const auto set = EOEset_ip(*bus.ctx, 2, ip);
    ASSERT_TRUE(set.ok()) << bus.words(set.error());
    const auto got = EOEget_ip(*bus.ctx, 2);
    ASSERT_TRUE(got.ok()) << bus.words(got.error());
    EXPECT_EQ(*got, ip);
    EXPECT_EQ(got->host_name(), "gateway");
    // One more parameter is set. The other parameters do not change.
    ASSERT_TRUE(EOEset_ip(*bus.ctx, 2, {.dns_server = Ipv4Address{1, 1, 1, 1}}).ok());
    EXPECT_EQ(EOEget_ip(*bus.ctx, 2)->dns_server, (Ipv4Address{1, 1, 1, 1}));
    EXPECT_EQ(EOEget_ip(*bus.ctx, 2)->address, ip.address);
    EoeFilter filter{.address_count = 2, .mask_count = 1, .no_broadcasts = true};
    filter.addresses[1] = {1, 2, 3, 4, 5, 6};
    filter.masks[0] = {255, 255, 255, 0, 0, 0};
    ASSERT_TRUE(EOEset_filter(*bus.ctx, 2, filter).ok());
    const auto read = EOEget_filter(*bus.ctx, 2);
    ASSERT_TRUE(read.ok()) << bus.words(read.error());
    EXPECT_EQ(*read, filter);
}

TEST_F(EoeTest, IsRefusedInWords) {
    answer(mail_bytes({0x03, 0x01, 0x01, 0x02}));
    EXPECT_EQ(bus.words(EOEset_ip(*bus.ctx, 1, some_ip()).error()),
              "slave 1: setting the IP parameters: the slave refused the EoE request (result 0x0201: the slave has no "
              "IP parameters to set)");
    answer(mail_bytes({0x09, 0x01, 0x01, 0x04}));
    EXPECT_EQ(bus.words(EOEget_filter(*bus.ctx, 1).error()),
              "slave 1: reading the address filter: the slave refused the EoE request (result 0x0401: the slave has no "
              "address filter)");
    EXPECT_EQ(EOEset_ip(*bus.ctx, 9, {}).error().code, Errc::unknown_slave);
    EoeFilter filter;
    filter.mask_count = 4;
    EXPECT_EQ(bus.words(EOEset_filter(*bus.ctx, 1, filter).error()),
              "slave 1: setting the address filter: argument out of range: an address filter has at most 15 addresses "
              "and 3 masks");
    MailboxBus other;
    (void)other.add_scripted(64, 0x3D);  // all protocols except EoE
    (void)other.add_scripted(64);
    other.start();
    EXPECT_EQ(other.words(EOEget_ip(*other.ctx, 1).error()),
              "slave 1: reading the IP parameters: not supported by the slave");
    EXPECT_EQ(other.words(EOEset_ip(*other.ctx, 2, {}).error()),
              "slave 2: setting the IP parameters: argument out of range: the mailbox message is 62 octets, at most 58 "
              "are possible");
}

TEST_F(EoeTest, HostileAnswersEndTheRequest) {
    EoeGetIp request;
    request.slave = 1;
    request.timeout = 50ms;
    const auto outcome = [&](const Mail& octets) {
        answer(octets);
        EXPECT_TRUE(submit(*bus.ctx, request).ok());
        bus.run(request);
        bus.idle(200ms);
        return request.error().code;
    };
    EXPECT_EQ(outcome(mail_bytes({0x07})), Errc::timeout);                        // no header
    EXPECT_EQ(outcome(mail_bytes({0x07, 0x01, 0, 0})), Errc::protocol);           // no parameters
    EXPECT_EQ(outcome(mail_bytes({0x07, 0x01, 0, 0, 1, 0, 0})), Errc::protocol);  // the flags are truncated
    EXPECT_EQ(outcome(mail_bytes({0x07, 0x01, 0, 0, 1, 0, 0, 0, 1, 2, 3, 4, 5})),
              Errc::protocol);                                          // the address is truncated
    EXPECT_EQ(outcome(mail_bytes({0x03, 0x01, 0, 0})), Errc::timeout);  // the answer to another request
    EXPECT_EQ(outcome(mail_bytes({0x00, 0x01, 0, 0})), Errc::timeout);  // a fragment
    EXPECT_EQ(outcome(mail_bytes({0x07, 0x01, 0xFF, 0xFF})), Errc::eoe_error);
    EXPECT_EQ(outcome(mail_bytes({0x07, 0x01, 0, 0, 0, 0, 0, 0})), Errc::none);  // none of the parameters
    EXPECT_FALSE(request.ip.mac.has_value());
    // The packed form of the answer.
    EXPECT_EQ(outcome(mail_bytes({0x07, 0x01, 0, 0, 3, 0, 0, 0, 1, 2, 3, 4, 5, 6, 4, 3, 2, 1})), Errc::none);
    EXPECT_EQ(request.ip.address, (Ipv4Address{1, 2, 3, 4}));
    slave.on_mail = nullptr;
}

// A request and its answer. Each of their frames in turn is lost on the way out, lost on the way back, or sent twice.
TEST(EoeLostFrames, EveryRequestIsAnswered) {
    with_each_frame_spoilt("eoe_gateway", 60, [](MailboxBus& bus) {
        EoeIp ip{.address = Ipv4Address{10, 0, 0, 7}};
        const auto set = EOEset_ip(*bus.ctx, 1, ip);
        EXPECT_TRUE(set.ok()) << bus.words(set.error());
        const auto got = EOEget_ip(*bus.ctx, 1);
        EXPECT_TRUE(got.ok() && *got == ip) << bus.words(got.error());
    });
}

// A hook sets the parameters in each start-up, also after a loss of power.
TEST(EoeHook, SetsTheParametersInEachStartUp) {
    MailboxBus bus;
    bus.add_device(sim::make_device("eoe_gateway").value());
    bus.start();
    bus.ctx->slave(1).hooks.preop_to_safeop = [](HookedSlave slave, void*) -> Task<> {
        EoeIp ip{.address = Ipv4Address{10, 0, 0, 9}};
        auto set = co_await slave.eoe_set_ip(ip);
        co_return set;
    };
    std::vector<std::byte> image(64);
    ASSERT_TRUE(config_map(*bus.ctx, image).ok());
    EXPECT_EQ(EOEget_ip(*bus.ctx, 1)->address, (Ipv4Address{10, 0, 0, 9}));
    bus.segment.set_power(0, false, bus.osal.now());
    bus.idle(10ms);
    bus.segment.set_power(0, true, bus.osal.now());
    RecoverRequest recover;
    recover.slave = 1;
    ASSERT_TRUE(submit(*bus.ctx, recover).ok());
    bus.run(recover);
    ASSERT_EQ(recover.state(), RequestState::success) << bus.words(recover.error());
    ReconfigRequest again;
    again.slave = 1;
    ASSERT_TRUE(submit(*bus.ctx, again).ok());
    bus.run(again);
    ASSERT_EQ(again.state(), RequestState::success) << bus.words(again.error());
    EXPECT_EQ(EOEget_ip(*bus.ctx, 1)->address, (Ipv4Address{10, 0, 0, 9}));
}

}  // namespace
}  // namespace margay
