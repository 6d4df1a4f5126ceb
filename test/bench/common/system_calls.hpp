// Counts the system calls of a cycle.
#pragma once

#include <functional>

namespace margay::bench {

// System calls of one cycle: the difference of two runs in traced child processes. `prepare` is called in the child and
// returns the cycle function. The cycle function returns false after an error. If `prepare` returns an empty function,
// the preparation failed. The result is negative when nothing could be counted.
[[nodiscard]] double calls_per_cycle(const std::function<std::function<bool()>()>& prepare);

// Prints how many system calls a cycle needs, and returns the exit code of the test: 0, 1 (more than `most`), 77
// (skipped: nothing could be counted).
[[nodiscard]] int check_calls(double calls, int most);

}  // namespace margay::bench
