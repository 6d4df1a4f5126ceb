// AoE with the gateway of the library: routes, notifications, lost frames, and the cycle. tshark decodes the messages
// of both ends.
#include "facts.hpp"
#include "mailbox/aoe_notes.hpp"
#include "mailbox/spoilt_frames.hpp"
#include "wire/mailbox_pcap.hpp"

#include <unistd.h>

#include <filesystem>
#include <map>

namespace margay {
namespace {

class AoeGateway : public testing::Test {
  protected:
    static constexpr AoeAddress kFirst{{{10, 0, 0, 1, 2, 1}}, 1001};
    static constexpr AoeAddress kSecond{{{10, 0, 0, 2, 2, 1}}, 1001};
    static constexpr AoeNetId kOwnId{{5, 80, 1, 2, 3, 4}};
    static constexpr AoeAddress kOwn{kOwnId, 1};
    MailboxBus bus;
    std::array<std::byte, 64> data{};
    void SetUp() override {
        bus.add_device(sim::make_device("aoe_gateway").value());
        bus.start();
        bus.idle(5ms);
    }
    Context& ctx() { return *bus.ctx; }
    std::uint32_t result(const AoeAddress& target, std::uint32_t group, std::uint32_t offset) {
        const auto read = AOEread(ctx(), 1, target, group, offset, MutableBytes(data).first(4));
        return read ? 0 : read.error().detail;
    }
    // Executes each kind of command once.
    void do_everything() {
        ASSERT_TRUE(AOEset_net_id(ctx(), 1, kOwnId).ok());
        for (const AoeAddress& target : {kOwn, kFirst, kSecond}) {
            const Mail value = mail_bytes({target.net_id.octets[3], 1, 2, 3});
            const auto written = AOEwrite(ctx(), 1, target, 0x100, 16, value);
            ASSERT_TRUE(written.ok()) << bus.words(written.error());
        }
        for (const AoeAddress& target : {kSecond, kOwn, kFirst}) {
            const auto read = AOEread(ctx(), 1, target, 0x100, 16, MutableBytes(data).first(4));
            ASSERT_TRUE(read.ok()) << bus.words(read.error());
            EXPECT_EQ(*read, 4U);
            EXPECT_EQ(data[0], std::byte{target.net_id.octets[3]});
            const auto reversed = AOEread_write(ctx(), 1, target, 0x300, 0, mail_bytes({1, 2, 3}), data);
            ASSERT_TRUE(reversed.ok()) << bus.words(reversed.error());
            EXPECT_EQ(Mail(data.begin(), data.begin() + 3), mail_bytes({3, 2, 1}));
        }
        EXPECT_TRUE(AOEwrite_control(ctx(), 1, kFirst, AdsState::stop, 0).ok());
        EXPECT_EQ(*AOEread_state(ctx(), 1, kFirst), AdsState::stop);
        EXPECT_EQ(*AOEread_state(ctx(), 1, kSecond), AdsState::run);
        EXPECT_EQ(AOEread_device_info(ctx(), 1, kSecond)->name(), "Subordinate 2");
        EXPECT_EQ(AOEread_device_info(ctx(), 1, kOwn)->build, 345);
    }
};

// The init command of configuration tools sets the NetID at the transition to PREOP, also when the slave starts again.
TEST_F(AoeGateway, GetsItsNetIdFromAHook) {
    bus.ctx->slave(1).hooks.transition = [](HookedSlave slave, Transition which, Moment moment, void*) -> Task<> {
        if (which != Transition::init_to_preop || moment != Moment::after) co_return Nothing{};
        auto set = co_await slave.aoe_set_net_id(kOwnId);
        if (!set) co_return set;
        // The same request in octets: read the state of the device at the new NetID.
        static const Mail read_state =
            joined({mail_bytes({5, 80, 1, 2, 3, 4, 1, 0}), Mail(8), mail_bytes({4, 0, 4, 0}), Mail(12)});
        std::array<std::byte, 64> answer{};
        auto state = co_await slave.raw_mail(kAoe, read_state, answer);
        if (!state) co_return state.error();
        if (*state != 40 || answer[36] != std::byte{5}) co_return Error{.code = Errc::protocol};
        co_return Nothing{};
    };
    EXPECT_EQ(result(kOwn, 0x100, 0), 7U);
    for (const AlState state : {AlState::init, AlState::preop}) {
        StateRequest change;
        change.slave = 1;
        change.wanted = state;
        ASSERT_TRUE(submit(ctx(), change).ok());
        bus.run(change);
        ASSERT_EQ(change.state(), RequestState::success) << bus.words(change.error());
    }
    EXPECT_EQ(result(kOwn, 0x100, 0), 0U);
}

TEST_F(AoeGateway, PassesEveryCommandOnToItsDevice) { do_everything(); }

TEST_F(AoeGateway, TellsWhatItRefuses) {
    EXPECT_EQ(result(kOwn, 0x100, 0), 7U) << "before the master has set the NetID";
    ASSERT_TRUE(AOEset_net_id(ctx(), 1, kOwnId).ok());
    EXPECT_EQ(result(kOwn, 0x100, 0), 0U);
    EXPECT_EQ(result({kFirst.net_id, 1002}, 0x100, 0), 6U);
    EXPECT_EQ(result({{{10, 0, 0, 3, 2, 1}}, 1001}, 0x100, 0), 7U);
    EXPECT_EQ(result(kFirst, 0x101, 0), 0x702U);
    EXPECT_EQ(result(kFirst, 0x100, 256), 0x703U);
    EXPECT_EQ(AOEwrite(ctx(), 1, kFirst, 0x200, 0, mail_bytes({1})).error().detail, 0x704U);
    EXPECT_EQ(AOEwrite(ctx(), 1, kFirst, 0x100, 255, mail_bytes({1, 2})).error().detail, 0x705U);
    EXPECT_EQ(AOEwrite_control(ctx(), 1, kFirst, AdsState::reset, 0).error().detail, 0x712U);
    // The end of the memory: the answer has fewer octets than requested.
    const auto end = AOEread(ctx(), 1, kFirst, 0x100, 250, data);
    ASSERT_TRUE(end.ok());
    EXPECT_EQ(*end, 6U);
}

TEST_F(AoeGateway, SendsNotifications) {
    AoeNotes notes;
    notes.only_slave = 1;
    notes.look_every = 1ms;
    ASSERT_TRUE(listen(ctx(), notes).ok());
    AoeAddNotification add;
    add.slave = 1;
    add.source = kMaster;
    add.target = kFirst;
    add.index_group = 0x100;
    add.length = 2;
    add.cycle_time = 5ms;
    ASSERT_TRUE(submit(ctx(), add).ok());
    bus.run(add);
    ASSERT_EQ(add.state(), RequestState::success) << bus.words(add.error());
    const auto changing = add.handle;
    bus.idle(100ms);
    EXPECT_EQ(notes.all.size(), 1U);  // the present value
    ASSERT_TRUE(AOEwrite(ctx(), 1, kFirst, 0x100, 0, mail_bytes({7, 8})).ok());
    bus.idle(50ms);
    ASSERT_EQ(notes.all.size(), 2U);
    EXPECT_EQ(notes.all[1].data, mail_bytes({7, 8}));
    EXPECT_EQ(notes.all[1].source, kFirst);
    EXPECT_EQ(notes.all[1].handle, changing);
    // A cyclic notification of the other device.
    add.target = kSecond;
    add.transmission = AoeTransmission::cyclic;
    ASSERT_TRUE(submit(ctx(), add).ok());
    bus.run(add);
    EXPECT_NE(add.handle, changing);
    notes.all.clear();
    bus.idle(100ms);
    EXPECT_GE(notes.all.size(), 18U);
    EXPECT_LE(notes.all.size(), 22U);
    AoeDeleteNotification end;
    end.slave = 1;
    end.target = kFirst;
    end.handle = add.handle;
    ASSERT_TRUE(submit(ctx(), end).ok());
    bus.run(end);
    EXPECT_EQ(end.result_code, 0x714U) << "the handle of another device";
    end.target = kSecond;
    ASSERT_TRUE(submit(ctx(), end).ok());
    bus.run(end);
    EXPECT_EQ(end.state(), RequestState::success) << bus.words(end.error());
    bus.idle(20ms);
    notes.all.clear();
    bus.idle(100ms);
    EXPECT_TRUE(notes.all.empty());
    // The table of the gateway has four lines.
    for (int n = 0; n < 4; ++n) {
        ASSERT_TRUE(submit(ctx(), add).ok());
        bus.run(add);
    }
    EXPECT_EQ(add.result_code, 0x716U);
}

TEST_F(AoeGateway, ManyCommandsToAllDevicesAtOnce) {
    constexpr std::size_t kMany = 60;
    std::array<AoeReadWrite, kMany> requests;
    std::array<std::array<std::byte, 4>, kMany> into{};
    std::array<Mail, kMany> out;
    for (std::size_t n = 0; n < kMany; ++n) {
        AoeReadWrite& r = requests[n];
        r.slave = 1;
        r.target = n % 2 == 0 ? kFirst : kSecond;
        r.index_group = 0x300;
        out[n] = mail_bytes({static_cast<unsigned>(n), 1, 2, 3});
        r.written = out[n];
        r.data = into[n];
        ASSERT_TRUE(submit(ctx(), r).ok());
    }
    for (std::size_t n = 0; n < kMany; ++n) {
        bus.run(requests[n]);
        EXPECT_EQ(requests[n].state(), RequestState::success) << bus.words(requests[n].error());
        EXPECT_EQ(into[n][3], static_cast<std::byte>(n));
    }
}

TEST_F(AoeGateway, TsharkDecodesWhatBothEndsSend) {
    if (!testing_tshark::installed()) GTEST_SKIP() << "tshark is not installed";
    bus.nic->keeps_mail = true;
    do_everything();
    (void)result(kFirst, 0x101, 0);
    (void)result({kFirst.net_id, 1002}, 0x100, 0);
    AoeAddNotification add;
    add.slave = 1;
    add.target = kFirst;
    add.source = kMaster;
    add.index_group = 0x100;
    add.length = 2;
    ASSERT_TRUE(submit(ctx(), add).ok());
    bus.run(add);
    AoeNotes notes;
    notes.look_every = 1ms;
    ASSERT_TRUE(listen(ctx(), notes).ok());
    bus.idle(20ms);
    EXPECT_EQ(notes.all.size(), 1U);
    const auto file = std::filesystem::temp_directory_path() / ("margay-aoe-" + std::to_string(::getpid()) + ".pcap");
    {
        testing_tshark::MailboxPcap pcap(file.string());
        for (const Mail& mail : bus.nic->mail)
            if (wire::load_mailbox_header(mail).type == kAoe) pcap.add(mail);
    }
    const auto packets = testing_tshark::fields_of(
        file.string(), {"frame.number", "_ws.malformed", "_ws.expert", "ams.cmdid", "ams.stateflags", "ams.errorcode",
                        "ams.adsresult", "ams.targetnetid", "ams.targetport", "ams.cbdata", "ams.invokeid"});
    ASSERT_EQ(packets.size(), 37U);
    std::map<std::string, unsigned> commands;
    unsigned refused = 0;
    unsigned first = 0;
    for (const auto& columns : packets) {
        ASSERT_EQ(columns.size(), 11U);
        EXPECT_EQ(columns[1] + columns[2], "") << "packet " << columns[0];
        EXPECT_TRUE(columns[4] == "0x0004" || columns[4] == "0x0005") << columns[4];
        ++commands[columns[3]];
        if (columns[5] == "0x00000006") ++refused;
        if (columns[7] == "10.0.0.1.2.1" && columns[8] == "1001") ++first;
    }
    EXPECT_EQ(refused, 1U);
    EXPECT_GE(first, 6U);
    for (const char* command : {"1", "2", "3", "4", "5", "6", "8", "9"}) EXPECT_GT(commands[command], 0U) << command;
    std::filesystem::remove(file);
}

// Every command, with each of its frames lost on the way out, lost on the way back, or sent twice.
TEST(AoeLostFrames, EveryCommandSucceeds) {
    constexpr AoeAddress kDevice{{{10, 0, 0, 1, 2, 1}}, 1001};
    with_each_frame_spoilt("aoe_gateway", 100, [&](MailboxBus& bus) {
        std::array<std::byte, 4> data{};
        const auto written = AOEwrite(*bus.ctx, 1, kDevice, 0x100, 0, mail_bytes({1, 2, 3, 4}));
        EXPECT_TRUE(written.ok()) << bus.words(written.error());
        const auto read = AOEread(*bus.ctx, 1, kDevice, 0x100, 0, data);
        EXPECT_TRUE(read.ok()) << bus.words(read.error());
        EXPECT_EQ(data[3], std::byte{4});
        const auto reversed = AOEread_write(*bus.ctx, 1, kDevice, 0x300, 0, mail_bytes({1, 2, 3, 4}), data);
        EXPECT_TRUE(reversed.ok()) << bus.words(reversed.error());
        EXPECT_EQ(data[0], std::byte{4});
        const auto info = AOEread_device_info(*bus.ctx, 1, kDevice);
        EXPECT_TRUE(info.ok()) << bus.words(info.error());
    });
}

// A device sends its value when it changes. Each value arrives once and in order, and no value arrives after the end.
TEST(AoeLostFrames, EveryNotificationArrivesOnce) {
    constexpr AoeAddress kDevice{{{10, 0, 0, 1, 2, 1}}, 1001};
    with_each_frame_spoilt("aoe_gateway", 400, [&](MailboxBus& bus) {
        AoeNotes notes;
        notes.look_every = 1ms;
        ASSERT_TRUE(listen(*bus.ctx, notes).ok());
        const auto until = [&](std::size_t count) {
            for (const Time end = bus.osal.now() + 300ms; notes.all.size() < count && bus.osal.now() < end;) bus.step();
            ASSERT_EQ(notes.all.size(), count);
        };
        AoeAddNotification add;
        add.slave = 1;
        add.source = kMaster;
        add.target = kDevice;
        add.index_group = 0x100;
        add.length = 1;
        add.cycle_time = 1ms;
        ASSERT_TRUE(submit(*bus.ctx, add).ok());
        bus.run(add);
        ASSERT_EQ(add.state(), RequestState::success) << bus.words(add.error());
        until(1);  // the present value
        for (unsigned value = 1; value <= 4; ++value) {
            const auto written = AOEwrite(*bus.ctx, 1, kDevice, 0x100, 0, mail_bytes({0x10 + value}));
            EXPECT_TRUE(written.ok()) << bus.words(written.error());
            until(1 + value);
            EXPECT_EQ(notes.all.back().data, mail_bytes({0x10 + value}));
            EXPECT_EQ(notes.all.back().handle, add.handle);
        }
        AoeDeleteNotification end;
        end.slave = 1;
        end.target = kDevice;
        end.handle = add.handle;
        ASSERT_TRUE(submit(*bus.ctx, end).ok());
        bus.run(end);
        EXPECT_EQ(end.state(), RequestState::success) << bus.words(end.error());
        EXPECT_TRUE(AOEwrite(*bus.ctx, 1, kDevice, 0x100, 0, mail_bytes({0x20})).ok());
        bus.idle(20ms);
        EXPECT_EQ(notes.all.size(), 5U);
    });
}

// AoE, VoE and SDOs beside a cycle of a millisecond. The working counter of every cycle has the expected value.
TEST(AoeInTheCycle, ProcessDataStaysUndisturbed) {
    MailboxBus bus;
    (void)bus.add_stack(128);
    bus.add_device(sim::make_device("aoe_gateway").value());
    bus.start();
    std::vector<std::byte> image(256);
    const auto mapped = config_map(*bus.ctx, image);
    ASSERT_TRUE(mapped.ok()) << bus.words(mapped.error());
    std::array<AoeRead, 8> reads;
    std::array<std::array<std::byte, 100>, 8> values{};
    unsigned done = 0;
    std::uint64_t most_frames = 0;
    for (int n = 0; n < 400; ++n) {
        bus.osal.advance(1ms);
        bus.segment.advance(bus.osal.now());
        const auto frames = bus.ctx->statistics().frames_sent;
        ASSERT_TRUE(send_processdata(*bus.ctx).ok());
        const auto wkc = receive_processdata(*bus.ctx, 500us);
        ASSERT_TRUE(wkc.ok()) << bus.words(wkc.error());
        (void)poll(*bus.ctx, bus.osal.now());
        if (n > 50) most_frames = std::max(most_frames, bus.ctx->statistics().frames_sent - frames);
        for (std::size_t k = 0; k < reads.size(); ++k) {
            if (reads[k].busy()) continue;
            if (reads[k].state() == RequestState::success) ++done;
            ASSERT_NE(reads[k].state(), RequestState::error) << bus.words(reads[k].error());
            reads[k].slave = 2;
            reads[k].target = {{{10, 0, 0, 1, 2, 1}}, 1001};
            reads[k].index_group = 0x100;
            reads[k].data = values[k];
            ASSERT_TRUE(submit(*bus.ctx, reads[k]).ok());
        }
    }
    EXPECT_GT(done, 60U);
    EXPECT_EQ(most_frames, bus.ctx->group(0).frames);
    for (auto& read : reads) read.cancel();
}

}  // namespace
}  // namespace margay
