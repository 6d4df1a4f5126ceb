// Of the library part `source`, for the programs.
#pragma once

#include "source/ready_made.hpp"

namespace margay::hosted {}
namespace margay::samples {
using namespace hosted;
}  // namespace margay::samples
