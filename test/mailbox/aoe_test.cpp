// The AoE client with a slave for which the test writes every answer. The octets are composed by hand from ETG.1020 and
// the ADS commands. Also hostile answers.
#include "facts.hpp"
#include "mailbox/aoe_notes.hpp"

namespace margay {
namespace {

constexpr AoeAddress kTarget{{{10, 0, 0, 1, 2, 1}}, 1001};

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
    // The answer to the received message with number n: its header with the addresses swapped, and this data.
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
        send(request);
        ASSERT_EQ(slave.received.size(), 1U);
    }
    void send(AoeRequest& request) {
        request.slave = 1;
        request.target = kTarget;
        request.source = kMaster;
        request.timeout = 100ms;
        slave.received.clear();
        const auto submitted = submit(*bus.ctx, request);
        ASSERT_TRUE(submitted.ok()) << bus.words(submitted.error());
        bus.run(request);
    }
    // Checks that the request on the wire has this command and this data.
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

// The answer to the previous command, which was given up, must not count.
TEST_F(AoeOctets, CommandsOfAHookHaveInvokeIdsOfTheirOwn) {
    bus.ctx->slave(1).hooks.preop_to_safeop = [](HookedSlave hooked, void*) -> Task<> {
        (void)co_await hooked.aoe_set_net_id(AoeNetId{{1, 1, 1, 1, 1, 1}});
        (void)co_await hooked.aoe_set_net_id(AoeNetId{{2, 2, 2, 2, 2, 2}});
        co_return Nothing{};
    };
    std::set<std::uint32_t> invoke_ids;
    unsigned commands = 0;
    slave.on_mail = [&](const Mail& mail) {
        if (mail.size() != 6 + 32 + 12 + 6) return;
        ++commands;
        invoke_ids.insert(load_le<std::uint32_t>(mail, 6 + 28));
        slave.reply(response(mail, kDone), kAoe);
    };
    std::vector<std::byte> image(64);
    (void)config_map(*bus.ctx, image);
    EXPECT_EQ(commands, 2U);
    EXPECT_EQ(invoke_ids.size(), 2U);
    EXPECT_EQ(invoke_ids.count(0), 0U);
}

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
    answer(mail_bytes({0x99, 0x99, 0x01, 0}));  // a code of the vendor, without the states
    run(state);
    EXPECT_EQ(state.result_code, 0x19999U);
    EXPECT_EQ(bus.words(state.error()),
              "slave 1: AoE read state: the device refused the AoE command (error code 0x19999: unknown code)");
    answer(mail_bytes({0, 0, 0, 0, 5, 0, 0, 0}));
    run(state);
    EXPECT_EQ(state.result_code, 0U);
    EXPECT_EQ(state.state(), RequestState::success);
}

// Answers that are too short, that announce more octets than they have, or that belong to something else.
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

// The slave has no message to repeat. The library does not execute a command with an effect twice.
TEST_F(AoeOctets, AnAnswerThatIsLostForGoodIsAskedForAgainIfTheCommandOnlyReads) {
    slave.forgets = true;
    AoeRead read;
    AoeWrite write;
    std::array<std::byte, 2> octets{};
    read.data = octets;
    write.data = octets;
    answer(mail_bytes({0, 0, 0, 0, 2, 0, 0, 0, 1, 2}));
    run(read);
    const auto frames = bus.nic->sent;
    run(read);
    bus.nic->lose_in.insert(bus.nic->sent + (bus.nic->sent - frames) - 1);
    send(read);
    EXPECT_EQ(slave.received.size(), 2U);
    EXPECT_EQ(read.error().code, Errc::none) << bus.words(read.error());
    answer(kDone);
    bus.nic->lose_mail_from = 1;
    send(write);
    EXPECT_EQ(slave.received.size(), 1U);
    EXPECT_EQ(write.error().code, Errc::reply_lost) << bus.words(write.error());
}

// The answers to commands that are busy at the same time come in another order.
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

TEST_F(AoeOctets, ANotificationHasStampsAndSamples) {
    AoeNotes notes;
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
                    2,  0, 0, 0, 0, 0, 0, 0,    1,    0,    0, 0, 9, 0, 0, 0, 0, 0, 0, 0});  // a sample of no octets
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
    // The message is truncated at each octet. The complete samples before that octet are delivered, and no octet behind
    // the end is read.
    for (std::size_t bytes = 0; bytes < two.size(); ++bytes) {
        notes.all.clear();
        slave.reply(joined({head, Mail(two.begin(), two.begin() + static_cast<std::ptrdiff_t>(bytes))}), kAoe);
        bus.idle(5ms);
        EXPECT_EQ(notes.all.size(), bytes < 29 ? 0U : bytes < 39 ? 1U : 2U) << bytes;
    }
    // Counts and sizes of 2^32 - 1 in the message.
    for (const std::size_t at : {4U, 16U, 24U}) {
        notes.all.clear();
        Mail wrong = two;
        std::fill_n(wrong.begin() + static_cast<std::ptrdiff_t>(at), 4, std::byte{0xFF});
        slave.reply(joined({head, wrong}), kAoe);
        bus.idle(5ms);
        EXPECT_LE(notes.all.size(), 3U);
    }
}

}  // namespace
}  // namespace margay
