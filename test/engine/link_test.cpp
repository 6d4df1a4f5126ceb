// The link. The replies of the far end are right, wrong, late, duplicated or missing.
#include "engine/scripted_nic.hpp"
#include "link/engine.hpp"
#include "util/task.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <random>

namespace margay {
namespace {

using namespace std::chrono_literals;
using wire::Command;
using wire::DatagramAddress;

class LinkTest : public testing::Test {
  protected:
    Time now{1s};
    ScriptedNic nic;
    std::vector<FrameSlot> slots = std::vector<FrameSlot>(8);
    std::vector<std::byte> memory = std::vector<std::byte>(64 * 1024);
    Engine engine{nic, slots, memory};

    const LinkStatistics& counted() { return engine.link().statistics(); }
    Time poll(Duration later = 100us) { return engine.poll(now += later); }

    struct Asked {
        bool done = false;
        Reply reply;
        std::array<std::byte, 4> data{};
    };
    static DatagramAddress station(std::uint16_t address, std::uint16_t ado) { return {StationAddress{address}, ado}; }
    // One FPRD of four octets.
    static Task<Result<>> ask(Engine& engine, Asked& asked, DatagramAddress address, Repeat repeat = Repeat::yes,
                              Command command = Command::FPRD) {
        Datagram datagram(engine.link(), command, address, MutableBytes(asked.data), repeat);
        asked.reply = co_await datagram;
        asked.done = true;
        co_return Result<>();
    }
    // One FPWR with `data`.
    static Task<Result<>> exchange(Engine& engine, Asked& asked, std::span<const std::byte> data) {
        Datagram datagram(engine.link(), Command::FPWR, station(0x1001, 0x1000), Bytes(data), Repeat::no);
        asked.reply = co_await datagram;
        asked.done = true;
        co_return Result<>();
    }
};

TEST_F(LinkTest, AnsweredDatagramBringsDataAndWorkingCounter) {
    Asked asked;
    OwnedTask task = ask(engine, asked, station(0x1001, 0x0130));
    task.start();
    poll();
    ASSERT_EQ(nic.sent.size(), 1U);
    EXPECT_FALSE(asked.done);
    auto reply = reply_to(nic.sent[0]);
    reply[26] = std::byte{0x42};
    nic.incoming.push_back(reply);
    poll();
    ASSERT_TRUE(asked.done);
    EXPECT_TRUE(asked.reply.ok());
    EXPECT_EQ(asked.reply.wkc, 1);
    EXPECT_EQ(asked.data[0], std::byte{0x42});
    EXPECT_EQ(counted().frames_received, 1U);
}

TEST_F(LinkTest, AsManyDatagramsInAFrameAsFit) {
    // 1498 octets of datagrams: 93 datagrams of 12 + 4 octets.
    std::vector<Asked> asked(100);
    std::vector<OwnedTask<Result<>>> tasks;
    for (std::uint16_t i = 0; i < 100; ++i) {
        tasks.push_back(ask(engine, asked[i], station(i, 0x0130)));
        tasks.back().start();
    }
    poll();
    ASSERT_EQ(nic.sent.size(), 2U);
    EXPECT_EQ(nic.sent[0].size(), wire::kFramePrefixBytes + 93 * 16);
    EXPECT_EQ(nic.sent[1].size(), wire::kFramePrefixBytes + 7 * 16);
    EXPECT_EQ(counted().bursts, 1U);
    // The second frame can return first.
    nic.incoming.push_back(reply_to(nic.sent[1], 7));
    nic.incoming.push_back(reply_to(nic.sent[0], 9));
    poll();
    for (std::size_t i = 0; i < 100; ++i) {
        ASSERT_TRUE(asked[i].done);
        EXPECT_EQ(asked[i].reply.wkc, i < 93 ? 9 : 7);
    }
}

TEST_F(LinkTest, LostFrameIsRepeatedAndThenGivenUp) {
    Asked asked;
    OwnedTask task = ask(engine, asked, station(0x1001, 0x0130));
    task.start();
    const int sendings = engine.link().settings.sendings;
    for (int i = 0; i < sendings; ++i) {
        const Time next = poll();
        EXPECT_EQ(nic.sent.size(), static_cast<std::size_t>(i) + 1);
        EXPECT_FALSE(asked.done);
        now = next;
    }
    poll();
    ASSERT_TRUE(asked.done);
    EXPECT_EQ(asked.reply.errc, Errc::no_frame);
    EXPECT_EQ(counted().lost, static_cast<std::uint64_t>(sendings));
    EXPECT_EQ(counted().retried, static_cast<std::uint64_t>(sendings) - 1);
}

TEST_F(LinkTest, WhatMustNotBeRepeatedIsNot) {
    Asked asked;
    OwnedTask task = ask(engine, asked, station(0x1001, 0x1000), Repeat::no);
    task.start();
    now = poll();
    poll();
    EXPECT_TRUE(asked.done);
    EXPECT_EQ(nic.sent.size(), 1U);
}

TEST_F(LinkTest, LateReplyIsNotTakenForTheRepeatedOne) {
    Asked asked;
    OwnedTask task = ask(engine, asked, station(0x1001, 0x0130));
    task.start();
    now = poll();
    poll();
    ASSERT_EQ(nic.sent.size(), 2U);
    EXPECT_NE(nic.sent[0][17], nic.sent[1][17]) << "a lost frame's index must not be used at once again";
    nic.incoming.push_back(reply_to(nic.sent[0], 5));
    poll();
    EXPECT_FALSE(asked.done);
    EXPECT_EQ(counted().unexpected, 1U);
    nic.incoming.push_back(reply_to(nic.sent[1], 1));
    nic.incoming.push_back(reply_to(nic.sent[1], 3));
    poll();
    EXPECT_TRUE(asked.done);
    EXPECT_EQ(asked.reply.wkc, 1);
    EXPECT_EQ(counted().unexpected, 2U) << "the duplicate";
}

TEST_F(LinkTest, LostIndexRestsEvenWhenAllOthersHaveBeenUsed) {
    Asked lost;
    OwnedTask task = ask(engine, lost, station(0x1001, 0x0130), Repeat::no);
    task.start();
    now = poll();
    poll(0us);
    const auto rests = nic.sent[0][17];
    for (int i = 0; i < 255; ++i) {
        Asked asked;
        OwnedTask next = ask(engine, asked, station(0x1002, 0x0130));
        next.start();
        poll(10us);
        EXPECT_NE(nic.sent.back()[17], rests) << i;
        nic.incoming.push_back(reply_to(nic.sent.back()));
        poll(10us);
        ASSERT_TRUE(asked.done);
    }
}

// A frame with each kind of error: the link counts and drops this frame, and still accepts the right frame.
TEST_F(LinkTest, WrongFramesAreCountedAndDropped) {
    Asked asked;
    OwnedTask task = ask(engine, asked, station(0x1001, 0x0130));
    task.start();
    poll();
    const Octets good = reply_to(nic.sent[0]);
    const auto with = [&](std::size_t at, int value) {
        Octets frame = good;
        frame[at] = static_cast<std::byte>(value);
        return frame;
    };
    nic.incoming = {nic.sent[0]};
    poll();
    EXPECT_EQ(counted().echoes, 1U);
    nic.incoming = {with(13, 0x00), with(15, 0x20)};  // EtherType, frame type
    poll();
    EXPECT_EQ(counted().foreign, 2U);
    nic.incoming = {Octets(good.begin(), good.begin() + 25), Octets(3), with(14, 0x08), with(23, 0x80)};
    poll();
    EXPECT_EQ(counted().malformed, 4U);
    nic.incoming = {with(17, 0x77)};  // an unused index
    poll();
    EXPECT_EQ(counted().unexpected, 1U);
    nic.incoming = {with(16, 0x05), with(18, 0x02), with(20, 0x20)};  // command, station, register
    poll();
    EXPECT_EQ(counted().mismatched, 3U);
    Octets shorter = good;  // four octets requested, two returned
    shorter[14] = std::byte{0x0e};
    shorter[22] = std::byte{2};
    shorter.resize(shorter.size() - 2);
    nic.incoming = {shorter};
    poll();
    EXPECT_EQ(counted().mismatched, 4U);
    EXPECT_FALSE(asked.done);
    nic.incoming = {good};
    poll();
    EXPECT_TRUE(asked.done);
    EXPECT_EQ(counted().frames_received, 1U);
}

TEST_F(LinkTest, PositionCountedUpBySlavesIsTheSameDatagram) {
    Asked asked;
    OwnedTask task =
        ask(engine, asked, DatagramAddress(std::uint16_t{0}, std::uint16_t{0x0000}), Repeat::yes, Command::BRD);
    task.start();
    poll();
    Octets reply = reply_to(nic.sent[0], 3);
    reply[18] = std::byte{3};
    nic.incoming.push_back(reply);
    poll();
    EXPECT_TRUE(asked.done);
}

TEST_F(LinkTest, NoiseOfEveryLengthChangesNothing) {
    Asked asked;
    OwnedTask task = ask(engine, asked, station(0x1001, 0x0130));
    task.start();
    poll();
    std::mt19937 random(1);
    for (std::size_t length = 1; length <= 1600; ++length) {
        Octets noise(length);
        for (auto& octet : noise) octet = static_cast<std::byte>(random());
        if (length > 16 && length % 2 == 0) {  // half of them begin like an EtherCAT frame
            noise[12] = std::byte{0x88};
            noise[13] = std::byte{0xa4};
            noise[15] = (noise[15] & std::byte{0x07}) | std::byte{0x10};
            noise[6] |= wire::kPassedEscBit;
            noise[17] = nic.sent[0][17];
        }
        nic.incoming.push_back(noise);
        poll(1us);
    }
    EXPECT_FALSE(asked.done);
    EXPECT_EQ(counted().foreign + counted().malformed + counted().mismatched + counted().unexpected + counted().echoes +
                  counted().unmarked,
              1600U);
}

TEST_F(LinkTest, BusyNicIsOfferedTheSameDatagramsAgain) {
    Asked first;
    Asked second;
    OwnedTask one = ask(engine, first, station(1, 0x0130));
    OwnedTask two = ask(engine, second, station(2, 0x0130));
    one.start();
    two.start();
    nic.answer = SendStatus::busy;
    const Time next = poll();
    EXPECT_LE(next, now + 1ms) << "poll must want to be called again soon";
    nic.answer = SendStatus::sent;
    now = next;
    poll(0us);
    ASSERT_EQ(nic.sent.size(), 1U);
    EXPECT_EQ(nic.sent[0][18], std::byte{1}) << "in the order in which they were submitted";
    nic.incoming.push_back(reply_to(nic.sent[0]));
    poll();
    EXPECT_TRUE(first.done && second.done);
    EXPECT_EQ(counted().datagrams_sent, 2U);
}

TEST_F(LinkTest, RefusingNicEndsInAnErrorOfItsOwn) {
    Asked asked;
    OwnedTask task = ask(engine, asked, station(1, 0x0130));
    task.start();
    nic.answer = SendStatus::failed;
    for (int i = 0; i < 10 && !asked.done; ++i) now = std::max(now, poll(0us));
    ASSERT_TRUE(asked.done);
    EXPECT_EQ(asked.reply.errc, Errc::nic);
}

TEST_F(LinkTest, DatagramDestroyedInFlightIsForgotten) {
    auto asked = std::make_unique<Asked>();
    Asked other;
    OwnedTask task = ask(engine, *asked, station(1, 0x0130));
    OwnedTask stays = ask(engine, other, station(2, 0x0130));
    task.start();
    stays.start();
    poll();
    task.reset();
    asked.reset();
    nic.incoming.push_back(reply_to(nic.sent[0]));
    poll();
    EXPECT_TRUE(other.done);
    stays.reset();
    EXPECT_EQ(engine.arena().used_bytes(), 0U);
}

TEST_F(LinkTest, MoreFramesThanSlotsWaitTheirTurn) {
    std::vector<Asked> asked(93 * 10);
    std::vector<std::byte> more(1024 * 1024);
    Engine large(nic, slots, more);
    std::vector<OwnedTask<Result<>>> tasks;
    for (auto& a : asked) {
        tasks.push_back(ask(large, a, station(1, 0x0130)));
        tasks.back().start();
    }
    large.poll(now);
    EXPECT_EQ(nic.sent.size(), slots.size());
    for (const auto& frame : nic.sent) nic.incoming.push_back(reply_to(frame));
    nic.sent.clear();
    large.poll(now + 1us);
    EXPECT_EQ(nic.sent.size(), 2U);
    for (const auto& frame : nic.sent) nic.incoming.push_back(reply_to(frame));
    large.poll(now + 2us);
    for (const auto& a : asked) EXPECT_TRUE(a.done);
}

// A wrong SII can contain a mailbox size that no frame can carry. The largest datagram has 1486 octets of data.
TEST_F(LinkTest, DatagramThatNoFrameHoldsIsRefusedAndNothingBehindItIsStuck) {
    for (const std::size_t bytes : {wire::kMaxDatagramData + 1, std::size_t{1487}, std::size_t{2000}}) {
        nic.sent.clear();
        Asked large;
        Asked behind;
        std::vector<std::byte> data(bytes);
        OwnedTask one = exchange(engine, large, data);
        OwnedTask two = ask(engine, behind, station(2, 0x0130));
        one.start();
        two.start();
        poll();
        EXPECT_TRUE(large.done);
        EXPECT_EQ(large.reply.errc, Errc::datagram_size);
        ASSERT_EQ(nic.sent.size(), 1U);
        nic.incoming.push_back(reply_to(nic.sent[0]));
        poll();
        EXPECT_TRUE(behind.done && behind.reply.ok());
    }
}

TEST_F(LinkTest, LargestDatagramIsSent) {
    Asked asked;
    std::vector<std::byte> data(wire::kMaxDatagramData);
    OwnedTask task = exchange(engine, asked, data);
    task.start();
    poll();
    ASSERT_EQ(nic.sent.size(), 1U);
    nic.incoming.push_back(reply_to(nic.sent[0]));
    poll();
    EXPECT_TRUE(asked.done && asked.reply.ok());
}

TEST_F(LinkTest, NicThatStaysBusyForEverEndsInAnErrorThatSaysSo) {
    Asked first;
    Asked second;
    OwnedTask one = ask(engine, first, station(1, 0x0130));
    OwnedTask two = ask(engine, second, station(2, 0x0130), Repeat::no);
    one.start();
    two.start();
    nic.answer = SendStatus::busy;
    engine.link().settings.queue_timeout = 300ms;
    const Time start = now;
    while (!first.done && now - start < 60s) {
        const Time next = poll(0us);
        if (!first.done) now = std::max(now + 1us, next);
    }
    ASSERT_TRUE(first.done && second.done);
    EXPECT_EQ(first.reply.errc, Errc::nic_busy);
    EXPECT_EQ(second.reply.errc, Errc::nic_busy);
    EXPECT_GE(now - start, 300ms);
    EXPECT_LE(now - start, 301ms);
    // Later datagrams have their own timeout.
    Asked third;
    OwnedTask three = ask(engine, third, station(3, 0x0130));
    three.start();
    poll();
    EXPECT_FALSE(third.done);
    nic.answer = SendStatus::sent;
    poll();
    ASSERT_EQ(nic.sent.size(), 1U);
    nic.incoming.push_back(reply_to(nic.sent[0]));
    poll();
    EXPECT_TRUE(third.done && third.reply.ok());
}

TEST_F(LinkTest, NicThatIsBusyForSomeTimeCostsNothingButTime) {
    Asked asked;
    OwnedTask task = ask(engine, asked, station(1, 0x0130));
    task.start();
    nic.answer = SendStatus::busy;
    const Time start = now;
    while (now - start < engine.link().settings.queue_timeout - 1ms) now = std::max(now + 1us, poll(0us));
    nic.answer = SendStatus::sent;
    poll(50us);
    ASSERT_EQ(nic.sent.size(), 1U);
    nic.incoming.push_back(reply_to(nic.sent[0]));
    poll();
    EXPECT_TRUE(asked.done && asked.reply.ok());
}

// A NIC that accepts a frame now and then is slow, not stuck: no datagram in a long queue times out.
TEST_F(LinkTest, NicThatTakesAFrameNowAndThenIsWaitedFor) {
    std::vector<std::byte> more(1024 * 1024);
    Engine large(nic, slots, more);
    large.link().settings.queue_timeout = 10ms;
    std::vector<Asked> asked(93 * 6);
    std::vector<OwnedTask<Result<>>> tasks;
    for (auto& a : asked) {
        tasks.push_back(ask(large, a, station(1, 0x0130)));
        tasks.back().start();
    }
    nic.most_frames_at_once = 1;
    for (int round = 0; round < 6; ++round) {
        nic.taken = 0;
        for (int n = 0; n < 9; ++n) large.poll(now += 1ms);
        ASSERT_EQ(nic.sent.size(), static_cast<std::size_t>(round) + 1);
        nic.incoming.push_back(reply_to(nic.sent.back()));
    }
    large.poll(now += 1ms);
    for (const Asked& a : asked) EXPECT_TRUE(a.done && a.reply.ok());
}

// The datagram that waited for the NIC was destroyed. A later datagram has its whole timeout.
TEST_F(LinkTest, NewQueueDoesNotInheritTheWaitOfAnOldOne) {
    auto old = std::make_unique<Asked>();
    OwnedTask forgotten = ask(engine, *old, station(1, 0x0130));
    forgotten.start();
    nic.answer = SendStatus::busy;
    poll();
    forgotten.reset();
    now += 100s;
    Asked asked;
    OwnedTask task = ask(engine, asked, station(2, 0x0130));
    task.start();
    poll();
    EXPECT_FALSE(asked.done);
}

// Some slaves increment the working counter without setting the mark in the source address. When the NIC hides the
// master's own frames, such replies are accepted.
TEST_F(LinkTest, UnmarkedReplyIsTakenWhereTheNicHidesOwnFrames) {
    nic.hides_own = true;
    for (const std::uint16_t wkc : {std::uint16_t{1}, std::uint16_t{0}}) {
        Asked asked;
        OwnedTask task = ask(engine, asked, station(1, 0x0130));
        task.start();
        poll();
        Octets reply = reply_to(nic.sent.back(), wkc);
        reply[wire::kSourceMacOffset] &= ~wire::kPassedEscBit;
        nic.incoming.push_back(reply);
        poll();
        ASSERT_TRUE(asked.done);
        EXPECT_TRUE(asked.reply.ok());
        EXPECT_EQ(asked.reply.wkc, wkc);
    }
    EXPECT_EQ(counted().echoes + counted().unmarked, 0U);
}

// Another master on the same cable sends the same datagrams, with another source address.
TEST_F(LinkTest, FrameOfAnotherMasterIsNoUnmarkedReply) {
    nic.hides_own = true;
    Asked asked;
    OwnedTask task = ask(engine, asked, station(1, 0x0130));
    task.start();
    poll();
    Octets other = nic.sent.back();
    other[wire::kSourceMacOffset + 5] ^= std::byte{0x01};
    nic.incoming.push_back(other);
    poll();
    EXPECT_FALSE(asked.done);
    EXPECT_EQ(counted().echoes, 1U);
}

TEST_F(LinkTest, WhereOnlyTheMarkTellsAnEchoTheErrorSaysThatFramesWereUnmarked) {
    for (const bool counted_up : {true, false}) {
        Asked asked;
        OwnedTask task = ask(engine, asked, station(1, 0x0130), Repeat::no);
        task.start();
        const Time next = poll();
        Octets back = reply_to(nic.sent.back(), counted_up ? 1 : 0);
        back[wire::kSourceMacOffset] &= ~wire::kPassedEscBit;
        nic.incoming.push_back(back);
        poll();
        EXPECT_FALSE(asked.done);
        now = next;
        poll();
        ASSERT_TRUE(asked.done);
        EXPECT_EQ(asked.reply.errc, Errc::no_frame);
        EXPECT_EQ(asked.reply.detail(), counted_up ? Error::kUnmarked : 0U) << "an echo has not been counted up";
    }
    EXPECT_EQ(counted().unmarked, 1U);
    EXPECT_EQ(counted().echoes, 1U);
    std::array<char, 400> text{};
    EXPECT_NE(describe({.code = Errc::no_frame, .step = Step::count_slaves, .detail = Error::kUnmarked}, text)
                  .find("frames came back unmarked"),
              std::string_view::npos);
}

TEST_F(LinkTest, TwoEnginesShareNothing) {
    ScriptedNic other_nic;
    std::vector<FrameSlot> other_slots(2);
    std::vector<std::byte> other_memory(4096);
    Engine other(other_nic, other_slots, other_memory);
    Asked here;
    Asked there;
    OwnedTask a = ask(engine, here, station(1, 0x0130));
    OwnedTask b = ask(other, there, station(1, 0x0130));
    a.start();
    b.start();
    poll();
    other.poll(now);
    nic.incoming.push_back(reply_to(nic.sent[0]));
    poll();
    other.poll(now);
    EXPECT_TRUE(here.done);
    EXPECT_FALSE(there.done);
    EXPECT_EQ(other.link().statistics().frames_received, 0U);
}

}  // namespace
}  // namespace margay
