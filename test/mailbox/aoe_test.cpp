// The AoE client: octets by hand from ETG.1020 and the ADS commands, hostile answers, and the gateway of the library.
// tshark decodes what both ends have sent.
#include "facts.hpp"
#include "mailbox/mailbox_bus.hpp"
#include "wire/mailbox_pcap.hpp"

#include <unistd.h>

#include <filesystem>
#include <map>

namespace margay {
namespace {

constexpr auto kAoe = wire::MailboxType::aoe;
constexpr AoeAddress kTarget{{{10, 0, 0, 1, 2, 1}}, 1001};
constexpr AoeAddress kMaster{{{1, 2, 3, 4, 5, 6}}, 0x8001};

Mail joined(std::initializer_list<Mail> parts) {
    Mail all;
    for (const Mail& part : parts) all.insert(all.end(), part.begin(), part.end());
    return all;
}

// A slave for which the test writes the answers.
class AoeOctets : public testing::Test {
  protected:
    MailboxBus bus;
    ScriptedSlave& slave = bus.add_scripted(128);
    std::array<std::byte, 32> data{};
    void SetUp() override {
        bus.start();
        bus.idle(5ms);
    }
    // The answer to the n-th message received: its header with addresses swapped, and this data.
    Mail response(const Mail& to, const Mail& payload, unsigned error = 0) {
        Mail mail(32);
        std::copy_n(to.begin() + 6 + 8, 8, mail.begin());
        std::copy_n(to.begin() + 6, 8, mail.begin() + 8);
        mail[16] = to[6 + 16];
        mail[18] = std::byte{5};
        mail[20] = static_cast<std::byte>(payload.size());
        store_le(mail, 24, error);
        std::copy_n(to.begin() + 6 + 28, 4, mail.begin() + 28);
        mail.insert(mail.end(), payload.begin(), payload.end());
        return mail;
    }
    void answer(const Mail& payload, unsigned error = 0) {
        slave.on_mail = [this, payload, error](const Mail& mail) { slave.reply(response(mail, payload, error), kAoe); };
    }
    void run(AoeRequest& request) {
        request.slave = 1;
        request.target = kTarget;
        request.source = kMaster;
        request.timeout = 100ms;
        slave.received.clear();
        const auto submitted = submit(*bus.ctx, request);
        ASSERT_TRUE(submitted.ok()) << bus.words(submitted.error());
        bus.run(request);
        ASSERT_EQ(slave.received.size(), 1U);
    }
    // The request on the wire must have this command and this data.
    void expect_sent(unsigned command, const Mail& payload) {
        Mail mail = slave.received.at(0);
        const Mail head = mail_bytes({10,   0,    0,       1, 2, 1, 0xE9,
                                      0x03, 1,    2,       3, 4, 5, 6,
                                      0x01, 0x80, command, 0, 4, 0, static_cast<unsigned>(payload.size()),
                                      0,    0,    0,       0, 0, 0, 0});
        ASSERT_EQ(mail.size(), 6 + 32 + payload.size());
        EXPECT_EQ(wire::load_mailbox_header(mail).type, kAoe);
        EXPECT_EQ(Mail(mail.begin() + 6, mail.begin() + 34), head);
        EXPECT_EQ(Mail(mail.begin() + 38, mail.end()), payload);
    }
};

const Mail kDone = mail_bytes({0, 0, 0, 0});

TEST_F(AoeOctets, Read) {
    AoeRead read;
    read.index_group = 0xF302;
    read.index_offset = 0x10180001;
    read.data = MutableBytes(data).first(8);
    answer(mail_bytes({0, 0, 0, 0, 4, 0, 0, 0, 0x47, 0x4D, 0, 0}));
    run(read);
    EXPECT_EQ(read.state(), RequestState::success) << bus.words(read.error());
    EXPECT_EQ(read.bytes, 4U);
    EXPECT_EQ(load_le<std::uint32_t>(data), 0x4D47U);
    expect_sent(2, mail_bytes({0x02, 0xF3, 0, 0, 0x01, 0, 0x18, 0x10, 8, 0, 0, 0}));
}

TEST_F(AoeOctets, WriteAndReadWrite) {
    const Mail value = mail_bytes({1, 2, 3});
    AoeWrite write;
    write.index_group = 0x11223344;
    write.index_offset = 0x55667788;
    write.data = value;
    answer(kDone);
    run(write);
    EXPECT_EQ(write.state(), RequestState::success) << bus.words(write.error());
    expect_sent(3, mail_bytes({0x44, 0x33, 0x22, 0x11, 0x88, 0x77, 0x66, 0x55, 3, 0, 0, 0, 1, 2, 3}));
    AoeReadWrite both;
    both.index_group = 1;
    both.index_offset = 2;
    both.written = value;
    both.data = MutableBytes(data).first(5);
    answer(mail_bytes({0, 0, 0, 0, 2, 0, 0, 0, 8, 9}));
    run(both);
    EXPECT_EQ(both.state(), RequestState::success) << bus.words(both.error());
    EXPECT_EQ(both.bytes, 2U);
    EXPECT_EQ(data[1], std::byte{9});
    expect_sent(9, mail_bytes({1, 0, 0, 0, 2, 0, 0, 0, 5, 0, 0, 0, 3, 0, 0, 0, 1, 2, 3}));
}

TEST_F(AoeOctets, StatesAndDeviceInformation) {
    const Mail value = mail_bytes({7});
    AoeWriteControl control;
    control.ads_state = AdsState::stop;
    control.device_state = 0x1234;
    control.data = value;
    answer(kDone);
    run(control);
    EXPECT_EQ(control.state(), RequestState::success) << bus.words(control.error());
    expect_sent(5, mail_bytes({6, 0, 0x34, 0x12, 1, 0, 0, 0, 7}));
    AoeReadState state;
    answer(mail_bytes({0, 0, 0, 0, 5, 0, 0x42, 0x01}));
    run(state);
    EXPECT_EQ(state.state(), RequestState::success) << bus.words(state.error());
    EXPECT_EQ(state.ads_state, AdsState::run);
    EXPECT_EQ(state.device_state, 0x0142);
    expect_sent(4, {});
    AoeReadDeviceInfo info;
    answer(joined({kDone, mail_bytes({3, 1, 0x30, 0x12, 'E', 'L', '6', '7', '5', '1', 0, 0, 0, 0, 0, 0, 0, 0, 0, 0})}));
    run(info);
    EXPECT_EQ(info.state(), RequestState::success) << bus.words(info.error());
    EXPECT_EQ(info.info.major, 3);
    EXPECT_EQ(info.info.minor, 1);
    EXPECT_EQ(info.info.build, 0x1230);
    EXPECT_EQ(info.info.name(), "EL6751");
    expect_sent(1, {});
    // A name that fills its field has no zero.
    answer(joined({kDone, Mail(20, std::byte{'x'})}));
    run(info);
    EXPECT_EQ(info.info.name().size(), 16U);
}

TEST_F(AoeOctets, Notifications) {
    AoeAddNotification add;
    add.index_group = 0x4020;
    add.index_offset = 8;
    add.length = 2;
    add.transmission = AoeTransmission::on_change;
    add.longest_delay = 1ms;
    add.cycle_time = 10ms;
    answer(mail_bytes({0, 0, 0, 0, 0x78, 0x56, 0x34, 0x12}));
    run(add);
    EXPECT_EQ(add.state(), RequestState::success) << bus.words(add.error());
    EXPECT_EQ(add.handle, 0x12345678U);
    Mail sent = mail_bytes({0x20, 0x40, 0, 0, 8, 0, 0, 0, 2, 0, 0, 0, 4, 0, 0, 0, 0x10, 0x27, 0, 0, 0xA0, 0x86, 1, 0});
    sent.resize(40);
    expect_sent(6, sent);
    AoeDeleteNotification end;
    end.handle = 0x12345678;
    answer(kDone);
    run(end);
    EXPECT_EQ(end.state(), RequestState::success) << bus.words(end.error());
    expect_sent(7, mail_bytes({0x78, 0x56, 0x34, 0x12}));
}

TEST_F(AoeOctets, NetIdOfTheSlave) {
    AoeSetNetId set;
    set.net_id = {{5, 80, 1, 2, 3, 4}};
    answer(kDone);
    run(set);
    EXPECT_EQ(set.state(), RequestState::success) << bus.words(set.error());
    const Mail& mail = slave.received.at(0);
    EXPECT_EQ(Mail(mail.begin() + 6, mail.begin() + 12), mail_bytes({5, 80, 1, 2, 3, 4}));
    EXPECT_EQ(Mail(mail.begin() + 38, mail.end()), mail_bytes({1, 0, 0, 0, 3, 0, 0, 0, 6, 0, 0, 0, 5, 80, 1, 2, 3, 4}));
}

TEST_F(AoeOctets, TheErrorOfTheHeaderAndTheResultAreApart) {
    AoeRead read;
    read.index_group = 0xF302;
    read.index_offset = 0x10180001;
    read.data = data;
    answer({}, 7);
    run(read);
    EXPECT_EQ(read.error_code, 7U);
    EXPECT_EQ(read.result_code, 0U);
    EXPECT_EQ(bus.words(read.error()),
              "slave 1: AoE read: the AoE command was not executed (error code 0x0007: no route to this NetID; index "
              "group 0xf302, offset 0x10180001)");
    answer(mail_bytes({0x03, 0x07, 0, 0, 0, 0, 0, 0}));
    run(read);
    EXPECT_EQ(read.error_code, 0U);
    EXPECT_EQ(read.result_code, 0x703U);
    EXPECT_EQ(bus.words(read.error()),
              "slave 1: AoE read: the device refused the AoE command (error code 0x0703: invalid index offset; index "
              "group 0xf302, offset 0x10180001)");
    AoeReadState state;
    answer(mail_bytes({0x99, 0x99, 0x01, 0}));  // a code of the vendor, and no states behind it
    run(state);
    EXPECT_EQ(state.result_code, 0x19999U);
    EXPECT_EQ(bus.words(state.error()),
              "slave 1: AoE read state: the device refused the AoE command (error code 0x19999: unknown code)");
    answer(mail_bytes({0, 0, 0, 0, 5, 0, 0, 0}));
    run(state);
    EXPECT_EQ(state.result_code, 0U);
    EXPECT_EQ(state.state(), RequestState::success);
}

// Answers that are too short, announce more than they have, or belong to something else.
TEST_F(AoeOctets, HostileAnswers) {
    AoeRead read;
    read.data = MutableBytes(data).first(8);
    const auto expect_error = [&](Errc code, const char* what, const std::function<Mail(const Mail&)>& how) {
        slave.on_mail = [&](const Mail& mail) { slave.reply(how(mail), kAoe); };
        data.fill(std::byte{0xEE});
        run(read);
        EXPECT_EQ(read.error().code, code) << what << ": " << bus.words(read.error());
        for (std::size_t n = 8; n < data.size(); ++n) ASSERT_EQ(data[n], std::byte{0xEE}) << what;
        bus.idle(150ms);
    };
    const Mail good = mail_bytes({0, 0, 0, 0, 2, 0, 0, 0, 1, 2});
    expect_error(Errc::none, "good", [&](const Mail& m) { return response(m, good); });
    const auto with = [&](std::size_t at, unsigned octet) {
        return [this, &good, at, octet](const Mail& m) {
            Mail wrong = response(m, good);
            wrong[at] = static_cast<std::byte>(octet);
            return wrong;
        };
    };
    expect_error(Errc::timeout, "another invoke ID", with(31, 0x55));
    expect_error(Errc::timeout, "another command", with(16, 3));
    expect_error(Errc::timeout, "no response", with(18, 4));
    expect_error(Errc::protocol, "announces more than there is", with(20, 11));
    expect_error(Errc::protocol, "announces 4 GiB", with(23, 0xFF));
    expect_error(Errc::protocol, "no result", with(20, 3));
    expect_error(Errc::protocol, "no length", with(20, 7));
    expect_error(Errc::protocol, "length longer than the data", with(36, 3));
    expect_error(Errc::protocol, "length of 4 GiB", with(39, 0xFF));
    expect_error(Errc::none, "octets behind the data are ignored", [&](const Mail& m) {
        Mail longer = response(m, good);
        longer.resize(60, std::byte{7});
        return longer;
    });
    expect_error(Errc::capacity, "more octets than wanted", [&](const Mail& m) {
        return response(m, joined({mail_bytes({0, 0, 0, 0, 9, 0, 0, 0}), Mail(9, std::byte{1})}));
    });
    for (std::size_t bytes = 1; bytes < 32; ++bytes)
        expect_error(Errc::timeout, "a part of the header", [&](const Mail& m) {
            Mail shorter = response(m, good);
            shorter.resize(bytes);
            return shorter;
        });
    slave.on_mail = [&](const Mail&) { slave.reply(mail_bytes({1, 0, 2, 0}), wire::MailboxType::error); };
    run(read);
    EXPECT_EQ(read.error().code, Errc::mailbox_error);
    AoeReadState state;
    answer(mail_bytes({0, 0, 0, 0, 5, 0, 0}));
    run(state);
    EXPECT_EQ(state.error().code, Errc::protocol) << "an octet of the states is missing";
    expect_error(Errc::none, "works again", [&](const Mail& m) { return response(m, good); });
}

// Commands that are busy at the same time are answered in another order.
TEST_F(AoeOctets, ManyInFlightByInvokeId) {
    constexpr std::size_t kMany = 12;
    std::array<AoeRead, kMany> reads;
    std::array<std::array<std::byte, 4>, kMany> values{};
    std::vector<Mail> waiting;
    slave.on_mail = [&](const Mail& mail) {
        waiting.push_back(mail);
        if (waiting.size() < kMany) return;
        for (auto one = waiting.rbegin(); one != waiting.rend(); ++one)
            slave.reply(response(*one, joined({mail_bytes({0, 0, 0, 0, 4, 0, 0, 0}),
                                               Mail(one->begin() + 38, one->begin() + 42)})),
                        kAoe);
    };
    for (std::size_t n = 0; n < kMany; ++n) {
        reads[n].slave = 1;
        reads[n].index_group = static_cast<std::uint32_t>(1000 + n);
        reads[n].data = values[n];
        ASSERT_TRUE(submit(*bus.ctx, reads[n]).ok());
    }
    for (std::size_t n = 0; n < kMany; ++n) {
        bus.run(reads[n]);
        EXPECT_EQ(reads[n].state(), RequestState::success) << bus.words(reads[n].error());
        EXPECT_EQ(load_le<std::uint32_t>(values[n]), 1000 + n);
    }
    EXPECT_EQ(mailbox_statistics(*bus.ctx, 1)->unexpected, 0U);
}

TEST_F(AoeOctets, WhatDoesNotFitTheMailboxIsRefusedInWords) {
    std::vector<std::byte> big(200);
    AoeWrite write;
    write.slave = 1;
    write.data = Bytes(big).first(79);
    EXPECT_EQ(bus.words(submit(*bus.ctx, write).error()),
              "slave 1: AoE write: argument out of range: the length in the AoE command is 79 octets, at most 78 "
              "are possible");
    AoeRead read;
    read.slave = 1;
    read.data = MutableBytes(big).first(83);
    EXPECT_EQ(bus.words(submit(*bus.ctx, read).error()),
              "slave 1: AoE read: argument out of range: the length in the AoE command is 83 octets, at most 82 "
              "are possible");
    answer(kDone);
    write.data = Bytes(big).first(78);
    run(write);
    EXPECT_EQ(write.state(), RequestState::success);
    answer(joined({mail_bytes({0, 0, 0, 0, 82, 0, 0, 0}), Mail(82, std::byte{4})}));
    read.data = MutableBytes(big).first(82);
    run(read);
    EXPECT_EQ(read.bytes, 82U);
    MailboxBus other;
    (void)other.add_scripted(128, 0x04);
    other.start();
    EXPECT_EQ(other.words(AOEread(*other.ctx, 1, kTarget, 0, 0, big).error()),
              "slave 1: AoE read: not supported by the slave");
}

class Notes final : public AoeListener {
  public:
    struct Note {
        AoeAddress source;
        std::uint32_t handle;
        std::uint64_t time;
        Mail data;
    };
    std::vector<Note> all;
    void notified(std::uint16_t, const AoeNotification& n) override {
        all.push_back({n.source, n.handle, n.time_stamp, Mail(n.data.begin(), n.data.end())});
    }
};

TEST_F(AoeOctets, ANotificationHasStampsAndSamples) {
    Notes notes;
    notes.only_slave = 1;
    notes.look_every = 1ms;
    ASSERT_TRUE(listen(*bus.ctx, notes).ok());
    const Mail head = mail_bytes(
        {1, 2, 3, 4, 5, 6, 0x01, 0x80, 10, 0, 0, 1, 2, 1, 0xE9, 0x03, 8, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
    const Mail two =
        mail_bytes({52, 0, 0, 0, 2, 0, 0, 0,                                                 // two stamps
                    1,  0, 0, 0, 0, 0, 0, 0x80, 2,    0,    0, 0,                            // a time, two samples
                    7,  0, 0, 0, 1, 0, 0, 0,    0xAA,                                        //
                    8,  0, 0, 0, 2, 0, 0, 0,    0xBB, 0xCC,                                  //
                    2,  0, 0, 0, 0, 0, 0, 0,    1,    0,    0, 0, 9, 0, 0, 0, 0, 0, 0, 0});  // one of no octets
    slave.reply(joined({head, two}), kAoe);
    bus.idle(10ms);
    ASSERT_EQ(notes.all.size(), 3U);
    EXPECT_EQ(notes.all[0].source, kTarget);
    EXPECT_EQ(notes.all[0].handle, 7U);
    EXPECT_EQ(notes.all[0].time, 0x8000000000000001U);
    EXPECT_EQ(notes.all[1].data, mail_bytes({0xBB, 0xCC}));
    EXPECT_EQ(notes.all[2].handle, 9U);
    EXPECT_EQ(notes.all[2].time, 2U);
    EXPECT_EQ(notes.all[2].data, Mail{});
    // Cut anywhere: the whole samples before are told, and nothing is read behind the end.
    for (std::size_t bytes = 0; bytes < two.size(); ++bytes) {
        notes.all.clear();
        slave.reply(joined({head, Mail(two.begin(), two.begin() + static_cast<std::ptrdiff_t>(bytes))}), kAoe);
        bus.idle(5ms);
        EXPECT_EQ(notes.all.size(), bytes < 29 ? 0U : bytes < 39 ? 1U : 2U) << bytes;
    }
    // Counts and sizes of 2^32 - 1.
    for (const std::size_t at : {4U, 16U, 24U}) {
        notes.all.clear();
        Mail wrong = two;
        std::fill_n(wrong.begin() + static_cast<std::ptrdiff_t>(at), 4, std::byte{0xFF});
        slave.reply(joined({head, wrong}), kAoe);
        bus.idle(5ms);
        EXPECT_LE(notes.all.size(), 3U);
    }
}

// ------------------------------------------------------------------ the gateway of the library

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
    // Each kind of command once.
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

// The init command of configuration tools: at the transition to PREOP, also when the slave starts again.
TEST_F(AoeGateway, GetsItsNetIdFromAHook) {
    bus.ctx->slave(1).hooks.transition = [](HookedSlave slave, Transition which, Moment moment, void*) -> Task<> {
        if (which != Transition::init_to_preop || moment != Moment::after) co_return Nothing{};
        auto set = co_await slave.aoe_set_net_id(kOwnId);
        if (!set) co_return set;
        // The same as octets: read the state of the device at the new NetID.
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
    // The end of the memory: fewer octets than wanted.
    const auto end = AOEread(ctx(), 1, kFirst, 0x100, 250, data);
    ASSERT_TRUE(end.ok());
    EXPECT_EQ(*end, 6U);
}

TEST_F(AoeGateway, SendsNotifications) {
    Notes notes;
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
    // Cyclic, of the other device.
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
    Notes notes;
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
        if (columns[5] == "0x00000006" || columns[6] == "0x00000702") ++refused;
        if (columns[7] == "10.0.0.1.2.1" && columns[8] == "1001") ++first;
    }
    EXPECT_EQ(refused, 2U);
    EXPECT_GE(first, 6U);
    for (const char* command : {"1", "2", "3", "4", "5", "6", "8", "9"}) EXPECT_GT(commands[command], 0U) << command;
    std::filesystem::remove(file);
}

// Every command, with each of its frames lost on the way out, lost on the way back, or sent twice.
TEST(AoeLostFrames, EveryCommandSucceeds) {
    enum class Fault { none, lost_out, lost_in, twice };
    constexpr AoeAddress kFirst{{{10, 0, 0, 1, 2, 1}}, 1001};
    const auto run = [&](Fault fault, std::uint64_t at) {
        MailboxBus bus;
        bus.add_device(sim::make_device("aoe_gateway").value());
        bus.start();
        bus.idle(20ms);
        const auto before = bus.nic->sent;
        if (fault == Fault::lost_out) bus.nic->lose_out.insert(before + at);
        if (fault == Fault::lost_in) bus.nic->lose_in.insert(before + at);
        if (fault == Fault::twice) bus.nic->twice.insert(before + at);
        std::array<std::byte, 4> data{};
        const auto written = AOEwrite(*bus.ctx, 1, kFirst, 0x100, 0, mail_bytes({1, 2, 3, 4}));
        EXPECT_TRUE(written.ok()) << bus.words(written.error());
        const auto read = AOEread(*bus.ctx, 1, kFirst, 0x100, 0, data);
        EXPECT_TRUE(read.ok()) << bus.words(read.error());
        EXPECT_EQ(data[3], std::byte{4});
        const auto reversed = AOEread_write(*bus.ctx, 1, kFirst, 0x300, 0, mail_bytes({1, 2, 3, 4}), data);
        EXPECT_TRUE(reversed.ok()) << bus.words(reversed.error());
        EXPECT_EQ(data[0], std::byte{4});
        const auto info = AOEread_device_info(*bus.ctx, 1, kFirst);
        EXPECT_TRUE(info.ok()) << bus.words(info.error());
        return bus.nic->sent - before;
    };
    const auto frames = run(Fault::none, 0);
    ASSERT_LT(frames, 100U);
    for (const Fault fault : {Fault::lost_out, Fault::lost_in, Fault::twice})
        for (std::uint64_t at = 0; at < frames; ++at) {
            SCOPED_TRACE(testing::Message() << "fault " << static_cast<int>(fault) << " at frame " << at);
            (void)run(fault, at);
        }
}

// AoE, VoE and SDOs beside a cycle of a millisecond: the working counter of every cycle is right.
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
