// Mailbox messages as the program sees them: with the header of six octets.
#pragma once

#include "compat/soem/facade.hpp"
#include "compat/soem/inbox.hpp"

namespace margay::soem {

inline constexpr std::size_t kMailHeader = sizeof(ec_mbxheadert);

// Writes a letter into a buffer of the program.
void put_letter(const Letter& letter, std::uint16_t station, std::uint8_t counter, ec_mbxbuft& into);
// Waits for a letter of the slave; without a type: of any type. EoE fragments go to the hook of the program first, and
// mailbox errors and emergencies into its list of errors.
std::optional<Letter> await_letter(ecx_contextt& context, Session& session, std::uint16_t slave,
                                   std::optional<MailboxType> type, Duration timeout);
// Gives EoE fragments that have arrived to the hook of the program, if it has one.
void serve_eoe_hook(ecx_contextt& context, Session& session);
// Sends a message of the program. >0: the slave has accepted it.
int send_mail(Session& session, std::uint16_t slave, const ec_mbxbuft& mail, Duration timeout);

}  // namespace margay::soem
