// The mailbox channel with a mailbox for which the test writes every octet. ETG.1000.4 "Mailbox" (header, counter,
// repeat), ETG.1000.6 table "Mailbox error reply". The behaviour of real slaves comes from the field notes (mailbox).
#include "api/master.hpp"
#include "mailbox/mailbox_bus.hpp"

namespace margay {
namespace {

using wire::MailboxType;

// An expedited upload response of two octets. The index is little-endian: 06 7F is index 0x7F06.
Mail two_octets(unsigned index_low, unsigned index_high, unsigned subindex, unsigned low, unsigned high) {
    return mail_bytes({0x00, 0x30, 0x4B, index_low, index_high, subindex, low, high, 0x00, 0x00});
}

class ChannelTest : public testing::Test {
  protected:
    MailboxBus bus;
    ScriptedSlave& slave = bus.add_scripted(64);

    void start(Limits limits = {}) { bus.start(limits); }
    SdoUpload request;
    std::array<std::byte, 16> memory{};
    void submit_upload(std::uint16_t index, Duration timeout = Duration{0}) {
        request.slave = 1;
        request.index = index;
        request.data = memory;
        request.timeout = timeout;
        ASSERT_TRUE(submit(*bus.ctx, request).ok());
    }
    MailboxStatistics statistics() { return *mailbox_statistics(*bus.ctx, 1); }
};

TEST_F(ChannelTest, SendsTheOctetsOfTheStandard) {
    start();
    slave.on_mail = [&](const Mail&) { slave.reply(two_octets(0x41, 0x60, 0x00, 0x37, 0x02)); };
    const auto value = SDOread<std::uint16_t>(*bus.ctx, 1, 0x6041, 0);
    ASSERT_TRUE(value.ok()) << bus.words(value.error());
    EXPECT_EQ(*value, 0x0237);
    ASSERT_EQ(slave.received.size(), 1U);
    // Length 10, address 0, channel 0, type CoE, counter 1; CoE header: SDO request; initiate upload; index; subindex;
    // reserved.
    EXPECT_EQ(slave.received[0],
              mail_bytes({0x0A, 0x00, 0x00, 0x00, 0x00, 0x13, 0x00, 0x20, 0x40, 0x41, 0x60, 0x00, 0, 0, 0, 0}));
}

TEST_F(ChannelTest, CountersRunFromOneToSevenWhateverTheSlaveCounts) {
    start();
    unsigned answers = 0;
    slave.on_mail = [&](const Mail&) {
        Mail mail = mail_bytes({0x0A, 0x00, 0x00, 0x00, 0x00, 0x03});
        mail[5] |= static_cast<std::byte>((answers++ % 3 == 0 ? 0 : 5) << 4);  // counters 0, 5, 5, 0 …
        const auto data = two_octets(0x00, 0x20, 0x00, answers, 0x00);
        mail.insert(mail.end(), data.begin(), data.end());
        slave.put(mail);
    };
    for (unsigned n = 1; n <= 16; ++n) {
        const auto value = SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0);
        ASSERT_TRUE(value.ok()) << n << ": " << bus.words(value.error());
        EXPECT_EQ(*value, n);
        EXPECT_EQ(wire::load_mailbox_header(slave.received[n - 1]).counter, (n - 1) % 7 + 1);
    }
}

// No frame is lost. A copy with the same counter is the mail that was read before, and not the answer to the next
// request.
TEST_F(ChannelTest, ACopyOfAReplyIsDropped) {
    start();
    unsigned answers = 0;
    slave.on_mail = [&](const Mail&) {
        const unsigned counter = answers++ % 7 + 1;
        Mail mail = mail_bytes({0x0A, 0x00, 0x00, 0x00, 0x00, 0x03});
        mail[5] |= static_cast<std::byte>(counter << 4);
        const auto data = two_octets(0x00, 0x20, 0x00, answers, 0x00);
        mail.insert(mail.end(), data.begin(), data.end());
        slave.put(mail);
        // Until the counter of the slave has changed once, it may be a counter that never changes.
        if (answers > 2) slave.put(mail);
    };
    for (unsigned n = 1; n <= 16; ++n) {
        const auto value = SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0);
        ASSERT_TRUE(value.ok()) << n << ": " << bus.words(value.error());
        EXPECT_EQ(*value, n);
    }
    EXPECT_GE(statistics().duplicates, 13U);
}

TEST_F(ChannelTest, WhatAnEarlierMasterLeftIsDrainedFirst) {
    start();
    // An old reply for the same object. The channel must not accept it for the new request.
    slave.reply(two_octets(0x00, 0x20, 0x00, 0xAA, 0xAA));
    slave.reply(two_octets(0x00, 0x20, 0x00, 0xBB, 0xBB));
    slave.on_mail = [&](const Mail&) { slave.reply(two_octets(0x00, 0x20, 0x00, 0x11, 0x22)); };
    bus.idle(1ms);
    EXPECT_EQ(*SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0), 0x2211);
    EXPECT_EQ(statistics().unexpected, 2U);
}

TEST_F(ChannelTest, OtherMailDoesNotDisturbARequest) {
    start();
    slave.on_mail = [&](const Mail&) {
        slave.reply({0x00, 0x10, 0x30, 0x81, 0x05, 1, 2, 3, 4, 5});  // emergency 0x8130, register 5
        slave.reply(mail_bytes({0x00, 0x00, 0xFF, 0xFF, 0xFF, 0xFF}), MailboxType::eoe);  // an EoE fragment
        slave.reply(mail_bytes({0x03, 0x40, 0xAB, 0xCD}));                                // a TxPDO
        slave.reply(mail_bytes({1, 2, 3, 4, 5, 6}), MailboxType::voe);
        slave.reply(two_octets(0x01, 0x20, 0x00, 9, 9));  // a late reply to another index
        slave.reply(two_octets(0x00, 0x20, 0x00, 0x11, 0x22));
    };
    submit_upload(0x2000);
    bus.run(request);
    EXPECT_EQ(request.state(), RequestState::success) << bus.words(request.error());
    EXPECT_EQ(memory[0], std::byte{0x11});
    const auto emergency = emergencies(*bus.ctx, 1).take();
    ASSERT_TRUE(emergency.has_value());
    EXPECT_EQ(emergency->code, 0x8130);
    EXPECT_EQ(emergency->error_register, 5);
    EXPECT_EQ(emergency->data[4], std::byte{5});
    EXPECT_EQ(statistics().unexpected, 4U);
}

TEST_F(ChannelTest, EmergenciesOverrunAreCounted) {
    start({.emergencies = 4});
    slave.on_mail = [&](const Mail&) {
        for (unsigned n = 1; n <= 6; ++n) slave.reply({0x00, 0x10, n, 0xFF, 0x01, 0, 0, 0, 0, 0});
        slave.reply(two_octets(0x00, 0x20, 0x00, 0, 0));
    };
    EXPECT_TRUE(SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0).ok());
    auto& ring = emergencies(*bus.ctx, 1);
    EXPECT_EQ(ring.dropped(), 2U);
    EXPECT_EQ(ring.count(), 6U);
    for (unsigned n = 1; n <= 4; ++n) EXPECT_EQ(ring.take()->code, 0xFF00 + n);
    EXPECT_FALSE(ring.take().has_value());
    EXPECT_FALSE(emergencies(*bus.ctx, 9).take().has_value());
}

TEST_F(ChannelTest, MailThatNobodyWaitsForIsFoundByTheWatch) {
    start();
    slave.reply({0x00, 0x10, 0x10, 0x23, 0x01, 0, 0, 0, 0, 0});
    bus.idle(50ms);
    EXPECT_FALSE(emergencies(*bus.ctx, 1).take().has_value());  // no request reads the mailbox
    (void)watch_mailboxes(*bus.ctx, 5ms);
    bus.idle(20ms);
    const auto emergency = emergencies(*bus.ctx, 1).take();
    ASSERT_TRUE(emergency.has_value());
    EXPECT_EQ(emergency->code, 0x2310);
    const auto before = bus.ctx->statistics().datagrams_sent;
    bus.idle(100ms);
    EXPECT_LE(bus.ctx->statistics().datagrams_sent - before, 21U);  // one datagram per check
    (void)watch_mailboxes(*bus.ctx, 0ms);
    bus.idle(10ms);
    const auto after = bus.ctx->statistics().datagrams_sent;
    bus.idle(100ms);
    EXPECT_EQ(bus.ctx->statistics().datagrams_sent, after);
}

TEST_F(ChannelTest, MailboxErrorReplyEndsTheRequestInWords) {
    start();
    slave.on_mail = [&](const Mail&) { slave.reply(mail_bytes({0x01, 0x00, 0x02, 0x00}), MailboxType::error); };
    const auto value = SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0);
    EXPECT_EQ(value.error().code, Errc::mailbox_error);
    EXPECT_EQ(bus.words(value.error()), "slave 1: SDO upload of 0x2000:0: mailbox error reply (detail 0x0002: " +
                                            std::string(wire::to_text(wire::MailboxErrorCode::unsupported_protocol)) +
                                            ")");
}

TEST_F(ChannelTest, SilenceEndsInATimeoutAndALateReplyIsNotTakenForTheNext) {
    start();
    slave.delay = 80ms;
    slave.on_mail = [&](const Mail& mail) {
        const auto n = static_cast<unsigned>(slave.received.size());
        slave.reply(two_octets(std::to_integer<unsigned>(mail[9]), 0x20, 0x00, n, 0));
    };
    submit_upload(0x2000, 50ms);
    const Time begin = bus.osal.now();
    bus.run(request);
    EXPECT_EQ(request.error().code, Errc::timeout);
    EXPECT_EQ(request.error().index, 0x2000);
    EXPECT_LT(bus.osal.now() - begin, 55ms);
    // The same object again: its reply looks like the late reply, so the channel waits for the late reply first.
    submit_upload(0x2000, 500ms);
    bus.run(request);
    EXPECT_EQ(request.state(), RequestState::success) << bus.words(request.error());
    EXPECT_EQ(memory[0], std::byte{2});
    EXPECT_EQ(statistics().unexpected, 1U);
}

TEST_F(ChannelTest, ASlaveThatNeverAnswersBlocksNobodyForLong) {
    start();
    for (int n = 0; n < 3; ++n) {
        submit_upload(0x2000, 250ms);
        bus.run(request);
        EXPECT_EQ(request.error().code, Errc::timeout);
    }
    // The slave has received the first request, its abort, and a question before each of the other requests, whose
    // answer could be the answer to the first request.
    EXPECT_EQ(slave.received.size(), 4U);
    slave.on_mail = [&](const Mail& mail) {
        const auto high = std::to_integer<unsigned>(mail[10]);
        slave.reply(two_octets(std::to_integer<unsigned>(mail[9]), high, std::to_integer<unsigned>(mail[11]), 7, 0));
    };
    const Time begin = bus.osal.now();
    submit_upload(0x2000, 250ms);
    bus.run(request);
    EXPECT_EQ(request.state(), RequestState::success) << bus.words(request.error());
    EXPECT_LT(bus.osal.now() - begin, 20ms);
}

TEST_F(ChannelTest, CanceledRequestLeavesTheChannelClean) {
    start();
    slave.on_mail = [&](const Mail& mail) {
        slave.reply(two_octets(std::to_integer<unsigned>(mail[9]), 0x20, 0x00, std::to_integer<unsigned>(mail[9]), 0));
    };
    // The request is cancelled at every moment of the exchange. Then another object is read, and the same object.
    for (int polls = 0; polls < 12; ++polls) {
        submit_upload(0x2000);
        for (int n = 0; n < polls && request.busy(); ++n) bus.step();
        const bool was_busy = request.busy();
        request.cancel();
        if (was_busy) {
            EXPECT_EQ(request.error().code, Errc::canceled);
        }
        EXPECT_EQ(*SDOread<std::uint16_t>(*bus.ctx, 1, 0x2042, 0), 0x42) << polls;
        EXPECT_EQ(*SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0), 0) << polls;
    }
}

TEST_F(ChannelTest, ACanceledSegmentedTransferIsAbortedAtTheSlave) {
    start();
    slave.on_mail = [&](const Mail& mail) {
        if (mail[8] == std::byte{0x40} && mail[9] == std::byte{0})
            slave.reply({0x00, 0x30, 0x41, 0x00, 0x20, 0x00, 100, 0, 0, 0, 1, 2, 3, 4});
        else if (mail[8] == std::byte{0x40})
            slave.reply(two_octets(0x42, 0x20, 0x00, 0x42, 0));
        else if (mail[8] == std::byte{0x60})
            slave.reply({0x00, 0x30, 0x00, 1, 2, 3, 4, 5, 6, 7});
    };
    std::array<std::byte, 128> into{};
    request.slave = 1;
    request.index = 0x2000;
    request.data = into;
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    while (slave.received.size() < 3) bus.step();  // the second segment is requested and gets no reply
    request.cancel();
    EXPECT_EQ(*SDOread<std::uint16_t>(*bus.ctx, 1, 0x2042, 0), 0x42);
    ASSERT_EQ(slave.received.size(), 5U);
    // Abort of 0x2000:0, "SDO protocol timed out".
    EXPECT_EQ(Mail(slave.received[3].begin() + 6, slave.received[3].end()),
              mail_bytes({0x00, 0x20, 0x80, 0x00, 0x20, 0x00, 0x00, 0x00, 0x04, 0x05}));
}

TEST_F(ChannelTest, AFullMailboxIsWaitedForAndNamed) {
    start();
    slave.takes = false;
    submit_upload(0x2000, 100ms);
    bus.run(request);  // the message is in the mailbox, and the slave does not read the message
    EXPECT_EQ(request.error().code, Errc::timeout);
    submit_upload(0x2001, 150ms);
    bus.run(request);
    EXPECT_EQ(request.error().code, Errc::mailbox_full) << bus.words(request.error());
    slave.takes = true;
    slave.on_mail = [&](const Mail& mail) {
        slave.reply(two_octets(std::to_integer<unsigned>(mail[9]), 0x20, 0x00, 7, 0));
    };
    bus.idle(10ms);
    submit_upload(0x2002, 100ms);
    bus.run(request);
    EXPECT_EQ(request.state(), RequestState::success) << bus.words(request.error());
}

TEST_F(ChannelTest, LengthsBeyondTheMailboxAndOfNothingEndTheRequest) {
    start();
    for (const unsigned length : {59U, 200U, 0xFFFFU, 0U}) {
        slave.on_mail = [&, length](const Mail&) {
            slave.put(mail_bytes(
                {length & 0xFF, length >> 8, 0, 0, 0, 0x03, 0x00, 0x30, 0x4B, 0x00, 0x20, 0x00, 1, 0, 0, 0}));
        };
        const auto value = SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0, 1s);
        EXPECT_EQ(value.error().code, Errc::protocol) << length;
        EXPECT_EQ(value.error().actual, length);
    }
    EXPECT_EQ(statistics().malformed, 4U);
}

TEST_F(ChannelTest, ALostReplyIsAskedForByTheToggleAndNothingIsWrittenTwice) {
    start();
    slave.on_mail = [&](const Mail&) { slave.reply(two_octets(0x00, 0x20, 0x00, 0x34, 0x12)); };
    EXPECT_TRUE(SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0).ok());
    // A request needs three frames here: the message, a look at the mailbox, and the reply. The last frame contains the
    // reply.
    const auto sent = bus.nic->sent;
    EXPECT_TRUE(SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0).ok());
    bus.nic->lose_in.insert(bus.nic->sent + (bus.nic->sent - sent) - 1);
    const auto value = SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0);
    ASSERT_TRUE(value.ok()) << bus.words(value.error());
    EXPECT_EQ(*value, 0x1234);
    EXPECT_EQ(slave.repeat_requests, 1U);
    EXPECT_EQ(slave.received.size(), 3U);
    EXPECT_EQ(statistics().repeats, 1U);
    EXPECT_EQ(statistics().resent, 0U);
}

// A slave without message counters. Each frame of an exchange is lost in turn. The replies cannot be distinguished, but
// no reply is lost or accepted twice.
TEST_F(ChannelTest, ASlaveThatDoesNotCountLosesNothingEither) {
    start();
    slave.counts = false;
    unsigned answers = 0;
    slave.on_mail = [&](const Mail& mail) {
        slave.reply(two_octets(std::to_integer<unsigned>(mail[9]), 0x20, 0x00, std::to_integer<unsigned>(mail[9]), 0));
        ++answers;
    };
    EXPECT_TRUE(SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0).ok());
    for (unsigned at = 0; at < 3; ++at) {
        for (auto* lost : {&bus.nic->lose_in, &bus.nic->lose_out}) {
            lost->insert(bus.nic->sent + at);
            for (const unsigned index : {0x11U, 0x22U, 0x33U}) {
                const auto value = SDOread<std::uint16_t>(*bus.ctx, 1, static_cast<std::uint16_t>(0x2000 + index), 0);
                ASSERT_TRUE(value.ok()) << at << ": " << bus.words(value.error());
                EXPECT_EQ(*value, index);
            }
        }
    }
    EXPECT_GE(slave.repeat_requests, 1U);
}

TEST_F(ChannelTest, AFloodOfOtherMailEndsInATimeoutAndBoundedMemory) {
    start();
    slave.on_mail = [&](const Mail&) {
        for (unsigned n = 0; n < 5000; ++n) slave.reply({0x00, 0x10, 0x10, 0x23, 0x01, 0, 0, 0, 0, 0});
    };
    const Time begin = bus.osal.now();
    submit_upload(0x2000, 200ms);
    bus.run(request);
    EXPECT_EQ(request.error().code, Errc::timeout);
    EXPECT_LE(bus.osal.now() - begin, 205ms);
    auto& ring = emergencies(*bus.ctx, 1);
    EXPECT_GT(ring.count(), 100U);
    EXPECT_EQ(ring.dropped(), ring.count() - Limits{}.emergencies);
}

// A slave acknowledges the repeat request and leaves its mailbox empty; another slave does not support repeat requests.
// In both cases the library sends the request again in a new message.
TEST_F(ChannelTest, AReplyThatIsLostForGoodIsAskedForAgain) {
    start();
    slave.on_mail = [&](const Mail& mail) {
        const Bytes sdo = Bytes(mail).subspan(wire::kMailboxHeaderBytes);
        const auto octet = [&](std::size_t n) { return std::to_integer<unsigned>(sdo[n]); };
        const unsigned counter = std::to_integer<unsigned>(mail[5]) >> 4;
        slave.reply({0, 0x30, 0x4B, octet(3), octet(4), octet(5), counter, 0x12, 0, 0});
    };
    bus.nic->keeps_mail = true;
    for (const bool acknowledges : {true, false}) {
        slave.forgets = acknowledges;
        slave.repeats = acknowledges;
        EXPECT_TRUE(SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0).ok());
        const auto before = slave.received.size();
        const Time begin = bus.osal.now();
        bus.nic->mail.clear();
        bus.nic->lose_mail_from = 1;
        submit_upload(0x2000, 500ms);
        while (bus.nic->mail.size() < 2) bus.step();  // the request, and its reply in a frame that is lost
        bus.nic->lose_mail_from = 0;
        bus.run(request);
        ASSERT_EQ(request.error().code, Errc::none) << bus.words(request.error());
        // The slave has received the request; a question, whose answer shows that no reply is late; and the request
        // again.
        ASSERT_EQ(slave.received.size(), before + 3);
        EXPECT_EQ(request.data[0], slave.received.back()[5] >> 4) << "of the last message";
        EXPECT_NE(slave.received[before][5], slave.received.back()[5]) << "its counter is new";
        EXPECT_LT(bus.osal.now() - begin, 300ms);
        EXPECT_TRUE(SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0).ok());
    }
    EXPECT_EQ(slave.repeat_requests, 1U);
}

// Every reply is lost. The request ends with an error in bounded time.
TEST_F(ChannelTest, AReplyThatIsLostAgainAndAgainEndsTheRequest) {
    start();
    slave.forgets = true;
    slave.on_mail = [&](const Mail&) { slave.reply(two_octets(0x00, 0x20, 0x00, 0x34, 0x12)); };
    EXPECT_TRUE(SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0).ok());
    bus.nic->lose_mail_from = 1;
    const Time begin = bus.osal.now();
    const auto value = SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0, 2s);
    EXPECT_EQ(value.error().code, Errc::reply_lost) << bus.words(value.error());
    EXPECT_EQ(
        bus.words(value.error()),
        "slave 1: SDO upload of 0x2000:0: the reply was lost on the wire, and the slave does not have it any more");
    EXPECT_LT(bus.osal.now() - begin, 1s);
    bus.nic->lose_mail_from = 0;
    EXPECT_TRUE(SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0).ok());
}

TEST_F(ChannelTest, PrioritiesGoFirstAndStarveNobody) {
    start();
    std::vector<unsigned> order;
    slave.on_mail = [&](const Mail& mail) {
        order.push_back(std::to_integer<unsigned>(mail[9]));
        slave.reply(two_octets(order.back(), 0x20, 0x00, 0, 0));
    };
    std::array<SdoUpload, 24> requests;
    std::array<std::byte, 4> into{};
    for (unsigned n = 0; n < requests.size(); ++n) {
        requests[n].slave = 1;
        requests[n].index = static_cast<std::uint16_t>(0x2000 + n);
        requests[n].data = into;
        // The first two requests have low priority. The other requests have high and less high priority alternately.
        requests[n].priority = n < 2 ? 0 : n % 2 == 0 ? 3 : 2;
        ASSERT_TRUE(submit(*bus.ctx, requests[n]).ok());
    }
    for (const auto& r : requests) bus.run(r);
    ASSERT_EQ(order.size(), requests.size());
    const auto place = [&](unsigned n) { return std::find(order.begin(), order.end(), n) - order.begin(); };
    EXPECT_LT(place(2), place(3));
    EXPECT_LT(place(4), place(3));
    EXPECT_LT(place(2), place(0));
    // The requests with low priority were overtaken eight times before they began and eight times at the channel, not
    // more often.
    EXPECT_GE(place(0), 8);
    EXPECT_LE(place(1), 18);
    EXPECT_LT(place(4), place(6));  // requests of equal priority keep their order
}

TEST_F(ChannelTest, MailboxesThatAreTooSmallOrNotThereAreTold) {
    bus.add_scripted(64, mailbox_protocol::kEoE);
    start();
    const auto eoe_only = SDOread<std::uint16_t>(*bus.ctx, 2, 0x2000, 0);
    EXPECT_EQ(eoe_only.error().code, Errc::unsupported);
    EXPECT_EQ(bus.words(eoe_only.error()), "slave 2: SDO upload of 0x2000:0: not supported by the slave");
}

// A channel that has looked in vain leaves the looking to the watch over all slaves. The watch ends with the last of
// these channels. Then the arena is empty, and no frame is on the wire.
TEST(ChannelWatch, EndsWhenNobodyWaitsAnyMore) {
    MailboxBus bus;
    for (int n = 0; n < 4; ++n) bus.add_scripted(64).on_mail = [](const Mail&) {};
    bus.start();
    const Arena& arena = master_of(*bus.ctx)->network.arena();
    bus.idle(1s);
    const std::size_t before = arena.used_bytes();
    std::array<std::uint32_t, 4> values{};
    std::array<SdoUpload, 4> requests;
    for (std::uint16_t n = 0; n < 4; ++n) {
        requests[n].slave = static_cast<std::uint16_t>(n + 1);
        requests[n].index = 0x2000;
        requests[n].data = std::as_writable_bytes(std::span(&values[n], 1));
        requests[n].timeout = 50ms;
        ASSERT_TRUE(submit(*bus.ctx, requests[n]).ok());
    }
    for (SdoUpload& request : requests) bus.run(request);
    bus.idle(1s);
    EXPECT_EQ(arena.used_bytes(), before);
    const auto sent = bus.nic->sent;
    bus.idle(1s);
    EXPECT_EQ(bus.nic->sent, sent);
}

TEST(ChannelRouting, MailFromSlaveToSlaveIsHandedOn) {
    MailboxBus bus;
    auto& one = bus.add_scripted(64);
    auto& two = bus.add_scripted(64);
    bus.start();
    const auto address = [&](std::uint16_t n) { return bus.ctx->slave(n).station_address.value; };
    one.on_mail = [&](const Mail&) {
        one.reply(mail_bytes({9, 8, 7, 6, 5, 4, 3}), MailboxType::voe, address(2));  // for slave 2
        one.reply(mail_bytes({1, 1, 1, 1}), MailboxType::voe, 0x4444);               // for no slave
        one.reply(two_octets(0x00, 0x20, 0x00, 5, 0), MailboxType::coe,
                  address(1));  // the address of the slave in place of the master's address
    };
    EXPECT_EQ(*SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0), 5);
    bus.idle(5ms);
    ASSERT_EQ(two.received.size(), 1U);
    const auto header = wire::load_mailbox_header(two.received[0]);
    EXPECT_EQ(header.address, address(1));  // address of the sender
    EXPECT_EQ(header.type, MailboxType::voe);
    EXPECT_EQ(header.counter, 1);
    EXPECT_EQ(Mail(two.received[0].begin() + 6, two.received[0].end()), mail_bytes({9, 8, 7, 6, 5, 4, 3}));
    EXPECT_EQ(mailbox_statistics(*bus.ctx, 1)->routed, 1U);
    EXPECT_EQ(mailbox_statistics(*bus.ctx, 1)->unexpected, 1U);
}

TEST(ChannelRouting, BothWaysAtOnceDoNotBlockEachOther) {
    MailboxBus bus;
    auto& one = bus.add_scripted(64);
    auto& two = bus.add_scripted(64);
    bus.start();
    const auto address = [&](std::uint16_t n) { return bus.ctx->slave(n).station_address.value; };
    one.on_mail = [&](const Mail&) {};
    two.on_mail = [&](const Mail&) {};
    for (unsigned n = 0; n < 5; ++n) {
        one.reply(mail_bytes({n, 1}), MailboxType::voe, address(2));
        two.reply(mail_bytes({n, 2}), MailboxType::voe, address(1));
    }
    (void)watch_mailboxes(*bus.ctx, 1ms);
    bus.idle(100ms);
    ASSERT_EQ(one.received.size(), 5U);
    ASSERT_EQ(two.received.size(), 5U);
    for (unsigned n = 0; n < 5; ++n) {
        EXPECT_EQ(one.received[n][6], std::byte(n));
        EXPECT_EQ(two.received[n][6], std::byte(n));
    }
}

TEST(ChannelRouting, MailForAMailboxThatIsFullIsDroppedInBoundedTime) {
    MailboxBus bus;
    auto& one = bus.add_scripted(64);
    auto& two = bus.add_scripted(64);
    bus.start();
    two.takes = false;
    for (unsigned n = 0; n < 20; ++n)
        one.reply(mail_bytes({n, 1}), MailboxType::voe, bus.ctx->slave(2).station_address.value);
    one.on_mail = [&](const Mail&) { one.reply(two_octets(0x00, 0x20, 0x00, 5, 0)); };
    EXPECT_EQ(*SDOread<std::uint16_t>(*bus.ctx, 1, 0x2000, 0), 5);
    bus.idle(3s);
    EXPECT_EQ(mailbox_statistics(*bus.ctx, 1)->undeliverable, 19U);  // one message is in the mailbox
}

}  // namespace
}  // namespace margay
