// A flash memory for stored values that is never broken and needs no time.
#pragma once

#include "subdevice/stored_values.hpp"

#include <algorithm>
#include <vector>

namespace margay::subdevice::testing {

struct MemoryStore final : ValueStore {
    std::vector<std::byte> cells{};
    std::size_t load(MutableBytes into) override {
        if (cells.size() > into.size()) return 0;
        std::ranges::copy(cells, into.begin());
        return cells.size();
    }
    HookAnswer save(Bytes block, Time) override {
        cells.assign(block.begin(), block.end());
        return Abort::none;
    }
};

}  // namespace margay::subdevice::testing
