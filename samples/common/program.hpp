// What every program does in the same way: exit codes, messages, output that must not be lost, signals.
#pragma once

#include <fmt/core.h>

#include <functional>
#include <string_view>

namespace margay::samples {

// What a program ends with. Every --help lists these codes.
namespace exit_code {
inline constexpr int kWell = 0;
inline constexpr int kSegment = 1;  // the segment or a device
inline constexpr int kUsage = 2;    // the arguments
inline constexpr int kSystem = 3;   // an interface, a file, a permission, or output that was lost
}  // namespace exit_code

// The exit codes in one line, for --help.
inline constexpr std::string_view kExitCodeText =
    "Exit codes: 0 well; 1 the segment or a device; 2 usage; 3 the system (interface, file, permission, lost output).";

// Writes to standard output. Never throws: after a write that failed nothing more is written, and output_lost() is
// true. run_program() then ends the program with exit_code::kSystem.
void write_out(std::string_view text);
// Hands buffered output to the system.
void flush_out();
[[nodiscard]] bool output_lost();

// The same with a format, as fmt::print().
template <class... T>
void print_out(fmt::format_string<T...> format, T&&... values) {
    write_out(fmt::vformat(format, fmt::make_format_args(values...)));
}

// Writes "PROGRAM: TEXT" and a line end to standard error, and returns `code`: `return fail("…");`. Never throws.
int fail(std::string_view text, int code = exit_code::kSegment);
// The same where the program goes on.
void warn(std::string_view text);

// SIGINT and SIGTERM are remembered from here on, so that a program can leave the segment in a safe state.
void stop_at_signals();
// True after such a signal, and when standard output is lost: nobody sees the rest.
[[nodiscard]] bool stop_asked();

// Runs `body` as the program `name` and returns the exit code: the one of `body`, or exit_code::kSystem after an
// exception (memory, as a rule) and when output was lost. A closed pipe is an error of a write, not a signal.
int run_program(std::string_view name, const std::function<int()>& body);

}  // namespace margay::samples
