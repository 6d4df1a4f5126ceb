// The drive of the library with SYNC0: AL status codes when SYNC0 and the frames disagree (ETG.1020 "AL status codes":
// 0x0032 the slave is not synchronous although SYNC0 occurs, 0x0034 too many frames missing, 0x002C SYNC0 is lost).
#include "clock/clock_bus.hpp"

#include <margay/master_clock.hpp>

namespace margay {
namespace {

using namespace std::chrono_literals;

struct DriveSync : testing::Test, ClockBus {
    SlaveSetup every_ms{.dc = {.source = SyncSettings::Source::application, .sync0_cycle = 1ms}};
    Time due{};

    void bring_up() {
        auto drive = sim::make_device("drive");
        ASSERT_TRUE(drive);
        segment.add(std::move(*drive).assemble());
        ASSERT_TRUE(segment.connect_master({0, 0}));
        start();
        const auto reference = configdc(*ctx, kFewFrames);
        ASSERT_TRUE(reference.ok()) << words(reference.error());
        ctx->slave(1).config.setup = &every_ms;
        const auto mapped = config_map(*ctx, image);
        ASSERT_TRUE(mapped.ok()) << words(mapped.error());
        due = osal.now() + 10ms;
    }
    // Executes cycles whose frames pass the drive at `phase` of SYNC0, until `holds` returns true, at most `most`
    // cycles.
    template <class Holds>
    bool run_at(Duration phase, int most, Holds holds) {
        MasterClock clock({.set_value = phase, .phase = {.cycle = 1ms}});
        for (int n = 0; n < most && !holds(); ++n) {
            osal.wait(due, -1);
            (void)send_processdata(*ctx);
            (void)receive_processdata(*ctx, reply_timeout);
            const Duration earlier = clock.update(*ctx, Duration{0});
            (void)poll(*ctx, osal.now());
            due += 1ms - earlier;
        }
        return holds();
    }
    bool run_to_op(Duration phase) {
        (void)run_at(phase, 300, [] { return false; });  // the phase is right before OP is requested
        EXPECT_TRUE(submit(*ctx, supervision).ok());
        return run_at(phase, 2000, [this] { return in_op(1) || ctx->slave(1).al.error; });
    }
};

TEST_F(DriveSync, FramesBetweenTheSignalsLeadToOp) {
    bring_up();
    EXPECT_TRUE(run_to_op(-500us));
    EXPECT_TRUE(in_op(1)) << joined(events());
    EXPECT_FALSE(run_at(-500us, 2000, [this] { return !in_op(1); })) << joined(events());
}

TEST_F(DriveSync, FramesTogetherWithTheSignalAreAPllError) {
    bring_up();
    EXPECT_TRUE(run_to_op(-10us));
    EXPECT_FALSE(in_op(1));
    EXPECT_EQ(ctx->slave(1).al.code, 0x0032) << joined(events());
    EXPECT_TRUE(run_at(-500us, 4000, [this] { return in_op(1); })) << "another phase, and the supervision tries again";
}

TEST_F(DriveSync, FramesThatStopAreASyncTimeout) {
    bring_up();
    ASSERT_TRUE(run_to_op(-500us));
    ASSERT_TRUE(in_op(1)) << joined(events());
    supervision.cancel();
    osal.advance(8ms);
    (void)readstate(*ctx);
    EXPECT_EQ(ctx->slave(1).al.state, AlState::safeop);
    EXPECT_EQ(ctx->slave(1).al.code, 0x0034);
}

TEST_F(DriveSync, ASignalThatStopsIsAFatalSyncError) {
    bring_up();
    ASSERT_TRUE(run_to_op(-500us));
    ASSERT_TRUE(in_op(1)) << joined(events());
    constexpr std::array<std::byte, 1> kOff{};
    RegisterWriteRequest off;
    off.slave = 1;
    off.address = wire::reg::kSyncActivation.address;
    off.data = kOff;
    ASSERT_TRUE(submit(*ctx, off).ok());
    EXPECT_TRUE(run_at(-500us, 100, [this] { return ctx->slave(1).al.error; }));
    EXPECT_EQ(ctx->slave(1).al.code, 0x002C);
}

}  // namespace
}  // namespace margay
