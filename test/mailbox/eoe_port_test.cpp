// Ethernet frames by EoE: fragments octet by octet with a scripted slave, hostile fragments, and the device
// "eoe_gateway" with a host at its port: lost frames of the line, queues, fairness, and the cycle.
#include "mailbox/eoe_frames.hpp"
#include "sim/ethernet_port.hpp"

#include <random>
#include <thread>

namespace margay {
namespace {

// A host at the port of a gateway: keeps the frames that arrive, and sends them back if `echo`.
struct Host final : sim::EthernetPeer {
    MailboxBus& bus;
    std::uint32_t number;  // of the slave, from 0
    std::vector<Mail> frames;
    bool echo = false;
    Host(MailboxBus& b, std::uint32_t n) : bus(b), number(n) { port().connect(this); }
    [[nodiscard]] sim::EthernetPort& port() { return *bus.segment.slave(number).ethernet(); }
    void arrived(Bytes frame, Time) override {
        frames.emplace_back(frame.begin(), frame.end());
        if (echo) {
            EXPECT_TRUE(port().put(frame));
        }
    }
    bool send(const Mail& frame) {
        const bool taken = port().put(frame);
        bus.segment.interrupt(number, bus.osal.now());
        return taken;
    }
};

// All frames that wait in a port.
std::vector<Mail> received(EoePort& port) {
    std::vector<Mail> frames;
    std::array<std::byte, kEoeFrameBytes> buffer{};
    while (const auto frame = port.receive(buffer))
        frames.emplace_back(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(frame->bytes));
    return frames;
}

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
    // A third frame takes the place of the oldest one.
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
    // A buffer that is too small: the size is known, and the frame is gone.
    say(eoe_parts(frame, 2, 64));
    EXPECT_EQ(port.receive(MutableBytes(buffer).first(10))->bytes, 64U);
    EXPECT_FALSE(port.receive(buffer).has_value());
}

// A fragment that is missing, repeated or changed drops its frame and no other one.
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
            // The first fragment twice begins the frame again; the last one twice is a fragment too many.
            const bool survives = twice && n != 1;
            const auto expected =
                survives ? std::vector<Mail>{before, broken, behind} : std::vector<Mail>{before, behind};
            EXPECT_EQ(received(port), expected) << n << twice;
        }
    // A last fragment that is missing is noticed when the next frame with that number begins.
    EXPECT_EQ(port.statistics().incomplete, 6U);
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
    EXPECT_EQ(statistics.incomplete, 1U);  // the others are fragments of a frame that was counted as too long
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
    // A slave that takes nothing: each frame is dropped after send_patience.
    bus.idle(3s);
    EXPECT_EQ(port.statistics().not_sent, 4U);
    EXPECT_TRUE(port.can_send());
    slave.takes = true;
    EXPECT_TRUE(port.send(ethernet_frame(60, 3)));
    bus.idle(50ms);
    EXPECT_EQ(port.statistics().sent, 1U);
    // From the slave: 4 of the longest frames fit, or more shorter ones.
    for (unsigned n = 0; n < 5; ++n) say(eoe_parts(frame, n, 64));
    EXPECT_EQ(port.statistics().overrun, 1U);
    EXPECT_EQ(received(port), std::vector<Mail>(4, frame));
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

// ------------------------------------------------------------------ a gateway

struct Gateway {
    MailboxBus bus;
    EoePortMemory<16, 16> memory{};
    EoePort port{memory};
    std::optional<Host> host;
    Gateway() {
        bus.add_device(sim::make_device("eoe_gateway").value());
        bus.start();
        bus.idle(20ms);
        host.emplace(bus, 0);
        port.slave = 1;
        EXPECT_TRUE(submit(*bus.ctx, port).ok());
    }
};

// While the mailbox does not work, frames are dropped. The port goes on when the slave is back.
TEST(EoeGateway, APortOutlivesTheLossOfItsSlave) {
    Gateway one;
    MailboxBus& bus = one.bus;
    const auto bring = [&](AlState wanted) {
        StateRequest state;
        state.slave = 1;
        state.wanted = wanted;
        ASSERT_TRUE(submit(*bus.ctx, state).ok());
        bus.run(state);
        ASSERT_EQ(state.state(), RequestState::success) << bus.words(state.error());
    };
    bring(AlState::init);
    EXPECT_TRUE(one.port.send(ethernet_frame(100, 1)));
    bus.idle(600ms);
    EXPECT_EQ(one.port.statistics().not_sent, 1U);
    bring(AlState::preop);
    ASSERT_TRUE(one.port.send(ethernet_frame(60, 2)));
    bus.idle(50ms);
    EXPECT_EQ(one.port.statistics().sent, 1U);
    // A scan closes the mailbox, and opens it again.
    ASSERT_TRUE(one.port.send(ethernet_frame(1514, 3)));
    ASSERT_TRUE(config_init(*bus.ctx).ok());
    bus.idle(50ms);
    EXPECT_EQ(one.port.statistics().not_sent, 2U);
    ASSERT_TRUE(one.port.send(ethernet_frame(60, 4)));
    bus.idle(50ms);
    EXPECT_EQ(one.port.statistics().sent, 2U);
    EXPECT_EQ(one.host->frames.back(), ethernet_frame(60, 4));
    one.port.cancel();
    EXPECT_EQ(one.port.error().code, Errc::canceled);
    // Frames of a slave that nobody exchanges stay in its mailbox.
    ASSERT_TRUE(one.host->send(ethernet_frame(60, 5)));
    bus.idle(20ms);
    EXPECT_TRUE(received(one.port).empty());
    ASSERT_TRUE(submit(*bus.ctx, one.port).ok());
    bus.idle(20ms);
    EXPECT_EQ(received(one.port), std::vector<Mail>{ethernet_frame(60, 5)});
}

TEST(EoeGateway, FramesOfAllSizesGoThereAndBack) {
    Gateway one;
    one.host->echo = true;
    std::vector<Mail> frames;
    for (std::size_t bytes = 14; bytes <= 1536; bytes += bytes < 70 ? 1 : 61)
        frames.push_back(ethernet_frame(bytes, static_cast<unsigned>(bytes)));
    std::vector<Mail> back;
    for (const Mail& frame : frames) {
        ASSERT_TRUE(one.port.send(frame));
        one.bus.idle(3ms);
        for (Mail& got : received(one.port)) back.push_back(std::move(got));
    }
    one.bus.idle(20ms);
    for (Mail& got : received(one.port)) back.push_back(std::move(got));
    EXPECT_EQ(one.host->frames, frames);
    EXPECT_EQ(back, frames);
}

TEST(EoeGateway, TimesAreAppendedAndTold) {
    Gateway one;
    ASSERT_TRUE(EOEset_ip(*one.bus.ctx, 1, {.append_time_stamp = true}).ok());
    EXPECT_TRUE(EOEget_ip(*one.bus.ctx, 1)->append_time_stamp);
    // The device may lag behind the bus a little.
    const auto now = static_cast<std::uint32_t>((one.bus.osal.now() - 1ms).time_since_epoch().count());
    for (const std::size_t bytes : {60U, 988U, 990U, 992U, 1010U, 1011U, 1014U, 1514U}) {
        const auto frame = ethernet_frame(bytes, 1);
        ASSERT_TRUE(one.host->send(frame));
        one.bus.idle(5ms);
        std::array<std::byte, kEoeFrameBytes> buffer{};
        const auto got = one.port.receive(buffer);
        ASSERT_TRUE(got.has_value()) << bytes;
        EXPECT_EQ(Mail(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(got->bytes)), frame);
        ASSERT_TRUE(got->time_stamp.has_value());
        EXPECT_LT(*got->time_stamp - now, 100'000'000U);
        EXPECT_EQ(got->port, 1);
    }
    ASSERT_TRUE(one.port.send(ethernet_frame(60, 1), true));
    one.bus.idle(5ms);
    const auto time = one.port.take_sending_time();
    ASSERT_TRUE(time.has_value());
    EXPECT_LT(*time - now, 100'000'000U);
}

TEST(EoeGateway, TheFilterSelectsFramesOfTheSlave) {
    Gateway one;
    EoeFilter filter{.address_count = 1, .no_broadcasts = true};
    filter.addresses[0] = {2, 2, 2, 2, 2, 2};
    ASSERT_TRUE(EOEset_filter(*one.bus.ctx, 1, filter).ok());
    auto wanted = ethernet_frame(60, 1);
    std::fill_n(wanted.begin(), 6, std::byte{2});
    auto broadcast = wanted;
    std::fill_n(broadcast.begin(), 6, std::byte{0xFF});
    for (const Mail& frame : {ethernet_frame(60, 5), wanted, broadcast}) ASSERT_TRUE(one.host->send(frame));
    one.bus.idle(10ms);
    EXPECT_EQ(received(one.port), std::vector<Mail>{wanted});
}

// Three frames there and back, with each frame of the line lost on the way out, lost on the way back, or sent twice:
// all arrive, once and in order.
TEST(EoeLostFrames, FramesArriveOnceAndInOrder) {
    enum class Fault { none, lost_out, lost_in, twice };
    const auto run = [](Fault fault, std::uint64_t at) {
        Gateway one;
        one.host->echo = true;
        one.bus.idle(5ms);
        const auto before = one.bus.nic->sent;
        if (fault == Fault::lost_out) one.bus.nic->lose_out.insert(before + at);
        if (fault == Fault::lost_in) one.bus.nic->lose_in.insert(before + at);
        if (fault == Fault::twice) one.bus.nic->twice.insert(before + at);
        const std::vector<Mail> frames{ethernet_frame(1514, 1), ethernet_frame(60, 2), ethernet_frame(1200, 3)};
        for (const Mail& frame : frames) EXPECT_TRUE(one.port.send(frame));
        std::vector<Mail> back;
        const Time end = one.bus.osal.now() + 2s;
        while (back.size() < 3 && one.bus.osal.now() < end) {
            one.bus.step();
            for (Mail& got : received(one.port)) back.push_back(std::move(got));
        }
        const auto sent = one.bus.nic->sent - before;
        one.bus.idle(300ms);
        for (Mail& got : received(one.port)) back.push_back(std::move(got));
        EXPECT_EQ(one.host->frames, frames);
        EXPECT_EQ(back, frames);
        return sent;
    };
    const auto frames = run(Fault::none, 0);
    ASSERT_LT(frames, 60U);
    for (const Fault fault : {Fault::lost_out, Fault::lost_in, Fault::twice})
        for (std::uint64_t at = 0; at < frames; ++at) {
            SCOPED_TRACE(testing::Message() << "fault " << static_cast<int>(fault) << " at frame " << at);
            run(fault, at);
        }
}

// One thread sends and another one receives, while the owner polls. When the fetching thread is late, frames are
// dropped and counted; the others arrive whole and in order.
TEST(EoeGateway, OtherThreadsFeedAndFetch) {
    Gateway one;
    one.host->echo = true;
    const auto numbered = [](std::uint32_t n) {
        auto frame = ethernet_frame(100 + n % 900, n);
        store_le(frame, 14, n);
        return frame;
    };
    std::atomic<bool> end{false};
    std::uint32_t sent = 0;
    std::uint32_t got = 0;
    bool wrong = false;
    std::thread feeder([&] {
        while (!end)
            if (one.port.can_send() && one.port.send(numbered(sent))) ++sent;
    });
    std::thread fetcher([&] {
        std::array<std::byte, kEoeFrameBytes> buffer{};
        std::uint32_t next = 0;
        for (bool last = false; !last;) {
            last = end;
            while (const auto frame = one.port.receive(buffer)) {
                const auto n = load_le<std::uint32_t>(buffer, 14);
                wrong |= n < next || Mail(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(frame->bytes)) !=
                                         numbered(n);
                next = n + 1;
                ++got;
            }
        }
    });
    one.bus.idle(300ms);
    end = true;
    feeder.join();
    fetcher.join();
    one.bus.idle(100ms);
    got += static_cast<std::uint32_t>(received(one.port).size());
    const auto statistics = one.port.statistics();
    EXPECT_FALSE(wrong);
    EXPECT_GT(got, 0U);
    EXPECT_EQ(statistics.sent, sent);
    EXPECT_EQ(statistics.received, got);
    EXPECT_EQ(statistics.received + statistics.overrun, sent);
}

// ------------------------------------------------------------------ the cycle

class EoeInTheCycle : public testing::Test {
  protected:
    MailboxBus bus;
    std::vector<std::unique_ptr<EoePortMemory<8, 8>>> memory;
    std::vector<std::unique_ptr<EoePort>> ports;
    std::vector<std::unique_ptr<Host>> hosts;
    std::vector<std::byte> image = std::vector<std::byte>(256);
    std::uint64_t most_octets = 0;
    bool checks = false;  // in OP
    std::uint16_t written = 0;

    void start(std::size_t slaves, std::uint16_t budget) {
        for (std::size_t n = 0; n < slaves; ++n) bus.add_device(sim::make_device("eoe_gateway").value());
        bus.start();
        bus.ctx->group(0).config.acyclic_bytes = budget;
        const auto mapped = config_map(*bus.ctx, image);
        ASSERT_TRUE(mapped.ok()) << bus.words(mapped.error());
        for (int n = 0; n < 5; ++n) cycle();
        ASSERT_TRUE(writestate(*bus.ctx, 0, AlState::op).ok());
        for (int n = 0; n < 100; ++n) cycle();
        ASSERT_EQ(statecheck(*bus.ctx, 0, AlState::op, 0ms)->state, AlState::op);
        for (std::uint16_t n = 0; n < slaves; ++n) {
            memory.push_back(std::make_unique<EoePortMemory<8, 8>>());
            ports.push_back(std::make_unique<EoePort>(*memory.back()));
            hosts.push_back(std::make_unique<Host>(bus, n));
            ports[n]->slave = static_cast<std::uint16_t>(n + 1);
            ASSERT_TRUE(submit(*bus.ctx, *ports[n]).ok());
        }
        for (int n = 0; n < 20; ++n) cycle();
        most_octets = 0;
        checks = true;
    }
    // One cycle of a millisecond: the inputs of each slave are the outputs of the cycle before.
    void cycle() {
        bus.osal.advance(1ms);
        bus.segment.advance(bus.osal.now());
        const auto before = bus.ctx->statistics().bytes_on_wire;
        ++written;
        for (const Slave& slave : bus.ctx->slaves()) store_le(slave.image.outputs.bytes, 0, written);
        ASSERT_TRUE(send_processdata(*bus.ctx).ok());
        const auto wkc = receive_processdata(*bus.ctx, 500us);
        ASSERT_TRUE(wkc.ok()) << bus.words(wkc.error());
        ASSERT_EQ(*wkc, bus.ctx->group(0).expected_wkc);
        for (const Slave& slave : bus.ctx->slaves())
            if (checks) {
                ASSERT_EQ(load_le<std::uint16_t>(slave.image.inputs.bytes), written - 1) << "slave " << slave.number;
            }
        (void)poll(*bus.ctx, bus.osal.now());
        most_octets = std::max(most_octets, bus.ctx->statistics().bytes_on_wire - before);
    }
};

// Both directions full, SDOs between: the process data of every cycle is right, and no cycle has more acyclic octets
// than its budget.
TEST_F(EoeInTheCycle, ProcessDataStaysUndisturbed) {
    start(4, 1498);
    for (auto& host : hosts) host->echo = true;
    std::vector<unsigned> sent(4);
    std::vector<unsigned> back(4);
    unsigned sdos = 0;
    SdoUpload sdo;
    std::array<std::byte, 4> value{};
    for (int n = 0; n < 600; ++n) {
        for (std::size_t k = 0; k < ports.size(); ++k) {
            if (hosts[k]->port().has_room() && sent[k] - back[k] < 20 && ports[k]->can_send())
                sent[k] += ports[k]->send(ethernet_frame(1514, sent[k])) ? 1U : 0U;
            for (const Mail& frame : received(*ports[k])) {
                ASSERT_EQ(frame, ethernet_frame(1514, back[k]));
                ++back[k];
            }
        }
        if (!sdo.busy()) {
            sdos += sdo.state() == RequestState::success ? 1U : 0U;
            sdo.slave = static_cast<std::uint16_t>(1 + n % 4);
            sdo.index = 0x1018;
            sdo.subindex = 1;
            sdo.data = value;
            ASSERT_TRUE(submit(*bus.ctx, sdo).ok());
        }
        cycle();
        if (HasFatalFailure()) return;
    }
    // A cycle sends its own frame, and one frame of riders at most.
    EXPECT_LE(most_octets, 2U * 1538);
    const auto [least, most] = std::minmax_element(back.begin(), back.end());
    EXPECT_GT(*least, 30U);
    EXPECT_LE(*most - *least, 2U) << "each slave has the same share";
    EXPECT_GT(sdos, 20U);
}

// One slave that floods the master does not keep another one from its share.
TEST_F(EoeInTheCycle, AFloodDoesNotStarveOthers) {
    start(3, 1498);
    unsigned got = 0;
    for (int n = 0; n < 300; ++n) {
        while (hosts[0]->send(ethernet_frame(1514, 1))) {
        }
        while (hosts[1]->send(ethernet_frame(1514, 2))) {
        }
        if (n % 30 == 0) {
            ASSERT_TRUE(hosts[2]->send(ethernet_frame(100, 3)));
        }
        got += static_cast<unsigned>(received(*ports[2]).size());
        (void)received(*ports[0]);
        (void)received(*ports[1]);
        cycle();
        if (HasFatalFailure()) return;
    }
    EXPECT_EQ(got, 10U);
    const auto first = ports[0]->statistics().received;
    const auto second = ports[1]->statistics().received;
    EXPECT_GT(first, 50U);
    EXPECT_LE(first > second ? first - second : second - first, 2U);
}

}  // namespace
}  // namespace margay
