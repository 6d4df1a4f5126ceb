// Two implementations of Osal: virtual time, and Linux.
#include "osal/linux/linux_osal.hpp"
#include "osal/virtual/virtual_osal.hpp"

#include <gtest/gtest.h>

#include <sys/socket.h>
#include <unistd.h>

#include <thread>

namespace margay {
namespace {

using namespace std::chrono_literals;

TEST(VirtualOsal, MovesOnlyWhenTold) {
    VirtualOsal osal(Time(5s));
    EXPECT_EQ(osal.now(), Time(5s));
    EXPECT_EQ(osal.now(), Time(5s));
    osal.advance(3ns);
    EXPECT_EQ(osal.now(), Time(5s + 3ns));
    osal.advance(-1s);
    EXPECT_EQ(osal.now(), Time(5s + 3ns));
}

TEST(VirtualOsal, WaitJumpsForwardOnly) {
    VirtualOsal osal(Time(5s));
    osal.wait(Time(7s), -1);
    EXPECT_EQ(osal.now(), Time(7s));
    osal.wait(Time(6s), -1);
    EXPECT_EQ(osal.now(), Time(7s));
    osal.wait(kNever, -1);
    EXPECT_EQ(osal.now(), Time(7s));
}

TEST(LinuxOsal, WaitsUntilTheTimeAndNotLess) {
    LinuxOsal osal;
    const Time start = osal.now();
    osal.wait(start + 2ms, -1);
    EXPECT_GE(osal.now(), start + 2ms);
    const Time later = osal.now();
    osal.wait(start, -1);  // in the past
    EXPECT_LT(osal.now() - later, 1s);
}

TEST(LinuxOsal, AFrameEndsTheWait) {
    int pair[2];
    ASSERT_EQ(::socketpair(AF_UNIX, SOCK_DGRAM, 0, pair), 0);
    ASSERT_EQ(::send(pair[0], "x", 1, 0), 1);
    LinuxOsal osal;
    const Time start = osal.now();
    osal.wait(start + 30s, pair[1]);
    EXPECT_LT(osal.now() - start, 20s);
    ::close(pair[0]);
    ::close(pair[1]);
}

TEST(LinuxOsal, WakeOfAnotherThreadEndsAWaitForEver) {
    LinuxOsal osal;
    std::thread waker([&] { osal.wake(); });
    osal.wait(kNever, -1);  // the test hangs here when the wake-up is lost
    waker.join();
}

TEST(LinuxOsal, OneWakeEndsOneWait) {
    LinuxOsal osal;
    osal.wake();
    osal.wake();
    const Time start = osal.now();
    osal.wait(start + 30s, -1);
    EXPECT_LT(osal.now() - start, 20s);
    const Time again = osal.now();
    osal.wait(again + 2ms, -1);
    EXPECT_GE(osal.now(), again + 2ms);
}

}  // namespace
}  // namespace margay
