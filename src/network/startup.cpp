#include "network/startup.hpp"

#include "mailbox/coe_sdo.hpp"
#include "network/pdos.hpp"
#include "network/startup_mail.hpp"
#include "util/check_value.hpp"
#include "wire/soe.hpp"

#include <algorithm>
#include <bit>

namespace margay {
namespace {

constexpr unsigned kTransitions = 0x7FF;  // the bits of all of them
constexpr Duration kBetweenLooks = std::chrono::milliseconds(1);
constexpr std::size_t kMostRegisterBytes = 1024;

Step step_of(Transition which) {
    static constexpr std::array kSteps{Step::command_ip, Step::command_ps, Step::command_so, Step::command_os,
                                       Step::command_op, Step::command_oi, Step::command_sp, Step::command_si,
                                       Step::command_pi, Step::command_ib, Step::command_bi};
    return kSteps[std::min<std::size_t>(static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(which))),
                                        kSteps.size() - 1)];
}

bool by_mailbox(const StartupCommand& command) {
    return command.kind != StartupCommand::Kind::write_register && command.kind != StartupCommand::Kind::check_register;
}

bool by_soe(const StartupCommand& command) {
    return command.kind == StartupCommand::Kind::write_parameter ||
           command.kind == StartupCommand::Kind::execute_parameter;
}

bool is_message(const StartupCommand& command) {
    return command.kind == StartupCommand::Kind::send_aoe || command.kind == StartupCommand::Kind::send_eoe;
}

// There is no mailbox in INIT. So mailbox commands for the moment before INIT is left are sent directly after the
// transition.
Moment moment_of(const StartupCommand& command, Transition which) {
    const bool early = which == Transition::init_to_preop || which == Transition::init_to_boot;
    return by_mailbox(command) && early ? Moment::after : command.moment;
}

bool is_due(const StartupCommand& command, Transition which, Moment moment) {
    return contains(command.transitions, which) && moment_of(command, which) == moment;
}

// Whether the command names a part of the library that works with it, and this part is that of its kind.
bool has_part(const StartupCommand& command) {
    if (!is_message(command) && !by_soe(command)) return true;
    const bool aoe = command.kind == StartupCommand::Kind::send_aoe;
    const MailboxType wanted = by_soe(command) ? MailboxType::soe : aoe ? MailboxType::aoe : MailboxType::eoe;
    return command.mail != nullptr && command.mail->type == wanted;
}

// The member of the command that is wrong for every slave; Argument::unknown: none.
Argument invalid_member(const StartupCommand& command) {
    const auto transitions = static_cast<unsigned>(command.transitions);
    if (transitions == 0 || transitions > kTransitions) return Argument::command_transition;
    if (command.kind > StartupCommand::Kind::send_eoe || command.moment > Moment::after || !has_part(command))
        return Argument::command_kind;
    if (command.timeout < Duration{0}) return Argument::command_time;
    const std::size_t bytes = command.octets().size();
    bool right = command.length <= command.value.size();
    if (command.kind == StartupCommand::Kind::write_register) right &= bytes != 0 && bytes <= kMostRegisterBytes;
    if (command.kind == StartupCommand::Kind::check_register) right &= command.data.empty() && command.length != 0;
    if (!right) return Argument::command_value;
    if (is_message(command) && !command.mail->valid(command.octets())) return Argument::command_message;
    if (!by_mailbox(command) && command.index + bytes > 0x10000) return Argument::register_octets;
    if (command.complete_access && command.kind == StartupCommand::Kind::write_object && command.subindex > 1)
        return Argument::complete_access;
    return by_soe(command) && command.subindex >= wire::soe::kDrives ? Argument::soe_drive : Argument::unknown;
}

Error invalid_command(const StartupCommand& command) {
    const Argument wrong = invalid_member(command);
    if (wrong == Argument::unknown) return {};
    return {.code = Errc::invalid_argument, .step = Step::none, .actual = static_cast<std::uint32_t>(wrong)};
}

// Completes the error of a command: transition, slave, place in the list, and the object or register of the command.
void name_command(Error& error, const Slave& slave, const StartupCommand& command, std::size_t place,
                  Transition which) {
    error.step = step_of(which);
    error.slave = slave.number;
    error.index = command.index;
    if (!by_mailbox(command)) error.detail |= Error::kRegisterCommand;
    if (by_soe(command) && error.code != Errc::soe_error && error.code != Errc::command_failed)
        error.detail |= Error::kParameterCommand;
    if (error.subindex == 0) error.subindex = command.subindex;
    if (is_message(command) && command.mail != nullptr) {
        error.index = 0;
        error.subindex = static_cast<std::uint8_t>(command.mail->type);
    }
    error.place = static_cast<std::uint8_t>(std::min<std::size_t>(place, 255));
}

Task<Result<>> write_register_of(Station station, const StartupCommand& command) {
    co_await required(write_bytes(station, command.index, command.octets(), Step::none));
    co_return Nothing{};
}

Task<Result<>> check_register_of(Station station, const StartupCommand& command) {
    const Time give_up = later(station.engine.now(), command.timeout);
    for (;;) {
        std::array<std::byte, 8> seen{};
        Datagram read(station.engine.link(), wire::Command::FPRD, {station.address, command.index},
                      MutableBytes(seen).first(command.length));
        auto reply = co_await read;
        Error error = error_of_reply(station, reply, Step::none, command.index);
        if (error.code != Errc::none) co_return error;
        bool same = true;
        std::array<std::byte, 8> wanted{};
        for (std::size_t n = 0; n < command.length; ++n) {
            seen[n] &= command.mask[n];
            wanted[n] = command.value[n] & command.mask[n];
            same = same && seen[n] == wanted[n];
        }
        if (same) co_return Nothing{};
        if (station.engine.now() >= give_up) {
            error = station.error(Errc::check_failed, Step::none, command.index);
            const std::size_t half = sizeof error.expected;
            if (load_le<std::uint32_t>(wanted) == load_le<std::uint32_t>(seen)) error.subindex = half;
            error.expected = load_le<std::uint32_t>(wanted, error.subindex);
            error.actual = load_le<std::uint32_t>(seen, error.subindex);
            co_return error;
        }
        co_await station.engine.sleep_for(kBetweenLooks);
    }
}

// Repeats the access while the working counter is 0, as often as the command allows.
Task<Result<>> access_register(Station station, const StartupCommand& command) {
    for (std::uint16_t left = command.retries;; --left) {
        Result<> done;
        if (command.kind == StartupCommand::Kind::write_register)
            done = co_await write_register_of(station, command);
        else
            done = co_await check_register_of(station, command);
        const bool absent = done.error().code == Errc::working_counter;
        if (absent && left != 0) {
            co_await station.engine.sleep_for(kBetweenLooks);
            continue;
        }
        if (absent && command.any_counter) co_return Nothing{};
        co_return done;
    }
}

MailPatience patience_of(Network& network, const Slave& slave, const StartupCommand& command) {
    if (command.timeout <= Duration{0}) return startup_patience(slave);
    return {.give_up = later(network.engine.now(), command.timeout), .each = command.timeout};
}

Task<Result<>> mail(Network& network, Slave& slave, const StartupCommand& command) {
    // The protocol that the SII of the slave must announce.
    const bool by_part = command.kind != StartupCommand::Kind::write_object;
    const unsigned protocol = by_part ? command.mail->protocol : 0U;
    if (!network.has_mailbox(slave) || !network.mailbox(slave).is_open() ||
        (slave.mailbox.protocols & protocol) != protocol)
        co_return network.station(slave).error(Errc::unsupported, Step::none, command.index);
    MailboxChannel& channel = network.mailbox(slave);
    const MailPatience patience = patience_of(network, slave, command);
    if (is_message(command) && command.octets().size() > channel.send_room())
        co_return Error{.code = Errc::invalid_argument,
                        .actual = static_cast<std::uint32_t>(Argument::command_message)};
    if (by_part) co_return co_await required(command.mail->send(channel, command, patience));
    const SdoObject object{.index = command.index, .subindex = command.subindex, .complete = command.complete_access};
    co_return co_await required(sdo_download(channel, object, command.octets(), patience));
}

Task<Result<>> run_one(Network& network, Slave& slave, const StartupCommand& command) {
    switch (command.kind) {
        case StartupCommand::Kind::write_register:
        case StartupCommand::Kind::check_register:
            co_return co_await required(access_register(network.station(slave), command));
        case StartupCommand::Kind::write_object:
        case StartupCommand::Kind::write_parameter:
        case StartupCommand::Kind::execute_parameter:
        case StartupCommand::Kind::send_aoe:
        case StartupCommand::Kind::send_eoe: co_return co_await required(mail(network, slave, command));
    }
    co_return Nothing{};
}

bool has_due(std::span<const StartupCommand> commands, Transition which, Moment moment) {
    return std::ranges::any_of(commands, [&](const StartupCommand& c) { return is_due(c, which, moment); });
}

Error invalid_commands(const Slave& slave) {
    std::size_t place = 0;
    for (const StartupCommand& command : slave.config.startup()) {
        ++place;
        Error error = invalid_command(command);
        const bool at_transition = (static_cast<unsigned>(command.transitions) & kTransitions) != 0;
        const bool reported_later = command.may_fail && at_transition;
        if (error.code == Errc::none || reported_later) continue;
        if (at_transition) {
            name_command(error, slave, command, place, command.transitions);
            return error;
        }
        return {.code = error.code,
                .step = Step::map_process_data,
                .slave = slave.number,
                .place = static_cast<std::uint8_t>(std::min<std::size_t>(place, 255)),
                .actual = error.actual};
    }
    return {};
}

}  // namespace

Task<Result<>> run_commands(Network& network, Slave& slave, Transition which, Moment moment) {
    std::size_t place = 0;
    for (const StartupCommand& command : slave.config.startup()) {
        ++place;
        if (!is_due(command, which, moment)) continue;
        Error error = invalid_command(command);
        if (error.code == Errc::none) {
            auto done = co_await run_one(network, slave, command);
            error = done.error();
        }
        if (error.code == Errc::none) continue;
        name_command(error, slave, command, place, which);
        if (!command.may_fail) co_return error;
        network.note(error);
    }
    co_return Nothing{};
}

namespace {

std::uint32_t check_of_ip_commands(std::span<const StartupCommand> commands) {
    CheckValue check;
    for (const StartupCommand& command : commands) {
        if (!contains(command.transitions, Transition::init_to_preop)) continue;
        const unsigned flags =
            (command.may_fail ? 1U : 0U) + (command.complete_access ? 2U : 0U) + (command.any_counter ? 4U : 0U);
        for (const unsigned octet :
             {static_cast<unsigned>(command.kind), static_cast<unsigned>(command.moment), flags,
              unsigned{command.index}, command.index / 256U, unsigned{command.subindex}, unsigned{command.length}})
            check.add(octet);
        check.add(command.octets());
        check.add(command.mask);
    }
    return check.get();
}

}  // namespace

constinit const detail::StartupPart detail::kStartupPart{
    .has = has_due, .invalid = invalid_commands, .run = run_commands, .check = check_of_ip_commands};

}  // namespace margay
