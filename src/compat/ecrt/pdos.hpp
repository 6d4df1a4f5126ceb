// PDOs of a slave: as the program configures them, and as read from the slave.
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
    bool listed = false;  // the entries are known; otherwise the entries of the slave are used
    std::vector<PdoEntry> entries;
};

// A SyncManager with its PDOs.
struct SyncWish {
    bool set = false;         // by the program
    bool from_slave = false;  // the PDOs of the slave, because the program has set none
    ec_direction_t direction = EC_DIR_INVALID;
    ec_watchdog_mode_t watchdog = EC_WD_DEFAULT;
    std::vector<PdoWish> pdos;
};
using SyncWishes = std::array<SyncWish, EC_MAX_SYNC_MANAGERS>;

// The PDOs that were read from a slave: the PDOs that are assigned now, and all known entries of its PDOs.
struct KnownPdos {
    Identity identity;
    SyncWishes syncs;
    std::map<std::uint16_t, std::vector<PdoEntry>> offered;
    Error unread;  // why the slave could not be read; Errc::none: `syncs` is the assignment of the slave
};

// The direction of a SyncManager by its SII.
[[nodiscard]] ec_direction_t direction_of(const SmInfo& sm);

// Whether the slave has responded that it does not have the requested object. After other errors it is unknown whether
// the object exists.
[[nodiscard]] bool is_answer(const Error& error);

// The entries of one PDO, from `known` or from the object dictionary; empty: the slave has no such PDO. An error, which
// was printed: the slave could not be asked. Waits.
[[nodiscard]] Result<std::vector<PdoEntry>> read_pdo(Bus& bus, const Slave& slave, KnownPdos& known,
                                                     std::uint16_t index);

// The PDOs of the slave at this position from its object dictionary, otherwise from its SII. The slave is read once.
// After a failure it is read again only with `again`. Waits; not for the cyclic thread.
[[nodiscard]] std::shared_ptr<KnownPdos> pdos_of(Bus& bus, const Slave& slave, bool again = false);
// The result of an earlier pdos_of(); nullptr: there is none, or the slave could not be read.
[[nodiscard]] std::shared_ptr<KnownPdos> kept_pdos(Bus& bus, const Slave& slave);
// To be called when the PDOs of the slave at this position of the ring (the first is 0) have changed or may have
// changed.
void forget_pdos(Bus& bus, std::uint16_t position);
// Calls forget_pdos() at activation if the lists that the program sets for the slave differ from the known lists, or if
// the program writes the lists as objects.
void forget_changed_pdos(Bus& bus, const Slave& slave, const ec_slave_config& config);

// The object is a PDO, or a list of the PDOs of a SyncManager.
[[nodiscard]] constexpr bool is_of_pdos(std::uint16_t index) {
    return (index >= 0x1600 && index <= 0x1BFF) || (index >= 0x1C10 && index <= 0x1C2F);
}

}  // namespace margay::compat::ecrt
