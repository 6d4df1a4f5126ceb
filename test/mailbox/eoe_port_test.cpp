// Ethernet frames by EoE with a scripted slave: fragments octet by octet, hostile fragments, queues.
#include "mailbox/eoe_frames.hpp"

namespace margay {
namespace {

class EoePortTest : public testing::Test {
  protected:
    MailboxBus bus;
    ScriptedSlave& slave = bus.add_scripted(76);  // 66 octets of data: fragments of 64
    EoePortMemory<4, 4> memory{};
    EoePort port{memory};
    void SetUp() override {
        bus.start();
        bus.idle(5ms);
        port.slave = 1;
        ASSERT_TRUE(submit(*bus.ctx, port).ok());
        bus.idle(2ms);
    }
    void say(const std::vector<Mail>& parts) {
        for (const Mail& part : parts) slave.reply(part, kEoe);
        bus.idle(20ms);
    }
    // The data of the messages that the slave has received.
    [[nodiscard]] std::vector<Mail> sent() const {
        std::vector<Mail> all;
        for (const Mail& mail : slave.received) all.emplace_back(mail.begin() + 6, mail.end());
        return all;
    }
};

TEST_F(EoePortTest, AFrameGoesInFragmentsOfWholeBlocks) {
    const auto frame = ethernet_frame(150, 1);
    const auto small = ethernet_frame(60, 2);
    port.port = 2;
    ASSERT_TRUE(port.send(frame));
    ASSERT_TRUE(port.send(small, true));
    bus.idle(10ms);
    auto expected = eoe_parts(frame, 0, 64);
    expected.push_back(eoe_parts(small, 1, 64)[0]);
    for (auto& part : expected) part[0] = std::byte{0x20};  // the port
    expected.back()[1] |= std::byte{0x04};                  // the time is requested
    EXPECT_EQ(sent(), expected);
    const auto statistics = port.statistics();
    EXPECT_EQ(statistics.sent, 2U);
    EXPECT_EQ(statistics.sent_octets, 210U);
    EXPECT_EQ(statistics.refused + statistics.not_sent, 0U);
    slave.reply(mail_bytes({1, 1, 0, 0x10, 4, 3, 2, 1}), kEoe);
    bus.idle(5ms);
    EXPECT_EQ(port.take_sending_time(), 0x01020304U);
    EXPECT_FALSE(port.take_sending_time().has_value());
}

TEST_F(EoePortTest, FragmentsOfFramesThatAlternateArePutTogether) {
    const auto one = ethernet_frame(150, 1);
    const auto other = ethernet_frame(190, 2);
    const auto a = eoe_parts(one, 3, 64);
    const auto b = eoe_parts(other, 4, 64);
    say({a[0], b[0], a[1], b[1], b[2], a[2]});
    EXPECT_EQ(received(port), (std::vector<Mail>{other, one}));
    // A third frame replaces the oldest frame.
    const auto third = ethernet_frame(100, 3);
    const auto c = eoe_parts(third, 5, 64);
    say({a[0], b[0], c[0], c[1], a[1], b[1], a[2], b[2]});
    EXPECT_EQ(received(port), (std::vector<Mail>{third, other}));
    EXPECT_EQ(port.statistics().incomplete, 1U);
    EXPECT_EQ(port.statistics().received, 4U);
    EXPECT_EQ(port.statistics().received_octets, 150U + 190 + 190 + 100);
}

TEST_F(EoePortTest, TimeStampAndPortAreTold) {
    const auto frame = ethernet_frame(64, 1);
    Mail part = eoe_part({.number = 1, .blocks = 2, .flags = 0x30}, Bytes(frame));
    Mail stamp = eoe_part({.number = 1, .fragment = 1, .blocks = 2, .last = true, .flags = 0x230},
                          mail_bytes({0xDD, 0xCC, 0xBB, 0xAA}));
    say({part, stamp});
    std::array<std::byte, 64> buffer{};
    const auto got = port.receive(buffer);
    ASSERT_TRUE(got.has_value());
    EXPECT_EQ(got->bytes, 64U);
    EXPECT_EQ(got->port, 3);
    EXPECT_EQ(got->time_stamp, 0xAABBCCDDU);
    EXPECT_EQ(Mail(buffer.begin(), buffer.end()), frame);
    // The buffer is too small. The call returns the size, and the frame is lost.
    say(eoe_parts(frame, 2, 64));
    EXPECT_EQ(port.receive(MutableBytes(buffer).first(10))->bytes, 64U);
    EXPECT_FALSE(port.receive(buffer).has_value());
}

// A missing, repeated or changed fragment drops its frame, and no other frame.
TEST_F(EoePortTest, ALostFragmentDropsOneFrameOnly) {
    const auto before = ethernet_frame(100, 1);
    const auto broken = ethernet_frame(190, 2);
    const auto behind = ethernet_frame(100, 3);
    for (std::size_t n = 0; n < 3; ++n)
        for (const bool twice : {false, true}) {
            auto parts = eoe_parts(broken, 2, 64);
            if (twice)
                parts.insert(parts.begin() + static_cast<std::ptrdiff_t>(n), parts[n]);
            else
                parts.erase(parts.begin() + static_cast<std::ptrdiff_t>(n));
            auto all = eoe_parts(before, 1, 64);
            all.insert(all.end(), parts.begin(), parts.end());
            for (const Mail& part : eoe_parts(behind, 3, 64)) all.push_back(part);
            say(all);
            // A repeated first fragment begins the frame again. A repeated last fragment is an error.
            const bool survives = twice && n != 1;
            const auto expected =
                survives ? std::vector<Mail>{before, broken, behind} : std::vector<Mail>{before, behind};
            EXPECT_EQ(received(port), expected) << n << twice;
        }
    // A missing last fragment is noticed when the next frame with the same number begins.
    EXPECT_EQ(port.statistics().incomplete, 6U);
}

// Frame numbers have 4 bits. The rest of an incomplete frame must not be joined with the next frame that has the same
// number.
TEST_F(EoePortTest, FramesWithTheSameNumberAreNotJoined) {
    std::vector<Mail> sent;
    std::vector<Mail> parts;
    std::vector<Mail> got;
    for (unsigned n = 0; n < 18; ++n) {
        const auto frame = ethernet_frame(120, n);
        const auto both = eoe_parts(frame, n % 16, 64);
        if (n != 17) parts.push_back(both[0]);
        if (n != 1) parts.push_back(both[1]);
        if (n != 1 && n != 17) sent.push_back(frame);
        if (n % 4 == 3) say(std::exchange(parts, {}));
        for (auto& one : received(port)) got.push_back(std::move(one));
    }
    say(parts);
    for (auto& one : received(port)) got.push_back(std::move(one));
    EXPECT_EQ(got, sent);
    EXPECT_EQ(port.statistics().incomplete, 2U);
}

// The same with room for one frame.
TEST_F(EoePortTest, FramesWithTheSameNumberAreCountedWithoutRoomForOthersToo) {
    port.cancel();
    bus.idle(5ms);
    EoePortMemory<4, 4, 1> one;
    EoePort small(one);
    small.slave = 1;
    ASSERT_TRUE(submit(*bus.ctx, small).ok());
    for (unsigned n = 0; n < 18; ++n) {
        const auto both = eoe_parts(ethernet_frame(120, n), n % 16, 64);
        if (n != 17) slave.reply(both[0], kEoe);
        if (n != 1) slave.reply(both[1], kEoe);
        bus.idle(5ms);
        EXPECT_EQ(received(small).size(), n == 1 || n == 17 ? 0U : 1U) << n;
    }
    EXPECT_EQ(small.statistics().incomplete, 2U);
    small.cancel();
    bus.idle(5ms);
}

TEST_F(EoePortTest, HostileFragmentsHarmNothing) {
    const auto part = ethernet_frame(64, 1);
    const auto good = ethernet_frame(60, 9);
    const auto lie = [&](unsigned fragment, unsigned blocks, bool last, std::size_t bytes) {
        return eoe_part({.number = 1, .fragment = fragment, .blocks = blocks, .last = last}, Bytes(part).first(bytes));
    };
    say({lie(0, 2, true, 10)});                           // shorter than an Ethernet header
    say({lie(0, 9, true, 64)});                           // less than announced
    say({lie(0, 1, true, 64)});                           // more than announced
    say({lie(0, 4, false, 63)});                          // no whole block
    say({lie(0, 0, false, 64)});                          // no size
    say({lie(0, 63, false, 64)});                         // 2016 octets
    say({lie(5, 10, false, 64), lie(63, 63, true, 64)});  // without a beginning
    say({lie(0, 48, false, 64), lie(1, 40, false, 64)});  // an offset that jumps
    say({lie(0, 3, false, 64), lie(1, 2, false, 64), lie(2, 4, false, 64), lie(3, 6, false, 64)});  // without end
    for (unsigned type = 2; type < 16; ++type) say({mail_bytes({type, 1, 0, 0, 1, 2, 3, 4})});
    say({mail_bytes({0}), mail_bytes({0, 1, 0}), mail_bytes({1, 1, 0, 0, 5})});
    EXPECT_TRUE(received(port).empty());
    say(eoe_parts(good, 1, 64));
    EXPECT_EQ(received(port), std::vector<Mail>{good});
    const auto statistics = port.statistics();
    EXPECT_EQ(statistics.received, 1U);
    EXPECT_EQ(statistics.too_long, 1U);
    EXPECT_EQ(statistics.malformed, 6U);
    EXPECT_EQ(statistics.incomplete, 1U);  // the others belong to a frame that was counted as too long
    EXPECT_TRUE(port.busy());
}

TEST_F(EoePortTest, FullQueuesDropAndCount) {
    const auto frame = ethernet_frame(1514, 1);
    slave.takes = false;
    for (int n = 0; n < 4; ++n) EXPECT_TRUE(port.send(frame)) << n;
    EXPECT_FALSE(port.can_send());
    EXPECT_FALSE(port.send(frame));
    EXPECT_FALSE(port.send(Mail(13)));
    EXPECT_FALSE(port.send(Mail(1537)));
    EXPECT_EQ(port.statistics().refused, 3U);
    // A slave that reads no messages: each frame is dropped after send_patience.
    bus.idle(3s);
    EXPECT_EQ(port.statistics().not_sent, 4U);
    EXPECT_TRUE(port.can_send());
    slave.takes = true;
    EXPECT_TRUE(port.send(ethernet_frame(60, 3)));
    bus.idle(50ms);
    EXPECT_EQ(port.statistics().sent, 1U);
    // From the slave: 4 frames of the maximum length fit, or a larger number of shorter frames.
    for (unsigned n = 0; n < 5; ++n) say(eoe_parts(frame, n, 64));
    EXPECT_EQ(port.statistics().overrun, 1U);
    EXPECT_EQ(received(port), std::vector<Mail>(4, frame));
}

TEST_F(EoePortTest, TheNameOfItsInterfaceIsCut) {
    EXPECT_EQ(port.interface_name(), "");
    port.set_interface_name("eoe0s1");
    EXPECT_EQ(port.interface_name(), "eoe0s1");
    port.set_interface_name("a name of an interface");
    EXPECT_EQ(port.interface_name(), "a name of an in");
    port.set_interface_name("");
    EXPECT_EQ(port.interface_name(), "");
}

TEST_F(EoePortTest, IsRefusedInWords) {
    const auto refused = [&](EoePort& one) { return bus.words(submit(*bus.ctx, one).error()); };
    EoePortMemory<1, 1, 1> room{};
    EoePort other(MutableBytes(room.to_slave).first(1000), room.from_slave, room.parts);
    other.slave = 1;
    EXPECT_EQ(refused(other),
              "slave 1: EoE frames: argument out of range: the memory of the EoePort has no room for one frame in each "
              "direction");
    EoePort second(room);
    second.slave = 7;
    EXPECT_EQ(refused(second), "slave 7: EoE frames: there is no such slave (there are 1)");
    second.slave = 1;
    second.look_every = 0ms;
    EXPECT_EQ(submit(*bus.ctx, second).error().code, Errc::invalid_argument);
    MailboxBus small;
    (void)small.add_scripted(41);
    (void)small.add_scripted(64, 0x3D);
    small.start();
    second.look_every = 1ms;
    EXPECT_EQ(small.words(submit(*small.ctx, second).error()),
              "slave 1: EoE frames: argument out of range: the mailbox message is 36 octets, at most 35 are possible");
    second.slave = 2;
    EXPECT_EQ(small.words(submit(*small.ctx, second).error()), "slave 2: EoE frames: not supported by the slave");
}

}  // namespace
}  // namespace margay
