// Checks the support matrix (test/matrix.md) and the field notes of test/README.md: each claim must name tests that
// exist.
#pragma once

#include "layers/source_tree.hpp"

namespace margay::layers {

// Rows that claim `works` without a test name, and named tests that do not exist. A name is FOLDER/SUITE or
// FOLDER/SUITE.TEST in backticks; its end can be replaced by "…". For bench_NAME and fuzz/NAME the source must exist.
// All names that begin with install/ are accepted. The other tests that are not GoogleTests are listed in
// matrix_check.cpp. `file`: the name of the file, for messages.
Faults matrix_faults(const std::string& text, const SourceTree& tree, const std::string& file = "README.md");

// Threads of other stacks (`S#725`) that occur twice in a table, and rows with threads whose status is none of the
// three status words.
Faults thread_faults(const std::string& text, const std::string& file);

}  // namespace margay::layers
