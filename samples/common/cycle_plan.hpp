// In which cycles the groups of a segment are exchanged, when an ENI gives them different cycle times.
#pragma once

#include <margay/files/eni.hpp>

#include <string>
#include <vector>

namespace margay::samples {

struct CyclePlan {
    Duration period = std::chrono::milliseconds(1);  // of the shortest cycle
    std::vector<unsigned> every{1};                  // group n is exchanged in each every[n]-th cycle
    std::string error{};                             // why there is no plan; empty: there is one
};

// `eni`: nullptr, or the file with the groups. `cycle`: the wish of the user; zero: as the file says, or 1 ms.
[[nodiscard]] CyclePlan plan_cycles(const files::EniConfiguration* eni, Duration cycle);

}  // namespace margay::samples
