// Ethernet frames by EoE with the device "eoe_gateway" and a host at its port: lost frames of the line, threads,
// tshark, fairness, and the cycle.
#include "mailbox/eoe_frames.hpp"
#include "wire/mailbox_pcap.hpp"

#include <unistd.h>

#include <filesystem>
#include <map>
#include <thread>

namespace margay {
namespace {

struct Gateway {
    MailboxBus bus;
    EoePortMemory<16, 16> memory{};
    EoePort port{memory};
    std::optional<EoeHost> host;
    Gateway() {
        bus.add_device(sim::make_device("eoe_gateway").value());
        bus.start();
        bus.idle(20ms);
        host.emplace(bus, 0);
        port.slave = 1;
        EXPECT_TRUE(submit(*bus.ctx, port).ok());
    }
};

// While the mailbox is closed, frames are dropped. The port works again when the slave is back.
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
    // A scan closes the mailbox and opens it again.
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
    // Frames of a slave without an EoePort stay in its mailbox.
    ASSERT_TRUE(one.host->send(ethernet_frame(60, 5)));
    bus.idle(20ms);
    EXPECT_TRUE(received(one.port).empty());
    ASSERT_TRUE(submit(*bus.ctx, one.port).ok());
    bus.idle(20ms);
    EXPECT_EQ(received(one.port), std::vector<Mail>{ethernet_frame(60, 5)});
}

TEST(EoeGateway, ASlaveHasOnePort) {
    Gateway one;
    EoePortMemory<2, 2> memory{};
    EoePort second{memory};
    second.slave = 1;
    ASSERT_TRUE(submit(*one.bus.ctx, second).ok());
    one.bus.idle(5ms);
    EXPECT_FALSE(second.busy());
    EXPECT_EQ(one.bus.words(second.error()),
              "slave 1: EoE frames: already in progress (an exchange of Ethernet frames is busy)");
    one.port.cancel();
    ASSERT_TRUE(submit(*one.bus.ctx, second).ok());
    one.bus.idle(5ms);
    EXPECT_TRUE(second.busy());
}

TEST(EoeGateway, ASlaveWithoutEoeThatAScanPutsInItsPlaceGetsNoFrames) {
    MailboxBus bus;
    for (const char* const device : {"digital_io_16", "eoe_gateway", "encoder"})
        bus.add_device(sim::make_device(device).value());
    bus.start();
    EoePortMemory<4, 4> memory{};
    EoePort port{memory};
    port.slave = 2;
    ASSERT_TRUE(submit(*bus.ctx, port).ok());
    ASSERT_TRUE(port.send(ethernet_frame(60, 1)));
    bus.idle(20ms);
    EXPECT_EQ(port.statistics().sent, 1U);
    bus.segment.disconnect({0, 0});
    bus.segment.disconnect({0, 1});
    ASSERT_TRUE(bus.segment.connect_master({1, 0}));
    bus.segment.reconsider();
    const auto found = config_init(*bus.ctx);
    ASSERT_TRUE(found.ok()) << bus.words(found.error());
    ASSERT_EQ(bus.ctx->slave(2).mailbox.protocols & mailbox_protocol::kEoE, 0U);
    ASSERT_TRUE(port.send(ethernet_frame(60, 2)));
    bus.idle(50ms);
    EXPECT_EQ(port.statistics().sent, 1U);
    EXPECT_EQ(port.statistics().not_sent, 1U);
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
    // The clock of the device may be a little behind the time of the bus.
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

// Three frames are sent there and back. Each frame of the line in turn is lost on the way out, lost on the way back, or
// sent twice. All Ethernet frames arrive, once and in order.
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

// All messages of the line are in a recording, and tshark decodes each of them without an error. The fields, combined
// by number and offset, are the frames of both directions.
TEST(EoeGateway, TsharkPutsTheSameFramesTogether) {
    if (!testing_tshark::installed()) GTEST_SKIP() << "tshark is not installed";
    Gateway one;
    one.host->echo = true;
    one.bus.idle(5ms);
    one.bus.nic->keeps_mail = true;
    std::vector<Mail> frames;
    for (const std::size_t bytes : {60U, 992U, 993U, 1514U, 64U, 1024U}) {
        frames.push_back(ethernet_frame(bytes, static_cast<unsigned>(bytes)));
        ASSERT_TRUE(one.port.send(frames.back()));
    }
    one.bus.idle(50ms);
    const auto file =
        std::filesystem::temp_directory_path() / ("margay-frames-" + std::to_string(::getpid()) + ".pcap");
    {
        testing_tshark::MailboxPcap pcap(file.string());
        for (const Mail& mail : one.bus.nic->mail) pcap.add(mail);
    }
    const auto packets = testing_tshark::fields_of(
        file.string(), {"ecat_mailbox.eoe.fragno", "ecat_mailbox.eoe.offset", "ecat_mailbox.eoe.frame",
                        "ecat_mailbox.eoe.last", "ecat_mailbox.eoe.fragment", "_ws.malformed", "_ws.expert"});
    ASSERT_EQ(packets.size(), one.bus.nic->mail.size());
    // by direction; tshark does not print the port, which shows the direction
    std::map<bool, std::vector<std::string>> whole;
    std::map<bool, std::string> begun;
    for (std::size_t n = 0; n < packets.size(); ++n) {
        const auto& p = packets[n];
        ASSERT_EQ(p.size(), 7U);
        EXPECT_EQ(p[5] + p[6], "") << "packet " << n + 1;
        const bool from_slave = one.bus.nic->mail[n][6] != std::byte{0};
        std::string& octets = begun[from_slave];
        if (p[0] == "0") octets.clear();
        if (p[0] != "0") {
            EXPECT_EQ(std::to_string(octets.size() / 2), p[1]);
            EXPECT_EQ(p[2], std::to_string(whole[from_slave].size()));
        }
        octets += p[4];
        if (p[3] == "1") whole[from_slave].push_back(octets);
    }
    std::vector<std::string> expected;
    for (const Mail& frame : frames) {
        std::string& hex = expected.emplace_back();
        for (const std::byte octet : frame) {
            constexpr const char* kDigits = "0123456789abcdef";
            hex += kDigits[std::to_integer<unsigned>(octet) >> 4];
            hex += kDigits[std::to_integer<unsigned>(octet) & 15];
        }
    }
    EXPECT_EQ(whole[false], expected);
    EXPECT_EQ(whole[true], expected);
    std::error_code ignored;
    if (!testing::Test::HasFailure()) std::filesystem::remove(file, ignored);
}

// One thread sends and another thread receives, while the owner polls. When the receiving thread is late, frames are
// dropped and counted. The other frames arrive complete and in order.
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
    std::atomic<std::uint32_t> got = 0;
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
    for (unsigned n = 0; n < 2'000'000 && got < 100; ++n) one.bus.step();
    end = true;
    feeder.join();
    fetcher.join();
    one.bus.idle(100ms);
    got += static_cast<std::uint32_t>(received(one.port).size());
    const auto statistics = one.port.statistics();
    EXPECT_FALSE(wrong);
    EXPECT_GE(got, 100U);
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
    std::vector<std::unique_ptr<EoeHost>> hosts;
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
            hosts.push_back(std::make_unique<EoeHost>(bus, n));
            ports[n]->slave = static_cast<std::uint16_t>(n + 1);
            ASSERT_TRUE(submit(*bus.ctx, *ports[n]).ok());
        }
        for (int n = 0; n < 20; ++n) cycle();
        most_octets = 0;
        checks = true;
    }
    // Executes one cycle of a millisecond. The inputs of each slave are the outputs of the previous cycle.
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

// Both directions are full, and SDOs are transferred beside them. The process data of every cycle is right, and no
// cycle has more acyclic octets than its budget.
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
    // A cycle sends its own frame, and at most one frame of riders.
    EXPECT_LE(most_octets, 2U * 1538);
    const auto [least, most] = std::minmax_element(back.begin(), back.end());
    EXPECT_GT(*least, 30U);
    EXPECT_GE(*least * 5, *most * 4) << "each slave has the same share, of which SDOs use a part";
    EXPECT_GT(sdos, 15U);
}

// One slave that sends as much as it can does not take the share of another slave.
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
