// The loop of a polled device.
#include "bench_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;

int transitions = 0;

// What is pending is read in each step: nothing that comes between two of them is missed, nothing is done twice.
TEST(DeviceLoop, EachStepLooksAtTheEventsAnew) {
    Bench bench;
    transitions = 0;
    bench.application.transition_hook = [](Transition, Time) {
        ++transitions;
        return Verdict::go();
    };
    for (int round = 1; round <= 5; ++round) {
        for (const std::uint16_t state : {std::uint16_t{1}, std::uint16_t{2}}) {
            bench.settle();
            EXPECT_EQ(bench.request(state), (AlStatus{static_cast<AlState>(state), false, 0}));
            bench.settle();
        }
        EXPECT_EQ(transitions, 2 * round) << "one for each request";
        // A state is asked for and mail comes, between the same two steps.
        bench.esc.al_control(0x12);
        ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)));
        bench.settle();
        EXPECT_EQ(bench.receive().size(), wire::coe::kSdoBytes);
        bench.settle();
        EXPECT_TRUE(bench.fetch().empty());
        EXPECT_EQ(bench.esc.events() & (wire::al_event::kAlControl | wire::al_event::sync_manager(0)), 0U);
    }
}

}  // namespace
}  // namespace margay::subdevice
