// Sets the places of mailboxes in place of the values of the SII.
#include <margay/mailbox_places.hpp>

#include "api/master.hpp"
#include "api/operation.hpp"
#include "wire/sii.hpp"

namespace margay {

Result<> place_mailboxes(Context& ctx, std::uint16_t slave, AlState state, const MailboxInfo& places) {
    constexpr Step kStep = Step::configure_mailbox;
    if (const Error refused = check_owner(ctx, kStep); refused.code != Errc::none) return refused;
    Network& network = master_of(ctx)->network;
    if (const Error refused = check_slave(network, slave, kStep); refused.code != Errc::none) return refused;
    if (state != AlState::preop && state != AlState::boot) return invalid(Argument::state, kStep, slave);
    MailboxInfo wanted = places;
    wanted.protocols = 1;  // none of both is a fault
    const auto fault = wire::sii::mailbox_fault(wanted);
    if (fault != wire::sii::Fault::none) return Error{.code = wire::sii::to_errc(fault), .step = kStep, .slave = slave};
    MailboxInfo& known = state == AlState::boot ? network.slave(slave).boot_mailbox : network.slave(slave).mailbox;
    wanted.protocols = known.protocols;
    known = wanted;
    return Result<>();
}

}  // namespace margay
