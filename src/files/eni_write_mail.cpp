// The start-up commands of EoE and AoE in an ENI.
#include <margay/configuration.hpp>
#include <margay/expected.hpp>

#include "files/eni_write.hpp"
#include "files/mail_commands.hpp"
#include "files/transitions.hpp"
#include "wire/esc.hpp"

#include <margay/idn.hpp>

namespace margay::files {

void write_transitions(Node command, Transition transitions) {
    for (const Transition t : kTransitions)
        if (contains(transitions, t)) add(command, "Transition", std::string(initials(t)));
}

std::uint64_t mail_timeout_ms(const StartupCommand& command, const SlaveConfiguration& config) {
    const Duration time = command.timeout > Duration{0} ? command.timeout : config.times().mailbox;
    return static_cast<std::uint64_t>(
        std::chrono::ceil<std::chrono::milliseconds>(std::max(time, Duration{0})).count());
}

std::vector<std::uint16_t> watchdogs_in_use(const Slave& slave) {
    const SlaveTimes times = slave.config.times();
    std::vector<std::uint16_t> all;
    if (times.pdi_watchdog) all.push_back(wire::reg::kPdiWatchdogTime.address);
    if (slave.config.process_data_watchdog) all.push_back(wire::reg::kProcessDataWatchdogTime.address);
    if (!all.empty() || times.watchdog_divider) all.insert(all.begin(), wire::reg::kWatchdogDivider.address);
    return all;
}

std::vector<std::string> unwritable(const Slave& slave) {
    using Kind = StartupCommand::Kind;
    const std::string begin = "slave " + std::to_string(slave.number) + ": ";
    std::vector<std::string> lost;
    for (const StartupCommand& one : slave.config.startup()) {
        if (one.kind == Kind::write_register || one.kind == Kind::check_register) continue;
        std::array<char, 16> idn{};
        const std::string what = one.kind == Kind::write_object ? "object " + hex(one.index)
                                 : one.kind == Kind::send_eoe   ? std::string("EoE")
                                 : one.kind == Kind::send_aoe   ? std::string("AoE")
                                                                : std::string(to_text(Idn{one.index}, idn)) +
                                                                    " of drive " + std::to_string(one.subindex);
        if (one.kind == Kind::execute_parameter)
            lost.push_back(begin + "the procedure command " + what + " is left out: an ENI can only write values");
        else if (one.moment == Moment::after || one.may_fail)
            lost.push_back(begin + "the command for " + what +
                           " is executed after its transition or may fail, which an ENI cannot say");
        if (one.complete_access && slave.config.no_complete_access)
            lost.push_back(begin + "the command for " + what +
                           " is executed without complete access, which an ENI cannot say");
    }
    if (slave.config.highest == AlState::preop || slave.config.highest == AlState::safeop)
        lost.push_back(begin + "it is brought to " + std::string(to_text(slave.config.highest)) +
                       " at most, which an ENI cannot say");
    if (slave.config.unchecked_pdos)
        lost.push_back(begin + "its PDOs are not compared when it starts up again, which an ENI cannot say");
    if (slave.wanted != nullptr && slave.wanted->tolerate)
        lost.push_back(begin + "another slave is tolerated in its place, which an ENI cannot say");
    return lost;
}

void write_message_commands(Node mailbox, const char* name, StartupCommand::Kind kind,
                            const SlaveConfiguration& config) {
    Node protocol = add(mailbox, name);
    Node inits = add(protocol, "InitCmds");
    std::optional<AoeNetId> net_id;
    for (const StartupCommand& one : config.startup()) {
        if (one.kind != kind) continue;
        Node node = add(inits, "InitCmd");
        write_transitions(node, one.transitions);
        add(node, "Timeout", mail_timeout_ms(one, config));
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
