// Vendor specific profile over EtherCAT: the data of a mailbox message of type VoE (ETG.1000.6 "Vendor specific
// protocol").
#pragma once

#include "util/bytes.hpp"

namespace margay::wire::voe {

struct Layout {
    using vendor_id = Field<std::uint32_t, 0>;
    using vendor_type = Field<std::uint16_t, 4>;
};
inline constexpr std::size_t kHeaderBytes = 6;  // followed by the data

}  // namespace margay::wire::voe
