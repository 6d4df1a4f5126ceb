#include "api/mail.hpp"

#include "wire/soe.hpp"

namespace margay {

Error check_mailbox(Network& network, Error where) {
    Error refused = check_slave(network, where.slave, where.step);
    const bool known = refused.code == Errc::none;
    if (known) refused = check_same_slave(network, where.slave, where.step);
    if (known && network.slave(where.slave).al.state == AlState::none)
        refused.code = Errc::missing_slave;  // no waiting for a lost slave, whose protocols may be unknown
    else if (known && !network.slave(where.slave).mailbox.present())
        refused.code = network.slave(where.slave).sii_read ? Errc::unsupported : Errc::wrong_state;
    where.code = refused.code;
    where.expected = refused.expected;
    if (refused.code != Errc::none) return where;
    const Slave& slave = network.slave(where.slave);
    if (network.marks(slave).in_hook && slave.al.state == AlState::init)
        where.code = Errc::wrong_state;  // the mailbox is closed in INIT, so a hook there must not wait
    else if (!network.mailbox(slave).is_open())
        where.code = Errc::wrong_state;  // the slave never reached PREOP
    return where.code == Errc::none ? Error{} : where;
}

Error check_mailbox(Network& network, std::uint16_t protocol, Error where) {
    const Error refused = check_mailbox(network, where);
    if (refused.code == Errc::unknown_slave || refused.code == Errc::missing_slave) return refused;
    const Slave& slave = network.slave(where.slave);
    if (!slave.sii_read || (slave.mailbox.protocols & protocol) != 0) return refused;
    where.code = Errc::unsupported;
    return where;
}

Error check_coe(Network& network, std::uint16_t slave, Step step, std::uint16_t index, std::uint8_t subindex) {
    return check_mailbox(network, mailbox_protocol::kCoE,
                         {.step = step, .slave = slave, .index = index, .subindex = subindex});
}

Error check_soe(Network& network, std::uint16_t slave, Step step, std::uint8_t drive, Idn idn) {
    const Error refused = check_mailbox(network, mailbox_protocol::kSoE,
                                        {.step = step, .slave = slave, .index = idn.value, .subindex = drive});
    if (refused.code != Errc::none || drive < wire::soe::kDrives) return refused;
    return invalid(Argument::soe_drive, step, slave, idn.value, drive);
}

// ------------------------------------------------------------------ messages that slaves send on their own

EmergencyRing& emergencies(Context& ctx, std::uint16_t slave) {
    Master* master = master_of(ctx);
    if (master == nullptr || slave < 1 || slave > master->network.mailboxes.count())
        return ContextAccess::no_emergencies(ctx);
    return master->network.mailboxes.channel(slave).emergencies();
}

Result<> watch_mailboxes(Context& ctx, Duration every) {
    if (const Error refused = check_owner(ctx, Step::mailbox_receive); refused.code != Errc::none) return refused;
    if (every < Duration{0}) return invalid(Argument::look_every, Step::mailbox_receive);
    master_of(ctx)->network.mailboxes.watch(every);
    return Result<>();
}

Result<MailboxStatistics> mailbox_statistics(Context& ctx, std::uint16_t slave) {
    if (const Error refused = check_owner(ctx, Step::mailbox_receive); refused.code != Errc::none) return refused;
    Network& network = master_of(ctx)->network;
    const Error refused = check_slave(network, slave, Step::mailbox_receive);
    if (refused.code != Errc::none) return refused;
    return network.mailboxes.channel(slave).statistics();
}

}  // namespace margay
