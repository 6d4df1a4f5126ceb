// Categories of the SII, from the view of an ESI.
#pragma once

#include "wire/sii.hpp"

#include <algorithm>
#include <array>

namespace margay::files {

// Whether the category is made from the description of the device. An ESI contains all other categories unchanged.
[[nodiscard]] inline bool is_described_category(std::uint16_t type) {
    namespace category = wire::sii::category;
    static constexpr std::array kDescribed{category::kStrings,     category::kGeneral, category::kFmmu,
                                           category::kSyncManager, category::kTxPdo,   category::kRxPdo,
                                           category::kDc,          category::kEnd};
    return std::ranges::find(kDescribed, type) != kDescribed.end();
}

}  // namespace margay::files
