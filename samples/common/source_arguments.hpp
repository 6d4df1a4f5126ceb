// SOURCE on the command line: the arguments that belong to it, and a function that executes a program on it.
#pragma once

#include "common/arguments.hpp"
#include "common/source.hpp"

#include <functional>
#include <string>

namespace margay::samples {

struct SourceArguments {
    std::string source{};
    SourceOptions options{};
    bool take_over = false;
};

// The forms of SOURCE, for --help. The text about a recording is for programs that record by --record.
[[nodiscard]] std::string source_text();
// The same for a program that needs real time: interfaces only.
[[nodiscard]] std::string interface_text();

// Adds SOURCE, --record, --trace and --take-over. `more` is text about other SOURCEs that this program accepts.
void add_source_arguments(Arguments& arguments, SourceArguments& values, const std::string& more = {});
// The same for a program that takes interfaces only.
void add_interface_arguments(Arguments& arguments, SourceArguments& values);

// The network interfaces of this system, and the ready-made segments with `prefix` ("sim:") before each name, one per
// line.
[[nodiscard]] std::string list_of_interfaces();
[[nodiscard]] std::string list_of_segments(const std::string& prefix);

// The reason why a program must not scan the segment: slaves are in SAFEOP or OP, or there is no link. Empty: it may
// scan. Reads the AL status of all slaves, before init().
[[nodiscard]] std::string scan_refusal(Source& source);

// Opens the source, executes `body`, closes the source and returns the exit code. Reports errors of the source on
// standard error. Refuses a segment on an interface when slaves are in SAFEOP or OP, unless --take-over is given:
// another master may be running them, and `body` begins with a scan, which puts all slaves to INIT.
int run_on_source(const SourceArguments& values, const std::function<int(Source&)>& body);

}  // namespace margay::samples
