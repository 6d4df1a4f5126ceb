// Two groups on one cable. Each group has its own period and its own budget for the datagrams of requests that travel
// with its cycles.
#include "process_data/bus.hpp"
#include "process_data/prepared_group.hpp"

namespace margay {
namespace {

using namespace std::chrono_literals;

// Group 0 is the group of the base class. Group 1 contains the second slave. The test sends both groups and writes
// their replies.
class TwoGroupsTest : public testing::Test, protected PreparedGroup {
  protected:
    static constexpr std::size_t kBudget = 40;  // two datagrams of 16 octets

    TwoGroupsTest() : PreparedGroup({io_slave(1, 8, 8), io_slave(2, 8, 8)}, 2) { slaves[1].config.group = 1; }
    void SetUp() override {
        for (std::uint8_t n = 0; n < 2; ++n) prepare_one(n);
    }
    // Adds waiting requests. A test calls this after the link has learned the period of the cycles.
    void ask_all() {
        for (auto& a : asked) {
            tasks.push_back(ask(engine, a));
            tasks.back().start();
        }
    }
    void prepare_one(std::uint8_t n) {
        ProcessGroup& g = groups[n];
        g.number = n;
        g.config.acyclic_bytes = kBudget;
        g.config.start.value = n * 0x10000U;
        g.layout = *lay_out(slaves, n, g.config, MutableBytes(image).subspan(n * 2U, 2));
        g.image = MutableBytes(image).subspan(n * 2U, 2);
        g.slaves = slaves;
        const auto count = plan_datagrams(slaves, n, g.config, g.layout, scratch);
        ASSERT_TRUE(count.ok());
        ASSERT_TRUE(prepare(tables, g, *count, engine.link()).ok());
    }
    struct Asked {
        bool done = false;
        std::array<std::byte, 4> data{};
    };
    static Task<Result<>> ask(Engine& engine, Asked& asked) {
        Datagram datagram(engine.link(), wire::Command::FPRD, wire::DatagramAddress(StationAddress{0x1001}, 0x0130),
                          MutableBytes(asked.data));
        (void)co_await datagram;
        asked.done = true;
        co_return Result<>();
    }
    // Octets of the datagrams that do not belong to the cycle.
    static std::size_t acyclic_bytes(std::span<const Octets> frames_sent) {
        std::size_t all = 0;
        for (const Octets& frame : frames_sent) {
            wire::DatagramReader reader(frame);
            while (const auto d = reader.next())
                if (d->header.command == wire::Command::FPRD) all += d->header.length + wire::kDatagramOverheadBytes;
        }
        return all;
    }
    void answer_all(std::size_t from) {
        for (std::size_t n = from; n < nic.sent.size(); ++n) nic.incoming.push_back(reply_to(nic.sent[n], 3));
    }
    void cycle_of(std::uint8_t n) {
        const std::size_t from = nic.sent.size();
        ASSERT_TRUE(send_cycle(groups[n], engine.link(), now).ok());
        EXPECT_LE(acyclic_bytes(std::span(nic.sent).subspan(from)), kBudget) << "group " << unsigned{n};
        answer_all(from);
        (void)end_cycle(groups[n], engine.link(), engine.receive_cycle(groups[n].prepared, now), now);
    }
    // Polls for some time after the cycle. poll() must not send a frame of its own.
    void poll_until(Time until) {
        for (; now < until; now += 50us) {
            const std::size_t from = nic.sent.size();
            engine.poll(now);
            EXPECT_EQ(nic.sent.size(), from) << "the queue is left to the cycles";
        }
        now = until;
    }
    [[nodiscard]] std::size_t done() const {
        return static_cast<std::size_t>(std::ranges::count_if(asked, [](const Asked& a) { return a.done; }));
    }

    std::vector<Asked> asked = std::vector<Asked>(60);
    std::vector<OwnedTask<Result<>>> tasks;
};

TEST_F(TwoGroupsTest, OfOneRateKeepTheirBudgets) {
    for (int n = 0; n < 12; ++n) {
        if (n == 2) ask_all();
        const std::size_t before = done();
        const Time begin = now;
        cycle_of(0);
        now += 1us;
        cycle_of(1);
        poll_until(begin + 1ms);
        if (n >= 2) {
            EXPECT_EQ(done() - before, 4U) << "two of each group's budget";
        }
    }
}

TEST_F(TwoGroupsTest, OfDifferentRatesKeepTheirBudgets) {
    for (int n = 0; n < 24; ++n) {
        if (n == 5) ask_all();
        const std::size_t before = done();
        const Time begin = now;
        cycle_of(0);
        if (n % 4 == 0) {
            now += 1us;
            cycle_of(1);
        }
        poll_until(begin + 1ms);
        if (n >= 5) {
            EXPECT_EQ(done() - before, n % 4 == 0 ? 4U : 2U) << n;
        }
    }
}

// When both groups stop, the queue waits no longer than until the next possible cycle of the slower group.
TEST_F(TwoGroupsTest, ThatStopLeaveTheQueueToPoll) {
    for (int n = 0; n < 4; ++n) {
        if (n == 2) ask_all();
        cycle_of(0);
        cycle_of(1);
        engine.poll(now);
        now += 1ms;
    }
    const std::size_t from = nic.sent.size();
    ASSERT_LT(done(), asked.size());
    engine.poll(now += 20ms);
    answer_all(from);
    engine.poll(now);
    EXPECT_EQ(done(), asked.size());
}

}  // namespace
}  // namespace margay
