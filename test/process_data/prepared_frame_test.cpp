// The frames of the cycle at the link. The replies are right, late, duplicated, wrong or missing.
#include "process_data/prepared_group.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

// Parameter true: poll() receives the frames before the cycle receives.
class PreparedFrameTest : public testing::TestWithParam<bool>, protected PreparedGroup {
  protected:
    PreparedFrameTest() : PreparedGroup({io_slave(1, 16, 16)}) {}
    void SetUp() override { prepare_frames(); }
    Result<> send(Duration later = 1ms) { return send_cycle(group, engine.link(), now += later); }
    Result<std::uint32_t> end() {
        if (GetParam()) drain();
        const CycleEnd came = engine.receive_cycle(group.prepared, now);
        const auto ended = end_cycle(group, engine.link(), came, now);
        drain();
        return ended;
    }
    void drain() {
        while (engine.receive_one(now)) {
        }
    }
    // The reply to the last sent frame: two octets of inputs, and a working counter.
    Octets reply(std::uint16_t wkc, std::uint8_t value) {
        Octets r = reply_to(nic.sent.back(), wkc);
        r[kDataAt + 2] = r[kDataAt + 3] = std::byte{value};
        return r;
    }
    struct Asked {
        bool done = false;
        Reply reply;
        std::array<std::byte, 4> data{};
    };
    static Task<Result<>> ask(Engine& engine, Asked& asked, MutableBytes data) {
        Datagram datagram(engine.link(), wire::Command::FPRD, wire::DatagramAddress(StationAddress{0x1001}, 0x0130),
                          data);
        asked.reply = co_await datagram;
        asked.done = true;
        co_return Result<>();
    }
};

INSTANTIATE_TEST_SUITE_P(Taken, PreparedFrameTest, testing::Bool(), [](const testing::TestParamInfo<bool>& taken) {
    return taken.param ? "ByPoll" : "ByTheCycle";
});

TEST_P(PreparedFrameTest, CarriesOutputsAndBringsInputs) {
    image[0] = std::byte{0x12};
    image[1] = std::byte{0x34};
    ASSERT_TRUE(send().ok());
    ASSERT_EQ(nic.sent.size(), 1U);
    EXPECT_EQ(nic.sent[0].size(), wire::kFramePrefixBytes + 12 + 4);
    EXPECT_EQ(nic.sent[0][kDataAt], std::byte{0x12});
    EXPECT_EQ(nic.sent[0][kDataAt + 1], std::byte{0x34});
    nic.incoming.push_back(reply(3, 0x77));
    const auto wkc = end();
    ASSERT_TRUE(wkc.ok());
    EXPECT_EQ(*wkc, 3U);
    EXPECT_EQ(image[0], std::byte{0x12}) << "outputs stay the application's";
    EXPECT_EQ(image[2], std::byte{0x77});
    EXPECT_EQ(counted().frames_received, 1U);
}

TEST_P(PreparedFrameTest, ShortDatagramIsNotTakenOver) {
    for (const std::uint16_t wkc : std::array<std::uint16_t, 4>{0, 1, 2, 4}) {
        ASSERT_TRUE(send().ok());
        nic.incoming.push_back(reply(wkc, 0x55));
        const auto ended = end();
        EXPECT_EQ(ended.error().code, Errc::working_counter);
        EXPECT_EQ(ended.error().expected, 3U);
        EXPECT_EQ(ended.error().actual, wkc);
        EXPECT_TRUE(group.datagrams[0].came);
        EXPECT_EQ(image[2], std::byte{0}) << wkc;
    }
}

TEST_P(PreparedFrameTest, ReplyOfAnOlderCycleIsNotTakenForThisOne) {
    ASSERT_TRUE(send().ok());
    const Octets late = reply(3, 0x11);
    EXPECT_EQ(end().error().code, Errc::no_frame);
    EXPECT_EQ(counted().lost, 1U);
    ASSERT_TRUE(send().ok());
    EXPECT_NE(nic.sent[0][kIndexAt], nic.sent[1][kIndexAt]);
    nic.incoming.push_back(late);
    EXPECT_EQ(end().error().code, Errc::no_frame);
    EXPECT_EQ(image[2], std::byte{0});
    ASSERT_TRUE(send().ok());
    const Octets twice = reply(3, 0x22);
    nic.incoming = {twice, twice};
    EXPECT_TRUE(end().ok());
    EXPECT_EQ(counted().unexpected, 2U) << "the late one and the second of two";
}

TEST_P(PreparedFrameTest, SendingAgainGivesUpWhatIsNotBack) {
    ASSERT_TRUE(send().ok());
    const Octets late = reply(3, 0x11);
    ASSERT_TRUE(send().ok());
    nic.incoming = {late, reply(3, 0x22)};
    ASSERT_TRUE(end().ok());
    EXPECT_EQ(image[2], std::byte{0x22});
    EXPECT_EQ(counted().lost, 1U);
}

// Every way in which a reply can be wrong.
TEST_P(PreparedFrameTest, WrongRepliesAreDropped) {
    struct Case {
        const char* name;
        std::size_t at;
        std::uint8_t flip;
    };
    const Case cases[] = {
        {"not passed any slave", wire::kSourceMacOffset, 0x02},
        {"other protocol", 12, 0x01},
        {"other frame length", 14, 0x01},
        {"other frame type", 15, 0x10},
        {"other command", 16, 0x01},
        {"other index", kIndexAt, 0x40},
        {"other address", 18, 0x01},
        {"other address, last octet", 21, 0x80},
        {"other length", 22, 0x01},
        {"another datagram behind", 23, 0x80},
    };
    for (const Case& c : cases) {
        ASSERT_TRUE(send().ok());
        Octets wrong = reply(3, 0x66);
        wrong[c.at] ^= std::byte{c.flip};
        nic.incoming.push_back(wrong);
        EXPECT_EQ(end().error().code, Errc::no_frame) << c.name;
        EXPECT_EQ(image[2], std::byte{0}) << c.name;
    }
    // The reply is truncated at each octet.
    for (std::size_t length = 1; length < nic.sent[0].size(); ++length) {
        ASSERT_TRUE(send().ok());
        Octets cut = reply(3, 0x66);
        cut.resize(length);
        nic.incoming.push_back(cut);
        EXPECT_EQ(end().error().code, Errc::no_frame) << length;
    }
    // Padding and the flag that a closed ring sets are not errors.
    ASSERT_TRUE(send().ok());
    Octets right = reply(3, 0x66);
    right.resize(60);
    right[23] ^= std::byte{0x40};
    nic.incoming.push_back(right);
    EXPECT_TRUE(end().ok());
    EXPECT_EQ(image[2], std::byte{0x66});
}

// In the additional readings, slaves may increment the position of a broadcast and change nothing else.
TEST_P(PreparedFrameTest, ReadingsAreComparedToo) {
    unprepare(group, engine.link(), now);
    group.config.al_status = true;
    group.layout = *lay_out(slaves, 0, group.config, image);
    group.image = image;
    group.slaves = slaves;
    group.marks = marks;
    const auto count = plan_datagrams(slaves, 0, group.config, group.layout, scratch);
    ASSERT_TRUE(prepare(tables, group, *count, engine.link()).ok());
    constexpr std::size_t kReading = wire::kFramePrefixBytes + 16;
    for (std::size_t at = 0; at < 8; ++at) {
        ASSERT_TRUE(send().ok());
        Octets odd = reply(3, 0x44);
        odd[kReading + at] ^= std::byte{0x20};
        odd[kReading + 10] = std::byte{0x12};
        nic.incoming.push_back(odd);
        const bool position = at == 2 || at == 3;
        EXPECT_EQ(end().error().code, position ? Errc::none : Errc::no_frame) << at;
        EXPECT_EQ(group.al_status.came, position) << at;
    }
    EXPECT_EQ(group.al_status.value, 0x12U);
    EXPECT_EQ(group.al_status.slaves, 3);
}

TEST_P(PreparedFrameTest, RefusedFrameIsAnErrorAndTheNextOneGoes) {
    nic.answer = SendStatus::busy;
    EXPECT_EQ(send().error().code, Errc::nic);
    EXPECT_EQ(end().error().code, Errc::no_frame);
    nic.answer = SendStatus::sent;
    ASSERT_TRUE(send().ok());
    nic.incoming.push_back(reply(3, 1));
    EXPECT_TRUE(end().ok());
}

TEST_P(PreparedFrameTest, RidersComeBackWithTheFrame) {
    Asked asked;
    OwnedTask task = ask(engine, asked, asked.data);
    task.start();
    ASSERT_TRUE(send().ok());
    ASSERT_EQ(nic.sent.size(), 1U);
    EXPECT_EQ(nic.sent[0].size(), wire::kFramePrefixBytes + 16 + 16);
    nic.incoming.push_back(reply(3, 0x31));
    EXPECT_TRUE(end().ok());
    EXPECT_FALSE(asked.done) << "whoever waits is resumed by poll(), not in the cycle";
    engine.poll(now);
    EXPECT_TRUE(asked.done);
    EXPECT_TRUE(asked.reply.ok());
    ASSERT_TRUE(send().ok());
    EXPECT_EQ(nic.sent[1].size(), wire::kFramePrefixBytes + 16) << "and the next frame is without it";
    nic.incoming.push_back(reply(3, 0x32));
    EXPECT_TRUE(end().ok());
}

TEST_P(PreparedFrameTest, RiderOfALostFrameTravelsAgain) {
    Asked asked;
    OwnedTask task = ask(engine, asked, asked.data);
    task.start();
    ASSERT_TRUE(send().ok());
    EXPECT_EQ(end().error().code, Errc::no_frame);
    for (int i = 0; i < 20 && !asked.done; ++i) {
        ASSERT_TRUE(send().ok());
        nic.incoming.push_back(reply(3, 1));
        EXPECT_TRUE(end().ok());
        engine.poll(now);
    }
    EXPECT_TRUE(asked.done && asked.reply.ok());
    EXPECT_EQ(counted().retried, 1U);
}

TEST_P(PreparedFrameTest, PollLeavesTheQueueToTheCycleWhileThereIsOne) {
    ASSERT_TRUE(send().ok());
    ASSERT_TRUE(send(1ms).ok());
    Asked asked;
    OwnedTask task = ask(engine, asked, asked.data);
    task.start();
    const auto sent = nic.sent.size();
    const Time next = engine.poll(now += 100us);
    EXPECT_EQ(nic.sent.size(), sent);
    EXPECT_LE(next, now + 2ms) << "but not for ever";
    engine.poll(now += 2ms);
    EXPECT_EQ(nic.sent.size(), sent + 1);
}

TEST_P(PreparedFrameTest, BudgetBoundsWhatRides) {
    group.config.acyclic_bytes = 40;
    std::vector<Asked> asked(10);
    std::vector<OwnedTask<Result<>>> tasks;
    for (auto& a : asked) tasks.push_back(ask(engine, a, a.data));
    for (auto& t : tasks) t.start();
    ASSERT_TRUE(send().ok());
    ASSERT_EQ(nic.sent.size(), 1U);
    EXPECT_EQ(nic.sent[0].size(), wire::kFramePrefixBytes + 16 + 2 * 16);
    // A request that is longer than the budget is sent alone.
    tasks.clear();
    Asked large;
    std::array<std::byte, 500> data{};
    OwnedTask task = ask(engine, large, data);
    task.start();
    ASSERT_TRUE(send().ok());
    EXPECT_EQ(nic.sent.back().size(), wire::kFramePrefixBytes + 16 + 512);
}

// The NIC accepts the frame of the cycle, but never the frame of the requests. The requests must end.
TEST_P(PreparedFrameTest, NicThatTakesOnlyTheCycleLeavesNoRequestWaitingForEver) {
    Asked asked;
    std::array<std::byte, wire::kMaxDatagramData> data{};  // does not fit behind the datagrams of the cycle
    OwnedTask task = ask(engine, asked, data);
    task.start();
    nic.most_frames_at_once = 1;
    const Time start = now;
    while (!asked.done && now - start < 60s) {
        nic.taken = 0;
        ASSERT_TRUE(send().ok());
        nic.incoming.push_back(reply(3, 1));
        ASSERT_TRUE(end().ok());
        engine.poll(now);
    }
    EXPECT_TRUE(asked.done);
    EXPECT_EQ(asked.reply.errc, Errc::nic_busy);
}

TEST_P(PreparedFrameTest, NicThatStaysBusyInTheCycleEndsWhatRides) {
    Asked asked;
    OwnedTask task = ask(engine, asked, asked.data);
    task.start();
    nic.answer = SendStatus::busy;
    const Time start = now;
    while (!asked.done && now - start < 60s) {
        EXPECT_EQ(send().error().code, Errc::nic);
        EXPECT_EQ(end().error().code, Errc::no_frame);
        engine.poll(now);
    }
    ASSERT_TRUE(asked.done);
    EXPECT_EQ(asked.reply.errc, Errc::nic_busy);
    EXPECT_LE(now - start, engine.link().settings.queue_timeout + 5ms);
    // The cycle continues as soon as the NIC accepts frames.
    nic.answer = SendStatus::sent;
    ASSERT_TRUE(send().ok());
    nic.incoming.push_back(reply(3, 1));
    EXPECT_TRUE(end().ok());
}

TEST_P(PreparedFrameTest, UnmarkedReplyIsTakenWhereTheNicHidesOwnFrames) {
    for (const bool hides : {true, false}) {
        nic.hides_own = hides;
        image[2] = std::byte{0};
        ASSERT_TRUE(send().ok());
        Octets unmarked = reply(3, 0x21);
        unmarked[wire::kSourceMacOffset] &= ~wire::kPassedEscBit;
        nic.incoming.push_back(unmarked);
        const auto ended = end();
        EXPECT_EQ(ended.ok(), hides);
        EXPECT_EQ(image[2], hides ? std::byte{0x21} : std::byte{0});
        EXPECT_EQ(ended.error().detail, hides ? 0U : Error::kUnmarked);
    }
    // The next cycle is lost and reported as lost.
    ASSERT_TRUE(send().ok());
    const auto ended = end();
    EXPECT_EQ(ended.error().code, Errc::no_frame);
    EXPECT_EQ(ended.error().detail, 0U);
}

}  // namespace
}  // namespace margay
