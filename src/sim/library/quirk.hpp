// Quirks: defects and unusual behaviour of real devices. Each quirk has a name and can be activated for a simulated
// device.
#pragma once

#include <cstdint>
#include <initializer_list>

namespace margay::sim {

// Quirks of the firmware. quirks.hpp has the list of all quirks with their descriptions.
enum class Quirk : std::uint8_t {
    // State machine
    ignores_acknowledge,
    needs_eeprom,
    strict_sync_managers,
    slow_state_changes,
    refuses_op_once,
    no_cycle1,
    // Mailbox
    old_mail,
    counter_zero,
    replies_twice,
    emergency_first,
    ethernet_first,
    mail_for_others,
    mailbox_full,
    slow_replies,
    never_replies,
    error_replies,
    overlong_replies,
    empty_replies,
    short_replies,
    foreign_replies,
    empty_repeats,
    // CoE
    refuses_complete_access,
    unpadded_complete_access,
    no_size_indicated,
    never_expedited,
    segments_only,
    small_segments,
    empty_segments,
    aborts_midway,
    toggle_stuck,
    no_assignment,
    few_mapping_entries,
    coe_disagrees,
    other_pdos,
};

class Quirks {
  public:
    constexpr Quirks() = default;
    constexpr Quirks(std::initializer_list<Quirk> list) {
        for (const auto q : list) add(q);
    }
    constexpr void add(Quirk quirk) { bits_ |= std::uint64_t{1} << static_cast<unsigned>(quirk); }
    [[nodiscard]] constexpr bool has(Quirk quirk) const { return (bits_ >> static_cast<unsigned>(quirk) & 1) != 0; }
    [[nodiscard]] constexpr bool any() const { return bits_ != 0; }

  private:
    std::uint64_t bits_ = 0;
};

}  // namespace margay::sim
