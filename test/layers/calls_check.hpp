// Checks the table of calls in README.md, for users who come from SOEM or IgH.
#pragma once

#include "layers/source_tree.hpp"

#include <array>
#include <set>

namespace margay::layers {

// The identifiers in the code of a text, without line comments.
std::set<std::string> identifiers_of(std::string_view text);

// The names that the columns of the table may use: SOEM, IgH (without the prefix `ecrt_`), Margay.
using CallNames = std::array<std::set<std::string>, 3>;

// One line for each identifier in backticks, in the table below "Coming from SOEM or IgH", that its column must not
// use. A name of IgH may be a part of a longer name, because the table leaves out `ecrt_` and `ecrt_master_`.
Faults call_faults(const std::string& readme, const CallNames& names);

}  // namespace margay::layers
