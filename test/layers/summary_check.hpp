// Compares the short list "What works" of README.md with the support matrix (test/matrix.md).
#pragma once

#include "layers/source_tree.hpp"

#include <span>

namespace margay::layers {

// An item of the short list, and the row of the matrix that has its status. An item may have several rows.
struct SummaryProof {
    std::string_view area;  // first column of the short list
    std::string_view item;  // the item; its end can be replaced by "…"
    std::string_view row;   // the beginning of the row of the matrix
};

// The faults of the short list in `readme`, compared with the matrix by `proofs`:
// - An item without a proof, and a proof whose item or row does not exist.
// - An item of the column "works" whose row does not have the status `works`. The status `partly` is allowed if the
//   last column of the same area has an item with that row.
// - A row of the matrix with the status `partly` or `planned` that no item of the last column has.
// - An item of the last column that says ": planned", and whose row is neither `planned` nor `partly`.
// Items of the column "works" are separated by commas and semicolons, items of the last column by semicolons and full
// stops.
Faults summary_faults(const std::string& readme, const std::string& matrix, std::span<const SummaryProof> proofs);

}  // namespace margay::layers
