// SOURCE on the command line: the arguments that belong to it, and how a program runs on one.
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

// SOURCE, --record, --trace and --take-over. `more` is what else this program takes as a SOURCE.
void add_source_arguments(Arguments& arguments, SourceArguments& values, const std::string& more = {});

// The network interfaces of this system, and the ready-made segments behind `prefix` ("sim:"), a line each.
[[nodiscard]] std::string list_of_interfaces();
[[nodiscard]] std::string list_of_segments(const std::string& prefix);

// Opens the source, runs `body`, closes the source and returns the exit code. What is wrong with the source is told on
// standard error. A segment on an interface with slaves in SAFEOP or OP is refused, unless --take-over is given:
// another master may be running it, and `body` begins with a scan, which puts all slaves to INIT.
int run_on_source(const SourceArguments& values, const std::function<int(Source&)>& body);

}  // namespace margay::samples
