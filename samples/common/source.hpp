// Makes a header of the library part `source` available to the programs.
#pragma once

#include "source/source.hpp"

namespace margay::hosted {}
namespace margay::samples {
using namespace hosted;
}  // namespace margay::samples
