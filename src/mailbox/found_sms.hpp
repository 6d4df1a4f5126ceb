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

// An entry of a PDO that is exchanged, as a walk over the slave's process data comes upon it. Index 0: a gap.
struct FoundEntry {
    Direction direction = Direction::outputs;
    std::uint8_t sync_manager = 0;
    std::uint8_t pdo_place = 0;    // which PDO of the SyncManager, 1 the first
    std::uint8_t entry_place = 0;  // which entry of the PDO, 1 the first
    std::uint16_t pdo = 0;         // its index
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    std::uint8_t data_type = 0;     // of CoE, where it is told
    std::uint32_t offset_bits = 0;  // from the start of the SyncManager's data
    std::uint32_t bits = 0;
};

// Gets all entries of a walk, SyncManager by SyncManager, in their order.
class EntrySink {
  public:
    virtual void take(const FoundEntry& entry) = 0;

  protected:
    ~EntrySink() = default;
};

using SmTypes = std::array<SmType, Slave::kSyncManagers>;

}  // namespace margay
