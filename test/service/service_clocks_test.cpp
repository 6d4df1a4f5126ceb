// margayd with an ENI that uses distributed clocks: the cycle follows the reference clock.
#include "service/service_fixture.hpp"

#include "common/source.hpp"

#include <margay/files/eni.hpp>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>

namespace margay::process {
namespace {

using namespace std::chrono_literals;

const std::string kClockedSlaves = "sim:coupler,drive,drive";

// The ENI of these slaves, with SYNC0 in the second one.
std::string eni_with_clocks() {
    static constexpr SlaveSetup kSetup{.dc = {.source = SyncSettings::Source::application, .shift = 100us}};
    auto source = samples::open_source(kClockedSlaves);
    EXPECT_TRUE(source) << source.error();
    HostContext ctx;
    std::vector<std::byte> image(4096);
    EXPECT_TRUE(source->begin(ctx));
    EXPECT_TRUE(config_init(ctx));
    ctx.slave(2).config.setup = &kSetup;
    EXPECT_TRUE(configdc(ctx, {.cycle = 2ms}));
    EXPECT_TRUE(config_map(ctx, image));
    const auto written = files::write_eni(ctx, {.cycle = 2ms});
    EXPECT_TRUE(written) << written.error;
    return written.text;
}

TEST_F(ServiceTest, TheCycleFollowsTheReferenceClockOfAnEni) {
    folder.write("etc/machine.xml", eni_with_clocks());
    // A machine that runs tests is late by tens of microseconds. A wrong sign or phase misses half a period, 1000.
    configure("a.toml", "source = \"" + kClockedSlaves +
                            "\"\neni = \"machine.xml\"\npriority = 50\nin_sync_us = 400\n");
    const auto ran = shell(
        "start; says 'in each cycle of 2000 '; sleep 0.5\n"
        "if grep 'no real-time policy' log; then stop; exit 77; fi\n"
        "says 'a: all is right: 3 slaves in OP'; says 'a: cycle in sync'; stop\n");
    if (ran.status == 77) GTEST_SKIP() << "the cycle would be too late for the clocks: " << ran.out;
    EXPECT_EQ(ran.status, 0) << ran.err << content_of(folder.path() / "log");
}

}  // namespace
}  // namespace margay::process
