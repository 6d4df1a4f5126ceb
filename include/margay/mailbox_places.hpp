// The places of a slave's mailboxes, for a slave whose SII does not describe them, or describes them wrongly. A program
// that writes firmware may know the mailboxes of BOOT from another source.
//
//     const margay::MailboxInfo boot{.out_start = 0x1000, .out_bytes = 256, .in_start = 0x1400, .in_bytes = 256};
//     margay::place_mailboxes(ctx, 2, margay::AlState::boot, boot);
//     // then request BOOT: Errc::unsupported if neither the SII nor the program describes the mailboxes
#pragma once

#include <margay/slave.hpp>

namespace margay {

class Context;

// Sets Slave::mailbox, or, for `state` BOOT, Slave::boot_mailbox; `protocols` of `places` is not used: where the SII
// names no protocols, only RawMail works, and FoE in BOOT needs FoE among the protocols of the SII. The places are used
// from the next transition from INIT on, until the next scan, or until the slave comes back with another revision. Then
// the places of its SII are used again. For the owner, before and beside the cycle; does not wait. Errors: not_owner,
// wrong_state before init(), unknown_slave, invalid_argument (`state` is neither PREOP nor BOOT), sii_format (both
// mailboxes must exist, have room for a header, fit into a datagram, lie in the memory of the slave and not overlap).
[[nodiscard]] Result<> place_mailboxes(Context& ctx, std::uint16_t slave, AlState state, const MailboxInfo& places);

}  // namespace margay
