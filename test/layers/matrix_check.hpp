// The support matrix of README.md is held to its word: what works is proved by tests that exist.
#pragma once

#include "layers/source_tree.hpp"

namespace margay::layers {

// Rows that claim `works` without naming a test, and tests that are named but not there. A name is
// FOLDER/SUITE or FOLDER/SUITE.TEST in backticks, its end may be left open by "…"; for what is no GoogleTest
// (install/, embedded/, clang/, fuzz/, bench_NAME) a file or folder of test/ has to stand for it.
Faults matrix_faults(const std::string& readme, const SourceTree& tree);

}  // namespace margay::layers
