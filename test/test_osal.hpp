// The osal of tests without threads: virtual time. In the program test_posix, PosixOsal and the time of the clock.
#pragma once

#ifdef MARGAY_TEST_POSIX
#include "osal/posix/posix_osal.hpp"

namespace margay {
using TestOsal = PosixOsal;
}
// A machine can take time from a test, never give it time: what lasts `least` in virtual time lasts as long or longer.
#define EXPECT_LASTS(duration, least) EXPECT_GE(duration, least)
#else
#include "osal/virtual/virtual_osal.hpp"

namespace margay {
using TestOsal = VirtualOsal;
}
#define EXPECT_LASTS(duration, exactly) EXPECT_EQ(duration, exactly)
#endif
