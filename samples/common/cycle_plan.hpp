// The cycle that an ENI requires: its period, the cycles in which each group is exchanged, and the clock that the cycle
// follows.
#pragma once

#include <margay/files/eni.hpp>
#include <margay/master_clock.hpp>

#include <optional>
#include <string>
#include <vector>

namespace margay::samples {

struct CyclePlan {
    Duration period = std::chrono::milliseconds(1);  // of the shortest cycle
    std::vector<unsigned> every{1};                  // group n is exchanged in each every[n]-th cycle
    // Set if the ENI uses distributed clocks. The cycle of the clocks' group then follows the reference clock, and its
    // frames pass half a cycle before SYNC0.
    std::optional<MasterClockSettings> clock{};
    std::string remark{};  // a sentence about a cycle that the clocks may not accept; empty: none
    std::string error{};   // why there is no plan; empty: there is one
};

// `eni`: nullptr, or the file with the groups. `cycle`: the cycle time that the user has requested; zero: the cycle
// time of the file, or 1 ms.
[[nodiscard]] CyclePlan plan_cycles(const files::EniConfiguration* eni, Duration cycle);

}  // namespace margay::samples
