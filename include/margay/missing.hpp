// Which slaves may be missing.
#pragma once

#include <margay/context.hpp>

#include <cstdint>

namespace margay {

// Whether the absence of this slave is no error: the slave is optional (ExpectedSlave, SlaveConfiguration), or is a
// member of a hot connect group that is absent as a whole. False for a slave that only tolerate() permits to be
// missing, and for a slave that does not exist. For the thread that owns the context.
[[nodiscard]] bool may_be_missing(Context& ctx, std::uint16_t slave);

}  // namespace margay
