// The support matrix of README.md and the field notes of test/README.md are held to their word: what works is proved by
// tests that exist.
#pragma once

#include "layers/source_tree.hpp"

namespace margay::layers {

// Rows that claim `works` without naming a test, and tests that are named but not there. A name is
// FOLDER/SUITE or FOLDER/SUITE.TEST in backticks, its end may be left open by "…"; for what is no GoogleTest
// (install/, embedded/, clang/, fuzz/, bench_NAME) a file or folder of test/ has to stand for it. `file` is what the
// text is of.
Faults matrix_faults(const std::string& text, const SourceTree& tree, const std::string& file = "README.md");

// Threads of other stacks (`S#725`) that are named twice in a table, and rows with threads whose status is none of the
// three.
Faults thread_faults(const std::string& text, const std::string& file);

}  // namespace margay::layers
