// margayd with an ENI that uses distributed clocks: the cycle follows the reference clock.
#include "service/service_fixture.hpp"

#include "process/made_eni.hpp"

namespace margay::process {
namespace {

using namespace std::chrono_literals;

const std::string kClockedSlaves = "sim:coupler,drive,drive";

TEST_F(ServiceTest, TheCycleFollowsTheReferenceClockOfAnEni) {
    folder.write("etc/machine.xml", clocked_eni(kClockedSlaves, 2, 2ms));
    // A machine that runs tests is late by tens of microseconds. A wrong sign or a wrong phase misses half a period,
    // 1000.
    configure("a.toml",
              "source = \"" + kClockedSlaves + "\"\neni = \"machine.xml\"\npriority = 50\nin_sync_us = 400\n");
    const auto ran = shell(
        "start; says 'in each cycle of 2000 '; sleep 0.5\n"
        "if grep 'no real-time policy' log; then stop; exit 77; fi\n"
        "says 'a: all is right: 3 slaves in OP'; says 'a: cycle in sync'; stop\n");
    if (ran.status == 77) GTEST_SKIP() << "the cycle would be too late for the clocks: " << ran.out;
    EXPECT_EQ(ran.status, 0) << ran.err << content_of(folder.path() / "log");
}

}  // namespace
}  // namespace margay::process
