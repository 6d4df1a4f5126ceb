// Functions that every program uses: exit codes, messages, output with error detection, signals.
#pragma once

#include <fmt/core.h>

#include <functional>
#include <string_view>

namespace margay::samples {

// The exit codes of the programs. Every --help lists them.
namespace exit_code {
inline constexpr int kWell = 0;
inline constexpr int kSegment = 1;  // an error of the segment or a device
inline constexpr int kUsage = 2;    // wrong arguments
inline constexpr int kSystem = 3;   // an error of an interface, a file or a permission, or lost output
}  // namespace exit_code

// The exit codes in one line, for --help.
inline constexpr std::string_view kExitCodeText =
    "Exit codes: 0 no error; 1 error of the segment or a device; 2 wrong arguments; 3 system error (interface, file, "
    "permission, lost output).";

// Writes to standard output. Never throws. After a failed write nothing more is written, and output_lost() returns
// true. run_program() then ends the program with exit_code::kSystem.
void write_out(std::string_view text);
// Passes buffered output to the operating system.
void flush_out();
[[nodiscard]] bool output_lost();

// The same for a text for people, see visible().
void print_text(std::string_view text);
// Writes formatted text for people to standard output, with the format of fmt::print().
template <class... T>
void print_out(fmt::format_string<T...> format, T&&... values) {
    print_text(fmt::vformat(format, fmt::make_format_args(values...)));
}

// Writes "PROGRAM: MESSAGE" and a line end to standard error, and returns `code`, for `return fail("…");`. Never
// throws.
int fail(std::string_view message, int code = exit_code::kSegment);
// Writes the same line as fail(), for a program that continues.
void warn(std::string_view text);

// Passes all messages of fail() and warn() to this function, for a program that does not write them to standard error.
// Any thread may call it; `text` has no line end. nullptr: messages go to standard error.
using MessageWriter = void (*)(std::string_view text);
void write_messages_by(MessageWriter writer);

// From this call on, SIGINT and SIGTERM only set a flag, so that a program can put the segment to a safe state before
// it ends.
void stop_at_signals();
// True after such a signal, and when standard output is lost.
[[nodiscard]] bool stop_asked();

// Executes `body` as the program `name` and returns the exit code of `body`, or exit_code::kSystem after an exception
// or lost output. If memory is exhausted where no exception can pass, the program ends at once with exit_code::kSystem.
// SIGPIPE is ignored: a closed pipe is a write error. Standard streams that the caller has closed are replaced by
// /dev/null, so that no file or socket gets their numbers. Writing to them is an error.
int run_program(std::string_view name, const std::function<int()>& body);

}  // namespace margay::samples
