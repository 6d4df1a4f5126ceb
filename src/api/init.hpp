// The part of init() that init_redundant() has in common with it.
#pragma once

#include "api/master.hpp"

#include <margay/features.hpp>

namespace margay {

// Places the master in `memory`, which belongs to the context.
Result<> init_in(Context& ctx, std::span<std::byte> memory, Nic& nic, Osal& osal, const Features& features);

}  // namespace margay
