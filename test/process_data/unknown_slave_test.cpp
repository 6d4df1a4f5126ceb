// Slaves below an unknown slave. Their places do not identify them until the unknown slave is removed.
#include "process_data/identities.hpp"

#include <margay/run.hpp>

namespace margay {
namespace {

// Another product is put in the place of slave 2 by mistake. {expect() has a list, how often slave 3 loses its power}.
struct BelowAnUnknownSlave : Identities, testing::WithParamInterface<std::pair<bool, int>> {
    void SetUp() override {
        listed = GetParam().first;
        build();
        ASSERT_TRUE(submit(*ctx, supervision).ok());
        cycles(300);
        (void)events();
        take_out(line[1]);
        power(tool, true);
        put_in(tool);
        cycles(2000);
        for (int n = 0; n < GetParam().second; ++n) {
            power(line[2], false);
            cycles(1000);
            power(line[2], true);
            cycles(3000);
        }
    }
    void mend() {
        take_out(tool);
        put_in(line[1]);
    }
};
TEST_P(BelowAnUnknownSlave, ASlaveComesBackWhenTheMistakeIsMended) {
    EXPECT_EQ(ctx->slave(3).al.state, AlState::none) << "its place does not say which slave it is";
    EXPECT_FALSE(all_right(*ctx));
    mend();
    EXPECT_TRUE(until([&] { return in_op(2) && in_op(3); }, 5000)) << joined(events());
    cycles(10);
    EXPECT_TRUE(all_right(*ctx)) << in_words(what_is_wrong(*ctx));
    expect_exchanged(2, line[1]);
    expect_exchanged(3, line[2]);
}
TEST_P(BelowAnUnknownSlave, ItIsReportedOnce) {
    cycles(10'000);
    const auto said = events();
    EXPECT_EQ(told(said, "product 0x00000102"), GetParam().second) << joined(said);
    EXPECT_FALSE(gets_outputs(tool));
}
// Another device is in the place of slave 3 when slave 2 is back. This device is not a known slave.
TEST_P(BelowAnUnknownSlave, AnotherDeviceStaysAStranger) {
    const auto other = make({.product = 0x777});
    power(other, true);
    take_out(line[2]);
    ASSERT_TRUE(segment.connect({tool, 1}, {other, 0}));
    cycles(3000);
    take_out(tool);
    ASSERT_TRUE(segment.connect({line[0], 1}, {line[1], 0}));
    segment.disconnect({other, 0});
    ASSERT_TRUE(segment.connect({line[1], 1}, {other, 0}));
    EXPECT_TRUE(until([&] { return in_op(2); }, 5000)) << joined(events());
    EXPECT_FALSE(gets_outputs(other));
    EXPECT_EQ(ctx->slave(3).al.state, AlState::none);
    EXPECT_FALSE(all_right(*ctx));
}
INSTANTIATE_TEST_SUITE_P(ListAndLosses, BelowAnUnknownSlave,
                         testing::Values(std::pair{true, 1}, std::pair{false, 1}, std::pair{true, 2}));

}  // namespace
}  // namespace margay
