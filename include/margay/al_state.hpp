// The states of the EtherCAT state machine, ETG.1000.6 table "AL control / AL status".
#pragma once

#include <cstdint>
#include <string_view>

namespace margay {

// The low four bits of AL control (0x0120) and AL status (0x0130). `none` is no state of the standard: it means that
// the slave does not answer.
enum class AlState : std::uint8_t {
    none = 0,
    init = 1,
    preop = 2,
    boot = 3,
    safeop = 4,
    op = 8,
};

// What a slave reports about itself: its state, its error indication (bit 4), and the AL status code (0x0134) of the
// error.
struct AlStatus {
    AlState state = AlState::none;
    bool error = false;
    std::uint16_t code = 0;
    friend constexpr bool operator==(const AlStatus&, const AlStatus&) = default;
};

// "INIT", "PREOP" … Static strings, callable from anywhere.
[[nodiscard]] std::string_view to_text(AlState state);

}  // namespace margay
