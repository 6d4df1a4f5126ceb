#include "network/attempts.hpp"

#include "network/wanted.hpp"

#include "util/check_value.hpp"

#include <algorithm>
#include <utility>

namespace margay {
namespace {

// The check value of the cause of a failure. It is never 0.
std::uint16_t check_of(const Error& cause) {
    CheckValue check;
    check.add_word(static_cast<std::uint32_t>(cause.code) << 16 | static_cast<std::uint32_t>(cause.step));
    check.add_word(std::uint32_t{cause.index} << 16 | std::uint32_t{cause.subindex} << 8 | cause.place);
    for (const std::uint32_t word : {cause.detail, cause.expected, cause.actual}) check.add_word(word);
    return std::max<std::uint16_t>(check.folded(), 1);
}

}  // namespace

Attempt::Attempt(Network& network, Slave& slave) : network_(network), slave_(slave), before_(slave.al) {
    SlaveMarks& marks = network.marks(slave);
    marks.repeating = marks.attempts != 0 && marks.cause_reported != 0;
}

Attempt::~Attempt() {
    if (!network_.marks(slave_).repeating) return;
    network_.marks(slave_).repeating = false;
    if (slave_.al == before_ || slave_.al.state == AlState::none) return;  // note_lost() has reported the loss
    network_.report({.kind = EventKind::state, .slave = slave_.number, .before = before_, .now = slave_.al});
}

bool is_well(const Network& network, const Slave& slave) {
    if (slave.al.error || network.marks(slave).attempts != 0) return false;
    if (network.marks(slave).settled != AlState::none) return slave.al.state == network.marks(slave).settled;
    return slave.al.state >= AlState::safeop && (slave.takes_part || !exchanges(slave));
}

void report_failure(Network& network, Slave& slave, const AlStatus& now, const Error& cause) {
    SlaveMarks& marks = network.marks(slave);
    slave.error = cause;
    slave.error.slave = slave.number;
    const std::uint16_t before = std::exchange(marks.cause_reported, check_of(cause));
    if (marks.attempts != 0 && before == marks.cause_reported) return;
    network.report({.kind = EventKind::recovery_failed, .slave = slave.number, .now = now, .error = cause});
    network.note(slave.error);
}

}  // namespace margay
