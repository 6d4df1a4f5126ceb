// What one source says of a slave's SyncManagers of process data.
#pragma once

#include <margay/slave.hpp>

#include <array>

namespace margay {

struct FoundSm {
    bool any = false;  // it is one of process data
    Direction direction = Direction::outputs;
    std::uint8_t pdos = 0;  // by the SII: how many were counted
    std::uint32_t bits = 0;
};
using FoundSms = std::array<FoundSm, Slave::kSyncManagers>;  // by number
using SmTypes = std::array<SmType, Slave::kSyncManagers>;

}  // namespace margay
