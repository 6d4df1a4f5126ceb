// A flash memory for stored values without faults. It needs no time, or it is busy for some calls. It finishes the
// block with which a command began.
#pragma once

#include "subdevice/stored_values.hpp"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

namespace margay::subdevice::testing {

struct MemoryStore final : ValueStore {
    std::vector<std::byte> cells{};
    std::size_t load(MutableBytes into) override {
        if (cells.size() > into.size()) return 0;
        std::ranges::copy(cells, into.begin());
        return cells.size();
    }
    HookAnswer save(Bytes block, Time now) override {
        if (!begun) begun.emplace(block.begin(), block.end());
        if (busy != 0) {
            --busy;
            return HookAnswer::later(now + std::chrono::milliseconds(1));
        }
        cells = *std::exchange(begun, std::nullopt);
        return Abort::none;
    }
    unsigned busy = 0;  // calls
    std::optional<std::vector<std::byte>> begun{};
};

}  // namespace margay::subdevice::testing
