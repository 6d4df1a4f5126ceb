// What one source (CoE, SoE or the SII) contains about the process data SyncManagers of a slave.
#pragma once

#include <margay/slave.hpp>

#include <array>

namespace margay {

struct FoundSm {
    bool any = false;  // this is a process data SyncManager
    Direction direction = Direction::outputs;
    std::uint8_t pdos = 0;  // from the SII: number of PDOs
    std::uint32_t bits = 0;
};
using FoundSms = std::array<FoundSm, Slave::kSyncManagers>;  // by number of the SyncManager
// By number of the SyncManager: an assigned PDO that the dictionary does not describe; 0: there is none.
using UndescribedPdos = std::array<std::uint16_t, Slave::kSyncManagers>;

// One entry of a PDO that is exchanged, found while reading the slave's process data. Index 0: a gap.
struct FoundEntry {
    Direction direction = Direction::outputs;
    std::uint8_t sync_manager = 0;
    std::uint8_t pdo_place = 0;    // place of the PDO in the SyncManager, from 1
    std::uint8_t entry_place = 0;  // place of the entry in the PDO, from 1
    std::uint16_t pdo = 0;         // index of the PDO
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    std::uint8_t data_type = 0;     // CoE data type, if known
    std::uint32_t offset_bits = 0;  // from the start of the SyncManager's data
    std::uint32_t bits = 0;
};

// Receives all entries in their order, SyncManager by SyncManager.
class EntrySink {
  public:
    virtual void add(const FoundEntry& entry) = 0;
    // Completes the data type of an entry that another source has found.
    virtual void note_type(const FoundEntry& by_sii) = 0;
    // Deletes what was found in the slave.
    virtual void forget() = 0;

  protected:
    ~EntrySink() = default;
};

using SmTypes = std::array<SmType, Slave::kSyncManagers>;

}  // namespace margay
