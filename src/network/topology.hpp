// Who hangs at which port of whom, from the DL status of each slave.
#pragma once

#include <margay/result.hpp>
#include <margay/slave.hpp>

#include <span>

namespace margay {

// Fills ports, parent, parent_port and entry_port of all slaves, which are in ring order with dl_status and
// port types read. A frame leaves a slave by its open ports in the order 0, 3, 1, 2 (ESC datasheets, "Frame
// processing order"). Error: Errc::unstable (Step::topology) naming the first slave that has no open port
// left to hang at, or whose open port leads nowhere.
Result<> find_topology(std::span<Slave> slaves);

}  // namespace margay
