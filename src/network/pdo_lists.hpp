// The lists of PDOs that the application wants: checks and sizes. Independent of the bus.
#pragma once

#include <margay/slave.hpp>
#include <margay/task.hpp>

#include <optional>

namespace margay {

class CheckValue;
class EntrySink;
struct Network;

// Checks the lists for contradictions: a SyncManager that the slave does not have, that is a mailbox or is listed
// twice; a PDO that is listed twice or has the other direction; entries without bits; a size that `slave.config.sms`
// contradicts. Code none: no contradiction.
[[nodiscard]] Error check_pdo_lists(const Slave& slave);

// Returns the list for a SyncManager; nullptr: there is none.
[[nodiscard]] const SmPdos* find_list(const Slave& slave, std::uint8_t sync_manager);

// Sum of the bits of all listed entries, and the number of PDOs without listed entries (`open`).
struct ListedBits {
    std::uint32_t bits = 0;
    std::size_t open = 0;
};
[[nodiscard]] ListedBits listed_bits(const SmPdos& list);

// Reserves the place in the image for a slave that cannot be read now: with the sizes of slave.config.sms if these are
// set, otherwise with the sizes of the PDO lists if these contain all entries. Returns whether the sizes are known;
// then slave.config.sms contains them, and slave.place_kept says that start addresses and control octets are still
// missing.
[[nodiscard]] bool keep_place(Slave& slave);
// Removes the values that keep_place() has written to slave.config. Call it before the slave is read.
void forget_kept_place(Slave& slave);
// Forgets the process data that the slave itself has described. Process data of the application stays.
void forget_described(Slave& slave);

// The direction of the PDOs in the list; by the SII if the list is empty.
[[nodiscard]] Direction direction_of(const Slave& slave, const SmPdos& list);

// Adds the whole content of the lists to a check value.
void add_lists(CheckValue& check, const Slave& slave);

// Whether the application, or one of its files, has set the SyncManagers of the process data.
[[nodiscard]] bool is_by_application(const SlaveConfiguration& config);

// The part of keep_place() that uses the lists.
[[nodiscard]] bool place_by_lists(Slave& slave);

// The functions for the PDO lists of a slave.
struct detail::PdoPart {
    Error (*check)(const Slave& slave);
    bool (*place)(Slave& slave);
    Task<Result<>> (*write)(Network& network, Slave& slave);
    Task<Result<>> (*walk)(Network& network, const Slave& slave, EntrySink& entries);
    void (*add_to)(CheckValue& check, const Slave& slave);
};
// nullptr: the slave has no lists.
[[nodiscard]] inline const detail::PdoPart* pdo_part(const Slave& slave) {
    return slave.config.pdos().empty() ? nullptr : slave.config.setup->pdos.part();
}

}  // namespace margay
