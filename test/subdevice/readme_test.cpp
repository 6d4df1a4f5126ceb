// The device of ten lines in src/subdevice/README.md: these lines compile as they are, and the device works.
#include "subdevice/standard_device.hpp"

#include "subdevice/plain_esc.hpp"

#include <gtest/gtest.h>

namespace readme_device {
namespace {

using Board = margay::subdevice::testing::PlainEsc;
unsigned shown = 0xFFFF;
void set_lamps(unsigned lamps) { shown = lamps; }

using namespace margay;
using namespace margay::subdevice;
#include <readme_device.inc>

[[maybe_unused]] constexpr auto* kMain = &main;  // main() does not end, so the test does not call it

}  // namespace
}  // namespace readme_device

namespace margay::subdevice {
namespace {

using namespace testing;
using namespace readme_device;

AlStatus request(std::uint16_t control) {
    esc.al_control(control);
    (void)stack.device.step(esc.now());
    return esc.al_status();
}

TEST(ReadmeDevice, ShowsItsOutputsInOpAndNoneOutsideOfIt) {
    stack.device.start(esc.now());
    esc.configure(0, {0x1000, 128, 0x26, 1});
    esc.configure(1, {0x1080, 128, 0x22, 1});
    esc.configure(2, {0x1400, 2, 0x64, 1});
    ASSERT_EQ(request(2), (AlStatus{AlState::preop, false, 0}));
    ASSERT_EQ(request(4), (AlStatus{AlState::safeop, false, 0}));
    ASSERT_TRUE(esc.ecat_write(0x1400, raw({0x34, 0x12})));
    ASSERT_EQ(request(8), (AlStatus{AlState::op, false, 0}));
    ASSERT_TRUE(esc.ecat_write(0x1400, raw({0x78, 0x56})));
    (void)stack.device.step(esc.now());
    EXPECT_EQ(shown, 0x5678U);
    ASSERT_EQ(request(1), (AlStatus{AlState::init, false, 0}));
    EXPECT_EQ(shown, 0U);
}

}  // namespace
}  // namespace margay::subdevice
