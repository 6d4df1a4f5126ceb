// Counts the system calls of a cycle.
#pragma once

#include <functional>

namespace margay::bench {

// System calls of one cycle: the difference of two runs in traced child processes. `prepare` is called in the child and
// returns the cycle, which returns false after an error; an empty function: the preparation failed. The result is
// negative when nothing could be counted.
[[nodiscard]] double calls_per_cycle(const std::function<std::function<bool()>()>& prepare);

}  // namespace margay::bench
