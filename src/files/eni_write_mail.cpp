// The messages by EoE and AoE that an ENI has for a slave.
#include <margay/files/eni.hpp>

#include "files/eni_write.hpp"
#include "files/transitions.hpp"
#include "wire/eoe.hpp"

namespace margay::files {
namespace {

namespace eoe = wire::eoe;

// What send_mail() sends to the slave; empty: the slave has another hook, or none.
std::span<const EniMail> mail_of(const Slave& slave) {
    if (slave.hooks.transition.sequence() != static_cast<Hook<Transition, Moment>::Sequence>(send_mail)) return {};
    return static_cast<const EniSlave*>(slave.hooks.user)->mail;
}

std::vector<std::byte> eoe_message(const EniMail& mail) {
    std::vector<std::byte> octets(eoe::kHeaderBytes + (mail.ip ? eoe::kIpBytes : eoe::kFilterBytes));
    const auto type = mail.ip ? eoe::Type::set_ip_request : eoe::Type::set_filter_request;
    eoe::store_header(octets, type, EoeResult::success);
    const MutableBytes parameters = MutableBytes(octets).subspan(eoe::kHeaderBytes);
    if (mail.ip)
        (void)eoe::store_ip(parameters, *mail.ip);
    else
        eoe::store_filter(parameters, *mail.filter);
    return octets;
}

void command(Node protocol, Transition transitions, std::span<const std::byte> octets) {
    Node inits = protocol.child("InitCmds");
    if (!inits) inits = add(protocol, "InitCmds");
    Node node = add(inits, "InitCmd");
    write_transitions(node, transitions);
    add(node, "Timeout", std::uint64_t{0});
    add(node, "Data", hex_octets(octets));
}

}  // namespace

void write_transitions(Node command, Transition transitions) {
    for (const Transition t : kTransitions)
        if (contains(transitions, t)) add(command, "Transition", std::string(initials(t)));
}

void write_eoe_commands(Node mailbox, const Slave& slave) {
    Node protocol = add(mailbox, "EoE");
    for (const EniMail& mail : mail_of(slave))
        if (mail.ip || mail.filter) command(protocol, mail.transitions, eoe_message(mail));
    if (!protocol.first_child()) mailbox.remove_child(protocol);
}

void write_aoe_commands(Node mailbox, const Slave& slave) {
    Node protocol = add(mailbox, "AoE");
    const EniMail* named = nullptr;
    for (const EniMail& mail : mail_of(slave)) {
        if (!mail.aoe_command.empty()) command(protocol, mail.transitions, mail.aoe_command);
        if (mail.net_id) named = &mail;
    }
    if (named != nullptr) {
        std::string text;
        for (const unsigned octet : named->net_id->octets) text += (text.empty() ? "" : ".") + std::to_string(octet);
        add(protocol, "NetId", text);
    }
    if (!protocol.first_child()) mailbox.remove_child(protocol);
}

}  // namespace margay::files
