#include "common/program.hpp"

#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <new>

namespace margay::samples {
namespace {

int exhaust_memory() { throw std::bad_alloc(); }
int fail_otherwise() { throw 1; }
// No exception can pass, as in a part of the library that is compiled without exceptions.
int pass_nothing(int (*call)()) noexcept { return call(); }

TEST(Program, WithoutMemoryEndsWithTheCodeOfASystemError) {
    const auto ended = testing::ExitedWithCode(exit_code::kSystem);
    EXPECT_EXIT(std::_Exit(run_program("demo", exhaust_memory)), ended, "^demo: out of memory\n$");
    const auto inside = [] { return pass_nothing(exhaust_memory); };
    EXPECT_EXIT(std::_Exit(run_program("demo", inside)), ended, "^demo: out of memory\n$");
}

TEST(Program, AFaultOfTheProgramStillAborts) {
    const auto inside = [] { return pass_nothing(fail_otherwise); };
    EXPECT_EXIT(std::_Exit(run_program("demo", inside)), testing::KilledBySignal(SIGABRT), "terminate");
}

}  // namespace
}  // namespace margay::samples
