// The lists of PDOs that the application wants, without a bus: whether they can be, and how many bits they make.
#pragma once

#include <margay/slave.hpp>

#include <optional>

namespace margay {

// Looks for what cannot be: a SyncManager that the slave does not have, that carries mail or is listed twice, PDOs
// twice or of the other direction, entries without bits, bits that `slave.config.sms` contradicts. Code none: all well.
[[nodiscard]] Error check_pdo_lists(const Slave& slave);

// The list for a SyncManager; nullptr: there is none.
[[nodiscard]] const SmPdos* find_list(const Slave& slave, std::uint8_t sync_manager);

// What the entries that are listed make in all, and how many PDOs have none listed.
struct ListedBits {
    std::uint32_t bits = 0;
    std::uint8_t open = 0;
};
[[nodiscard]] ListedBits listed_bits(const SmPdos& list);

// Keeps the place in the image that the application wants for a slave that cannot be asked now: by slave.config.sms
// where these are set, else by the lists of PDOs, where these tell all entries. Says whether the sizes are known; then
// slave.config.sms has them, and slave.place_kept that start addresses and control octets are still to come.
[[nodiscard]] bool keep_place(Slave& slave);
// Takes back what keep_place() has put into slave.config, before the slave is asked.
void forget_kept_place(Slave& slave);

// By the PDOs of the list, or by the SII where it has none.
[[nodiscard]] Direction direction_of(const Slave& slave, const SmPdos& list);

}  // namespace margay
