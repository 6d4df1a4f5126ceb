// The part of init() that init_redundant() has in common with it.
#pragma once

#include "api/master.hpp"

#include <margay/features.hpp>

namespace margay {

// The memory of the context from its first octet with the maximum alignment on; Errc::capacity if it has less than
// context_bytes() octets.
Result<std::span<std::byte>> memory_of(Context& ctx);

// Places the master in `memory`, which is that of memory_of(), without what init_redundant() uses.
Result<> init_in(Context& ctx, std::span<std::byte> memory, Nic& nic, Osal& osal, const Features& features);

}  // namespace margay
