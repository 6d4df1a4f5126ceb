// The messages by EoE and AoE of ENI files, which become start-up commands; and the modules compared.
#include <margay/files/eni.hpp>
#include <margay/margay.hpp>

#include "files/eni_read.hpp"
#include "files/esi_read.hpp"
#include "files/mail_commands.hpp"
#include "files/modules.hpp"

#include <charconv>

namespace margay::files {
namespace {

void add_command(EniSlaveData& s, StartupCommand command, std::vector<std::byte> message) {
    command.data = Borrowed<std::byte>(std::span<const std::byte>(s.octets.emplace_back(std::move(message))));
    s.mail.push_back(command);
}

StartupCommand read_command(Reader& r, Node node, StartupCommand command) {
    command.transitions = read_transitions(r, node);
    command.timeout = read_eni_time(r, child(node, "Timeout"));
    return command;
}

void read_eoe(Reader& r, Node protocol, EniSlaveData& s) {
    for (const Node node : protocol.child("InitCmds").children("InitCmd")) {
        if (r.boolean(child(node, "Disabled"))) continue;
        const StartupCommand command = read_command(r, node, send_eoe(Transition::none, {}));
        auto message = eoe_message(r.octets(child(node, "Data")));
        if (!message)
            r.remark(node, kNoEoeMessage);
        else if (command.transitions != Transition::none)
            add_command(s, command, std::move(*message));
    }
}

// "1.2.3.4.1.1"
std::optional<AoeNetId> net_id_of(std::string_view text) {
    AoeNetId id;
    const char* at = text.data();
    const char* const end = at + text.size();
    for (std::size_t n = 0; n < id.octets.size(); ++n) {
        if (n != 0 && (at == end || *at++ != '.')) return std::nullopt;
        const auto [next, error] = std::from_chars(at, end, id.octets[n]);
        if (error != std::errc()) return std::nullopt;
        at = next;
    }
    return at == end ? std::optional(id) : std::nullopt;
}

// The slave gets its NetID at IP, before the commands that use the NetID, unless one of the commands sets a NetID.
void read_net_id(Reader& r, Node protocol, bool given, EniSlaveData& s) {
    const Value text = child(protocol, "NetId");
    if (!text.there || text.text.empty()) return;
    const auto id = net_id_of(text.text);
    if (!id)
        return r.fail(
            text.at, "NetId is '" + Reader::text(text) + "', and not six numbers from 0 to 255 with dots between them");
    if (given) return;
    const auto message = aoe_net_id_command(*id);
    add_command(s, send_aoe(Transition::init_to_preop, {}), {message.begin(), message.end()});
}

void read_aoe(Reader& r, Node protocol, EniSlaveData& s) {
    struct Command {
        StartupCommand command;
        std::vector<std::byte> message;
    };
    bool given = false;
    std::vector<Command> commands;
    for (const Node node : protocol.child("InitCmds").children("InitCmd")) {
        if (r.boolean(child(node, "Disabled"))) continue;
        const StartupCommand command = read_command(r, node, send_aoe(Transition::none, {}));
        auto message = r.octets(child(node, "Data"));
        if (!is_aoe_command(message)) {
            r.remark(node, kNoAoeCommand);
            continue;
        }
        if (command.transitions == Transition::none) continue;
        given = given || given_net_id(message);
        commands.push_back({command, std::move(message)});
    }
    read_net_id(r, protocol, given, s);
    for (Command& one : commands) add_command(s, one.command, std::move(one.message));
}

// Compares the detected modules, if the slave has a list of them.
Result<> check_detected(Context& ctx, const EniSlave& slave) {
    constexpr std::uint32_t kNoObject = 0x0602'0000;
    const auto other = find_other_module(ctx, slave.number, slave.modules);
    if (!other && other.error().code == Errc::sdo_abort && other.error().detail == kNoObject) return {};
    if (!other) return other.error();
    if (!other->there) return {};
    return Error{.code = Errc::check_failed,
                 .step = Step::sdo_upload,
                 .slave = slave.number,
                 .index = kDetectedModules,
                 .subindex = static_cast<std::uint8_t>(other->slot + 1),
                 .expected = other->wanted,
                 .actual = other->found};
}

}  // namespace

void read_eni_mail(Reader& r, Node mailbox, EniSlaveData& s) {
    read_eoe(r, mailbox.child("EoE"), s);
    read_aoe(r, mailbox.child("AoE"), s);
    for (const char* name : {"FoE", "VoE"})
        for (const Node node : mailbox.child(name).child("InitCmds").children("InitCmd"))
            r.remark(node, std::string("the start-up command of ") + name + " is not supported and not sent");
}

Result<> check_modules(Context& ctx, const EniConfiguration& eni) {
    Result<> first;
    for (const EniSlave& one : eni.slaves) {
        if (one.modules.empty() || one.number > ctx.slaves().size()) continue;
        const Slave& slave = ctx.slave(one.number);
        if (slave.al.state != AlState::preop || slave.al.error) continue;
        const auto compared = check_detected(ctx, one);
        if (first && !compared) first = compared;
    }
    return first;
}

}  // namespace margay::files
