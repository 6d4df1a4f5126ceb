// Overlapped cycles: a cycle is sent before the previous cycle is received, by one thread or by two.
#include "process_data/bus.hpp"
#include "process_data/prepared_group.hpp"

#include <atomic>
#include <mutex>
#include <thread>

namespace margay {
namespace {

using namespace std::chrono_literals;

// Two slaves with one octet in each direction. The test writes every reply.
class OverlapTest : public testing::Test, protected PreparedGroup {
  protected:
    OverlapTest() : PreparedGroup({io_slave(1, 8, 8), io_slave(2, 8, 8)}) {}
    void SetUp() override {
        group.config.cycles_in_flight = 2;
        group.config.al_status = true;
        for (Slave& slave : slaves) {
            slave.takes_part = true;
            slave.al.state = AlState::op;
        }
        prepare_frames();
    }
    Result<> send() { return send_overlapped(group, engine.link(), now += 1ms); }
    // Receives all frames of the NIC and ends the oldest cycle.
    Result<std::uint32_t> receive() {
        (void)engine.receive_overlapped(oldest_cycle(group), now);
        return end_overlapped(group, engine.link(), now);
    }
    // The reply to the sent frame with number n: one octet of inputs from each slave, and the states of both slaves.
    Octets reply(std::size_t n, std::uint8_t value, std::uint16_t wkc = 6) {
        Octets r = reply_to(nic.sent[n], wkc);
        r[kDataAt + 2] = r[kDataAt + 3] = std::byte{value};
        r[kDataAt + 6 + wire::kDatagramHeaderBytes] = std::byte{0x08};
        return r;
    }
};

TEST_F(OverlapTest, TwoCyclesAreUnderWay) {
    image[0] = std::byte{0x11};
    ASSERT_TRUE(send().ok());
    image[0] = std::byte{0x22};
    ASSERT_TRUE(send().ok());
    const auto third = send();
    EXPECT_EQ(third.error().code, Errc::busy);
    EXPECT_EQ(third.error().expected, 2U);
    ASSERT_EQ(nic.sent.size(), 2U);
    EXPECT_EQ(nic.sent[0][kDataAt], std::byte{0x11});
    EXPECT_EQ(nic.sent[1][kDataAt], std::byte{0x22});
    EXPECT_NE(nic.sent[0][kIndexAt], nic.sent[1][kIndexAt]);
    EXPECT_EQ(group.cycles_sent, 2U);

    nic.incoming = {reply(0, 0x51), reply(1, 0x52)};
    auto wkc = receive();
    ASSERT_TRUE(wkc.ok());
    EXPECT_EQ(*wkc, 6U);
    EXPECT_EQ(group.cycle_received, 1U);
    EXPECT_EQ(image[2], std::byte{0x51});
    EXPECT_EQ(image[0], std::byte{0x22}) << "outputs stay the application's";
    ASSERT_TRUE(send().ok()) << "there is room again";
    ASSERT_TRUE(receive().ok());
    EXPECT_EQ(group.cycle_received, 2U);
    EXPECT_EQ(image[2], std::byte{0x52});
    EXPECT_EQ(counted().frames_sent, 2U) << "each is counted when it is received";
    EXPECT_EQ(counted().frames_received, 2U);
    EXPECT_TRUE(oldest_cycle(group).size() == 1) << "the third";
}

TEST_F(OverlapTest, AReplyThatComesFirstWaitsForItsTurn) {
    ASSERT_TRUE(send().ok());
    ASSERT_TRUE(send().ok());
    nic.incoming = {reply(1, 0x52), reply(0, 0x51)};
    ASSERT_TRUE(receive().ok());
    EXPECT_EQ(group.cycle_received, 1U);
    EXPECT_EQ(image[2], std::byte{0x51});
    ASSERT_TRUE(receive().ok());
    EXPECT_EQ(group.cycle_received, 2U);
    EXPECT_EQ(image[2], std::byte{0x52});
}

TEST_F(OverlapTest, AReplyThatPollTakesInWaitsToo) {
    ASSERT_TRUE(send().ok());
    nic.incoming = {reply(0, 0x51)};
    engine.poll(now);
    EXPECT_EQ(image[2], std::byte{0});
    ASSERT_TRUE(receive().ok());
    EXPECT_EQ(image[2], std::byte{0x51});
}

TEST_F(OverlapTest, ALostCycleIsToldInItsTurnAndBringsNothing) {
    ASSERT_TRUE(send().ok());
    ASSERT_TRUE(send().ok());
    nic.incoming = {reply(1, 0x52)};
    EXPECT_EQ(receive().error().code, Errc::no_frame);
    EXPECT_EQ(group.cycle_received, 1U);
    EXPECT_EQ(image[2], std::byte{0}) << "not what the next cycle has brought";
    EXPECT_FALSE(group.datagrams[0].came);
    EXPECT_FALSE(group.al_status.came);
    const Octets late = reply(0, 0x51);
    nic.incoming = {late};
    ASSERT_TRUE(receive().ok());
    EXPECT_EQ(image[2], std::byte{0x52});
    engine.poll(now);
    EXPECT_EQ(counted().lost, 1U);
    EXPECT_EQ(counted().unexpected, 1U) << "the late one";
    EXPECT_EQ(image[2], std::byte{0x52});
}

TEST_F(OverlapTest, IndicesOfLostFramesRest) {
    std::vector<Octets> late;
    for (std::size_t n = 0; n < 100; ++n) {
        ASSERT_TRUE(send().ok());
        late.push_back(reply(n, 0x66));
        EXPECT_EQ(receive().error().code, Errc::no_frame);
    }
    now += 1s;
    // All lost replies arrive at once. The library accepts none of them for a cycle in flight.
    for (std::size_t n = 100; n < 128; ++n) {
        ASSERT_TRUE(send().ok());
        nic.incoming.assign(late.begin(), late.end());
        nic.incoming.push_back(reply(n, 0x31));
        ASSERT_TRUE(receive().ok());
        EXPECT_EQ(image[2], std::byte{0x31});
    }
}

TEST_F(OverlapTest, ARefusedCycleIsStillOneToBeReceived) {
    nic.answer = SendStatus::busy;
    EXPECT_EQ(send().error().code, Errc::nic);
    nic.answer = SendStatus::sent;
    ASSERT_TRUE(send().ok());
    nic.incoming = {reply(0, 0x51)};
    EXPECT_EQ(receive().error().code, Errc::no_frame);
    EXPECT_EQ(counted().send_refused, 1U);
    EXPECT_EQ(counted().lost, 0U);
    ASSERT_TRUE(receive().ok());
    EXPECT_EQ(group.cycle_received, 2U);
}

TEST_F(OverlapTest, WhatAReplyLeftInAFrameIsNotSentAgain) {
    for (std::size_t n = 0; n < 4; ++n) {
        ASSERT_TRUE(send().ok());
        const Octets& sent = nic.sent.back();
        wire::DatagramReader reader(sent);
        const auto process = reader.next();
        const auto states = reader.next();
        ASSERT_TRUE(process && states);
        EXPECT_EQ(process->wkc, 0);
        EXPECT_EQ(states->wkc, 0);
        EXPECT_EQ(states->header.address, wire::DatagramAddress(std::uint16_t{0}, 0x0130));
        EXPECT_EQ(states->data[0], std::byte{0}) << "slaves only add bits to what is sent";
        Octets back = reply(n, static_cast<std::uint8_t>(n));
        back[kDataAt + 6 - wire::kDatagramHeaderBytes + 12] ^= std::byte{0x02};  // the slaves increment the position
        nic.incoming = {back};
        ASSERT_TRUE(receive().ok());
        EXPECT_EQ(group.al_status.value, 0x08U);
    }
}

TEST_F(OverlapTest, InputsOfASlaveThatDoesNotTakePartStay) {
    ASSERT_TRUE(send().ok());
    nic.incoming = {reply(0, 0x41)};
    ASSERT_TRUE(receive().ok());
    slaves[1].takes_part = false;
    statuses[0].accepted = 3;
    for (PreparedFrame& frame : frames) frame.settle();
    for (std::size_t n = 1; n < 4; ++n) {
        ASSERT_TRUE(send().ok());
        nic.incoming = {reply(n, 0x42, 3)};
        EXPECT_EQ(receive().error().code, Errc::working_counter);
        EXPECT_EQ(image[2], std::byte{0x42});
        EXPECT_EQ(image[3], std::byte{0x41}) << "of the last cycle it was in";
    }
}

TEST_F(OverlapTest, RequestsTravelInFramesOfTheirOwn) {
    struct Asked {
        static Task<Result<>> ask(Engine& engine, bool& done, MutableBytes data) {
            Datagram datagram(engine.link(), wire::Command::FPRD, wire::DatagramAddress(StationAddress{0x1001}, 0x0130),
                              data);
            auto reply = co_await datagram;
            done = reply.ok();
            co_return Result<>();
        }
    };
    bool done = false;
    std::array<std::byte, 2> data{};
    OwnedTask task = Asked::ask(engine, done, data);
    task.start();
    ASSERT_TRUE(send().ok());
    ASSERT_TRUE(send().ok());
    engine.poll(now);
    ASSERT_EQ(nic.sent.size(), 3U);
    EXPECT_EQ(nic.sent[0].size(), nic.sent[1].size());
    EXPECT_LT(std::to_integer<int>(nic.sent[2][kIndexAt]), 128);
    EXPECT_GE(std::to_integer<int>(nic.sent[0][kIndexAt]), 128);
    nic.incoming = {reply_to(nic.sent[2]), reply(0, 1), reply(1, 2)};
    engine.poll(now);
    EXPECT_TRUE(done);
    EXPECT_TRUE(receive().ok());
    EXPECT_TRUE(receive().ok());
}

TEST_F(OverlapTest, MappingAgainForgetsWhatIsUnderWay) {
    ASSERT_TRUE(send().ok());
    const Octets late = reply(0, 0x51);
    unprepare(group, engine.link(), now);
    nic.incoming = {late};
    engine.poll(now);
    EXPECT_EQ(counted().unexpected, 1U);
    EXPECT_EQ(send().error().code, Errc::unknown_group);
}

// The same with the public calls, on the simulated segment.
class OverlappedBus : public testing::Test {
  protected:
    Bus bus;
    std::vector<std::byte> image = std::vector<std::byte>(8192);
    HostContext& ctx() { return *bus.ctx; }
    const Group& group() { return ctx().group(0); }
    void map(std::uint8_t cycles) {
        group().config.cycles_in_flight = cycles;
        group().config.al_status = true;
        group().config.dc_reference = 1;
        ASSERT_TRUE(config_map(ctx(), image).ok());
    }
};

TEST_F(OverlappedBus, OneThreadSendsAheadAndReceivesInOrder) {
    for (int i = 0; i < 3; ++i) bus.add(5000, 5000);
    bus.start({.slaves = 8, .process_frames = 9});
    map(3);
    EXPECT_EQ(group().frames, 3);
    ASSERT_TRUE(send_processdata(ctx()).ok());
    bus.osal.advance(500us);
    ASSERT_TRUE(send_processdata(ctx()).ok());
    std::uint64_t time = 0;
    for (std::uint32_t n = 1; n < 1000; ++n) {
        bus.osal.advance(500us);
        ASSERT_TRUE(send_processdata(ctx()).ok());
        const auto wkc = receive_processdata(ctx(), 5ms);
        ASSERT_TRUE(wkc.ok());
        EXPECT_EQ(*wkc, group().expected_wkc);
        EXPECT_EQ(group().cycle_received, n);
        EXPECT_GT(group().dc_time.value, time);
        time = group().dc_time.value;
        (void)poll(ctx(), bus.osal.now());
    }
    EXPECT_EQ(ctx().statistics().lost, 0U);
}

TEST_F(OverlappedBus, ReceivingWaitsForACycle) {
    bus.add(16, 16);
    bus.start();
    map(2);
    const Time start = bus.osal.now();
    EXPECT_EQ(receive_processdata(ctx(), 3ms).error().code, Errc::timeout);
    EXPECT_EQ(bus.osal.now(), start + 3ms);
    EXPECT_TRUE(bus.cycle().ok()) << "as one that does not overlap";
}

TEST_F(OverlappedBus, TooFewFrames) {
    bus.add(16, 16);
    bus.start({.slaves = 8, .process_frames = 1});
    group().config.cycles_in_flight = 2;
    const auto mapped = config_map(ctx(), image);
    EXPECT_EQ(mapped.error().code, Errc::too_many_frames);
    EXPECT_EQ(mapped.error().expected, 2U);
}

// The owner stops the time of the reference clock, for example while the reference clock is restored. The other thread
// reads the places of the datagrams at the same moment: under ThreadSanitizer both must be different memory.
TEST(OverlapThreads, TheOwnerStopsTheTimeWhileAnotherThreadSends) {
    PreparedGroup bus({io_slave(1, 8, 8), io_slave(2, 8, 8)});
    ProcessGroup& group = bus.group;
    group.config.cycles_in_flight = 2;
    bus.slaves[0].dl.dc = true;
    group.config.dc_reference = group.dc_reference = 1;
    for (Slave& slave : bus.slaves) {
        slave.takes_part = true;
        slave.al.state = AlState::op;
    }
    bus.prepare_frames();
    const auto time = std::ranges::find(group.readings, &group.dc_time, &PreparedReading::into);
    ASSERT_NE(time, group.readings.end());
    std::thread sender([&] { EXPECT_TRUE(send_overlapped(group, bus.engine.link(), bus.now).ok()); });
    EXPECT_FALSE(redirect_time(group, nullptr)) << "the frame that is sent keeps its command";
    sender.join();
    EXPECT_TRUE(time->held);
    EXPECT_EQ(bus.nic.sent.size(), 1U);
}

// A NIC and a clock that two threads can use.
struct Guarded final : Nic, Osal {
    Guarded(Nic& n, VirtualOsal& o) : nic(n), osal(o) {}
    Nic& nic;
    VirtualOsal& osal;
    mutable std::recursive_mutex mutex;

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        const std::lock_guard lock(mutex);
        return nic.send(frame);
    }
    std::size_t receive(std::span<std::byte> into) noexcept override {
        const std::lock_guard lock(mutex);
        return nic.receive(into);
    }
    Time next_arrival() const noexcept override {
        const std::lock_guard lock(mutex);
        return nic.next_arrival();
    }
    Time now() noexcept override {
        const std::lock_guard lock(mutex);
        return osal.now();
    }
    void wait(Time until, WaitHandles handle) noexcept override {
        {
            const std::lock_guard lock(mutex);
            osal.wait(until, handle);
        }
        std::this_thread::yield();
    }
};

// Three slaves behind this NIC. Two cycles can be in flight.
class OverlappedBusThreads : public OverlappedBus {
  protected:
    SimulatedNic line{bus.segment, bus.osal};
    Guarded guarded{line, bus.osal};

    void SetUp() override {
        for (int i = 0; i < 3; ++i) bus.add(16, 16);
        bus.segment.power_up(bus.osal.now());
        bus.ctx = std::make_unique<HostContext>(Limits{.slaves = 8});
        ASSERT_TRUE(init(ctx(), guarded, guarded).ok());
        ASSERT_TRUE(config_init(ctx()).ok());
        map(2);
    }
    void TearDown() override { bus.ctx.reset(); }  // before the NIC is destroyed
};

// One thread sends as fast as possible. The owner receives, polls, and reads the states. Every cycle comes back
// complete and in order.
TEST_F(OverlappedBusThreads, OneSendsAndTheOwnerReceives) {
    constexpr std::uint32_t kCycles = 3000;

    bool sent_well = true;
    std::thread sender([&] {
        for (std::uint32_t sent = 0; sent < kCycles;) {
            image[0] = static_cast<std::byte>(sent);
            const auto done = send_processdata(ctx());
            sent += done ? 1 : 0;
            sent_well &= done.ok() || done.error().code == Errc::busy;
            if (!done) std::this_thread::yield();
        }
    });
    std::uint64_t time = 0;
    std::uint32_t states_read = 0;
    ReadStateRequest states;
    for (std::uint32_t received = 0; received < kCycles;) {
        const auto wkc = receive_processdata(ctx(), 1ms);
        (void)poll(ctx(), guarded.now());
        if (!states.busy()) {
            states_read += states.state() == RequestState::success ? 1 : 0;
            EXPECT_TRUE(submit(ctx(), states).ok());
        }
        if (wkc.error().code == Errc::timeout) continue;  // the other thread has not sent yet
        ++received;
        EXPECT_TRUE(wkc.ok()) << received;
        EXPECT_EQ(group().cycle_received, received);
        EXPECT_EQ(group().al_status.slaves, 3);
        EXPECT_GE(group().dc_time.value, time);
        time = group().dc_time.value;
    }
    sender.join();
    EXPECT_TRUE(sent_well);
    EXPECT_GT(states_read, 10U);
    EXPECT_EQ(group().cycles_sent, kCycles);
    EXPECT_EQ(ctx().statistics().lost, 0U);
    std::array<std::byte, 1> last{};
    bus.segment.slave(0).read(0x1100, last);
    EXPECT_EQ(last[0], std::byte{(kCycles - 1) & 0xFF});
}

// A slave is lost and comes back while one thread sends and the owner receives and supervises.
TEST_F(OverlappedBusThreads, ASlaveIsLostAndComesBack) {
    constexpr std::uint32_t kMostCycles = 400'000;  // on a busy machine the threads take turns slowly
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx(), supervision).ok());
    std::atomic<bool> enough = false;
    std::thread sender([&] {
        while (!enough)
            if (!send_processdata(ctx())) std::this_thread::yield();
    });
    const auto power = [&](bool on) {
        const std::lock_guard lock(guarded.mutex);
        bus.segment.set_power(2, on, bus.osal.now());
    };
    unsigned others_fresh = 0;
    // Executes cycles until the condition is true.
    const auto until = [&](auto holds) {
        for (std::uint32_t received = 0; received < kMostCycles && !holds(); ++received) {
            const auto wkc = receive_processdata(ctx(), 1ms);
            others_fresh += wkc.error().detail == Error::kOthersFresh ? 1 : 0;
            (void)poll(ctx(), guarded.now());
        }
    };
    const auto is_in = [&](AlState state) { return ctx().slave(3).al.state == state; };
    until([&] { return is_in(AlState::op); });
    power(false);
    until([&] { return others_fresh > 100; });
    power(true);
    until([&] { return is_in(AlState::op); });
    enough = true;
    sender.join();
    EXPECT_GT(others_fresh, 100U);
    EXPECT_EQ(ctx().slave(3).al.state, AlState::op);
    supervision.cancel();
}

}  // namespace
}  // namespace margay
