#include "system_calls.hpp"

#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <optional>

namespace margay::bench {
namespace {

// The number of system calls of a child process between two stops that the child makes.
std::optional<long> calls_between_stops(pid_t child) {
    int status = 0;
    if (::waitpid(child, &status, 0) != child || !WIFSTOPPED(status)) return std::nullopt;
    (void)::ptrace(PTRACE_SETOPTIONS, child, nullptr, PTRACE_O_TRACESYSGOOD);
    long stops = 0;
    for (;;) {
        if (::ptrace(PTRACE_SYSCALL, child, nullptr, nullptr) != 0) return std::nullopt;
        if (::waitpid(child, &status, 0) != child || WIFEXITED(status)) return std::nullopt;
        if (!WIFSTOPPED(status)) continue;
        if (WSTOPSIG(status) == SIGSTOP) return stops / 2;  // one stop at the entry of a call, one at the exit
        if (WSTOPSIG(status) == (SIGTRAP | 0x80)) ++stops;
    }
}

// System calls for this number of cycles, counted in a traced child process; negative when tracing is not possible.
long count_calls(const std::function<std::function<bool()>()>& prepare, unsigned cycles) {
    const pid_t child = ::fork();
    if (child == 0) {
        {
            const auto cycle = prepare();
            if (!cycle || ::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0) ::_exit(1);
            (void)::raise(SIGSTOP);
            for (unsigned n = 0; n < cycles; ++n)
                if (!cycle()) ::_exit(1);
            (void)::raise(SIGSTOP);
        }
        ::_exit(0);
    }
    const auto calls = calls_between_stops(child);
    // The child removes the program that it has attached to the far end of the cable.
    if (calls) (void)::ptrace(PTRACE_DETACH, child, nullptr, nullptr);
    if (!calls) (void)::kill(child, SIGKILL);
    (void)::waitpid(child, nullptr, 0);
    return calls.value_or(-1);
}

}  // namespace

double calls_per_cycle(const std::function<std::function<bool()>()>& prepare) {
    constexpr unsigned kCycles = 500;
    const long once = count_calls(prepare, kCycles);
    const long twice = count_calls(prepare, 2 * kCycles);
    return once < 0 || twice < 0 ? -1 : static_cast<double>(twice - once) / kCycles;
}

int check_calls(double calls, int most) {
    constexpr int kSkipped = 77;
    if (calls < 0) {
        std::printf("nothing was counted: no cable, or no permission to watch a process\n");
        return kSkipped;
    }
    std::printf("%.3f system calls a cycle, %d at most\n", calls, most);
    return calls <= most ? 0 : 1;
}

}  // namespace margay::bench
