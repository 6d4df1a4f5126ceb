// PDOs of a slave: as a program configures them, and as a slave offers them.
#pragma once

#include <margay/error.hpp>
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
    Error unread;  // why the slave could not be asked: then `syncs` is not what it has; Errc::none: it is
};

// The direction of a SyncManager by its SII.
[[nodiscard]] ec_direction_t direction_of(const SmInfo& sm);

// The slave has answered, and does not have what it was asked for. Other errors say nothing about that.
[[nodiscard]] bool is_answer(const Error& error);

// The entries of one PDO, from `known` or from the object dictionary; empty: the slave has no such PDO. An error, which
// was printed: the slave could not be asked. Waits.
[[nodiscard]] Result<std::vector<PdoEntry>> read_pdo(Bus& bus, const Slave& slave, KnownPdos& known,
                                                     std::uint16_t index);

// What the slave at this position offers, by its object dictionary, otherwise by its SII. The slave is asked once; when
// that has failed, again only with `again`. Waits; not for the cyclic thread.
[[nodiscard]] std::shared_ptr<KnownPdos> pdos_of(Bus& bus, const Slave& slave, bool again = false);
// What was read before; nullptr: nothing, or the slave could not be asked.
[[nodiscard]] std::shared_ptr<KnownPdos> kept_pdos(Bus& bus, const Slave& slave);
// The PDOs of the slave at this position of the ring, the first is 0, are or may be others now.
void forget_pdos(Bus& bus, std::uint16_t position);
// The same at activation, if the lists that the program sets for the slave are not those that are known, or if it
// writes them as objects.
void forget_changed_pdos(Bus& bus, const Slave& slave, const ec_slave_config& config);

// The object is a PDO, or a list of the PDOs of a SyncManager.
[[nodiscard]] constexpr bool is_of_pdos(std::uint16_t index) {
    return (index >= 0x1600 && index <= 0x1BFF) || (index >= 0x1C10 && index <= 0x1C2F);
}

}  // namespace margay::compat::ecrt
