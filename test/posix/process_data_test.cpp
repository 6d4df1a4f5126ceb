// Process data in real time with PosixOsal: the waits of the master end when a reply has arrived, and several slaves
// reach OP. No result depends on a duration, because other programs may delay the test.
#include "sim/process_data.hpp"
#include "osal/posix/posix_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "process_data/io_image.hpp"
#include "sim/devices.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <gtest/gtest.h>

namespace margay {
namespace {

using namespace std::chrono_literals;

class PosixProcessData : public testing::Test {
  protected:
    static constexpr std::uint32_t kSlaves = 3;

    void SetUp() override {
        for (std::uint32_t n = 0; n < kSlaves; ++n) {
            (void)segment.add(sim::device_from_sii(io_image(16, 16)).assemble());
            ASSERT_TRUE(n == 0 ? segment.connect_master({0, 0}) : segment.connect({n - 1, 1}, {n, 0}));
        }
        segment.power_up(osal.now());
        ASSERT_TRUE(init(ctx, nic, osal));
        ASSERT_EQ(*config_init(ctx), kSlaves);
        ASSERT_TRUE(config_map(ctx, image));
        ASSERT_TRUE(reach(ctx, AlState::op, 60s, {.period = 2ms}));
        ASSERT_TRUE(submit(ctx, supervision));
    }
    sim::ProcessDataFirmware& device(std::uint32_t number) {
        return static_cast<sim::ProcessDataFirmware&>(*segment.slave(number - 1).firmware());
    }
    // Executes cycles until `done` returns true. Returns false after one minute.
    template <class Done>
    bool cycle_until(Done done) {
        const Time limit = osal.now() + 60s;
        const auto ended =
            run_cycle(ctx, {.period = 2ms}, [&](const CycleInfo& info) { return !done(info) && osal.now() < limit; });
        return ended.ok() && osal.now() < limit;
    }

    PosixOsal osal;
    sim::Segment segment;
    SimulatedNic nic{segment, osal};
    HostContext ctx{Limits{.slaves = 8}};
    SuperviseRequest supervision;
    std::array<std::byte, 64> image{};
};

TEST_F(PosixProcessData, GoesBothWays) {
    for (std::uint32_t n = 1; n <= kSlaves; ++n) {
        ctx.slave(n).image.outputs.bytes[0] = static_cast<std::byte>(0x10 + n);
        device(n).inputs()[0] = static_cast<std::byte>(0x20 + n);
        device(n).poke();
    }
    ASSERT_TRUE(cycle_until([&](const CycleInfo&) {
        bool all = true;
        for (std::uint32_t n = 1; n <= kSlaves; ++n)
            all = all && ctx.slave(n).image.inputs.bytes[0] == static_cast<std::byte>(0x20 + n) &&
                  device(n).outputs()[0] == static_cast<std::byte>(0x10 + n);
        return all;
    }));
}

TEST_F(PosixProcessData, ASlaveThatLosesItsPowerIsMissedAndComesBack) {
    segment.set_power(1, false, osal.now());
    ASSERT_TRUE(cycle_until([&](const CycleInfo&) { return ctx.slave(2).al.state == AlState::none; }));
    EXPECT_EQ(ctx.slave(1).al.state, AlState::op);
    segment.set_power(1, true, osal.now());
    ASSERT_TRUE(cycle_until([&](const CycleInfo&) { return all_right(ctx); }));
    for (std::uint32_t n = 1; n <= kSlaves; ++n) EXPECT_EQ(ctx.slave(n).al.state, AlState::op) << n;
}

}  // namespace
}  // namespace margay
