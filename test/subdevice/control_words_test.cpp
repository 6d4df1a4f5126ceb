// Every AL control word in every state, with and without an error: the answer is always a state of the standard, an
// error always has a code, and the SyncManagers follow the state.
#include "bench_device.hpp"

namespace margay::subdevice {
namespace {

using namespace testing;

// Brings the device to a state, with an error indication if wanted.
void bring(Bench& bench, AlState state, bool error) {
    (void)bench.request(0x11);
    bench.configure(128);
    for (const unsigned to : {2U, 4U, 8U}) {
        if (to > static_cast<unsigned>(state)) break;
        if (to == 8) {
            ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
            (void)bench.step();
        }
        (void)bench.request(static_cast<std::uint16_t>(to));
    }
    if (error) (void)bench.request(0x0F);
    ASSERT_EQ(bench.esc.al_status().state, state);
    ASSERT_EQ(bench.esc.al_status().error, error);
}

class ControlWords : public ::testing::TestWithParam<std::tuple<AlState, bool>> {};
INSTANTIATE_TEST_SUITE_P(States, ControlWords,
                         ::testing::Combine(::testing::Values(AlState::init, AlState::preop, AlState::safeop,
                                                              AlState::op),
                                            ::testing::Bool()));

TEST_P(ControlWords, EachIsAnsweredInWordsOfTheStandard) {
    const auto [state, error] = GetParam();
    Bench bench;
    // The low octet, and one bit of the reserved high octet.
    for (unsigned word = 0; word < 0x200; ++word) {
        bring(bench, state, error);
        const auto before = bench.esc.al_status();
        const auto now = bench.request(static_cast<std::uint16_t>(word));
        const auto to = static_cast<AlState>(word & 0x0F);
        const bool acknowledge = (word & 0x10) != 0;
        EXPECT_TRUE(now.state == AlState::init || now.state == AlState::preop || now.state == AlState::safeop ||
                    now.state == AlState::op)
            << word;
        EXPECT_EQ(now.error, now.code != 0) << word;
        // The device reaches no state above the next state, and no higher state while there is an error.
        const bool next = now.state == AlState::preop
                              ? before.state == AlState::init
                              : static_cast<unsigned>(now.state) == 2 * static_cast<unsigned>(before.state);
        EXPECT_TRUE(now.state <= before.state || (next && (!error || acknowledge))) << word;
        if (!now.error) {
            EXPECT_TRUE(now.state == to || now.state == before.state) << word;
        }
        if (to == AlState::init && (acknowledge || !error || state != AlState::init)) {
            EXPECT_EQ(now, (AlStatus{AlState::init, false, 0})) << word;
        }
        EXPECT_EQ(bench.esc.locked(0), now.state == AlState::init) << word;
        EXPECT_EQ(bench.esc.locked(2), now.state < AlState::safeop) << word;
        // The device still works.
        EXPECT_EQ(bench.request(0x11), (AlStatus{AlState::init, false, 0})) << word;
    }
}

}  // namespace
}  // namespace margay::subdevice
