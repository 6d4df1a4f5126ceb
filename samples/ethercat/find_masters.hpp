// Finds the masters of a call by the arguments, the environment, the applications and the service of this system.
#pragma once

#include "ethercat/call.hpp"

#include <vector>

namespace margay::ethercat {

// The first of these sources that exists:
// - the sources of --source, or the sockets of --attach;
// - the sources of MARGAY_MASTER0, MARGAY_MASTER1 …;
// - the sockets of the masters in /etc/margay/*.toml, by their numbers, and then all other /run/margay/*.sock;
// - the sources of the masters in /etc/margay/*.toml, when nothing serves a socket: margayd does not run.
// The result has only the masters that --master selects.
[[nodiscard]] Answer<std::vector<Master>> find_masters(const Arguments& arguments);

}  // namespace margay::ethercat
