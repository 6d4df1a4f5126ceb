// The segment of a master, by its number.
#pragma once

#include "source/source.hpp"

#include <string>

namespace margay::compat::ecrt {

// The SOURCE that the user has bound to a master: that of the environment variable MARGAY_MASTER<index>, otherwise of
// the line `MARGAY_MASTER<index>=SOURCE` of the file that MARGAY_MASTERS names (without it /etc/margay/masters.conf).
// Lines of the file that begin with # are comments. Empty if nothing is bound.
[[nodiscard]] std::string bound_source(unsigned index);

// Opens a SOURCE in the time of the system, because the programs have threads. A recording is refused: it has a time of
// its own.
[[nodiscard]] hosted::OpenedSource open_segment(const std::string& source);

}  // namespace margay::compat::ecrt
