// When a cycle was sent whose time has come, and when a datagram was sent whose reply has come. The test writes each
// reply.
#include "process_data/prepared_group.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

struct CycleTimes : testing::Test, PreparedGroup {
    CycleTimes() : PreparedGroup({io_slave(1, 16, 16)}) {}
    void SetUp() override {
        slaves[0].dl.dc_64bit = true;
        group.config.dc_reference = group.dc_reference = 1;
        prepare_frames();
    }
    Time send(Duration later = 1ms) {
        EXPECT_TRUE(send_cycle(group, engine.link(), now += later).ok());
        return now;
    }
    // The reply to the frame that was sent last.
    void answer() { nic.incoming.push_back(reply_to(nic.sent.back(), 3)); }
    void receive() {
        const CycleEnd end = engine.receive_cycle(group.prepared, now);
        (void)end_cycle(group, engine.link(), end, now);
    }
    // Nothing: there is no time of which the library knows when it was read.
    std::optional<Time> of_time() {
        if (!group.dc_time.came) return std::nullopt;
        return time_sent_at(group, engine.link());
    }
    struct Asked {
        Time sent{};
        bool done = false;
    };
    static Task<Result<>> ask(Engine& engine, Asked& asked) {
        std::array<std::byte, 4> data{};
        TimedDatagram datagram(engine.link(), wire::Command::FPRD,
                               wire::DatagramAddress(StationAddress{0x1001}, 0x0130), MutableBytes(data));
        (void)co_await datagram;
        asked = {datagram.sent_at(), true};
        co_return Result<>();
    }
};

TEST_F(CycleTimes, PollReadsTheTimeOfTheCycleUnderWay) {
    const Time first = send();
    answer();
    receive();
    EXPECT_EQ(of_time(), first);
    const Time second = send();
    EXPECT_EQ(of_time(), first) << "the second cycle is not back";
    EXPECT_EQ(cycles_without_time(group), 1U);
    answer();
    (void)engine.poll(now);
    EXPECT_EQ(of_time(), second);
    EXPECT_EQ(cycles_without_time(group), 0U);
    EXPECT_EQ(cycles_under_way(group), 1U);
    receive();
    EXPECT_EQ(of_time(), second);
    EXPECT_EQ(cycles_without_time(group), 0U);
}

TEST_F(CycleTimes, ALostCycleHasBroughtNoTime) {
    (void)send();
    answer();
    receive();
    const Time second = send();
    (void)engine.poll(now);
    receive();
    EXPECT_EQ(of_time(), std::nullopt);
    const Time third = send();
    answer();
    (void)engine.poll(now);
    EXPECT_EQ(of_time(), third);
    EXPECT_EQ(third - second, 1ms);
}

// The application sends the next cycle without receiving.
TEST_F(CycleTimes, ALostCycleThatTheApplicationDoesNotReceiveHasBroughtNoTime) {
    (void)send();
    answer();
    (void)engine.poll(now);
    const Time second = send();
    answer();
    (void)engine.poll(now);
    EXPECT_EQ(of_time(), second);
    const Time third = send();
    (void)engine.poll(now);
    EXPECT_EQ(of_time(), second);
    EXPECT_EQ(third - second, 1ms);
    const Time fourth = send();
    EXPECT_EQ(of_time(), std::nullopt) << "the time is of the second cycle, and the third one is lost";
    answer();
    (void)engine.poll(now);
    EXPECT_EQ(of_time(), fourth);
}

TEST_F(CycleTimes, ALostFrameWithARiderHasBroughtNoTime) {
    (void)send();
    answer();
    (void)engine.poll(now);
    Asked asked;
    OwnedTask task = ask(engine, asked);
    task.start();
    (void)send();
    (void)engine.poll(now + 900ms);  // the frame has timed out
    EXPECT_EQ(of_time(), std::nullopt);
}

// The reply to the frame that carried the datagram is received by the cycle. The coroutine continues when poll() has
// read the next frame.
TEST_F(CycleTimes, ADatagramIsSentWithItsCycle) {
    (void)send();
    answer();
    receive();
    (void)send();
    answer();
    receive();
    Asked asked;
    OwnedTask task = ask(engine, asked);
    task.start();
    (void)engine.poll(now += 300us);
    const Time third = send(700us);
    answer();
    receive();
    const Time fourth = send();
    answer();
    (void)engine.poll(now);
    ASSERT_TRUE(asked.done);
    EXPECT_EQ(asked.sent, third);
    EXPECT_EQ(of_time(), fourth);
}

TEST_F(CycleTimes, ADatagramIsSentAgainWithALaterCycle) {
    (void)send();
    answer();
    receive();
    Asked asked;
    OwnedTask task = ask(engine, asked);
    task.start();
    const Time lost = send();
    receive();
    Time last = lost;
    for (unsigned n = 0; n < 200 && !asked.done; ++n) {
        last = send();
        answer();
        (void)engine.poll(now);
        receive();
    }
    ASSERT_TRUE(asked.done);
    EXPECT_EQ(counted().retried, 1U);
    EXPECT_EQ(asked.sent, last);
}

TEST_F(CycleTimes, ADatagramIsSentByPollWithoutCycles) {
    Asked asked;
    OwnedTask task = ask(engine, asked);
    task.start();
    const Time sent = now += 300us;
    (void)engine.poll(sent);
    nic.incoming.push_back(reply_to(nic.sent.back(), 1));
    (void)engine.poll(now += 50us);
    ASSERT_TRUE(asked.done);
    EXPECT_EQ(asked.sent, sent);
}

}  // namespace
}  // namespace margay
