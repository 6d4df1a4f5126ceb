// The osal of tests that need real time and real threads: LinuxOsal; PosixOsal in the program test_posix.
#pragma once

#ifdef MARGAY_TEST_POSIX
#include "osal/posix/posix_osal.hpp"

namespace margay {
using RealOsal = PosixOsal;
}
#else
#include "osal/linux/linux_osal.hpp"

namespace margay {
using RealOsal = LinuxOsal;
}
#endif
