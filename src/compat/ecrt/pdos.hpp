// PDOs of a slave: as a program configures them, and as a slave offers them.
#pragma once

#include <margay/pdo.hpp>
#include <margay/slave.hpp>

#include <ecrt.h>

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

namespace margay::compat::ecrt {

class Bus;

// A PDO of a SyncManager.
struct PdoWish {
    std::uint16_t index = 0;
    bool listed = false;  // the entries are known; otherwise those of the slave
    std::vector<PdoEntry> entries;
};

// A SyncManager with its PDOs.
struct SyncWish {
    bool set = false;         // by the program
    bool from_slave = false;  // what the slave offers, because the program has set nothing
    ec_direction_t direction = EC_DIR_INVALID;
    ec_watchdog_mode_t watchdog = EC_WD_DEFAULT;
    std::vector<PdoWish> pdos;
};
using SyncWishes = std::array<SyncWish, EC_MAX_SYNC_MANAGERS>;

// What a slave offers: the PDOs that are assigned now, and the entries of all of its PDOs that are known.
struct KnownPdos {
    Identity identity;
    SyncWishes syncs;
    std::map<std::uint16_t, std::vector<PdoEntry>> offered;
};

// The direction of a SyncManager by its SII.
[[nodiscard]] ec_direction_t direction_of(const SmInfo& sm);

// Asks the slave: its object dictionary, otherwise its SII. Waits; not for the cyclic thread.
[[nodiscard]] KnownPdos read_pdos(Bus& bus, const Slave& slave);
// The entries of one PDO, from `known` or from the object dictionary; empty: not known. Waits.
[[nodiscard]] std::vector<PdoEntry> read_pdo(Bus& bus, const Slave& slave, KnownPdos& known, std::uint16_t index);

// What the slave at this position offers: asked once.
[[nodiscard]] std::shared_ptr<KnownPdos> pdos_of(Bus& bus, const Slave& slave);

}  // namespace margay::compat::ecrt
