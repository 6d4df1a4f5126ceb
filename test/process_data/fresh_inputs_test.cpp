// Which slaves have fresh inputs, and the inputs of a lost slave.
#include "process_data/bus.hpp"
#include "process_data/prepared_group.hpp"
#include "sim/library/library.hpp"

#include <margay/run.hpp>
#include <margay/shared_image.hpp>

namespace margay {
namespace {

using namespace std::chrono_literals;

// Three slaves in OP with one octet in each direction. The last slave loses its power.
class FreshInputsTest : public testing::Test {
  protected:
    Bus bus;
    std::vector<std::byte> image = std::vector<std::byte>(64);
    std::uint8_t counter = 0x10;

    HostContext& ctx() { return *bus.ctx; }
    void start(const GroupConfiguration& config = {}) {
        for (int n = 0; n < 3; ++n) bus.add(8, 8);
        bus.start();
        ctx().group(0).config = config;
        ASSERT_TRUE(config_map(ctx(), image).ok());
        ASSERT_EQ(bus.to_op().state, AlState::op);
    }
    // Every device provides a new value, then a cycle is executed.
    Result<std::uint32_t> cycle() {
        ++counter;
        for (std::size_t n = 1; n <= 3; ++n) {
            bus.device(n).inputs()[0] = std::byte{counter};
            bus.device(n).poke();
        }
        return bus.cycle();
    }
    bool has_new_value(std::size_t n) { return ctx().slave(n).image.inputs.bytes[0] == std::byte{counter}; }
    void lose_the_last() {
        bus.segment.set_power(2, false, bus.osal.now());
        (void)cycle();
    }
};

TEST_F(FreshInputsTest, ALostSlavesAreNotFreshAndThoseOfTheOthersAre) {
    start();
    ASSERT_TRUE(cycle().ok());
    for (std::uint16_t n = 1; n <= 3; ++n) EXPECT_TRUE(inputs_fresh(ctx(), n)) << n;

    // The library does not yet know which slave is missing. It has copied no inputs, and reports no inputs as fresh.
    lose_the_last();
    const auto unknown = cycle();
    EXPECT_EQ(unknown.error().code, Errc::working_counter);
    EXPECT_EQ(unknown.error().detail, 0U);
    for (std::uint16_t n = 1; n <= 3; ++n) {
        EXPECT_FALSE(has_new_value(n)) << n;
        EXPECT_FALSE(inputs_fresh(ctx(), n)) << n;
    }

    // When the missing slave is known, the other slaves continue, and the error contains this.
    ASSERT_TRUE(readstate(ctx()).ok());
    for (int round = 0; round < 3; ++round) {
        const auto known = cycle();
        EXPECT_EQ(known.error().code, Errc::working_counter);
        EXPECT_EQ(known.error().detail, Error::kOthersFresh);
        EXPECT_EQ(known.error().slave, 3);
        std::array<char, 200> text{};
        EXPECT_EQ(
            describe(known.error(), text),
            "slave 3: exchanging process data: wrong working counter (expected 9, got 6), the inputs of the other "
            "slaves are fresh");
        for (std::uint16_t n = 1; n <= 3; ++n) {
            EXPECT_EQ(has_new_value(n), n != 3) << n;
            EXPECT_EQ(inputs_fresh(ctx(), n), n != 3) << n;
        }
    }

    // After a lost frame no inputs are fresh.
    bus.segment.lose_next({0, 0});
    EXPECT_EQ(cycle().error().code, Errc::no_frame);
    for (std::uint16_t n = 1; n <= 3; ++n) EXPECT_FALSE(inputs_fresh(ctx(), n)) << n;
}

TEST_F(FreshInputsTest, TheyStayFreshUntilTheNextCycleIsReceived) {
    start();
    ASSERT_TRUE(cycle().ok());
    ASSERT_TRUE(send_processdata(ctx()).ok());
    EXPECT_TRUE(inputs_fresh(ctx(), 1)) << "the next cycle is under way, the image has those of the last";
    ASSERT_TRUE(receive_processdata(ctx(), 500us).ok());
    EXPECT_TRUE(inputs_fresh(ctx(), 1));
}

// The cable is unplugged. If the application does not receive after an error of send_processdata(), its inputs are old,
// too.
class RefusedCycles : public FreshInputsTest, public testing::WithParamInterface<bool> {};
INSTANTIATE_TEST_SUITE_P(Supervised, RefusedCycles, testing::Bool());

TEST_P(RefusedCycles, BringNoFreshInputs) {
    start();
    SuperviseRequest supervision;
    if (GetParam()) {
        ASSERT_TRUE(submit(ctx(), supervision).ok());
    }
    for (int n = 0; n < 100; ++n) ASSERT_TRUE(cycle().ok());
    ASSERT_TRUE(all_right(ctx()));
    bus.segment.disconnect({0, 0});
    bus.segment.reconsider();
    bus.osal.advance(1ms);
    ASSERT_EQ(send_processdata(ctx()).error().code, Errc::nic);
    for (std::uint16_t n = 1; n <= 3; ++n) EXPECT_FALSE(inputs_fresh(ctx(), n)) << n;
    EXPECT_FALSE(all_right(ctx()));
    EXPECT_EQ(what_is_wrong(ctx()).code, Errc::no_frame);
    EXPECT_FALSE(ctx().group(0).datagrams[0].came);
    EXPECT_EQ(receive_processdata(ctx(), 100us).error().code, Errc::no_frame);
    ASSERT_TRUE(bus.segment.connect_master({0, 0}));
    bus.segment.reconsider();
    ASSERT_TRUE(cycle().ok());
    EXPECT_TRUE(inputs_fresh(ctx(), 1));
    supervision.cancel();
}

TEST_F(FreshInputsTest, NoneBeforeTheFirstCycleAndOfNobody) {
    HostContext early(Limits{.slaves = 1});
    EXPECT_FALSE(inputs_fresh(early, 1)) << "before init()";
    for (int n = 0; n < 3; ++n) bus.add(8, 8);
    bus.start();
    EXPECT_FALSE(inputs_fresh(ctx(), 1)) << "not mapped";
    ASSERT_TRUE(config_map(ctx(), image).ok());
    for (std::uint16_t n = 0; n <= 4; ++n) EXPECT_FALSE(inputs_fresh(ctx(), n)) << n;
    ASSERT_TRUE(cycle().ok());
    EXPECT_TRUE(inputs_fresh(ctx(), 3));
    EXPECT_FALSE(inputs_fresh(ctx(), 0));
    EXPECT_FALSE(inputs_fresh(ctx(), 4));
}

struct LostInputsCase {
    LostInputs what;
    bool overlapped;
    std::uint8_t cycles_in_flight;
};
class LostInputsTest : public FreshInputsTest, public testing::WithParamInterface<LostInputsCase> {};
INSTANTIATE_TEST_SUITE_P(
    Forms, LostInputsTest,
    testing::Values(LostInputsCase{LostInputs::keep, false, 1}, LostInputsCase{LostInputs::keep, true, 1},
                    LostInputsCase{LostInputs::keep, false, 2}, LostInputsCase{LostInputs::zero, false, 1},
                    LostInputsCase{LostInputs::zero, true, 1}, LostInputsCase{LostInputs::zero, false, 2}));

TEST_P(LostInputsTest, AreKeptUnlessTheyShallBeZero) {
    GroupConfiguration config;
    config.overlapped = GetParam().overlapped;
    config.lost_inputs = GetParam().what;
    config.cycles_in_flight = GetParam().cycles_in_flight;
    start(config);
    ASSERT_TRUE(cycle().ok());
    const std::byte last = ctx().slave(3).image.inputs.bytes[0];
    EXPECT_EQ(last, std::byte{counter});
    lose_the_last();
    EXPECT_EQ(ctx().slave(3).image.inputs.bytes[0], last) << "not known to be lost yet";
    ASSERT_TRUE(readstate(ctx()).ok());
    for (int round = 0; round < 3; ++round) {
        // With overlapping cycles the inputs change only when a cycle is received.
        const bool held = GetParam().cycles_in_flight > 1 && round == 0;
        const bool zero = GetParam().what == LostInputs::zero && !held;
        EXPECT_EQ(ctx().slave(3).image.inputs.bytes[0], zero ? std::byte{0} : last) << round;
        EXPECT_EQ(cycle().error().detail, Error::kOthersFresh);
        EXPECT_TRUE(has_new_value(1) && has_new_value(2));
        EXPECT_TRUE(inputs_fresh(ctx(), 1) && !inputs_fresh(ctx(), 3));
    }
}

// Another thread may read the image between two calls of receive_processdata(), so poll() does not change it. The
// parameters: cycles in flight, and whether the slave is lost (else the application lowers it).
class HeldInputs : public FreshInputsTest, public testing::WithParamInterface<std::tuple<int, bool>> {};
INSTANTIATE_TEST_SUITE_P(Forms, HeldInputs, testing::Combine(testing::Values(1, 2), testing::Bool()));

TEST_P(HeldInputs, BecomeZeroWhenACycleIsReceived) {
    const auto [in_flight, lost] = GetParam();
    GroupConfiguration config;
    config.lost_inputs = LostInputs::zero;
    config.hold_inputs = in_flight == 1;
    config.cycles_in_flight = static_cast<std::uint8_t>(in_flight);
    start(config);
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx(), supervision).ok());
    for (int n = 0; n < 5; ++n) ASSERT_TRUE(cycle().ok());
    const std::byte last = ctx().slave(3).image.inputs.bytes[0];
    ASSERT_EQ(last, std::byte{counter});
    if (lost) {
        bus.segment.set_power(2, false, bus.osal.now());
    } else {
        ASSERT_TRUE(set_target(ctx(), 3, AlState::preop).ok());
    }
    for (int n = 0; n < 500 && ctx().slave(3).takes_part; ++n) {
        bus.osal.advance(1ms);
        (void)poll(ctx(), bus.osal.now());
    }
    ASSERT_FALSE(ctx().slave(3).takes_part);
    EXPECT_EQ(ctx().slave(3).image.inputs.bytes[0], last) << "poll() has changed the image";
    (void)bus.cycle();
    EXPECT_EQ(ctx().slave(3).image.inputs.bytes[0], std::byte{0});
}

// A setting that the application changes after the mapping is used from the next mapping on. The inputs become zero
// also if no cycle can be sent. The parameter: whether the mapping holds the inputs.
class HeldAsMapped : public FreshInputsTest, public testing::WithParamInterface<bool> {};
INSTANTIATE_TEST_SUITE_P(Forms, HeldAsMapped, testing::Bool());

TEST_P(HeldAsMapped, WhateverTheApplicationSetsLater) {
    GroupConfiguration config;
    config.lost_inputs = LostInputs::zero;
    config.hold_inputs = GetParam();
    start(config);
    ctx().group(0).config.hold_inputs = !GetParam();
    ASSERT_TRUE(replan_processdata(ctx()).ok());
    SuperviseRequest supervision;
    ASSERT_TRUE(submit(ctx(), supervision).ok());
    for (int n = 0; n < 5; ++n) ASSERT_TRUE(cycle().ok());
    const std::byte last = ctx().slave(3).image.inputs.bytes[0];
    ASSERT_EQ(last, std::byte{counter});
    bus.segment.set_power(2, false, bus.osal.now());
    for (int n = 0; n < 500 && ctx().slave(3).takes_part; ++n) {
        bus.osal.advance(1ms);
        (void)poll(ctx(), bus.osal.now());
    }
    ASSERT_FALSE(ctx().slave(3).takes_part);
    EXPECT_EQ(ctx().slave(3).image.inputs.bytes[0], GetParam() ? last : std::byte{0});
    bus.segment.disconnect({0, 0});
    bus.segment.reconsider();
    bus.osal.advance(1ms);
    ASSERT_EQ(send_processdata(ctx()).error().code, Errc::nic);
    ASSERT_EQ(receive_processdata(ctx(), 100us).error().code, Errc::no_frame);
    EXPECT_EQ(ctx().slave(3).image.inputs.bytes[0], std::byte{0});
}

TEST_F(FreshInputsTest, SharedImageGetsTheInputsOfTheOthers) {
    std::vector<std::byte> memory(SharedImage::memory_bytes(3, 3));
    SharedImage shared(memory);
    GroupConfiguration config;
    config.shared = &shared;
    start(config);
    ASSERT_TRUE(cycle().ok());
    ASSERT_TRUE(shared.refresh_inputs());
    lose_the_last();
    (void)cycle();
    EXPECT_FALSE(shared.refresh_inputs()) << "nothing new came";
    ASSERT_TRUE(readstate(ctx()).ok());
    EXPECT_EQ(cycle().error().detail, Error::kOthersFresh);
    ASSERT_TRUE(shared.refresh_inputs());
    EXPECT_EQ(shared.inputs()[0], std::byte{counter});
    EXPECT_NE(shared.inputs()[2], std::byte{counter});
}

// Two slaves. The first slave maps its mailbox status, which has its own datagram behind the process data. The test
// writes every reply.
class DegradedStatusTest : public testing::Test, protected PreparedGroup {
  protected:
    DegradedStatusTest() : PreparedGroup({io_slave(1, 8, 8), io_slave(2, 8, 8)}) {
        slaves[0].config.mailbox_status = true;
        slaves[0].mailbox = {.out_start = 0x1800, .out_bytes = 64, .in_start = 0x1880, .in_bytes = 64, .protocols = 4};
        for (Slave& slave : slaves) {
            slave.takes_part = true;
            slave.al.state = AlState::op;
        }
    }
    // The offset of the mailbox status in the frame.
    [[nodiscard]] std::size_t status_at() const {
        return kDataAt + group.plans[0].bytes + wire::kDatagramOverheadBytes;
    }
    // Returns a reply in which the first slave has written its mailbox status.
    [[nodiscard]] Octets with_status(Octets reply) const {
        store_le<std::uint16_t>(reply, status_at() + group.plans[1].bytes, 1);
        return reply;
    }
    // The second slave is lost.
    void degrade() {
        slaves[1].takes_part = false;
        statuses[0].accepted = static_cast<std::uint16_t>(statuses[0].full - (statuses[0].full > 3 ? 3 : 1));
        for (PreparedFrame& frame : frames) frame.settle();
    }
};

TEST_F(DegradedStatusTest, MailboxStatusBitsComeInWhileDegradedWithOverlappedImages) {
    group.config.overlapped = true;
    prepare_frames();
    const std::uint32_t bit = slaves[0].image.mailbox_status_bit;
    ASSERT_NE(bit, SlaveImage::kNone);
    degrade();
    ASSERT_EQ(group.datagrams.size(), 2U);
    EXPECT_EQ(group.datagrams[1].expected, 1U);
    for (const bool full : {true, false, true}) {
        ASSERT_TRUE(send_cycle(group, engine.link(), now += 1ms).ok());
        Octets back = with_status(reply_to(nic.sent.back(), group.datagrams[0].accepted));
        const std::size_t at = status_at();
        ASSERT_LT(at, back.size());
        const auto mask = static_cast<std::byte>(1U << (bit % 8));
        back[at] = full ? back[at] | mask : back[at] & ~mask;
        nic.incoming.push_back(back);
        const auto ended = end_cycle(group, engine.link(), engine.receive_cycle(group.prepared, now), now);
        EXPECT_EQ(ended.error().detail, Error::kOthersFresh);
        EXPECT_EQ((image[bit / 8] & mask) != std::byte{0}, full);
    }
}

// Both slaves take part when the cycle is sent. When the cycle is received, the second slave is known to be lost, and
// the octets for its inputs contain the sent octets.
TEST_F(DegradedStatusTest, ASlaveLostWhileTheCycleIsUnderWayKeepsItsInputs) {
    prepare_frames();
    const auto in = [&](std::size_t n) { return slaves[n].image.inputs.bytes[0]; };
    const auto cycle = [&](std::uint16_t wkc, std::uint8_t first, std::uint8_t second, bool lose) {
        EXPECT_TRUE(send_cycle(group, engine.link(), now += 1ms).ok());
        if (lose) degrade();
        Octets back = with_status(reply_to(nic.sent.back(), wkc));
        back[kDataAt + slaves[0].image.inputs.offset_bits / 8] = std::byte{first};
        if (second != 0) back[kDataAt + slaves[1].image.inputs.offset_bits / 8] = std::byte{second};
        nic.incoming.push_back(back);
        return end_cycle(group, engine.link(), engine.receive_cycle(group.prepared, now), now);
    };
    const std::uint16_t all = group.datagrams[0].full;
    ASSERT_TRUE(cycle(all, 0x11, 0x21, false).ok());
    EXPECT_EQ(in(1), std::byte{0x21});
    const auto short_one = cycle(static_cast<std::uint16_t>(all - 3), 0x12, 0, true);
    EXPECT_EQ(short_one.error().detail, Error::kOthersFresh);
    EXPECT_EQ(in(0), std::byte{0x12});
    EXPECT_EQ(in(1), std::byte{0x21});
    EXPECT_EQ(cycle(group.datagrams[0].accepted, 0x13, 0, false).error().detail, Error::kOthersFresh);
    EXPECT_EQ(in(0), std::byte{0x13});
    EXPECT_EQ(in(1), std::byte{0x21});
}

// The application lowers a slave to INIT and raises it to PREOP. Then the SyncManagers of process data are off. Active
// FMMUs would exchange plain memory and increment the working counter.
TEST(FreshInputs, NotOfASlaveThatWasTakenToPreopByHand) {
    for (const char* name : {"analog_io_4_2", "drive"}) {
        Bus bus;
        for (const char* device : {"coupler", name}) {
            const auto n = bus.segment.add(std::move(*sim::make_device(device)).assemble());
            ASSERT_TRUE(n == 0 ? bus.segment.connect_master({0, 0}) : bus.segment.connect({n - 1, 1}, {n, 0}));
        }
        bus.start();
        std::vector<std::byte> image(256);
        ASSERT_TRUE(config_map(*bus.ctx, image).ok());
        ASSERT_EQ(bus.to_op().state, AlState::op);
        ASSERT_TRUE(bus.cycle().ok());
        ASSERT_TRUE(inputs_fresh(*bus.ctx, 2));
        for (const AlState state : {AlState::init, AlState::preop}) {
            ASSERT_TRUE(writestate(*bus.ctx, 2, state).ok());
            ASSERT_EQ(statecheck(*bus.ctx, 2, state, 2s)->state, state);
            for (int n = 0; n < 100; ++n) {
                const auto wkc = bus.cycle();
                ASSERT_EQ(wkc.error().code, Errc::working_counter) << name << n;
                ASSERT_FALSE(inputs_fresh(*bus.ctx, 2)) << name << n;
            }
        }
        EXPECT_FALSE(all_right(*bus.ctx));
    }
}

}  // namespace
}  // namespace margay
