// The osal of tests without threads: VirtualOsal with virtual time; PosixOsal with real time in the program test_posix.
#pragma once

#ifdef MARGAY_TEST_POSIX
#include "osal/posix/posix_osal.hpp"

namespace margay {
using TestOsal = PosixOsal;
}
// Other programs may delay a test, so an operation in real time lasts as long as in virtual time or longer.
#define EXPECT_LASTS(duration, least) EXPECT_GE(duration, least)
#else
#include "osal/virtual/virtual_osal.hpp"

namespace margay {
using TestOsal = VirtualOsal;
}
#define EXPECT_LASTS(duration, exactly) EXPECT_EQ(duration, exactly)
#endif
