// The start-up commands of EoE and AoE in an ENI.
#include <margay/configuration.hpp>

#include "files/eni_write.hpp"
#include "files/mail_commands.hpp"
#include "files/transitions.hpp"

namespace margay::files {

void write_transitions(Node command, Transition transitions) {
    for (const Transition t : kTransitions)
        if (contains(transitions, t)) add(command, "Transition", std::string(initials(t)));
}

void write_message_commands(Node mailbox, const char* name, StartupCommand::Kind kind,
                            std::span<const StartupCommand> commands) {
    Node protocol = add(mailbox, name);
    Node inits = add(protocol, "InitCmds");
    std::optional<AoeNetId> net_id;
    for (const StartupCommand& one : commands) {
        if (one.kind != kind) continue;
        Node node = add(inits, "InitCmd");
        write_transitions(node, one.transitions);
        add(node, "Timeout", static_cast<std::uint64_t>(one.timeout / std::chrono::milliseconds(1)));
        add(node, "Data", hex_octets(one.octets()));
        if (kind == StartupCommand::Kind::send_aoe && !net_id) net_id = given_net_id(one.octets());
    }
    if (net_id) {
        std::string text;
        for (const unsigned octet : net_id->octets) text += (text.empty() ? "" : ".") + std::to_string(octet);
        add(protocol, "NetId", text);
    }
    if (!inits.first_child()) mailbox.remove_child(protocol);
}

}  // namespace margay::files
